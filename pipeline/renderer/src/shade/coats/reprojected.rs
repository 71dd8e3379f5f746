//! Reprojection of the light that rough coats reflect.
//!
//! The stored light of a coat is divided by the coat's albedo C(θ_o), so textures stay sharp. A pixel reuses it if the
//! surface, the lamps and the reflected surfaces are unchanged. Smooth coats are traced in every frame.
//!
//! A mover changes the light of a coat by about the fraction of the lobe that it covers. With α as the half-width of
//! the GGX distribution, and θ as the angle between mirror direction and mover:
//!
//! ```text
//! f ≈ Ω / (4π α²) / (1 + (θ / 2α)²)²          Ω  solid angle of the mover's bounding sphere
//! ```
//!
//! Pixels that trace rays share the light of reprojected neighbors, as if the neighbors had traced their own rays.

use super::{Coated, Lobe, Reflected, counted, reflected, with_sparks};
use crate::frame::Frame;
use crate::shade::audits::{Audits, reuse_in_turns};
use crate::shade::direct::{margin, shades};
use crate::shade::layer::{Layer, Lit, Visible};
use crate::shade::movement::{MovingBox, Sphere, change_of_light, intensities};
use crate::shade::reprojected::{allowed_error, most_lit};
use crate::shade::tolerance::Tolerance;
use glam::Vec3;
use pipeline::error::Result;
use pipeline::state::{decode, encode};
use plane::Plane;
use rayon::prelude::*;
use render_core::{
    Busy, CoatView, CoatsInView, DirectLights, LobeLight, MACROBLOCK, ReflectedLight, Reuse, luminance, spread,
};
use std::f32::consts::PI;
use std::sync::Arc;
use std::sync::atomic::AtomicU64;

/// Maximum fraction of a lobe that a mover covers, and maximum fraction within [`AROUND`] of the mover.
const COVERED: [f32; 2] = [0.005, 0.05];
/// Radius around movers in which the light of surfaces changes, in radii of the mover.
const AROUND: f32 = 3.0;
/// Maximum relative change of the sum of virtual lights between frames with reprojected light.
const CHANGED: f32 = 0.01;
/// Minimum albedo of a coat with reprojected light.
const LEAST_ALBEDO: f32 = 1e-4;

/// Layer of [`Coats`](super::Coats) with reprojection of unchanged light.
#[derive(Clone)]
pub(in crate::shade) struct ReprojectedCoats {
    light: ReflectedLight,
    /// Permitted mean square error of reprojection, in squares of the tolerance.
    allowed: f32,
    /// Maximum fraction of the pixels for which light is computed; `None` without a limit.
    budget: Option<f32>,
    /// Lamps of the previous frame; `None` before the first frame.
    lamps: Option<Arc<DirectLights>>,
    /// Intensities of the virtual lights in the previous frame.
    intensities: Vec<Vec3>,
}

impl ReprojectedCoats {
    /// Creates the layer for a film coded with `quantiser_scale`, 1…112.
    pub fn new(quantiser_scale: u32) -> Self {
        let allowed = allowed_error(quantiser_scale);
        Self { light: ReflectedLight::default(), allowed, budget: None, lamps: None, intensities: Vec::new() }
    }

    /// Returns whether lamps and virtual lights are nearly unchanged, and stores the lights of `frame`.
    fn holds(&mut self, frame: &Frame) -> bool {
        let lamps = self.lamps.replace(frame.direct.clone());
        let before = std::mem::replace(&mut self.intensities, intensities(frame));
        let has_same_lights = change_of_light(&before, &self.intensities) <= CHANGED;
        has_same_lights && lamps.is_some_and(|lamps| lamps.has_lamps_of(&frame.direct))
    }
}

/// Coat of a pixel with its albedo.
#[derive(Clone, Copy)]
struct PixelCoat {
    view: CoatView,
    albedo: Vec3,
    is_rough: bool,
}

/// Returns the coat of each pixel, in raster order.
fn coats_of(visible: &Visible, busy: &Busy) -> Vec<Option<PixelCoat>> {
    let seen = visible.surfaces;
    let width = seen.pixels.width();
    let mut coats = vec![None; seen.pixels.samples().len()];
    coats.par_chunks_mut((MACROBLOCK * width).max(1)).enumerate().for_each(|(strip, coats)| {
        busy.measure(|| {
            for (k, coat) in coats.iter_mut().enumerate() {
                let pixel = seen.pixels.samples()[strip * MACROBLOCK * width + k];
                let Frame { surfaces, epsilon, .. } = visible.frame;
                *coat = Coated::of_pixel(&pixel, seen, surfaces, *epsilon).map(|coated| {
                    let view = CoatView {
                        position: pixel.position.into(),
                        normal: pixel.geometric_normal.into(),
                        mirrored: coated.middle(),
                        alpha: coated.alpha(),
                        depth: pixel.depth,
                        pixel_width: seen.view.pixel_width(pixel.depth),
                    };
                    // Further lobes have other widths.
                    let is_rough = coated.is_rough() && !coated.has_lobes();
                    PixelCoat { view, albedo: coated.albedo(), is_rough }
                });
            }
        });
    });
    coats
}

/// Objects that moved since the previous frame.
struct Movers<'a> {
    visible: &'a Visible<'a>,
    /// Whether each instance moved.
    moves: Vec<bool>,
    spheres: Vec<Sphere>,
}

impl<'a> Movers<'a> {
    fn new(visible: &'a Visible<'a>) -> Self {
        let swept = &visible.movement.swept;
        let mut moves = vec![false; visible.surfaces.world.len()];
        for thing in swept {
            moves[thing.instance as usize] = true;
        }
        Self { visible, moves, spheres: swept.iter().map(MovingBox::sphere).collect() }
    }

    /// Returns whether no mover changes the light of `coat`, which pixel (x, y) shows.
    fn spare(&self, coat: &CoatView, x: usize, y: usize) -> bool {
        let Visible { surfaces, frame, movement, .. } = *self.visible;
        let pixel = surfaces.pixels.get(x, y);
        let is_shaded = |thing: &MovingBox| {
            let thing = thing.grown(margin(surfaces, &pixel));
            frame.direct.sources().iter().any(|source| shades(&thing, coat.position, source))
        };
        let is_reflected = |sphere: &Sphere| {
            covered_share(coat, sphere, 1.0) > COVERED[0] || covered_share(coat, sphere, AROUND) > COVERED[1]
        };
        !self.moves[pixel.instance as usize]
            && !self.spheres.iter().any(is_reflected)
            && !movement.swept.iter().any(is_shaded)
    }
}

/// Returns the fraction of the lobe of `coat` that a sphere covers, with `scale` times its radius.
fn covered_share(coat: &CoatView, sphere: &Sphere, scale: f32) -> f32 {
    let (way, radius) = (sphere.center - coat.position, sphere.radius * scale);
    let distance = way.length();
    if distance <= radius {
        return 1.0;
    }
    let sine = radius / distance;
    // A sphere below the surface is not reflected.
    if way.dot(coat.normal) < -radius {
        return 0.0;
    }
    let angle = (way.dot(coat.mirrored) / distance).clamp(-1.0, 1.0).acos() - sine.asin();
    let half_width = 2.0 * coat.alpha;
    let density = (1.0 + (angle.max(0.0) / half_width).powi(2)).powi(-2) / (PI * half_width * half_width);
    PI * sine * sine * density
}

impl Layer for ReprojectedCoats {
    /// Lights all pixels in the first sample, including unwanted ones: the next frame may reproject any of them.
    fn light(&mut self, visible: &Visible<'_>, wanted: Option<&Plane<bool>>, tolerance: &Tolerance<'_>) -> Lit {
        // Reproject only the first sample.
        if visible.sample > 0 {
            return super::Coats.light(visible, wanted, tolerance);
        }
        let Visible { frame, surfaces: seen, radiance, .. } = *visible;
        let (width, height) = (seen.pixels.width(), seen.pixels.height());
        let (busy, shadow_rays) = (Busy::default(), AtomicU64::new(0));

        // Reproject light to the coats of this frame.
        let coats = Plane::from_vec(width, height, coats_of(visible, &busy));
        let holds = self.holds(frame) && !visible.known.is_some_and(|known| known.changes());
        let known = visible.motion.filter(|_| holds);
        let movers = Movers::new(visible);
        let reuse = |x: usize, y: usize, _: f32| match coats.get(x, y) {
            Some(coat) if coat.is_rough && movers.spare(&coat.view, x, y) => reuse_in_turns(x, y, frame.index),
            _ => Reuse::Forbidden,
        };
        let albedo_of = |x, y| coats.get(x, y).map_or(0.0, |coat| luminance(coat.albedo)).max(LEAST_ALBEDO);
        let of_lobe = |x: usize, y: usize, light: f32| {
            let albedo = albedo_of(x, y);
            tolerance.of_coat(x, y, luminance(radiance.get(x, y)), albedo * light) / albedo
        };
        let views = coats.map(|coat| coat.map(|coat| coat.view));
        let most = most_lit(self.budget.filter(|_| holds), seen);
        let to = CoatsInView { coats: &views, known, allowed: self.allowed, most };
        let reprojected = busy.take(self.light.carry(to, reuse, of_lobe));

        // Trace the remaining pixels, which share the light of reprojected neighbors.
        let missing = reprojected.missing.clone();
        let lobe_of = |x: usize, y: usize| {
            let coat = coats.get(x, y).filter(|_| !missing.get(x, y))?;
            let light = reprojected.light.get(x, y)?;
            Some(Lobe::reprojected(&coat.view, coat.albedo, &light))
        };
        let (lobes, mut reflected) = reflected(
            visible,
            |x, y| if missing.get(x, y) { None } else { lobe_of(x, y).or(Some(Lobe::default())) },
            &shadow_rays,
            &busy,
        );

        // Store the new light divided by the albedo, and complete the picture with the reprojected light.
        let lit = Plane::from_fn(width, height, |x, y| {
            let lobe = lobes.get(x, y);
            let coat = coats.get(x, y).filter(|coat| coat.is_rough && missing.get(x, y) && lobe.has_rays())?;
            let Reflected { light, spark, noise, nearness } = reflected.get(x, y);
            let per_albedo = |light: Vec3| (light / coat.albedo.max(Vec3::splat(LEAST_ALBEDO))).to_array();
            let traced = per_albedo(light - lobe.known);
            Some(LobeLight { whole: per_albedo(light), traced, excess: per_albedo(spark), noise, nearness })
        });
        for y in 0..height {
            for (x, pixel) in reflected.row_mut(y).iter_mut().enumerate() {
                if let (Some(coat), Some(light)) = (coats.get(x, y), reprojected.light.get(x, y)) {
                    let of = |light: [f32; 3]| coat.albedo * Vec3::from(light);
                    *pixel = Reflected { light: of(light.whole), spark: of(light.excess), ..Reflected::default() };
                }
            }
        }
        // Pixels without light have the light of coats around them.
        if !reprojected.bare.is_empty() {
            let albedo = |coat: PixelCoat| coat.albedo.max(Vec3::splat(LEAST_ALBEDO));
            let mut spread_light = Plane::from_fn(width, height, |x, y| {
                coats.get(x, y).map_or([0.0; 3], |coat| (reflected.get(x, y).light / albedo(coat)).to_array())
            });
            let has_light = |k: usize| coats.samples()[k].is_some();
            busy.take(spread(&mut spread_light, &reprojected.bare, seen, has_light));
            for &index in &reprojected.bare {
                let coat = coats.samples()[index as usize].expect("only coats are open");
                let light = coat.albedo * Vec3::from(spread_light.samples()[index as usize]);
                reflected.samples_mut()[index as usize] = Reflected { light, ..Reflected::default() };
            }
        }
        let open = reprojected.open as u64;
        let audits = reprojected.complete(&lit, &views, &mut self.light);
        Lit {
            radiance: Some(with_sparks(&reflected, seen, &busy)),
            computed: Some(missing),
            open,
            audits: Audits { reprojected: audits, ..Audits::default() },
            ..counted(shadow_rays, &busy)
        }
    }

    fn forget(&mut self) {
        (self.light, self.lamps, self.intensities) = Default::default();
    }

    fn set_quantiser_scale(&mut self, quantiser_scale: u32) {
        self.allowed = allowed_error(quantiser_scale);
    }

    fn copy(&self) -> Option<Box<dyn Layer>> {
        Some(Box::new(self.clone()))
    }

    fn set_budget(&mut self, share: Option<f32>) {
        self.budget = share;
    }

    fn state(&self) -> Vec<u8> {
        encode(&self.light)
    }

    fn restore(&mut self, state: &[u8], last: &Frame<'_>) -> Result<()> {
        self.light = decode(state)?;
        (self.lamps, self.intensities) = (Some(last.direct.clone()), intensities(last));
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{Vec2, Vec3A};
    use render_core::Bsdf;
    use render_core::sampling::owen_sobol_point;

    /// Compares the estimate of a mover's share of a lobe with the fraction of sampled directions that hit its sphere.
    #[test]
    fn movers_cover_the_share_of_a_lobe_that_samples_hit() {
        let outgoing = Vec3::new(0.5, 0.0, 0.75f32.sqrt());
        let mirrored = Vec3A::new(-outgoing.x, 0.0, outgoing.z);
        for roughness in [0.3f32, 0.6] {
            let alpha = roughness * roughness;
            let bsdf = Bsdf::new(Vec3::ZERO, Vec3::ONE, roughness);
            let (position, normal) = (Vec3A::ZERO, Vec3A::Z);
            let coat = CoatView { position, normal, mirrored, alpha, depth: 1.0, pixel_width: 0.01 };
            for turned in [0.0f32, 0.2, 0.5] {
                // Turn the direction to the sphere out of the plane of incidence.
                let towards = Vec3A::new(mirrored.x, turned, mirrored.z).normalize();
                let sphere = Sphere { center: 3.0 * towards, radius: 0.3 };
                let is_hit = |point: Vec2| {
                    bsdf.sample_coat(outgoing, point).is_some_and(|way| {
                        let along = Vec3A::from(way).dot(sphere.center);
                        along > 0.0 && sphere.center.length_squared() - along * along < sphere.radius * sphere.radius
                    })
                };
                let count = 4096;
                let hits = (0..count).filter(|&i| is_hit(owen_sobol_point(i, 1))).count() as f32 / count as f32;
                let share = covered_share(&coat, &sphere, 1.0);
                assert!(share > 0.4 * hits, "roughness {roughness}, {turned}: {share} instead of {hits}");
                assert!(share < 4.0 * hits + 0.01, "roughness {roughness}, {turned}: {share} instead of {hits}");
            }
        }
    }
}
