//! Environment light: radiance by direction, and importance sampling of directions.

mod gradient;
mod lamps;

pub use gradient::Gradient;
pub(crate) use lamps::SkyLamp;

use crate::luminance;
use crate::sampling::Distribution;
use glam::{Vec2, Vec3};
use plane::Plane;
use std::f32::consts::{PI, TAU};

/// Distant light from all directions, the same at every point of the scene.
///
/// Directions are drawn from a grid of cells. A cell is bounded by two heights (its row) and by two angles about +y
/// (its column). Directions are uniform over the solid angle of a cell.
#[derive(Clone, Debug)]
pub struct Environment {
    source: Sky,
    /// Distribution of the columns of each row; `None` for rows without light.
    columns: Vec<Option<Distribution>>,
    rows: Distribution,
    size: [usize; 2],
    /// Integral of radiance over the sphere \[W·m⁻²\].
    fluence: Vec3,
    /// Small bright spots that direct light samples, and all other light. `None` for most skies.
    parts: Option<Box<SplitSky>>,
}

/// Sky with separate lamps: the radiance of the sky is the sum of rest and lamps.
#[derive(Clone, Debug)]
struct SplitSky {
    lamps: Vec<SkyLamp>,
    /// All light except the lamps; `None` if black.
    rest: Option<Environment>,
}

#[derive(Clone, Debug)]
enum Sky {
    Gradient(Gradient),
    Image(EquirectangularMap),
}

/// Image of all directions, with rows from straight up to straight down. The middle of the image is in direction −z,
/// its right half towards +x.
#[derive(Clone, Debug)]
struct EquirectangularMap {
    texels: Plane<Vec3>,
    intensity: f32,
    /// Rotation about +y \[°\].
    rotation: f32,
    /// Sine and cosine of the rotation about +y.
    turn: (f32, f32),
}

/// Number of rows into which a gradient is divided for sampling directions.
const GRADIENT_ROWS: usize = 128;

/// Direction sampled from a sky.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SkySample {
    /// Direction towards the sky, a unit vector.
    pub direction: Vec3,
    /// Density of the sampled direction \[sr⁻¹\].
    pub pdf: f32,
}

impl Environment {
    /// Builds the light of a gradient. Returns `None` if the gradient is black.
    #[must_use]
    pub fn gradient(gradient: Gradient) -> Option<Self> {
        Self::new(Sky::Gradient(gradient), [1, GRADIENT_ROWS], |_, row| {
            // Average several heights, since a gradient is steep only near its horizon.
            let heights = (0..16).map(|i| (PI * (row as f32 + (i as f32 + 0.5) / 16.0) / GRADIENT_ROWS as f32).cos());
            heights.map(|y| gradient.radiance(Vec3::new((1.0 - y * y).sqrt(), y, 0.0))).sum::<Vec3>() / 16.0
        })
    }

    /// Builds the light of an equirectangular image with radiances scaled by `intensity`. The image is rotated by
    /// `rotation` degrees about +y, counter-clockwise seen from above. Negative or non-finite texels count as black.
    /// Returns `None` if the image is black.
    #[must_use]
    pub fn image(texels: Plane<Vec3>, intensity: f32, rotation: f32) -> Option<Self> {
        let sane = texels.map(|c| if c.is_finite() { c.max(Vec3::ZERO) } else { Vec3::ZERO });
        let turn = rotation.to_radians().sin_cos();
        let map = EquirectangularMap { texels: sane, intensity, rotation, turn };

        // Separate small bright spots from the remaining light.
        let whole = Self::of_map(map.clone())?;
        let parts = lamps::split(&map, luminance(whole.fluence) / (4.0 * PI)).map(|(lamps, rest)| {
            let rest = Self::of_map(EquirectangularMap { texels: rest, ..map });
            Box::new(SplitSky { lamps, rest })
        });
        Some(Self { parts, ..whole })
    }

    fn of_map(map: EquirectangularMap) -> Option<Self> {
        let (size, intensity) = ([map.texels.width(), map.texels.height()], map.intensity);
        Self::new(Sky::Image(map.clone()), size, |column, row| map.mean_over_texel(column, row) * intensity)
    }

    /// Builds a sky. `mean` returns the radiance of a cell, which is nonzero unless the whole cell is black.
    fn new(source: Sky, size: [usize; 2], mean: impl Fn(usize, usize) -> Vec3) -> Option<Self> {
        // Weight each cell by its luminance times solid angle, and sum the fluence.
        let mut fluence = glam::DVec3::ZERO;
        let columns: Vec<Option<Distribution>> = (0..size[1])
            .map(|row| {
                let solid_angle = f64::from(cell_solid_angle(size, row));
                let cell = |column| {
                    let power = mean(column, row).as_dvec3() * solid_angle;
                    fluence += power;
                    f64::from(luminance(power.as_vec3()))
                };
                Distribution::new((0..size[0]).map(cell).collect::<Vec<f64>>())
            })
            .collect();
        let rows = Distribution::new(columns.iter().map(|row| row.as_ref().map_or(0.0, Distribution::total)))?;
        Some(Self { source, columns, rows, size, fluence: fluence.as_vec3(), parts: None })
    }

    /// Returns the radiance from the unit `direction`, which points towards the sky \[W·m⁻²·sr⁻¹\].
    #[must_use]
    pub fn radiance(&self, direction: Vec3) -> Vec3 {
        match &self.source {
            Sky::Gradient(gradient) => gradient.radiance(direction),
            Sky::Image(map) => map.radiance(direction),
        }
    }

    /// Returns the small bright spots of an image that are sampled one by one.
    pub(crate) fn lamps(&self) -> &[SkyLamp] {
        self.parts.as_ref().map_or(&[], |parts| &parts.lamps)
    }

    /// Returns the number of small bright spots that direct light samples one by one.
    #[must_use]
    pub fn lamp_count(&self) -> usize {
        self.lamps().len()
    }

    /// Returns all light except the sky's lamps, or `None` if the remaining light is black.
    #[must_use]
    pub fn beside_lamps(&self) -> Option<&Self> {
        match &self.parts {
            Some(parts) => parts.rest.as_ref(),
            None => Some(self),
        }
    }

    /// Returns the integral of radiance over all directions \[W·m⁻²\].
    #[must_use]
    pub fn fluence(&self) -> Vec3 {
        self.fluence
    }

    /// Samples a direction with a density roughly proportional to luminance. `u` is in the unit square.
    #[must_use]
    pub fn sample(&self, u: Vec2) -> SkySample {
        // Draw a row, then a cell of this row.
        let row = self.rows.pick(f64::from(u.y));
        let columns = self.columns[row.index].as_ref().expect("only rows with light are picked");
        let column = columns.pick(f64::from(u.x));

        // Draw height and angle uniformly within the cell: zones of equal height have equal areas.
        let (top, bottom) = (height(row.index, self.size[1]), height(row.index + 1, self.size[1]));
        let y = top + (bottom - top) * row.rest as f32;
        let angle = TAU * (column.index as f32 + column.rest as f32) / self.size[0] as f32;
        let sin = (1.0 - y * y).max(0.0).sqrt();
        let direction = self.to_world(Vec3::new(-sin * angle.sin(), y, sin * angle.cos()));
        let pdf = (row.probability * column.probability) as f32 / cell_solid_angle(self.size, row.index);
        SkySample { direction, pdf }
    }

    /// Returns the density of [`Environment::sample`] \[sr⁻¹\].
    #[must_use]
    pub fn pdf(&self, direction: Vec3) -> f32 {
        // Find the cell of the direction. Within a cell, the density is constant.
        let local = self.to_local(direction);
        let place = equirectangular(local);
        let row = ((place.y * self.size[1] as f32) as usize).min(self.size[1] - 1);
        let column = ((place.x * self.size[0] as f32) as usize).min(self.size[0] - 1);
        let Some(columns) = &self.columns[row] else { return 0.0 };
        (self.rows.probability(row) * columns.probability(column)) as f32 / cell_solid_angle(self.size, row)
    }

    /// Passes all numbers that the light depends on to `visitor`, in a fixed order.
    pub fn visit_numbers(&self, visitor: &mut impl FnMut(&[f32])) {
        match &self.source {
            Sky::Gradient(Gradient { zenith, horizon, ground }) => {
                // The first number distinguishes gradients (0) from images (1).
                visitor(&[0.0]);
                [zenith, horizon, ground].into_iter().for_each(|color| visitor(color));
            }
            Sky::Image(map) => {
                let (width, height) = (map.texels.width(), map.texels.height());
                visitor(&[1.0, width as f32, height as f32, map.intensity, map.rotation]);
                for row in map.texels.rows() {
                    visitor(&row.iter().flat_map(Vec3::to_array).collect::<Vec<f32>>());
                }
            }
        }
    }

    fn to_local(&self, d: Vec3) -> Vec3 {
        match &self.source {
            Sky::Gradient(_) => d,
            Sky::Image(map) => map.turned(d, -1.0),
        }
    }

    fn to_world(&self, d: Vec3) -> Vec3 {
        match &self.source {
            Sky::Gradient(_) => d,
            Sky::Image(map) => map.turned(d, 1.0),
        }
    }
}

/// Returns the cosine between +y and the upper border of a row.
fn height(row: usize, rows: usize) -> f32 {
    (PI * row as f32 / rows as f32).cos()
}

fn cell_solid_angle(size: [usize; 2], row: usize) -> f32 {
    // Use cos a − cos b = 2 sin((a + b)/2) sin((b − a)/2), which stays precise at the poles.
    let half = PI / (2.0 * size[1] as f32);
    TAU / size[0] as f32 * 2.0 * ((2.0 * row as f32 + 1.0) * half).sin() * half.sin()
}

/// Maps a direction to the unit square, x to the right and y down.
fn equirectangular(d: Vec3) -> Vec2 {
    let across = 0.5 + d.x.atan2(-d.z) / TAU;
    let down = d.x.hypot(d.z).atan2(d.y) / PI;
    Vec2::new(across, down)
}

impl EquirectangularMap {
    fn turned(&self, d: Vec3, way: f32) -> Vec3 {
        let (sin, cos) = (self.turn.0 * way, self.turn.1);
        Vec3::new(cos * d.x + sin * d.z, d.y, cos * d.z - sin * d.x)
    }

    /// Maps a position in the unit square to a unit vector.
    fn direction(&self, place: Vec2) -> glam::Vec3A {
        let (sine, cosine) = (PI * place.y).sin_cos();
        let (sin, cos) = (TAU * place.x).sin_cos();
        self.turned(Vec3::new(-sine * sin, cosine, sine * cos), 1.0).into()
    }

    /// Interpolates bilinearly between texels. Columns wrap around; rows end at the poles.
    fn radiance(&self, direction: Vec3) -> Vec3 {
        let (width, height) = (self.texels.width(), self.texels.height());
        // Texel centers are at half-integers.
        let place = equirectangular(self.turned(direction, -1.0)) * Vec2::new(width as f32, height as f32) - 0.5;
        let (corner, part) = (place.floor(), place - place.floor());
        let texel = |dx: i64, dy: i64| self.texel(corner.x as i64 + dx, corner.y as i64 + dy);
        let upper = texel(0, 0).lerp(texel(1, 0), part.x);
        upper.lerp(texel(0, 1).lerp(texel(1, 1), part.x), part.y) * self.intensity
    }

    fn texel(&self, x: i64, y: i64) -> Vec3 {
        let (width, height) = (self.texels.width() as i64, self.texels.height() as i64);
        self.texels.get(x.rem_euclid(width) as usize, y.clamp(0, height - 1) as usize)
    }

    /// Returns the mean of the bilinear function over a texel, with weights ⅛, ¾, ⅛ along each axis.
    fn mean_over_texel(&self, column: usize, row: usize) -> Vec3 {
        let (x, y) = (column as i64, row as i64);
        let along =
            |dy: i64| (self.texel(x - 1, y + dy) + self.texel(x + 1, y + dy)) * 0.125 + self.texel(x, y + dy) * 0.75;
        (along(-1) + along(1)) * 0.125 + along(0) * 0.75
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::hammersley;
    use crate::sampling::uniform_sphere;

    /// Builds a dim sky with one bright texel and a black half.
    fn sunny(rotation: f32) -> Environment {
        let texels = Plane::from_fn(32, 16, |x, y| match (x, y) {
            (20, 3) => Vec3::new(5000.0, 4000.0, 3000.0),
            (_, 8..) => Vec3::ZERO,
            _ => Vec3::new(0.1, 0.2, 0.4),
        });
        Environment::image(texels, 2.0, rotation).unwrap()
    }

    fn environments() -> [Environment; 3] {
        [Environment::gradient(Gradient::PLAIN).unwrap(), sunny(0.0), sunny(70.0)]
    }

    #[test]
    fn densities_integrate_to_one_and_hold_for_what_is_drawn() {
        for environment in environments() {
            let count = 1 << 20;
            let mean = (0..count).map(|i| f64::from(environment.pdf(uniform_sphere(hammersley(i, count)))));
            let integral = mean.sum::<f64>() / count as f64 * 4.0 * std::f64::consts::PI;
            assert!((integral - 1.0).abs() < 0.01, "{integral}");
            for i in 0..5000 {
                let SkySample { direction, pdf } = environment.sample(hammersley(i, 5000));
                assert!((direction.length() - 1.0).abs() < 1e-5 && pdf > 0.0);
                // On the border between two cells, rounding may choose either cell.
                let again = environment.pdf(direction);
                let inside = environment.pdf((direction + Vec3::new(1e-4, 2e-4, -1e-4)).normalize());
                assert!((again / pdf - 1.0).abs() < 1e-3 || again != inside, "{pdf} drawn, {again} told");
            }
        }
    }

    /// For a few normals, importance sampling and uniform sampling of the sphere agree on ∫ L cos⁺ dω.
    #[test]
    fn drawing_where_light_is_gives_the_integral() {
        for environment in environments() {
            for normal in [Vec3::Y, Vec3::X, Vec3::new(-0.5, 0.3, -0.8).normalize()] {
                let count = 1 << 18;
                let even: Vec3 = (0..count)
                    .map(|i| uniform_sphere(hammersley(i, count)))
                    .map(|d| environment.radiance(d) * normal.dot(d).max(0.0))
                    .sum::<Vec3>()
                    * (4.0 * PI / count as f32);
                let few = 4096;
                let drawn: Vec3 = (0..few)
                    .map(|i| environment.sample(hammersley(i, few)))
                    .map(|SkySample { direction: d, pdf }| environment.radiance(d) * (normal.dot(d).max(0.0) / pdf))
                    .sum::<Vec3>()
                    / few as f32;
                let scale = luminance(environment.fluence());
                assert!((drawn - even).abs().max_element() < 0.01 * scale, "{drawn} and {even}");
            }
        }
    }

    #[test]
    fn images_stand_as_they_should() {
        // A bright texel at eye level, a quarter of the width to the right of the middle, is in direction +x.
        let texels = |at| Plane::from_fn(64, 33, |x, y| if (x, y) == at { Vec3::ONE } else { Vec3::ZERO });
        let environment = Environment::image(texels((47, 16)), 1.0, 0.0).unwrap();
        assert!(environment.radiance(Vec3::new(1.0, 0.0, -0.05).normalize()).x > 0.9);
        // A rotation by 90°, counter-clockwise seen from above, turns +x into −z.
        let turned = Environment::image(texels((47, 16)), 3.0, 90.0).unwrap();
        assert!(turned.radiance(Vec3::new(-0.05, 0.0, -1.0).normalize()).x > 2.7);
        assert_eq!(turned.radiance(Vec3::X), Vec3::ZERO);
        assert!(Environment::image(texels((99, 99)), 1.0, 0.0).is_none(), "black");
    }

    #[test]
    fn fluence_is_the_integral_over_all_directions() {
        let constant = Environment::gradient(Gradient::constant([1.0, 2.0, 3.0])).unwrap();
        assert!((constant.fluence() / (4.0 * PI) - Vec3::new(1.0, 2.0, 3.0)).abs().max_element() < 1e-4);
    }
}
