//! Emissive surfaces: power, random points, and representative sample points.

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

/// Maximum number of pieces of a light for which each piece has the same points.
const FEW_PANELS: usize = 4;

/// Emissive surface: all emissive triangles of one instance.
#[derive(Clone, Debug)]
pub struct AreaLight {
    /// Index of the instance in [`Scene::instances`](crate::scene::Scene::instances).
    pub instance: usize,
    /// Whether the instance's transform, shape or material ever changes.
    pub moves: bool,
    patches: Vec<Patch>,
    panels: usize,
    choice: Distribution,
    /// Area of one side \[m²\].
    pub area: f32,
    double_sided: bool,
    /// Emitted radiance before the texture's factor \[W·m⁻²·sr⁻¹\].
    emission: Vec3,
    textured: bool,
}

/// Random point of an emissive surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LightPoint {
    /// Index into the mesh's triangles.
    pub triangle: usize,
    /// Barycentric weight of the second corner.
    pub u: f32,
    /// Barycentric weight of the third corner.
    pub v: f32,
    /// Probability density of the random point over area \[m⁻²\].
    pub density: f32,
    /// Mean radiance of the point's cell if a texture was split \[W·m⁻²·sr⁻¹\].
    cell_emission: Option<Vec3>,
}

/// Filter of the texture at a point of a light.
#[derive(Clone, Copy, Debug)]
enum Detail {
    /// No filter.
    Point,
    /// Mean over the point's cell; without cells, mean over this fraction of the light's area.
    Mean(f32),
}

/// Point of an emissive surface that represents a fraction of the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AreaSample {
    /// Position of the point, slightly off the surface \[m\].
    pub position: Vec3A,
    /// Distance of the point from the surface \[m\].
    pub offset: f32,
    /// Normal of the emitting side, a unit vector.
    pub normal: Vec3A,
    /// Intensity along the normal \[W·sr⁻¹\]: radiance times represented area.
    pub intensity: Vec3,
    /// Area that the point represents \[m²\].
    pub area: f32,
}

impl AreaLight {
    pub(super) fn new(surfaces: &Surfaces, instance: usize) -> Option<Self> {
        let material = surfaces.material(instance);
        if !material.emits() || material.unlit {
            return None;
        }
        // Choose points in proportion to power, so that bright pieces receive most of them.
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

    /// Returns the radiant flux of all emitting sides \[W\], linear RGB.
    #[must_use]
    pub fn power(&self) -> Vec3 {
        let one_side: Vec3 = self.patches.iter().map(|p| p.emission * p.area * PI).sum();
        if self.double_sided { one_side * 2.0 } else { one_side }
    }

    /// Builds the sample at `point`, which represents the whole light. `side` (0…1) selects one of two sides.
    fn sample(&self, surfaces: &Surfaces, point: LightPoint, side: f32, detail: Detail) -> AreaSample {
        // Compute the position and the normal of the emitting side. A mirrored instance reverses the corners.
        let LightPoint { triangle: t, u, v, density, cell_emission } = point;
        let [a, b, c] = surfaces.corners(self.instance, t);
        let mirrored = if surfaces.world(self.instance).matrix3.determinant() < 0.0 { -1.0 } else { 1.0 };
        let sides = if self.double_sided { 2.0 } else { 1.0 };
        let turn = if self.double_sided && side >= 0.5 { -mirrored } else { mirrored };
        let normal = ((b - a).cross(c - a) * turn).normalize_or_zero();
        let share = sides / density;
        let position = a + (b - a) * u + (c - a) * v;

        // Evaluate the emission. A point that represents an area uses the mean over this area.
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

        // Move the point off the surface by more than the rounding error of its coordinates.
        let offset = position.abs().max_element().max((b - a).length()) * 1e-5;
        AreaSample { position: position + normal * offset, offset, normal, intensity: emission * share, area: share }
    }

    /// Returns the emissive pieces as polygons.
    pub(crate) fn polygons(&self, surfaces: &Surfaces) -> Vec<Polygon> {
        let mirrored = if surfaces.world(self.instance).matrix3.determinant() < 0.0 { -1.0 } else { 1.0 };
        // Cells of a texture are scaled copies of their patch, in the coordinates of its two sides.
        let polygon = |patch: &Patch| {
            let [a, b, c] = surfaces.corners(self.instance, patch.triangle);
            let whole = [a, b, c, if patch.parallelogram { a + c - b } else { c }];
            // The sides of the patch are ab and ac for a triangle, ab and bc for a parallelogram.
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

    /// Draws a point with a density roughly proportional to emitted power. `which` selects the piece, `place` the point
    /// on the piece.
    pub(crate) fn point(&self, which: f64, place: Vec2) -> LightPoint {
        let Pick { index, probability, .. } = self.choice.pick(which);
        let patch = &self.patches[index];
        let (triangle, u, v) = patch.located(patch.cell.point(place));
        let cell_emission = (!patch.cell.is_whole()).then_some(patch.emission);
        LightPoint { triangle, u, v, density: probability as f32 / patch.area, cell_emission }
    }

    /// Returns the density over area of [`AreaLight::point`] for each triangle of the mesh \[m⁻²\]. With a split
    /// texture, [`AreaLight::density`] varies within a triangle.
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

    /// Returns the density over area of [`AreaLight::point`] at a point \[m⁻²\], or `None` if no texture was split.
    pub(crate) fn density(&self, triangle: usize, u: f32, v: f32) -> Option<f32> {
        if !self.textured || self.patches.len() == self.panels {
            return None;
        }
        let has = |patch: &Patch| patch.place(triangle, u, v).is_some_and(|place| patch.cell.contains(place));
        // Cells without emission are omitted, so no point is drawn in them.
        let Some(index) = self.patches.iter().position(has) else { return Some(0.0) };
        Some((self.choice.probability(index) / f64::from(self.patches[index].area)) as f32)
    }

    /// Returns the number of separate emissive pieces: rectangles, and triangles outside any rectangle.
    #[must_use]
    pub fn patch_count(&self) -> usize {
        self.panels
    }

    /// Returns whether a texture varies the emission.
    pub(crate) fn is_textured(&self) -> bool {
        self.textured
    }

    /// Returns the longest side of the bounding box of the emissive triangles \[m\].
    #[must_use]
    pub fn extent(&self, surfaces: &Surfaces) -> f32 {
        let mut corners = (Vec3A::INFINITY, Vec3A::NEG_INFINITY);
        for corner in self.polygons(surfaces).into_iter().flat_map(|polygon| polygon.corners) {
            corners = (corners.0.min(corner), corners.1.max(corner));
        }
        (corners.1 - corners.0).max_element()
    }

    /// Builds `count` points that together represent the light, distributed evenly by emitted power.
    #[must_use]
    pub fn samples(&self, surfaces: &Surfaces, count: usize) -> Vec<AreaSample> {
        // Even strata of power select piece and side. The radical inverse orders the strata, so that the first few
        // points are spread over the whole light. Using the values of the radical inverse instead would leave uneven
        // gaps.
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

        // Each face uses a separate sequence of points: a shared sequence would correlate position and choice of face.
        let mut counts = vec![0; 2 * self.patches.len()];
        strata.iter().for_each(|&which| counts[face(which)] += 1);
        let shares = self.shares_of_points(&counts);
        let mut places: Vec<_> = counts.iter().copied().map(centered_sobol).collect();
        // With few points, all points of a face are off-center to the same side. Shift them, unless the light has few panels.
        let shifts = self.panels > FEW_PANELS;

        // Build one sample per stratum of power.
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

    /// Returns, for each face, the fraction of the light's power per point, given the number of points on each face.
    /// Each piece has two faces.
    ///
    /// ```text
    /// p / n           for a face with the fraction p ≥ 2 / N of the power, and n points
    /// Σ p / Σ n       for points of all other faces, which represent each other        N  points of the light
    /// ```
    /// The result depends on a face's power, not on its random number of points. Otherwise, among faces worth one
    /// point, the points of a face with two would have half the weight, and other faces would be overrepresented.
    fn shares_of_points(&self, counts: &[usize]) -> Vec<f32> {
        // Pool the faces with too little power for two points.
        let sides = if self.double_sided { 2.0 } else { 1.0 };
        let all = counts.iter().sum::<usize>() as f64;
        let power = |face: usize| self.choice.probability(face / 2) / sides;
        let has_sides = |face: usize| face.is_multiple_of(2) || self.double_sided;
        let stands_alone = |face: usize, count: usize| count > 0 && power(face) * all >= 2.0;
        // Sum power and points of the pooled faces, including faces without points.
        let (mut rest, mut points) = (0.0, 0);
        for (face, &count) in counts.iter().enumerate() {
            if has_sides(face) && !stands_alone(face, count) {
                rest += power(face);
                points += count;
            }
        }

        // Densities already contain p. The remaining factor converts them to the returned fractions.
        let mut shares = Vec::with_capacity(counts.len());
        for (face, &count) in counts.iter().enumerate() {
            let share = match count {
                0 => 0.0,
                _ if stands_alone(face, count) => power(face) / count as f64,
                _ => rest / points as f64,
            };
            shares.push(share as f32);
        }
        shares
    }
}

impl PhotonEmitter for AreaLight {
    fn power(&self, _: &Ball) -> Vec3 {
        Self::power(self)
    }

    fn emit(&self, Space { surfaces, .. }: Space, Start { rest, place, way, .. }: Start, share: f32) -> EmittedPhoton {
        let sample = self.sample(surfaces, self.point(rest, place), way.x, Detail::Point);
        // The same number chose the side. Its remainder serves as a new random number.
        let way = if self.double_sided { Vec2::new((way.x * 2.0).fract(), way.y) } else { way };
        let direction = cosine_hemisphere(sample.normal.into(), way).into();
        // Flux is radiance · area · π. The density of the point is proportional to its radiance.
        let flux = sample.intensity * PI * share;
        EmittedPhoton { origin: sample.position, direction, flux, from_moving: self.moves, distant: false }
    }

    fn towards(&self, Space { surfaces, .. }: Space, at: Facing, [place, way]: [Vec2; 2]) -> Option<SeenLight> {
        let sample = self.sample(surfaces, self.point(f64::from(way.x), place), way.y, Detail::Point);
        let to_sample = sample.position - at.position;
        let (distance, towards) = (to_sample.length(), to_sample.try_normalize()?);
        let cosines = at.cosine(towards)? * sample.normal.dot(-towards).max(0.0);
        // The distance term is bounded, otherwise a nearby point would outshine all other points.
        let irradiance = sample.intensity * cosines / (distance * distance + self.area / PI);
        Some(SeenLight { irradiance, towards, end: Some(sample.position), start: Vec4::ZERO })
    }
}

/// Returns a position in the unit square, shifted cyclically by a vector that depends on the face. The vectors are
/// multiples of (1/g, 1/g²) with g³ = g + 1, and their fractional parts are evenly distributed (Roberts 2018).
fn shifted(place: Vec2, face: usize) -> Vec2 {
    let shift = [0.754_877_666_246_692_8, 0.569_840_290_998_053_2].map(|step: f64| (step * face as f64).fract() as f32);
    (place + Vec2::from(shift)).fract()
}
