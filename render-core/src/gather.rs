//! Short looks around a point: how near the surroundings are, and the light that softening took from its virtual lights.
//!
//! A virtual light is softened, `cos θ cos θ_l / (r² + s)` in place of `/ r²`, so that a single one cannot outshine its
//! surroundings nearby. What that removes is light from close by \[Kollig04\]:
//!
//! ```text
//! E_removed(x) = ∫ L(y) cos θ · s / (r² + s) dω  ≈  π/N Σ L(yᵢ) · s / (rᵢ² + s)      for N cosine-distributed rays
//!   s   softening, m²          r   distance from x to y, where the ray ends
//!   L   radiance that the surfels around y stand for, plus what y emits where its glow is made of virtual lights too
//! ```
//!
//! # Differs from the paper
//! L(y) comes from the surfels around y, which feed the virtual lights too, and not from a path traced onward: what is given
//! back is what was taken, no more, and a ray costs a look-up. Only in gaps that are narrower than surfels can tell are rays
//! followed on (`gather/gap.rs`).

mod gap;

use crate::Units;
use crate::accel::Accelerator;
use crate::anchor::{Anchors, Spot, SurfelMap};
use crate::direct::{Lamps, Receiver};
use crate::photon::Energies;
use crate::sampling::{concentric_disc, frame, hash_unit, sobol_point};
use crate::surface::{Interaction, Surface, Surfaces};
use gap::Gaps;
use glam::{Mat3A, Vec3, Vec3A};
use std::f32::consts::PI;
use std::sync::Arc;

/// How near a surface is whose light surfels do not tell from that of its surroundings, in sides of an anchor's share.
///
/// Measured on `atrium` and `nave`: without following rays on, pictures by all lights are off by 2.8e-3 and 3.7e-3 of relative
/// MSE; with 0.1 by 2.1e-3 and 3.2e-3, with 0.3 by 2.0e-3 and 3.0e-3, with 0.8 by 1.8e-3 and 2.8e-3. That was with anchors
/// softened over one share; over eight, 0.4, 0.8 and 1.6 leave 1.39e-3, 1.31e-3, 1.25e-3 and 1.47e-3, 1.44e-3, 1.47e-3.
const NEAR: f32 = 0.8;
/// Rays that give back less than this share of what they see are not followed up: in sum not even half a per cent.
const LEAST_SHARE: f32 = 5e-4;

/// What the virtual lights of a frame stand for, ready to be asked from anywhere.
pub struct Gather {
    fixed: Arc<SurfelMap>,
    carried: SurfelMap,
    /// Radiance around each fixed surfel, then around each carried one \[W·m⁻²·sr⁻¹\].
    radiance: Vec<Vec3>,
    /// Softening of the fixed and of the carried anchors \[m²\].
    softening: [f32; 2],
    gaps: Gaps,
    /// By instance.
    moving: Vec<bool>,
    /// Instances whose own glow is made of virtual lights with the softening of the fixed anchors.
    glow_softened: Vec<bool>,
}

/// Directions of one look around: even over the disc below, cosine-distributed on the hemisphere above it.
#[derive(Clone, Debug)]
pub struct Directions(Vec<Vec3A>);

/// What a look around found.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct Surroundings {
    /// Harmonic mean distance of what the rays met \[m\]; infinite where they met nothing.
    pub harmonic_mean: f32,
    /// Distance to the nearest of it \[m\].
    pub nearest: f32,
    sources: Vec<Source>,
    emitted: Vec3,
    emitted_by_position: Mat3A,
}

/// A piece of surface nearby whose light was taken.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
struct Source {
    /// Place in [`Gather::radiance`].
    surfel: u32,
    /// Irradiance per radiance.
    share: Vec3,
    /// Derivative of the logarithm of `share` by the position \[m⁻¹\].
    by_position: Vec3A,
}

/// Where a ray ended.
struct Seen<'a> {
    surface: Interaction<'a>,
    /// From the place before \[m\].
    distance: f32,
}

impl Surroundings {
    /// Adds light that does not come from virtual lights.
    fn emit(&mut self, surface: &Interaction, source: &Source) {
        let radiance = surface.emission();
        if radiance == Vec3::ZERO {
            return;
        }
        let light = radiance * source.share;
        self.emitted += light;
        self.emitted_by_position += outer(light, source.by_position);
    }
}

impl Directions {
    /// `count` directions; a power of two is the most even.
    pub fn new(count: usize) -> Self {
        let on_sphere = |i| {
            let p = concentric_disc(sobol_point(i));
            Vec3A::new(p.x, p.y, (1.0 - p.length_squared()).max(0.0).sqrt())
        };
        Self((0..count as u64).map(on_sphere).collect())
    }
}

impl Gather {
    /// For the frame of `surfaces`, with the `energies` that its photons left. `glow_softened` says for each instance
    /// whether its glow is made of virtual lights as soft as the fixed anchors, `lamps` where all other lights are.
    pub fn new(
        surfaces: &Surfaces,
        anchors: &Anchors,
        energies: &Energies,
        units: &Units,
        lamps: Lamps,
        glow_softened: Vec<bool>,
    ) -> Self {
        let scene = surfaces.scene();
        let fixed = anchors.surfels.fixed.clone();
        let carried = anchors.surfels.carried_in_world(surfaces);
        let mut radiance = fixed.radiance(&energies.surfels[0]);
        radiance.extend(carried.radiance(&energies.surfels[1]));
        Self {
            fixed,
            carried,
            radiance,
            softening: [anchors.softening(true), anchors.carried_softening()],
            gaps: Gaps { near: NEAR * anchors.area_share.sqrt(), epsilon: units.epsilon, lamps },
            moving: scene.moving_instances(),
            glow_softened,
        }
    }

    /// Shoots the `directions` from `receiver`, turned about its normal by an angle that follows from `key`.
    pub fn look_around(
        &self,
        accelerator: &Accelerator,
        surfaces: &Surfaces,
        receiver: &Receiver,
        directions: &Directions,
        key: u64,
    ) -> Surroundings {
        let Receiver { position, normal, geometric_normal } = *receiver;
        let (x, y) = frame(normal.into());
        let (sine, cosine) = (std::f32::consts::TAU * hash_unit(key, 0, 0)).sin_cos();
        let (x, y) = (Vec3A::from(x * cosine + y * sine), Vec3A::from(y * cosine - x * sine));
        let mut found = Surroundings {
            harmonic_mean: f32::INFINITY,
            nearest: f32::INFINITY,
            sources: Vec::new(),
            emitted: Vec3::ZERO,
            emitted_by_position: Mat3A::ZERO,
        };
        let (mut inverse_distances, mut above) = (0.0, 0);
        let weight = PI / directions.0.len() as f32;
        let spread = weight.sqrt();
        for local in &directions.0 {
            let direction = x * local.x + y * local.y + normal * local.z;
            if direction.dot(geometric_normal) <= 0.0 {
                continue;
            }
            above += 1;
            let Some(hit) = accelerator.closest(position, direction) else { continue };
            inverse_distances += 1.0 / hit.distance;
            found.nearest = found.nearest.min(hit.distance);
            let r2 = hit.distance * hit.distance;
            let softening = self.softening[usize::from(self.moving[hit.instance as usize])];
            let share = softening / (r2 + softening);
            if share < LEAST_SHARE {
                continue;
            }
            // Of a texture a ray sees what lies between it and its neighbours.
            let width = (hit.distance * spread).min(softening.sqrt());
            let surface = surfaces.meet(&hit, direction, width);
            let way = direction * hit.distance;
            // ∇ ln of cos θ cos θ_l s / (r⁴ (r² + s)) along the surface, the element of the other surface held fixed; both
            // cosines carry the way's length.
            let towards = way.dot(surface.geometric_normal).min(-MIN_COSINE * hit.distance);
            let falloff = way * (4.0 / r2 + 2.0 / (r2 + softening));
            let gradient = falloff - surface.geometric_normal / towards;
            let gradient = gradient - normal * gradient.dot(normal);
            let source = Source { surfel: 0, share: Vec3::splat(weight * share), by_position: gradient };
            if self.glow_softened[hit.instance as usize] {
                found.emit(&surface, &source);
            }
            let seen = Seen { surface, distance: hit.distance };
            let mut random = (0..).map(|k| hash_unit(key, above, k));
            let (seen, source) = self.gaps.follow(accelerator, surfaces, seen, source, &mut random, &mut found);
            self.take(&seen, source, &mut found);
        }
        found.harmonic_mean = above as f32 / inverse_distances;
        found
    }

    /// Whether all that `found` took light from is there. What a look around found is; what was read from a file may not be.
    pub fn knows(&self, found: &Surroundings) -> bool {
        found.sources.iter().all(|source| (source.surfel as usize) < self.radiance.len())
    }

    /// How near a moving thing has to be for its own light to have lost much: from its anchors' softening \[m\].
    pub fn reach_of_carried(&self) -> f32 {
        if self.carried.len() == 0 { 0.0 } else { self.softening[1].sqrt() }
    }

    /// Radiance that `surface` of `instance` reflects, as its surfels stand for it: from all light, to the accuracy of
    /// their density \[W·m⁻²·sr⁻¹\].
    pub fn radiance_around(&self, surface: &Surface, instance: u32) -> Vec3 {
        let carried = self.moving[instance as usize];
        let (surfels, first) = self.surfels(carried);
        let mut sum = Vec3::ZERO;
        let spot = spot(surface.position, surface.geometric_normal, carried.then_some(instance));
        surfels.splat(&spot, |surfel, weight| {
            sum += self.radiance[first + surfel] * weight;
        });
        sum
    }

    /// Notes what `surface` gives back.
    fn take(&self, seen: &Seen, source: Source, found: &mut Surroundings) {
        let surface = &seen.surface;
        if surface.is_back() {
            return;
        }
        let carried = self.moving[surface.instance as usize];
        let (surfels, first) = self.surfels(carried);
        let mut nearest = (0, 0.0);
        let spot = spot(surface.position, surface.geometric_normal, carried.then_some(surface.instance));
        surfels.splat(&spot, |surfel, weight| {
            if weight > nearest.1 {
                nearest = (surfel, weight);
            }
        });
        if nearest.1 > 0.0 {
            found.sources.push(Source { surfel: (first + nearest.0) as u32, ..source });
        }
    }

    /// Those of what moves or of what stands still, and the place of the first in `radiance`.
    fn surfels(&self, carried: bool) -> (&SurfelMap, usize) {
        if carried { (&self.carried, self.fixed.len()) } else { (&self.fixed, 0) }
    }

    /// Irradiance that softening took at the place of `found`, with this frame's energies \[W·m⁻²\], and its derivative by
    /// the position: RGB per metre, a column for each axis.
    pub fn removed_light(&self, found: &Surroundings) -> (Vec3, Mat3A) {
        let (mut sum, mut by_position) = (found.emitted, found.emitted_by_position);
        for source in &found.sources {
            let radiance = self.radiance[source.surfel as usize];
            let light = radiance * source.share;
            sum += light;
            by_position += outer(light, source.by_position);
        }
        (sum, by_position)
    }
}

/// Cosine below which a surface is taken as seen at that cosine, where only derivatives are concerned: they would not be
/// finite edge on.
const MIN_COSINE: f32 = 0.05;

/// Where a surface stands among the surfels; of one instance alone, if that moves.
fn spot(position: Vec3A, normal: Vec3A, instance: Option<u32>) -> Spot {
    Spot { position, normal, instance, came: None }
}

/// `a · bᵀ`.
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

    /// Squares of 40 m, each from a corner along two edges and facing their cross product.
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

    /// The light removed at `receiver`, and its derivative, when every anchor stands for the same radiance.
    fn removed(scene: &Scene, receiver: impl Fn(f32) -> Receiver, softening: &mut f32) -> Vec<(f32, Vec3A)> {
        let pose: Pose = scene.pose(0.0);
        let surfaces = Surfaces::new(scene, &pose);
        let anchors = Anchors::spread(scene, &surfaces, &Units::of(scene), 4000, 0);
        let count = anchors.surfels.fixed.len();
        let area = anchors.area_share * anchors.fixed.len() as f32;
        let energies = Energies {
            fixed: Vec::new(),
            carried: Vec::new(),
            surfels: [vec![Vec3::splat(RADIANCE * PI * area / count as f32); count], Vec::new()],
            emitted: Vec3::ZERO,
            reflected: Vec3::ZERO,
            lost: Vec3::ZERO,
            traced: 0,
        };
        let units = Units::of(scene);
        let gather =
            Gather::new(&surfaces, &anchors, &energies, &units, Lamps::default(), vec![false; scene.instances.len()]);
        *softening = gather.softening[0];
        let accelerator = Geometry::new(scene).place(&pose);
        let directions = Directions::new(4096);
        let place = |step: f32| {
            let found = gather.look_around(
                &accelerator,
                &surfaces,
                &receiver(step * gather.softening[0].sqrt()),
                &directions,
                7,
            );
            let (light, slope) = gather.removed_light(&found);
            (light.x, Vec3A::new(slope.x_axis.x, slope.y_axis.x, slope.z_axis.x))
        };
        [1.0, 0.99, 1.01].map(place).to_vec()
    }

    /// Above a wide floor of even radiance: E = π L (1 − h²/s · ln(1 + s/h²)), from ∫ over the hemisphere with r = h / cos θ.
    #[test]
    fn closed_form_above_a_floor() {
        let floor = squares(&[[Vec3::new(-20.0, 0.0, -20.0), Vec3::Z * 40.0, Vec3::X * 40.0]]);
        let mut softening = 0.0;
        let facing_down = |height: f32| Receiver {
            position: Vec3A::new(0.3, height, 0.2),
            normal: Vec3A::NEG_Y,
            geometric_normal: Vec3A::NEG_Y,
        };
        let (light, _) = removed(&floor, facing_down, &mut softening)[0];
        // The height is √s.
        let expected = PI * RADIANCE * (1.0 - 2f32.ln());
        assert!((light / expected - 1.0).abs() < 0.01, "{light} in place of {expected}");
    }

    /// Between two wide plates of albedo ρ, a height h apart, a ray is followed from plate to plate while its pieces are shorter
    /// than `near`; of cosine-distributed ones (h/near)² are not.
    #[test]
    fn narrow_gaps_are_as_dark_as_their_reflections_make_them() {
        const ALBEDO: f32 = 0.5;
        let height = 0.1;
        let (along, across) = (Vec3::Z * 40.0, Vec3::X * 40.0);
        let floor = [Vec3::new(-20.0, 0.0, -20.0), along, across];
        let ceiling = [Vec3::new(-20.0, height, -20.0), across, along];
        let mut plates = squares(&[floor, ceiling]);
        plates.materials[0].base_color = Vec3::splat(ALBEDO);
        let on_floor =
            |_: f32| Receiver { position: Vec3A::new(0.3, 1e-3, 0.2), normal: Vec3A::Y, geometric_normal: Vec3A::Y };
        let mut softening = 0.0;
        let (light, _) = removed(&plates, on_floor, &mut softening)[0];
        let near = NEAR * (PI * softening / SHARES).sqrt();
        let long = (height / near).powi(2);
        let caught = (0..gap::MOST_REFLECTIONS).fold(1.0, |later, _| long + (1.0 - long) * ALBEDO * later);
        // Over cos² θ, which is even for these rays.
        let steps = 10_000;
        let expected = (0..steps).map(|k| {
            let length = height / ((k as f32 + 0.5) / steps as f32).sqrt();
            softening / (length * length + softening) * if length < near { caught } else { 1.0 }
        });
        let expected = PI * RADIANCE * expected.sum::<f32>() / steps as f32;
        assert!((light / expected - 1.0).abs() < 0.05, "{light} in place of {expected}");
    }

    /// On a floor beside a wall: the derivative is what small steps find.
    #[test]
    fn the_derivative_is_that_of_small_steps() {
        let corner = squares(&[
            [Vec3::new(0.0, 0.0, -20.0), Vec3::Z * 40.0, Vec3::X * 40.0],
            [Vec3::new(0.0, 0.0, -20.0), Vec3::Y * 40.0, Vec3::Z * 40.0],
        ]);
        let on_floor =
            |x: f32| Receiver { position: Vec3A::new(x, 1e-3, 0.0), normal: Vec3A::Y, geometric_normal: Vec3A::Y };
        let mut softening = 0.0;
        let found = removed(&corner, on_floor, &mut softening);
        let difference = (found[2].0 - found[1].0) / (0.02 * softening.sqrt());
        let slope = found[0].1;
        assert!(difference < 0.0, "less light is lost farther away");
        assert!((slope.x / difference - 1.0).abs() < 0.1, "{slope} in place of {difference}");
        assert!(slope.z.abs() < 0.1 * slope.x.abs() && slope.y.abs() < 1e-6, "{slope}");
    }
}
