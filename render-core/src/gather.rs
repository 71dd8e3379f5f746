//! Bias compensation by final gather: restores the light of nearby virtual lights that the bounded geometry term
//! removes.
//!
//! The geometry term of a virtual light is bounded: it is `cos θ cos θ_l / (r² + s)` instead of `cos θ cos θ_l / r²`. A
//! single light then cannot outshine its surroundings, but nearby light is missing \[Kollig04\]:
//!
//! ```text
//! E(x) = ∫ L(y) cos θ · s / (r² + s) dω  ≈  π/N Σ L(yᵢ) · s / (rᵢ² + s)      for N cosine-distributed rays
//!   s   bound of the geometry term, m²          r   distance from x to y, where the ray ends
//!   L   radiance represented by the surfels around y, plus emission of y that virtual lights represent
//! ```
//!
//! # Differs from the paper
//! L(y) comes from the surfels around y, which also provide the flux of the virtual lights, instead of further path
//! tracing. The compensation is exactly the missing light, and a ray costs one query. Rays continue only in gaps
//! narrower than the resolution of surfels (`gather/gap.rs`).

mod gap;

use crate::anchor::{Anchors, Moved, Sight, Spot, SurfelMap};
use crate::light::{Lamps, ShadingPoint};
use crate::photon::AnchorFlux;
use crate::sampling::{centered_sobol, concentric_disc, frame, hash_unit};
use crate::surface::{Interaction, Surface, Surfaces};
use crate::{PosedScene, Units};
use gap::Gaps;
use glam::{Mat3A, Vec3, Vec3A};
use std::f32::consts::PI;
use std::sync::Arc;

/// Distance to a surface below which surfels cannot resolve the surface's light, in units of the side of an anchor's
/// area.
///
/// Relative MSE with all lights, for several values of this distance (0: no continued rays) and geometry terms bounded
/// over one or eight areas:
///
/// | Bound | Scene | 0 | 0.1 | 0.3 | 0.4 | 0.8 | 1.6 |
/// |---|---|---|---|---|---|---|---|
/// | 1 area | `atrium` | 2.8e-3 | 2.1e-3 | 2.0e-3 | | 1.8e-3 | |
/// | 1 area | `nave` | 3.7e-3 | 3.2e-3 | 3.0e-3 | | 2.8e-3 | |
/// | 8 areas | `atrium` | | | | 1.39e-3 | 1.31e-3 | 1.25e-3 |
/// | 8 areas | `nave` | | | | 1.47e-3 | 1.44e-3 | 1.47e-3 |
const NEAR: f32 = 0.8;
/// Minimum ratio of a ray's compensation to the radiance of the surface hit. Rays below this ratio are dropped; in sum,
/// they contribute less than 0.5 %.
const LEAST_SHARE: f32 = 5e-4;

/// Final gather of one frame, with the radiance by surfel that virtual lights represent.
pub struct FinalGather {
    fixed: Arc<SurfelMap>,
    dynamic: SurfelMap,
    /// Radiance around each fixed surfel, then around each dynamic one \[W·m⁻²·sr⁻¹\].
    radiance: Vec<Vec3>,
    /// Bounds of the geometry terms of fixed and dynamic anchors \[m²\].
    bound: [f32; 2],
    gaps: Gaps,
    /// Whether each instance is dynamic.
    moving: Arc<[bool]>,
    /// Whether virtual lights with the bound of fixed anchors represent each instance's emission.
    virtual_emitters: Vec<bool>,
}

impl std::fmt::Debug for FinalGather {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.debug_struct("FinalGather").field("surfels", &self.radiance.len()).finish_non_exhaustive()
    }
}

/// Directions of one final gather, cosine-distributed on the hemisphere: uniform on the disc below it.
#[derive(Clone, Debug)]
pub struct GatherDirections(Vec<Vec3A>);

/// Result of a final gather at one point.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[must_use]
#[non_exhaustive]
pub struct Gathered {
    /// Harmonic mean distance of the hits \[m\]; infinite without hits.
    pub harmonic_mean: f32,
    /// Distance to the nearest hit \[m\]; infinite without hits.
    pub nearest: f32,
    sources: Vec<SurfelShare>,
    emitted: Vec3,
    emitted_by_position: Mat3A,
}

impl Gathered {
    /// Returns surroundings without light, from the harmonic mean and the minimum of their distances \[m\].
    pub fn of_distances(harmonic_mean: f32, nearest: f32) -> Self {
        let (emitted, emitted_by_position) = (Vec3::ZERO, Mat3A::ZERO);
        Self { harmonic_mean, nearest, sources: Vec::new(), emitted, emitted_by_position }
    }

    /// Frees all memory except the distances. [`FinalGather::compensation`] is then zero.
    pub fn forget_light(&mut self) {
        self.sources = Vec::new();
        (self.emitted, self.emitted_by_position) = (Vec3::ZERO, Mat3A::ZERO);
    }
}

/// Light that the bounded geometry term removes.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Compensation {
    /// Irradiance \[W·m⁻²\], linear RGB.
    pub irradiance: Vec3,
    /// Derivative of the irradiance with respect to position \[W·m⁻³\], one column per axis.
    pub by_position: Mat3A,
}

/// Nearby surfel and its contribution to the compensation.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct SurfelShare {
    /// Index of the surfel in [`FinalGather::radiance`].
    surfel: u32,
    /// Compensating irradiance per unit of the surfel's radiance.
    share: Vec3,
    /// Derivative of the logarithm of `share` with respect to position \[m⁻¹\].
    by_position: Vec3A,
}

/// Surface that a gather ray hit.
struct Seen<'a> {
    surface: Interaction<'a>,
    /// Length of the last segment of the ray \[m\].
    distance: f32,
    /// Contribution of the ray to the compensation, before its surfel is assigned.
    source: SurfelShare,
}

impl Gathered {
    /// Adds emission that virtual lights represent.
    fn emit(&mut self, surface: &Interaction, source: &SurfelShare) {
        let radiance = surface.emission();
        if radiance == Vec3::ZERO {
            return;
        }
        let light = radiance * source.share;
        self.emitted += light;
        self.emitted_by_position += outer(light, source.by_position);
    }
}

impl GatherDirections {
    /// Builds `count` directions, which are most even if `count` is a power of two.
    #[must_use]
    pub fn new(count: usize) -> Self {
        // Project points of the unit disc up to the hemisphere.
        let on_sphere = |u| {
            let p = concentric_disc(u);
            Vec3A::new(p.x, p.y, (1.0 - p.length_squared()).max(0.0).sqrt())
        };
        Self(centered_sobol(count).map(on_sphere).collect())
    }

    /// Returns the directions around a unit `normal`, rotated about it by an angle that depends on `key`.
    pub fn around(&self, normal: Vec3A, key: u64) -> impl Iterator<Item = Vec3A> {
        let (x, y) = frame(normal.into());
        let (sine, cosine) = (std::f32::consts::TAU * hash_unit(key, 0, 0)).sin_cos();
        let (x, y) = (Vec3A::from(x * cosine + y * sine), Vec3A::from(y * cosine - x * sine));
        self.0.iter().map(move |local| x * local.x + y * local.y + normal * local.z)
    }
}

impl FinalGather {
    /// Builds the final gather for the frame of `surfaces`, with the flux that photons deposited at surfels.
    #[must_use]
    pub fn new(surfaces: &Surfaces, anchors: &Anchors, anchor_flux: &AnchorFlux, units: &Units) -> Self {
        // Convert the flux of all surfels to radiance. Moving occluders change fixed surfels only.
        let scene = surfaces.scene();
        let fixed = anchors.surfels.fixed.clone();
        let dynamic = anchors.surfels.dynamic_in_world(surfaces);
        let mut radiance = fixed.radiance(&anchor_flux.surfels[0], &anchor_flux.moved);
        radiance.extend(dynamic.radiance(&anchor_flux.surfels[1], &Moved::default()));
        Self {
            fixed,
            dynamic,
            radiance,
            bound: [anchors.geometry_term_bound(true), anchors.dynamic_geometry_term_bound()],
            gaps: Gaps { near: NEAR * anchors.area_share.sqrt(), epsilon: units.epsilon, lamps: Lamps::default() },
            moving: surfaces.moving().clone(),
            virtual_emitters: vec![false; scene.instances.len()],
        }
    }

    /// Adds the lamps that light surfels but that rays rarely hit. By default, no lamps are added.
    #[must_use]
    pub fn with_lamps(mut self, lamps: Lamps) -> Self {
        self.gaps.lamps = lamps;
        self
    }

    /// Disables continued rays. This is required if the number of reflections is limited, since surfels do not record
    /// the number of reflections of their light.
    #[must_use]
    pub fn with_limited_bounces(mut self) -> Self {
        self.gaps.near = 0.0;
        self
    }

    /// Sets for each instance whether virtual lights with the bound of fixed anchors represent the instance's emission,
    /// which is then compensated. The default is false for all instances.
    ///
    /// # Panics
    /// If the number of values differs from the number of instances.
    #[must_use]
    pub fn with_virtual_emitters(self, virtual_emitters: Vec<bool>) -> Self {
        assert_eq!(virtual_emitters.len(), self.virtual_emitters.len(), "one value for each instance");
        Self { virtual_emitters, ..self }
    }

    /// Traces rays in the `directions` from `receiver`, rotated about the normal of `receiver` by an angle that depends
    /// on `key`.
    pub fn gather(
        &self,
        scene: PosedScene,
        receiver: &ShadingPoint,
        directions: &GatherDirections,
        key: u64,
    ) -> Gathered {
        let ShadingPoint { position, normal, geometric_normal } = *receiver;

        // Collect hit distances for the radius of a record, and compensation for its light.
        let mut found = Gathered::of_distances(f32::INFINITY, f32::INFINITY);
        let (mut inverse_distances, mut above) = (0.0, 0);
        let weight = PI / directions.0.len() as f32;
        let spread = weight.sqrt();
        for direction in directions.around(normal, key) {
            if direction.dot(geometric_normal) <= 0.0 {
                continue;
            }

            // Count distances to all hits, even if they are too far away for any compensation.
            above += 1;
            let Some(hit) = scene.accelerator.closest(position, direction) else { continue };
            inverse_distances += 1.0 / hit.distance;
            found.nearest = found.nearest.min(hit.distance);

            // Drop rays with negligible compensation s / (r² + s).
            let r2 = hit.distance * hit.distance;
            let bound = self.bound[usize::from(self.moving[hit.instance as usize])];
            let share = bound / (r2 + bound);
            if share < LEAST_SHARE {
                continue;
            }

            // A ray represents the region up to the neighboring rays, so average the texture over that region.
            let width = (hit.distance * spread).min(bound.sqrt());
            let surface = scene.surfaces.meet(&hit, direction, width);
            let way = direction * hit.distance;

            // Compute the gradient of ln(cos θ cos θ_l s / (r⁴ (r² + s))) along the surface, with the hit point fixed.
            // Both cosines contain the length of `way`.
            let towards = way.dot(surface.geometric_normal).min(-MIN_COSINE * hit.distance);
            let falloff = way * (4.0 / r2 + 2.0 / (r2 + bound));
            let gradient = falloff - surface.geometric_normal / towards;
            let gradient = gradient - normal * gradient.dot(normal);
            let source = SurfelShare { surfel: 0, share: Vec3::splat(weight * share), by_position: gradient };

            // Add emission, then follow the ray out of a narrow gap to the surfels at its end.
            if self.virtual_emitters[hit.instance as usize] {
                found.emit(&surface, &source);
            }
            let seen = Seen { surface, distance: hit.distance, source };
            let mut random = (0..).map(|k| hash_unit(key, above, k));
            let seen = self.gaps.follow(scene, seen, &mut random, &mut found);
            self.take(&seen, scene, &mut found);
        }
        found.harmonic_mean = above as f32 / inverse_distances;
        // Free unused capacity, since records keep the result for many frames.
        found.sources.shrink_to_fit();
        found
    }

    /// Returns whether this frame has every surfel in `found`. Always returns true for results of this scene.
    /// Results read from a file may refer to other surfels.
    #[must_use]
    pub fn is_complete(&self, found: &Gathered) -> bool {
        found.sources.iter().all(|source| (source.surfel as usize) < self.radiance.len())
    }

    /// Returns the distance below which the bounded geometry term removes much of the dynamic anchors' light \[m\], or
    /// 0 without dynamic anchors.
    #[must_use]
    pub fn dynamic_reach(&self) -> f32 {
        if self.dynamic.len() == 0 { 0.0 } else { self.bound[1].sqrt() }
    }

    /// Returns the radiance that `surface` of `instance` reflects of all light \[W·m⁻²·sr⁻¹\]. The radiance comes from
    /// surfels, so its resolution is limited by their density.
    #[must_use]
    pub fn surfel_radiance(&self, scene: PosedScene, surface: &Surface, instance: u32) -> Vec3 {
        let dynamic = self.moving[instance as usize];
        let (surfels, first) = self.surfels(dynamic);
        let mut sum = Vec3::ZERO;
        let (position, normal) = (surface.position, surface.geometric_normal);
        let spot = Spot { position, normal, instance, only_own: dynamic, came: None };
        surfels.splat(&spot, self.sight(dynamic, scene).as_ref(), |surfel, weight| {
            sum += self.radiance[first + surfel] * weight;
        });
        sum
    }

    /// Adds the surfel that represents the hit surface.
    fn take(&self, seen: &Seen, scene: PosedScene, found: &mut Gathered) {
        let Seen { surface, source, .. } = seen;
        if surface.is_back() {
            return;
        }
        let dynamic = self.moving[surface.instance as usize];
        let (surfels, first) = self.surfels(dynamic);
        let (position, normal) = (surface.position, surface.geometric_normal);
        let spot = Spot { position, normal, instance: surface.instance, only_own: dynamic, came: None };
        if let Some(surfel) = surfels.nearest(&spot, self.sight(dynamic, scene).as_ref()) {
            found.sources.push(SurfelShare { surfel: (first + surfel) as u32, ..*source });
        }
    }

    /// Returns the visibility between static surfels. Surfels of dynamic objects need none.
    fn sight<'s>(&self, dynamic: bool, scene: PosedScene<'s>) -> Option<Sight<'s>> {
        (!dynamic).then_some(Sight { accelerator: scene.accelerator, epsilon: self.gaps.epsilon })
    }

    /// Returns the dynamic or the fixed surfels, and the index of the first of them in `radiance`.
    fn surfels(&self, dynamic: bool) -> (&SurfelMap, usize) {
        if dynamic { (&self.dynamic, self.fixed.len()) } else { (&self.fixed, 0) }
    }

    /// Returns the bias compensation at the point of `found`, with the flux of this frame.
    #[must_use]
    pub fn compensation(&self, found: &Gathered) -> Compensation {
        let (mut sum, mut by_position) = (found.emitted, found.emitted_by_position);
        for source in &found.sources {
            let radiance = self.radiance[source.surfel as usize];
            let light = radiance * source.share;
            sum += light;
            by_position += outer(light, source.by_position);
        }
        Compensation { irradiance: sum, by_position }
    }
}

/// Minimum cosine at a hit that derivatives use. At grazing angles, derivatives would not be finite.
const MIN_COSINE: f32 = 0.05;

/// Returns the outer product `a · bᵀ`.
fn outer(a: Vec3, b: Vec3A) -> Mat3A {
    let a = Vec3A::from(a);
    Mat3A::from_cols(a * b.x, a * b.y, a * b.z)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::anchor::SHARES;
    use crate::scene::{Material, Mesh, Node, Pose, Scene, Transform};
    use crate::{Geometry, Units};
    use glam::Quat;

    const RADIANCE: f32 = 2.0;

    /// Builds squares of 40 m. Each is given by a corner and two edges, and faces the cross product of the edges.
    fn squares(list: &[[Vec3; 3]]) -> Scene {
        let mut scene = Scene::default();
        scene.materials.push(Material::default());
        let rest = Transform { translation: Vec3::ZERO, rotation: Quat::IDENTITY, scale: Vec3::ONE };
        scene.nodes.push(Node { name: String::new(), parent: None, rest });
        for (k, &[corner, a, b]) in list.iter().enumerate() {
            scene.meshes.push(Mesh {
                positions: vec![corner, corner + a, corner + a + b, corner + b],
                triangles: vec![[0, 1, 2], [0, 2, 3]],
                ..Mesh::default()
            });
            scene.instances.push(crate::scene::Instance { node: 0, mesh: k });
        }
        scene
    }

    /// Returns the light removed at `receiver`, and its derivative, if every anchor represents the same radiance.
    fn removed(scene: &Scene, receiver: impl Fn(f32) -> ShadingPoint, bound: &mut f32) -> Vec<(f32, Vec3A)> {
        let pose: Pose = scene.pose(0.0);
        let surfaces = Surfaces::new(scene, &pose);
        let anchors = Anchors::spread(&surfaces, &Units::of(scene), 4000, 0);
        let count = anchors.surfels.fixed.len();
        let area = anchors.area_share * anchors.fixed.len() as f32;
        let anchor_flux = AnchorFlux {
            fixed: Vec::new(),
            dynamic: Vec::new(),
            surfels: [vec![Vec3::splat(RADIANCE * PI * area / count as f32); count], Vec::new()],
            emitted: Vec3::ZERO,
            reflected: Vec3::ZERO,
            lost: Vec3::ZERO,
            traced: 0,
            moved: Moved::default(),
        };
        let units = Units::of(scene);
        let gather = FinalGather::new(&surfaces, &anchors, &anchor_flux, &units);
        *bound = gather.bound[0];
        let accelerator = Geometry::new(scene).place(&pose);
        let directions = GatherDirections::new(4096);
        let place = |step: f32| {
            let found = gather.gather(
                PosedScene::new(&accelerator, &surfaces),
                &receiver(step * gather.bound[0].sqrt()),
                &directions,
                7,
            );
            let Compensation { irradiance: light, by_position: slope } = gather.compensation(&found);
            (light.x, Vec3A::new(slope.x_axis.x, slope.y_axis.x, slope.z_axis.x))
        };
        [1.0, 0.99, 1.01].map(place).to_vec()
    }

    /// Above a wide floor of uniform radiance, E = π L (1 − h²/s · ln(1 + s/h²)): the integral over the hemisphere with
    /// r = h / cos θ.
    #[test]
    fn closed_form_above_a_floor() {
        let floor = squares(&[[Vec3::new(-20.0, 0.0, -20.0), Vec3::Z * 40.0, Vec3::X * 40.0]]);
        let mut bound = 0.0;
        let facing_down = |height: f32| ShadingPoint {
            position: Vec3A::new(0.3, height, 0.2),
            normal: Vec3A::NEG_Y,
            geometric_normal: Vec3A::NEG_Y,
        };
        let (light, _) = removed(&floor, facing_down, &mut bound)[0];
        // With a height of √s, h²/s = 1.
        let expected = PI * RADIANCE * (1.0 - 2f32.ln());
        assert!((light / expected - 1.0).abs() < 0.01, "{light} in place of {expected}");
    }

    /// Between two wide plates of albedo ρ at distance h, a ray continues from plate to plate while its segments are
    /// shorter than `near`. A cosine-distributed segment is longer with probability (h/near)².
    #[test]
    fn narrow_gaps_are_as_dark_as_their_reflections_make_them() {
        const ALBEDO: f32 = 0.5;
        let height = 0.1;
        let (along, across) = (Vec3::Z * 40.0, Vec3::X * 40.0);
        let floor = [Vec3::new(-20.0, 0.0, -20.0), along, across];
        let ceiling = [Vec3::new(-20.0, height, -20.0), across, along];
        let mut plates = squares(&[floor, ceiling]);
        plates.materials[0].base_color = Vec3::splat(ALBEDO);
        let on_floor = |_: f32| ShadingPoint {
            position: Vec3A::new(0.3, 1e-3, 0.2),
            normal: Vec3A::Y,
            geometric_normal: Vec3A::Y,
        };
        let mut bound = 0.0;
        let (light, _) = removed(&plates, on_floor, &mut bound)[0];
        let near = NEAR * (PI * bound / SHARES).sqrt();
        let long = (height / near).powi(2);
        let caught = (0..gap::MOST_REFLECTIONS).fold(1.0, |later, _| long + (1.0 - long) * ALBEDO * later);
        // Integrate over cos² θ, which is uniform for these rays.
        let steps = 10_000;
        let expected = (0..steps).map(|k| {
            let length = height / ((k as f32 + 0.5) / steps as f32).sqrt();
            bound / (length * length + bound) * if length < near { caught } else { 1.0 }
        });
        let expected = PI * RADIANCE * expected.sum::<f32>() / steps as f32;
        assert!((light / expected - 1.0).abs() < 0.05, "{light} in place of {expected}");
    }

    /// On a floor next to a wall, the derivative matches finite differences.
    #[test]
    fn the_derivative_is_that_of_small_steps() {
        let corner = squares(&[
            [Vec3::new(0.0, 0.0, -20.0), Vec3::Z * 40.0, Vec3::X * 40.0],
            [Vec3::new(0.0, 0.0, -20.0), Vec3::Y * 40.0, Vec3::Z * 40.0],
        ]);
        let on_floor =
            |x: f32| ShadingPoint { position: Vec3A::new(x, 1e-3, 0.0), normal: Vec3A::Y, geometric_normal: Vec3A::Y };
        let mut bound = 0.0;
        let found = removed(&corner, on_floor, &mut bound);
        let difference = (found[2].0 - found[1].0) / (0.02 * bound.sqrt());
        let slope = found[0].1;
        assert!(difference < 0.0, "less light is lost farther away");
        assert!((slope.x / difference - 1.0).abs() < 0.1, "{slope} in place of {difference}");
        assert!(slope.z.abs() < 0.1 * slope.x.abs() && slope.y.abs() < 1e-6, "{slope}");
    }
}
