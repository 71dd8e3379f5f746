//! Cost estimates of the stages before the first frame: amount of work times unit price.
//!
//! Prices are means over the shipped scenes. They come from reports of runs with every stage: seconds per unit of work, in
//! frames after the first. `docs/guide.md#plan` lists the commands and compares estimates with measurements.
//!
//! Only ratios of prices matter, and they differ little between processors. They differ more between scenes: the cost of
//! lightcuts depends on a scene's detail, of which the number of triangles is a poor measure.

use super::stage::Stage;
use crate::settings::{Lighting, RenderSettings, Size};
use render_core::scene::Scene;

/// Price of placing all objects \[CPU s per frame\].
const PLACING: f64 = 2.5e-5;
/// Price of tracing a photon \[CPU s\].
const PHOTON: f64 = 1.3e-6;
/// Price of updating a light in the light tree \[CPU s\].
const LIGHT: f64 = 1.1e-7;
/// Price of a primary ray, with its motion from the previous frame \[CPU s\].
const PRIMARY_RAY: f64 = 3.3e-7;
/// Price of an area light at a pixel \[CPU s\].
const AREA_LIGHT: f64 = 4.7e-7;
/// Price of a point, spot or sun at a pixel \[CPU s\].
const POINT_LIGHT: f64 = 8.8e-7;
/// Price of a dynamic anchor light at a pixel or cache record \[CPU s\]. A record serves several pixels.
const MOVING_ANCHOR: f64 = 1.8e-8;
const PIXELS_OF_A_RECORD: f64 = 10.0;
/// Price of cached indirect light at a pixel, for a scene of one triangle \[CPU s\]. It grows with a power of the number of
/// triangles.
const CACHED_PIXEL: f64 = 1.1e-7;
const CACHED_DETAIL: f64 = 0.5;
/// Larger frames have more pixels per record: above this number of pixels, the price falls with a power of the number. `nave`
/// takes 2.0 CPU s per frame at 256², 5.6 at 512², and 23 at 1024² with four samples, which share records.
const SMALL_PICTURE: f64 = 65_536.0;
const LARGER_PICTURE: f64 = -0.24;
/// Price of a lightcut per pixel, for a scene of one triangle \[CPU s\]. It grows with a power of the number of triangles.
const CUT_PIXEL: f64 = 7.8e-7;
const CUT_DETAIL: f64 = 0.4;
/// Price of a virtual light at a pixel if all lights are evaluated \[CPU s\].
const LIGHT_AT_PIXEL: f64 = 1.0e-7;
/// Cost of bias compensation as a fraction of cached indirect light.
const COMPENSATION: f64 = 0.03;
/// Prices of the tone curve, coding and masking at a pixel \[CPU s\].
const TONE_MAPPED_PIXEL: f64 = 1.3e-8;
const CODED_PIXEL: f64 = 2.2e-8;
const MASKED_PIXEL: f64 = 1.6e-8;

/// Amounts of work in a scene with its settings.
pub(super) struct Costs {
    /// Number of samples in a frame.
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
            pixels: (width * height) as f64 * f64::from(settings.samples),
            samples: f64::from(settings.samples),
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

    /// Returns the CPU time of `stage` in a frame in which it runs \[s\]. `None` if the scene lacks the feature, and for stages
    /// that only save time.
    pub(super) fn of_stage(&self, stage: Stage) -> Option<f64> {
        let Self { pixels, .. } = *self;
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

    /// Returns the CPU time of direct light from emissive surfaces in a frame \[s\]; `None` without these surfaces.
    pub(super) fn of_area_lights(&self) -> Option<f64> {
        (self.area_lights > 0.0).then_some(AREA_LIGHT * self.area_lights * self.pixels)
    }

    /// Returns the CPU time of direct light from points, spots and suns in a frame \[s\]; `None` without these lights.
    pub(super) fn of_punctual_lights(&self) -> Option<f64> {
        (self.points > 0.0).then_some(POINT_LIGHT * self.points * self.pixels)
    }

    fn indirect(&self) -> f64 {
        // Cache records serve all samples of a pixel.
        let (cached, pixels) = (self.cache && self.lighting == Lighting::Lightcuts, self.pixels / self.samples);
        if cached {
            let sparse = (pixels / SMALL_PICTURE).max(1.0).powf(LARGER_PICTURE);
            return CACHED_PIXEL * self.triangles.powf(CACHED_DETAIL) * sparse * pixels;
        }
        let by_pixel = match self.lighting {
            Lighting::AllLights => LIGHT_AT_PIXEL * self.lights,
            _ if self.lighting.is_baked() => CACHED_PIXEL,
            _ => CUT_PIXEL * self.triangles.powf(CUT_DETAIL),
        };
        by_pixel * self.pixels
    }

    /// Returns the CPU time of the remaining work in a frame \[s\]: direct light, tone curve and encoder.
    pub(super) fn of_the_rest(&self) -> f64 {
        let direct = self.of_area_lights().unwrap_or(0.0) + self.of_punctual_lights().unwrap_or(0.0);
        direct + (TONE_MAPPED_PIXEL + CODED_PIXEL) * self.pixels
    }
}
