//! Glowing surfaces: their power, points drawn at random, and points that stand for a share of the light.

mod balance;
mod cell;
mod order;
mod patch;
mod sampled;

use super::emission::{Ball, EmittedPhoton, Facing, PhotonEmitter, SeenLight, Space, Start};
use crate::accel::Hit;
use crate::polygon::Polygon;
use crate::sampling::{Distribution, Pick, centered_sobol, cosine_hemisphere, radical_inverse};
use crate::surface::Surfaces;
use glam::{Vec2, Vec3, Vec3A, Vec4};
use patch::{Patch, Pieces, pieces};
use std::f32::consts::PI;

/// A light of no more pieces has the same points on each.
const FEW_PANELS: usize = 4;

/// A glowing surface: all emissive triangles of one instance.
#[derive(Clone, Debug)]
pub struct AreaLight {
    /// Index into [`Scene::instances`](crate::scene::Scene::instances).
    pub instance: usize,
    /// Whether the instance moves, or changes its shape or material, at any time.
    pub moves: bool,
    patches: Vec<Patch>,
    panels: usize,
    choice: Distribution,
    /// Square meters, one side.
    pub area: f32,
    double_sided: bool,
    /// Emitted radiance where no texture changes it \[W·m⁻²·sr⁻¹\].
    emission: Vec3,
    textured: bool,
}

/// A point of a glowing surface, drawn at random.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LightPoint {
    /// Index into the mesh's triangles.
    pub triangle: usize,
    /// Barycentric weight of the second corner.
    pub u: f32,
    /// Barycentric weight of the third corner.
    pub v: f32,
    /// Density over area with which it was drawn \[m⁻²\].
    pub density: f32,
    /// Mean radiance of the cell that it is in, where a texture was split \[W·m⁻²·sr⁻¹\].
    cell_emission: Option<Vec3>,
}

/// How exactly the texture is read at a point of a light.
#[derive(Clone, Copy, Debug)]
enum Detail {
    /// At the point.
    Point,
    /// Averaged over this share of the light's area, or over the point's cell.
    Mean(f32),
}

/// A point of a glowing surface that stands for a share of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AreaSample {
    /// A little off the surface, meters.
    pub position: Vec3A,
    /// How far off it is \[m\].
    pub offset: f32,
    /// Unit normal of the glowing side.
    pub normal: Vec3A,
    /// Intensity along the normal \[W·sr⁻¹\]: radiance times the share of the area.
    pub intensity: Vec3,
    /// The share of the area \[m²\].
    pub area: f32,
}

impl AreaLight {
    pub(super) fn new(surfaces: &Surfaces, instance: usize) -> Option<Self> {
        let material = surfaces.material(instance);
        if !material.emits() || material.unlit {
            return None;
        }
        let Pieces { patches, panels } = pieces(surfaces, instance);
        let choice = Distribution::new(patches.iter().map(|patch| f64::from(patch.power())))?;
        let area = patches.iter().map(|patch| patch.area).sum();
        let (emission, textured) = (material.emission, material.emission_texture.is_some());
        Some(Self {
            instance,
            moves: surfaces.moving()[instance],
            patches,
            panels,
            choice,
            area,
            double_sided: material.double_sided,
            emission,
            textured,
        })
    }

    /// Radiant flux of all its glowing sides \[W\], linear RGB.
    #[must_use]
    pub fn power(&self) -> Vec3 {
        let one_side: Vec3 = self.patches.iter().map(|p| p.emission * p.area * PI).sum();
        if self.double_sided { one_side * 2.0 } else { one_side }
    }

    /// The sample at `point`, standing for the whole light. `side` (0…1) chooses one of two sides.
    fn sample(&self, surfaces: &Surfaces, point: LightPoint, side: f32, detail: Detail) -> AreaSample {
        let LightPoint { triangle: t, u, v, density, cell_emission } = point;
        let [a, b, c] = surfaces.corners(self.instance, t);
        let mirrored = if surfaces.world(self.instance).matrix3.determinant() < 0.0 { -1.0 } else { 1.0 };
        let sides = if self.double_sided { 2.0 } else { 1.0 };
        let turn = if self.double_sided && side >= 0.5 { -mirrored } else { mirrored };
        let normal = ((b - a).cross(c - a) * turn).normalize_or_zero();
        let share = sides / density;
        let position = a + (b - a) * u + (c - a) * v;
        let texture = |width: f32| {
            let hit = Hit { distance: 0.0, instance: self.instance as u32, triangle: t as u32, u, v };
            surfaces.at(&hit, -normal, width).emission
        };
        let emission = match (detail, cell_emission) {
            _ if !self.textured => self.emission,
            (Detail::Point, _) => texture(0.0),
            (Detail::Mean(_), Some(mean)) => mean,
            (Detail::Mean(blur), None) => texture((blur * share).sqrt()),
        };
        let offset = position.abs().max_element().max((b - a).length()) * 1e-5;
        AreaSample { position: position + normal * offset, offset, normal, intensity: emission * share, area: share }
    }

    /// The pieces that glow, as shapes.
    pub(crate) fn polygons(&self, surfaces: &Surfaces) -> Vec<Polygon> {
        let mirrored = if surfaces.world(self.instance).matrix3.determinant() < 0.0 { -1.0 } else { 1.0 };
        let polygon = |patch: &Patch| {
            let [a, b, c] = surfaces.corners(self.instance, patch.triangle);
            let whole = [a, b, c, if patch.parallelogram { a + c - b } else { c }];
            // Along the sides of the patch's shape: a triangle's are a b and a c, a parallelogram's a b and b c.
            let (x, y) = (b - a, if patch.parallelogram { c - b } else { c - a });
            let part = || patch.cell.corners().map(|p| a + x * p.x + y * p.y);
            Polygon {
                corners: if patch.cell.is_whole() { whole } else { part() },
                normal: ((b - a).cross(c - a) * mirrored).normalize_or_zero(),
                double_sided: self.double_sided,
                radiance: patch.emission,
            }
        };
        self.patches.iter().map(polygon).collect()
    }

    /// A point of the surface drawn about in proportion to emitted power. `which` chooses the piece, `place` the point on it.
    pub(crate) fn point(&self, which: f64, place: Vec2) -> LightPoint {
        let Pick { index, probability, .. } = self.choice.pick(which);
        let patch = &self.patches[index];
        let (triangle, u, v) = patch.located(patch.cell.point(place));
        let cell_emission = (!patch.cell.is_whole()).then_some(patch.emission);
        LightPoint { triangle, u, v, density: probability as f32 / patch.area, cell_emission }
    }

    /// For each triangle of the mesh, the density over area with which [`AreaLight::point`] draws from it \[m⁻²\]. Where a texture was
    /// split, [`AreaLight::density`] differs within a triangle.
    pub(crate) fn densities(&self, triangles: usize) -> Vec<f32> {
        let mut densities = vec![0.0; triangles];
        for (index, patch) in self.patches.iter().enumerate() {
            let density = (self.choice.probability(index) / f64::from(patch.area)) as f32;
            densities[patch.triangle] = if patch.area > 0.0 { density } else { 0.0 };
            if patch.parallelogram {
                densities[patch.triangle + 1] = densities[patch.triangle];
            }
        }
        densities
    }

    /// Density over area with which [`AreaLight::point`] draws a point \[m⁻²\], where a texture was split; none elsewhere.
    pub(crate) fn density(&self, triangle: usize, u: f32, v: f32) -> Option<f32> {
        if !self.textured || self.patches.len() == self.panels {
            return None;
        }
        let has = |patch: &Patch| patch.place(triangle, u, v).is_some_and(|place| patch.cell.contains(place));
        // Cells that do not glow are left out: nothing is drawn there.
        let Some(index) = self.patches.iter().position(has) else { return Some(0.0) };
        Some((self.choice.probability(index) / f64::from(self.patches[index].area)) as f32)
    }

    /// How many separate pieces glow: rectangles, or triangles that belong to none.
    #[must_use]
    pub fn patch_count(&self) -> usize {
        self.panels
    }

    /// Whether a texture makes it glow unevenly.
    pub(crate) fn is_textured(&self) -> bool {
        self.textured
    }

    /// Largest side of the box around the glowing triangles, meters.
    #[must_use]
    pub fn extent(&self, surfaces: &Surfaces) -> f32 {
        let mut corners = (Vec3A::INFINITY, Vec3A::NEG_INFINITY);
        for corner in self.polygons(surfaces).into_iter().flat_map(|polygon| polygon.corners) {
            corners = (corners.0.min(corner), corners.1.max(corner));
        }
        (corners.1 - corners.0).max_element()
    }

    /// `count` points that together stand for the light, spread evenly by emitted power.
    #[must_use]
    pub fn samples(&self, surfaces: &Surfaces, count: usize) -> Vec<AreaSample> {
        // Even strata of power choose piece and side, in an order that spreads any first few of the points over the whole light:
        // that of the radical inverse, whose values alone leave uneven gaps.
        let mut ranks: Vec<usize> = (0..count).collect();
        ranks.sort_by(|&a, &b| radical_inverse(3, a as u64).total_cmp(&radical_inverse(3, b as u64)));
        let mut strata = vec![0.0; count];
        for (rank, index) in ranks.into_iter().enumerate() {
            strata[index] = (rank as f64 + 0.5) / count as f64;
        }
        let face = |which: f64| {
            let Pick { index, rest, .. } = self.choice.pick(which);
            2 * index + usize::from(self.double_sided && rest >= 0.5)
        };

        // Each face has points of its own: one sequence for all of them would tie the place to the choice of the face.
        let mut counts = vec![0; 2 * self.patches.len()];
        strata.iter().for_each(|&which| counts[face(which)] += 1);
        let shares = self.shares_of_points(&counts);
        let mut places: Vec<_> = counts.iter().copied().map(centered_sobol).collect();
        // Few points are to one side of a face, all of them to the same one. A few panels keep theirs.
        let shifts = self.panels > FEW_PANELS;

        let mut samples = Vec::with_capacity(count);
        for which in strata {
            let face = face(which);
            let place = places[face].next().expect("one place for each point of the face");
            let place = if shifts && counts[face] > 1 { shifted(place, face) } else { place };
            let side = (face % 2) as f32;
            let mut sample = self.sample(surfaces, self.point(which, place), side, Detail::Mean(1.0 / count as f32));
            sample.intensity *= shares[face];
            sample.area *= shares[face];
            samples.push(sample);
        }
        samples
    }

    /// Share of the light's power that each point of a face has, by the number of points of each face: two for a piece.
    ///
    /// ```text
    /// p / n           of a face with the share p of the power that is worth two points or more, p N ≥ 2, and has n
    /// Σ p / Σ n       of the points of all others, which stand for each other          N  points of the light
    /// ```
    ///
    /// The power of a face decides, and not the number that it got by chance: of faces worth a point, those that got two would
    /// give each half as much, and the light of all others would outweigh theirs.
    fn shares_of_points(&self, counts: &[usize]) -> Vec<f32> {
        let sides = if self.double_sided { 2.0 } else { 1.0 };
        let all = counts.iter().sum::<usize>() as f64;
        let power = |face: usize| self.choice.probability(face / 2) / sides;
        let has_sides = |face: usize| face.is_multiple_of(2) || self.double_sided;
        let stands_alone = |face: usize, count: usize| count > 0 && power(face) * all >= 2.0;
        let (mut rest, mut points) = (0.0, 0);
        for (face, &count) in counts.iter().enumerate() {
            if has_sides(face) && !stands_alone(face, count) {
                rest += power(face);
                points += count;
            }
        }
        // Densities contain p already. The remaining factor turns them into these shares.
        let share = |(face, &count): (usize, &usize)| match count {
            0 => 0.0,
            _ if stands_alone(face, count) => power(face) / count as f64,
            _ => rest / points as f64,
        };
        counts.iter().enumerate().map(share).map(|share| share as f32).collect()
    }
}

impl PhotonEmitter for AreaLight {
    fn power(&self, _: &Ball) -> Vec3 {
        Self::power(self)
    }

    fn emit(&self, Space { surfaces, .. }: Space, Start { rest, place, way, .. }: Start, share: f32) -> EmittedPhoton {
        let sample = self.sample(surfaces, self.point(rest, place), way.x, Detail::Point);
        // The same number chose the side; what it has left over is as good as new.
        let way = if self.double_sided { Vec2::new((way.x * 2.0).fract(), way.y) } else { way };
        let direction = cosine_hemisphere(sample.normal.into(), way).into();
        // Radiance · area · π is the flux; the point was chosen with density radiance/area-weighted.
        let flux = sample.intensity * PI * share;
        EmittedPhoton { origin: sample.position, direction, flux, from_moving: self.moves, distant: false }
    }

    fn towards(&self, Space { surfaces, .. }: Space, at: Facing, [place, way]: [Vec2; 2]) -> Option<SeenLight> {
        let sample = self.sample(surfaces, self.point(f64::from(way.x), place), way.y, Detail::Point);
        let to_sample = sample.position - at.position;
        let (distance, towards) = (to_sample.length(), to_sample.try_normalize()?);
        let cosines = at.cosine(towards)? * sample.normal.dot(-towards).max(0.0);
        // Bounded, as a point close by would outshine all others.
        let irradiance = sample.intensity * cosines / (distance * distance + self.area / PI);
        Some(SeenLight { irradiance, towards, end: Some(sample.position), start: Vec4::ZERO })
    }
}

/// A place in the unit square, moved around its borders by a vector of the face's own: multiples of 1/g and 1/g², g³ = g + 1, whose
/// remainders are spread evenly (Roberts 2018).
fn shifted(place: Vec2, face: usize) -> Vec2 {
    let shift = [0.754_877_666_246_692_8, 0.569_840_290_998_053_2].map(|step: f64| (step * face as f64).fract() as f32);
    (place + Vec2::from(shift)).fract()
}
