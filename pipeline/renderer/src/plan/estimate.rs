//! Estimated cost of the stages of a frame, before the first frame: work by the price of its unit.
//!
//! Prices are means over the shipped scenes, from reports of runs in which everything ran: seconds of the stages, in frames
//! after the first, by the units below; `docs/plan.md` has the commands, and estimates beside what was measured. Only ratios
//! matter here, and these differ little between processors. They differ more between scenes: light that is found by cuts
//! costs what a scene's detail requires, of which the number of triangles is a poor measure.

use super::stage::Stage;
use crate::settings::{Lighting, RenderSettings, Size};
use render_core::scene::Scene;

/// Price of placing everything \[CPU s a frame\].
const PLACING: f64 = 2.5e-5;
/// Price of following a photon.
const PHOTON: f64 = 1.3e-6;
/// Price of a new energy in the light tree.
const LIGHT: f64 = 1.1e-7;
/// Price of the first hit of a pixel, and of its place in the frame before.
const PRIMARY_RAY: f64 = 3.3e-7;
/// Price of the light of a glowing surface at a pixel.
const AREA_LIGHT: f64 = 4.7e-7;
/// Price of the light of a point or a sun at a pixel.
const POINT_LIGHT: f64 = 8.8e-7;
/// Price of an anchor light on something that moves, at a pixel or at a record of the cache. A record serves some pixels.
const MOVING_ANCHOR: f64 = 1.8e-8;
const PIXELS_OF_A_RECORD: f64 = 10.0;
/// Price of a pixel's indirect light by the cache, in a scene of one triangle; it grows with a power of their number.
const CACHED_PIXEL: f64 = 1.1e-7;
const CACHED_DETAIL: f64 = 0.5;
/// Larger pictures have more pixels to a record: from this many pixels on, the price falls with a power of their number. `nave` takes
/// 2.0, 5.6 and 23 CPU s a frame at 256², 512² and, with four samples, which share records, 1024² pixels.
const SMALL_PICTURE: f64 = 65_536.0;
const LARGER_PICTURE: f64 = -0.24;
/// The same by a cut for every pixel.
const CUT_PIXEL: f64 = 7.8e-7;
const CUT_DETAIL: f64 = 0.4;
/// Price of a virtual light at a pixel, where every one is evaluated.
const LIGHT_AT_PIXEL: f64 = 1.0e-7;
/// Part of cached indirect light that compensation is.
const COMPENSATION: f64 = 0.03;
/// Prices of the tone curve, of coding, and of masking at a pixel.
const TONE_MAPPED_PIXEL: f64 = 1.3e-8;
const CODED_PIXEL: f64 = 2.2e-8;
const MASKED_PIXEL: f64 = 1.6e-8;

/// Work of a scene in its settings.
pub(super) struct Costs {
    /// Samples of all pixels.
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

    /// CPU seconds of `stage` for a frame that it runs for. None where that cannot be said: for what the scene does not
    /// have, and for stages that save time.
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

    /// CPU seconds that direct light of glowing surfaces takes in a frame; none without any.
    pub(super) fn of_area_lights(&self) -> Option<f64> {
        (self.area_lights > 0.0).then_some(AREA_LIGHT * self.area_lights * self.pixels)
    }

    /// CPU seconds that direct light of points, spots and suns takes in a frame; none without any.
    pub(super) fn of_punctual_lights(&self) -> Option<f64> {
        (self.points > 0.0).then_some(POINT_LIGHT * self.points * self.pixels)
    }

    fn indirect(&self) -> f64 {
        // Records of the cache serve all samples of a pixel.
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

    /// Cost of what every film needs: direct light, the tone curve and the encoder.
    pub(super) fn of_the_rest(&self) -> f64 {
        let direct = self.of_area_lights().unwrap_or(0.0) + self.of_punctual_lights().unwrap_or(0.0);
        direct + (TONE_MAPPED_PIXEL + CODED_PIXEL) * self.pixels
    }
}
