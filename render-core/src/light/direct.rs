//! Direct light, with shadows.
//!
//! The sample points of a light are the same for all pixels and frames. Penumbras are then smooth and static, whereas
//! random points would leave noise that costs the encoder bits. Shadow rays from a sample to all pixels of a tile are
//! traced together.

use super::emitters::Emitters;
use super::points::LightPoints;
use super::receiver::{Disc, ShadingPoint};
use super::sampled::{Lamps, Sampled, Source, Traced};
use super::tile::ReceiverTile;
use crate::accel::{Accelerator, PACKET, Shadows};
use crate::anchor::{Anchor, Anchors};
use crate::luminance;
use crate::surface::Surfaces;
use glam::{Vec3, Vec3A};
use std::f32::consts::PI;

/// Fraction of a receiver's other direct light below which dynamic anchors, in sum, need no shadow rays.
const UNSHADOWED_SHARE: f32 = 1e-3;

/// Lights of a frame that are sampled with shadow rays at every pixel.
#[derive(Debug)]
pub struct DirectLights {
    lights: Vec<Box<dyn Sampled>>,
    dynamic: Vec<(Anchor, Vec3)>,
    dynamic_geometry_term_bound: f32,
    dynamic_apart: bool,
}

/// Dynamic anchors of a frame as lights.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct DynamicLights<'a> {
    /// Anchors, each with its intensity along the normal \[W·sr⁻¹\].
    pub anchors: &'a [(Anchor, Vec3)],
    /// Bound of the geometry terms, [`Anchors::dynamic_geometry_term_bound`] \[m²\].
    pub geometry_term_bound: f32,
}

impl DirectLights {
    /// Prepares the lights of a frame. `areas` are the indices in [`Emitters::areas`] of the emissive surfaces to
    /// sample. `dynamic_flux` is the flux of [`Anchors::dynamic`] \[W\].
    #[must_use]
    pub fn new(
        emitters: &Emitters,
        surfaces: &Surfaces,
        anchors: &Anchors,
        dynamic_flux: &[Vec3],
        areas: &[usize],
    ) -> Self {
        // A Lambertian emitter of flux Φ has intensity Φ / π along its normal.
        let mut dynamic = Vec::new();
        for (anchor, &flux) in anchors.dynamic_in_world(surfaces).into_iter().zip(dynamic_flux) {
            if flux.max_element() > 0.0 {
                dynamic.push((anchor, flux / PI));
            }
        }
        Self {
            lights: emitters.sampled(surfaces, areas),
            dynamic,
            dynamic_geometry_term_bound: anchors.dynamic_geometry_term_bound(),
            dynamic_apart: false,
        }
    }

    /// Excludes the dynamic anchors: callers must add their light, [`DirectLights::dynamic`].
    #[must_use]
    pub fn with_dynamic_apart(self) -> Self {
        Self { dynamic_apart: true, ..self }
    }

    /// Returns the emitting dynamic anchors if excluded by [`DirectLights::with_dynamic_apart`], otherwise an empty
    /// list.
    #[must_use]
    pub fn dynamic(&self) -> DynamicLights<'_> {
        DynamicLights {
            anchors: if self.dynamic_apart { &self.dynamic } else { &[] },
            geometry_term_bound: self.dynamic_geometry_term_bound,
        }
    }

    /// Returns the irradiance at `receiver` \[W·m⁻²\], linear RGB.
    pub fn irradiance(&self, accelerator: &Accelerator, receiver: &ShadingPoint) -> Traced<Vec3> {
        let Traced { value, shadow_rays } = self.irradiance_tile(accelerator, std::slice::from_ref(receiver));
        Traced { value: value[0], shadow_rays }
    }

    /// Returns the irradiance at each of the `receivers` \[W·m⁻²\], bit-identical to [`DirectLights::irradiance`].
    /// Processing is faster if the receivers are close together.
    pub fn irradiance_tile(&self, accelerator: &Accelerator, receivers: &[ShadingPoint]) -> Traced<Vec<Vec3>> {
        self.irradiance_by(LightPoints::All, accelerator, receivers)
    }

    /// Returns the irradiance at each of the `receivers` \[W·m⁻²\], by the given sample `points` of each light.
    pub fn irradiance_by(
        &self,
        points: LightPoints,
        accelerator: &Accelerator,
        receivers: &[ShadingPoint],
    ) -> Traced<Vec<Vec3>> {
        // Process receivers in packets: the shadow rays to a packet are traced together.
        let mut sums = vec![Vec3::ZERO; receivers.len()];
        let mut shadow_rays = 0;
        let shadows = Shadows::new(accelerator);
        for (receivers, sums) in receivers.chunks(PACKET).zip(sums.chunks_mut(PACKET)) {
            // Process dynamic anchors last: anchors that are faint compared with the other lights need no shadow rays.
            let tile = ReceiverTile::new(&shadows, receivers, points);
            for light in &self.lights {
                light.add_to(&tile, sums);
            }
            if !self.dynamic_apart {
                self.add_dynamic(&tile, sums);
            }
            shadow_rays += tile.shadow_rays();
        }
        Traced { value: sums, shadow_rays }
    }

    /// Returns one point of each sampled light, or the direction towards a distant light.
    #[must_use]
    pub fn lamps(&self) -> Lamps {
        Lamps(self.lights.iter().map(|light| light.lamp()).collect())
    }

    /// Returns whether both have the same lights in the same positions. Anchors are ignored.
    #[must_use]
    pub fn has_lamps_of(&self, other: &Self) -> bool {
        let pairs = || self.lights.iter().zip(&other.lights);
        self.lights.len() == other.lights.len() && pairs().all(|(light, other)| light.is_same(&**other))
    }

    /// Returns the regions around the lights, in which all shadow rays end.
    #[must_use]
    pub fn sources(&self) -> Vec<Source> {
        self.lights.iter().map(|light| light.source()).collect()
    }

    /// Returns whether this sampler samples `instance` as an emissive surface.
    #[must_use]
    pub fn samples_instance(&self, instance: u32) -> bool {
        self.lights.iter().any(|light| light.instance() == Some(instance))
    }

    /// Returns the radiance \[W·m⁻²·sr⁻¹\] that a surface with its own BRDF reflects of lights that rays cannot hit.
    /// With an `area_brdf`, the radiance includes light from emissive surfaces.
    ///
    /// `brdf(direction, half_angle)` is the BRDF \[sr⁻¹\] for light from a disc of `half_angle` radians around a
    /// direction. A distant light is one disc; its first points determine its visible fraction. An area light is one
    /// disc per point.
    pub fn reflected(
        &self,
        accelerator: &Accelerator,
        receiver: &ShadingPoint,
        brdf: impl Fn(Vec3A, f32) -> Vec3,
        area_brdf: Option<impl Fn(Vec3A, f32) -> Vec3>,
    ) -> Traced<Vec3> {
        // An emissive surface needs a shadow ray per sample that contributes; other lights need one or two each.
        let shadows = &Shadows::new(accelerator);
        let mut whole = Traced::default();
        for light in self.lights.iter().filter(|light| light.instance().is_none()) {
            whole.add(light.reflected(shadows, receiver, &brdf));
        }
        if let Some(brdf) = area_brdf {
            for light in self.lights.iter().filter(|light| light.instance().is_some()) {
                whole.add(light.reflected(shadows, receiver, &brdf));
            }
        }
        whole
    }

    /// Adds the light of the dynamic anchors.
    fn add_dynamic(&self, tile: &ReceiverTile, sums: &mut [Vec3]) {
        // Compute the luminance that each receiver may still accept from anchors without shadow rays.
        let mut unshadowed = [0.0; PACKET];
        for (unshadowed, &sum) in unshadowed.iter_mut().zip(&*sums) {
            *unshadowed = luminance(sum) * UNSHADOWED_SHARE;
        }
        for (anchor, intensity) in &self.dynamic {
            // Trace shadow rays only to receivers at which the anchor exceeds that luminance.
            let terms = tile.terms(&disc_of(anchor, self.dynamic_geometry_term_bound));
            let mut active = 0;
            for i in 0..sums.len() {
                let y = luminance(*intensity * terms[i]);
                if y > unshadowed[i] {
                    active |= 1 << i;
                } else {
                    unshadowed[i] -= y;
                }
            }

            // Receivers without a shadow ray count as unoccluded.
            let hidden = tile.hidden_from(anchor.position, active, None);
            for (i, sum) in sums.iter_mut().enumerate() {
                if hidden >> i & 1 == 0 {
                    let passed = if active >> i & 1 == 1 { tile.passed(anchor.position, i) } else { Vec3::ONE };
                    *sum += *intensity * terms[i] * passed;
                }
            }
        }
    }
}

fn disc_of(anchor: &Anchor, bound: f32) -> Disc {
    Disc { position: anchor.position.to_array(), normal: anchor.normal.to_array(), bound }
}
