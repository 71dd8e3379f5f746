//! Lamps in an image of the sky: small groups of texels, bright enough to cast shadows with sharp edges.
//!
//! ```text
//! texel = rest + lamp          rest  the texels around a bright spot          lamp  the excess of a bright texel
//! ```
//!
//! An image is interpolated linearly between texels, so the equation applies to the radiance of every direction. Lamps
//! are sampled one by one, as discs (`light/distant.rs`). The rest is sampled as a dome of many lights.

use super::{EquirectangularMap, cell_solid_angle, height};
use crate::luminance;
use crate::sampling::{Distribution, centered_sobol};
use glam::{Vec2, Vec3, Vec3A};
use plane::Plane;
use std::collections::BTreeSet;
use std::f32::consts::TAU;

/// Minimum radiance of a lamp's texels, relative to the sky's mean. At 64 times the mean, all light of a sky fits into
/// a disc of 14° radius.
const BRIGHT: f32 = 64.0;
/// Minimum fraction of the sky's light in a lamp: sixteen of the 1024 lights of a dome.
const LEAST_SHARE: f32 = 1.0 / 64.0;
/// Maximum angular radius of a lamp \[rad\]: 6°. Wider spots cast soft shadows, which the dome can render.
const MOST_RADIUS: f32 = 0.1;
/// Maximum number of lamps of a sky. The brightest are used; each costs shadow rays at every pixel.
const MOST_LAMPS: usize = 8;
/// Maximum number of doublings of the minimum radiance until a spot is small. The glare around a spot belongs to the
/// rest.
const DOUBLINGS: u32 = 12;
/// Number of cells along a side of a texel, for sampling directions.
const CELLS: usize = 4;
/// Number of directions from a lamp's center that define the lamp's border.
const BORDER: usize = 8;

/// Small bright spot of a sky.
#[derive(Clone, Debug)]
pub(crate) struct SkyLamp {
    /// Integral of the lamp's radiance over all directions: the irradiance of a surface that faces the lamp \[W·m⁻²\].
    pub irradiance: Vec3,
    /// Direction to the lamp's center, a unit vector.
    pub towards: Vec3A,
    /// Angular radius of the lamp \[rad\].
    pub angular_radius: f32,
    /// Directions to the lamp's border, unit vectors.
    pub border: [Vec3A; BORDER],
    /// Distribution of rows of cells, from the top. Each cell has a direction and a flux.
    rows: Distribution,
    columns: Vec<Option<Distribution>>,
    directions: Vec<Vec<Vec3A>>,
}

impl SkyLamp {
    /// Returns `count` directions, each of which represents an equal fraction of the lamp's light.
    pub fn directions(&self, count: usize) -> Vec<Vec3A> {
        let direction = |u: Vec2| {
            let row = self.rows.pick(f64::from(u.y)).index;
            let columns = self.columns[row].as_ref().expect("only rows with light are picked");
            self.directions[row][columns.pick(f64::from(u.x)).index]
        };
        centered_sobol(count).map(direction).collect()
    }
}

/// Finds the lamps of an image with mean luminance `mean` over the sphere. Returns the lamps and the texels without
/// them, or `None` if the image has no lamps.
pub(super) fn split(map: &EquirectangularMap, mean: f32) -> Option<(Vec<SkyLamp>, Plane<Vec3>)> {
    // Find the brightest spots, with ties ordered by position.
    let finder = Finder { map, mean };
    let mut spots = finder.spots(&finder.all_texels(), BRIGHT * mean, DOUBLINGS);
    spots.sort_by(|a, b| b.share.total_cmp(&a.share).then(a.texels.cmp(&b.texels)));
    spots.truncate(MOST_LAMPS);
    if spots.is_empty() {
        return None;
    }

    // Darken the texels of each lamp to the level of the surroundings.
    let mut rest = map.texels.clone();
    let mut lamps = Vec::new();
    for spot in spots {
        let around = finder.around(&spot.texels);
        let mut excess = Plane::filled(map.texels.width(), map.texels.height(), Vec3::ZERO);
        for &(x, y) in &spot.texels {
            let texel = map.texels.get(x, y);
            let remains = texel.min(around);
            rest.set(x, y, remains);
            excess.set(x, y, texel - remains);
        }
        let excess = EquirectangularMap { texels: excess, ..map.clone() };
        lamps.extend(lamp(&excess, &spot.texels));
    }
    Some((lamps, rest))
}

/// Set of texels, as (column, row).
type Texels = BTreeSet<(usize, usize)>;

/// Group of connected bright texels.
struct Spot {
    texels: Texels,
    /// Fraction of the sky's light in the spot.
    share: f32,
}

struct Finder<'a> {
    map: &'a EquirectangularMap,
    mean: f32,
}

impl Finder<'_> {
    fn size(&self) -> [usize; 2] {
        [self.map.texels.width(), self.map.texels.height()]
    }

    fn luminance(&self, x: usize, y: usize) -> f32 {
        luminance(self.map.texels.get(x, y)) * self.map.intensity
    }

    fn all_texels(&self) -> Texels {
        // Drop all darker texels at once, since an image has millions.
        let [width, height] = self.size();
        let all = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        all.filter(|&(x, y)| self.luminance(x, y) >= BRIGHT * self.mean).collect()
    }

    /// Finds the small and sufficiently bright spots among `texels`, with luminance of at least `least`. Wide spots are
    /// searched again with a threshold of twice that luminance.
    fn spots(&self, texels: &Texels, least: f32, doublings: u32) -> Vec<Spot> {
        let mut left: Texels = texels.iter().copied().filter(|&(x, y)| self.luminance(x, y) >= least).collect();
        let mut spots = Vec::new();
        while let Some(&first) = left.first() {
            // Drop faint spots. Search wide spots again with a higher threshold.
            let spot = self.connected(first, &mut left);
            let share = self.share(&spot);
            if share < LEAST_SHARE {
                continue;
            }
            if self.radius(&spot) <= MOST_RADIUS {
                spots.push(Spot { texels: spot, share });
            } else if doublings > 0 {
                spots.extend(self.spots(&spot, 2.0 * least, doublings - 1));
            }
        }
        spots
    }

    /// Removes the texels connected with `first` from `left` and returns them.
    fn connected(&self, first: (usize, usize), left: &mut Texels) -> Texels {
        let (mut spot, mut next) = (Texels::new(), vec![first]);
        left.remove(&first);
        while let Some((x, y)) = next.pop() {
            spot.insert((x, y));
            next.extend(self.neighbors(x, y).into_iter().filter(|neighbor| left.remove(neighbor)));
        }
        spot
    }

    /// Returns the eight neighbors of a texel. Columns wrap around; rows end at the poles.
    fn neighbors(&self, x: usize, y: usize) -> Vec<(usize, usize)> {
        let [width, height] = self.size();
        let mut neighbors = Vec::new();
        for row in y.saturating_sub(1)..(y + 2).min(height) {
            for dx in [width - 1, 0, 1] {
                neighbors.push(((x + dx) % width, row));
            }
        }
        neighbors
    }

    /// Returns the mean radiance of the texels around a spot.
    fn around(&self, spot: &Texels) -> Vec3 {
        // A set contains each texel once, although several texels of the spot may border on it.
        let near: Texels = spot.iter().flat_map(|&(x, y)| self.neighbors(x, y)).collect();
        let ring: Vec<Vec3> = near.difference(spot).map(|&(x, y)| self.map.texels.get(x, y)).collect();
        ring.iter().sum::<Vec3>() / ring.len().max(1) as f32
    }

    /// Returns the fraction of the sky's light in a spot.
    fn share(&self, spot: &Texels) -> f32 {
        let flux: f32 = spot.iter().map(|&(x, y)| self.luminance(x, y) * cell_solid_angle(self.size(), y)).sum();
        flux / (self.mean * 4.0 * std::f32::consts::PI)
    }

    /// Returns the angular radius of a spot \[rad\].
    fn radius(&self, spot: &Texels) -> f32 {
        let [width, height] = self.size();
        let place =
            |&(x, y): &(usize, usize)| Vec2::new((x as f32 + 0.5) / width as f32, (y as f32 + 0.5) / height as f32);
        let directions: Vec<Vec3A> = spot.iter().map(|texel| self.map.direction(place(texel))).collect();
        let Some(middle) = directions.iter().sum::<Vec3A>().try_normalize() else { return f32::INFINITY };
        directions.iter().map(|direction| direction.angle_between(middle)).fold(0.0, f32::max)
    }
}

/// Builds the lamp of an image that is black outside a spot of `texels`.
fn lamp(excess: &EquirectangularMap, texels: &Texels) -> Option<SkyLamp> {
    let [width, rows] = [excess.texels.width(), excess.texels.height()];
    let fine = [CELLS * width, CELLS * rows];

    // Number columns across the seam relative to the first texel, half the image to either side. Interpolation spreads
    // light one texel farther.
    let first = texels.first()?.0 as i64;
    let unwrapped = |x: usize| {
        let offset = (x as i64 - first).rem_euclid(width as i64);
        first + if offset > width as i64 / 2 { offset - width as i64 } else { offset }
    };
    let columns = || texels.iter().map(|texel| unwrapped(texel.0));
    let (left, right) = (columns().min()? - 1, columns().max()? + 2);
    let right = right.min(left + width as i64);
    let (top, bottom) = (texels.iter().map(|t| t.1).min()?.saturating_sub(1), texels.iter().map(|t| t.1).max()? + 2);
    let bottom = bottom.min(rows);

    // Divide texels into 4×4 cells. The flux of a cell is L ω at its center.
    let (mut irradiance, mut sum, mut by_row) = (glam::DVec3::ZERO, glam::DVec3::ZERO, Vec::new());
    let (mut distributions, mut directions) = (Vec::new(), Vec::new());
    for row in top * CELLS..bottom * CELLS {
        let solid_angle = cell_solid_angle(fine, row);
        let y = 0.5 * (height(row, fine[1]) + height(row + 1, fine[1]));
        let (mut weights, mut own) = (Vec::new(), Vec::new());
        for column in left * CELLS as i64..right * CELLS as i64 {
            let angle = TAU * (column as f32 + 0.5) / fine[0] as f32;
            let sine = (1.0 - y * y).max(0.0).sqrt();
            let direction = excess.turned(Vec3::new(-sine * angle.sin(), y, sine * angle.cos()), 1.0).normalize();
            let flux = excess.radiance(direction).as_dvec3() * f64::from(solid_angle);
            let weight = f64::from(luminance(flux.as_vec3()));
            irradiance += flux;
            sum += direction.as_dvec3() * weight;
            weights.push(weight);
            own.push(Vec3A::from(direction));
        }

        // Store the distribution of the row, even if the row is black.
        let distribution = Distribution::new(weights);
        by_row.push(distribution.as_ref().map_or(0.0, Distribution::total));
        distributions.push(distribution);
        directions.push(own);
    }
    let rows = Distribution::new(by_row)?;
    let towards = Vec3A::from(sum.as_vec3()).try_normalize()?;

    // Find the border: the lit cells farthest from the center in eight directions.
    let mut lit: Vec<Vec3A> = Vec::new();
    for (distribution, directions) in distributions.iter().zip(&directions) {
        let Some(distribution) = distribution else { continue };
        let shining = directions.iter().enumerate().filter(|(column, _)| distribution.probability(*column) > 0.0);
        lit.extend(shining.map(|(_, direction)| *direction));
    }
    let (x, y) = crate::sampling::frame(towards.into());
    let border = std::array::from_fn(|k| {
        let (sine, cosine) = (TAU * k as f32 / BORDER as f32).sin_cos();
        let along = Vec3A::from(x * cosine + y * sine);
        lit.iter().copied().max_by(|a, b| a.dot(along).total_cmp(&b.dot(along))).unwrap_or(towards)
    });
    let angular_radius = border.iter().map(|direction| direction.angle_between(towards)).fold(0.0, f32::max);
    let irradiance = irradiance.as_vec3();
    Some(SkyLamp { irradiance, towards, angular_radius, border, rows, columns: distributions, directions })
}

#[cfg(test)]
mod tests {
    use crate::environment::Environment;
    use crate::luminance;
    use crate::sampling::{hammersley, uniform_sphere};
    use glam::{Vec3, Vec3A};
    use plane::Plane;
    use std::f32::consts::PI;

    /// Column, row and radiance of a bright texel.
    type Texel = (usize, usize, f32);

    /// Builds a sky of radiance 0.2 with the texels `bright`.
    fn sky(bright: &[(usize, usize, f32)]) -> Environment {
        let mut texels = Plane::filled(64, 32, Vec3::splat(0.2));
        bright.iter().for_each(|&(x, y, radiance)| texels.set(x, y, Vec3::splat(radiance)));
        Environment::image(texels, 1.0, 30.0).expect("a sky")
    }

    /// Returns ∫ L dω over all directions, from the midpoints of a grid of angles.
    fn integral(sky: &Environment) -> Vec3 {
        let (rows, columns) = (1024u32, 2048u32);
        let mut sum = glam::DVec3::ZERO;
        for row in 0..rows {
            let (sine, cosine) = ((row as f32 + 0.5) * PI / rows as f32).sin_cos();
            for column in 0..columns {
                let (across, along) = ((column as f32 + 0.5) * 2.0 * PI / columns as f32).sin_cos();
                let radiance = sky.radiance(Vec3::new(sine * across, cosine, sine * along));
                sum += (radiance * sine).as_dvec3();
            }
        }
        (sum * f64::from(2.0 * PI * PI) / f64::from(rows * columns)).as_vec3()
    }

    /// At the seam, at both poles and elsewhere, a bright texel becomes one lamp. Lamps and rest sum to all light.
    #[test]
    fn lamps_and_rest_are_the_whole_sky() {
        let cases: [(&[Texel], usize); 7] = [
            (&[(20, 5, 40_000.0)], 1),
            (&[(0, 12, 40_000.0)], 1),
            (&[(63, 12, 40_000.0), (0, 12, 30_000.0)], 1),
            (&[(5, 0, 90_000.0)], 1),
            (&[(5, 31, 90_000.0)], 1),
            (&[(10, 8, 9000.0), (40, 14, 9000.0)], 2),
            (&[(10, 8, 1.0)], 0),
        ];
        for (bright, count) in cases {
            let sky = sky(bright);
            assert_eq!(sky.lamps().len(), count, "{bright:?}");
            let rest = sky.beside_lamps().expect("the sky around").fluence();
            let sum: Vec3 = sky.lamps().iter().map(|lamp| lamp.irradiance).sum();
            let whole = integral(&sky);
            assert!(((sum + rest) / whole - 1.0).abs().max_element() < 0.01, "{bright:?}: {sum} + {rest}, not {whole}");
            assert!(count == 0 || luminance(rest) < 1.3 * 0.2 * 4.0 * PI, "{bright:?}: {rest}");
        }
    }

    /// Directions of a lamp follow the distribution of the lamp's light: both have the same mean direction.
    #[test]
    fn directions_are_those_of_the_light() {
        for bright in [&[(0, 12, 40_000.0)][..], &[(30, 3, 40_000.0), (31, 3, 20_000.0)], &[(5, 0, 90_000.0)]] {
            let sky = sky(bright);
            let [lamp] = sky.lamps() else { panic!("one lamp") };
            let count = 1 << 20;
            let mut mean = Vec3::ZERO;
            for direction in (0..count).map(|i| uniform_sphere(hammersley(i, count))) {
                mean += direction * luminance(sky.radiance(direction) - Vec3::splat(0.2));
            }
            let mean = Vec3A::from(mean.normalize());
            let drawn = lamp.directions(32).iter().sum::<Vec3A>().normalize();
            assert!(lamp.towards.angle_between(mean) < 0.004, "{bright:?}: {}", lamp.towards.angle_between(mean));
            assert!(drawn.angle_between(mean) < 0.01, "{bright:?}: {}", drawn.angle_between(mean));
            assert!(lamp.angular_radius < 0.25, "{}", lamp.angular_radius);
        }
    }

    /// A spot as wide as a window stays in the dome. A bright spot within the glare of the wide spot becomes a lamp.
    #[test]
    fn wide_regions_are_no_lamps() {
        let of = |radiance: fn(f32) -> f32| {
            let texels = Plane::from_fn(128, 64, |x, y| {
                let way = (x as f32 - 64.0).hypot(y as f32 - 20.0);
                Vec3::splat(0.01 + radiance(way))
            });
            Environment::image(texels, 1.0, 0.0).expect("a sky")
        };
        assert!(of(|way| if way < 8.0 { 100.0 } else { 0.0 }).lamps().is_empty());
        let spot = of(|way| if way < 1.0 { 50_000.0 } else { 200.0 / (1.0 + way * way) });
        assert_eq!(spot.lamps().len(), 1);
        assert!(spot.lamps()[0].angular_radius < 0.2, "{}", spot.lamps()[0].angular_radius);
    }
}
