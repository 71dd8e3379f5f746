//! Estimated costs of the stages, before the first frame: amount of work times unit price.
//!
//! Prices are means over the shipped scenes. They are measured in runs with every stage, per unit of work, in frames
//! after the first. `docs/guide.md#plan` lists the commands and compares estimates with measurements.
//!
//! Only ratios of prices affect the plan, and they differ little between processors. They differ more between scenes:
//! the cost of lightcuts depends on a scene's detail, which the number of triangles measures poorly.

use super::stage::Stage;
use crate::settings::{Lighting, RenderSettings, Size};
use render_core::scene::Scene;

/// Price of placing all objects \[CPU s per frame\].
const PLACING: f64 = 2.5e-5;
/// Price of tracing a photon \[CPU s\].
const PHOTON: f64 = 1.3e-6;
/// Price of updating a light in the light tree \[CPU s\].
const LIGHT: f64 = 1.1e-7;
/// Price of a primary ray, including its motion from the previous frame \[CPU s\].
const PRIMARY_RAY: f64 = 3.3e-7;
/// Price of an area light at a pixel \[CPU s\].
const AREA_LIGHT: f64 = 4.7e-7;
/// Price of a point light, spotlight or sun at a pixel \[CPU s\].
const POINT_LIGHT: f64 = 8.8e-7;
/// Price of a dynamic anchor light at a pixel or cache record \[CPU s\].
const MOVING_ANCHOR: f64 = 1.8e-8;
/// Mean number of pixels that a cache record serves.
const PIXELS_OF_A_RECORD: f64 = 10.0;
/// Price of cached indirect light at a pixel, for a scene of one triangle \[CPU s\].
const CACHED_PIXEL: f64 = 1.1e-7;
/// Exponent of the number of triangles in the price of cached indirect light.
const CACHED_DETAIL: f64 = 0.5;
/// Number of pixels above which the price of cached indirect light falls, because more pixels share a record. `nave`
/// takes 2.0 CPU s per frame at 256², 5.6 at 512², and 23 at 1024² with four samples, which share records.
const SMALL_PICTURE: f64 = 65_536.0;
/// Exponent of the number of pixels, relative to [`SMALL_PICTURE`], in the price of cached indirect light.
const LARGER_PICTURE: f64 = -0.24;
/// Price of a lightcut per pixel, for a scene of one triangle \[CPU s\].
const CUT_PIXEL: f64 = 7.8e-7;
/// Exponent of the number of triangles in the price of a lightcut.
const CUT_DETAIL: f64 = 0.4;
/// Price of a virtual light at a pixel if all lights are evaluated \[CPU s\].
const LIGHT_AT_PIXEL: f64 = 1.0e-7;
/// Cost of bias compensation as a fraction of cached indirect light.
const COMPENSATION: f64 = 0.03;
/// Price of the tone curve at a pixel \[CPU s\].
const TONE_MAPPED_PIXEL: f64 = 1.3e-8;
/// Price of coding a pixel \[CPU s\].
const CODED_PIXEL: f64 = 2.2e-8;
/// Price of masking a pixel \[CPU s\].
const MASKED_PIXEL: f64 = 1.6e-8;

/// Amounts of work in a frame of a scene.
pub(super) struct Costs {
    /// Number of pixel samples in a frame.
    pixels: f64,
    samples: f64,
    photons: f64,
    lights: f64,
    triangles: f64,
    area_lights: f64,
    points: f64,
    moving_anchors: f64,
    lighting: Lighting,
    cache: bool,
}

impl Costs {
    pub(super) fn of(scene: &Scene, settings: &RenderSettings, area_lights: usize) -> Self {
        let Size { width, height } = settings.size;
        Self {
            pixels: (width * height) as f64 * f64::from(settings.samples.most()),
            samples: f64::from(settings.samples.most()),
            photons: settings.photons as f64,
            lights: settings.vpls as f64,
            triangles: scene.triangle_count() as f64,
            area_lights: area_lights as f64,
            points: scene.punctual_lights.len() as f64,
            moving_anchors: settings.moving_vpls as f64,
            lighting: settings.lighting,
            cache: settings.cache,
        }
    }

    /// Returns the CPU time of `stage` in a frame in which it runs \[s\]. Returns `None` if the scene lacks the
    /// feature, and for stages that only save time.
    pub(super) fn of_stage(&self, stage: Stage) -> Option<f64> {
        let Self { pixels, .. } = *self;
        // Evaluate dynamic anchors at records with a cache, and at pixels without one.
        let places = if self.cache { pixels / PIXELS_OF_A_RECORD } else { pixels };
        Some(match stage {
            Stage::ObjectPlacing => PLACING,
            Stage::Photons => PHOTON * self.photons,
            Stage::TreeUpdate => LIGHT * self.lights,
            Stage::DynamicAnchors => MOVING_ANCHOR * self.moving_anchors * places,
            Stage::PrimaryRays => PRIMARY_RAY * pixels,
            Stage::Indirect => self.indirect(),
            Stage::Compensation if self.cache => COMPENSATION * self.indirect(),
            Stage::Masking => MASKED_PIXEL * pixels,
            _ => return None,
        })
    }

    /// Returns the CPU time of direct light from emissive surfaces in a frame \[s\]; `None` without emissive surfaces.
    pub(super) fn of_area_lights(&self) -> Option<f64> {
        (self.area_lights > 0.0).then_some(AREA_LIGHT * self.area_lights * self.pixels)
    }

    /// Returns the CPU time of direct light from point lights, spotlights and suns in a frame \[s\]; `None` without
    /// such lights.
    pub(super) fn of_punctual_lights(&self) -> Option<f64> {
        (self.points > 0.0).then_some(POINT_LIGHT * self.points * self.pixels)
    }

    fn indirect(&self) -> f64 {
        // Count each pixel once with a cache: records serve all samples of a pixel.
        let (cached, pixels) = (self.cache && self.lighting == Lighting::Lightcuts, self.pixels / self.samples);
        if cached {
            let sparse = (pixels / SMALL_PICTURE).max(1.0).powf(LARGER_PICTURE);
            return CACHED_PIXEL * self.triangles.powf(CACHED_DETAIL) * sparse * pixels;
        }
        // Without a cache, every sample has its own indirect light.
        let by_pixel = match self.lighting {
            Lighting::AllLights => LIGHT_AT_PIXEL * self.lights,
            _ if self.lighting.is_baked() => CACHED_PIXEL,
            _ => CUT_PIXEL * self.triangles.powf(CUT_DETAIL),
        };
        by_pixel * self.pixels
    }

    /// Returns the CPU time of direct light, tone curve and encoder in a frame \[s\], which run in all scenes.
    pub(super) fn of_the_rest(&self) -> f64 {
        let direct = self.of_area_lights().unwrap_or(0.0) + self.of_punctual_lights().unwrap_or(0.0);
        direct + (TONE_MAPPED_PIXEL + CODED_PIXEL) * self.pixels
    }
}
