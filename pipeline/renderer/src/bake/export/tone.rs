//! Tone curve of the exported image, equal to the film's.

use crate::settings::{Lighting, RenderSettings, Size};
use crate::texels::BakedTexels;
use crate::{Plan, Preparation, Shading, exposure_of_first_frame};
use glam::Vec3;
use perceptual::ToneMap;
use pipeline::error::Result;
use render_core::scene::Scene;
use std::sync::Arc;

/// Side of the frame that determines the exposure \[pixels\].
const SIDE: usize = 128;

/// Returns the tone curve of a film with `settings`. Without a given exposure, the film's first frame determines it,
/// rendered with baked light at 128×128 pixels.
pub(in crate::bake) fn tone_map(scene: &Scene, settings: &RenderSettings, baked: &Arc<BakedTexels>) -> Result<ToneMap> {
    if !settings.auto_exposure {
        return Ok(settings.tone_map);
    }
    let tone_map = settings.tone_map;
    let size = Size { width: SIDE, height: SIDE };
    let renderer = RenderSettings { lighting: Lighting::Baked, size, ..settings.clone() };
    let plan = Plan::new(scene, &renderer);
    let mut preparation = Preparation::new(scene, &renderer, &plan);
    let exposure = exposure_of_first_frame(&mut preparation, |settings, plan| {
        Shading::new(settings, plan).with_baked(baked.clone())
    });
    Ok(tone_map.with_exposure(exposure))
}

/// Returns the radiance that a plain sRGB display shows as `tone_map` shows `radiance`.
pub(super) fn shown(tone_map: &ToneMap, radiance: Vec3) -> Vec3 {
    let display = ToneMap::srgb();
    Vec3::from(radiance.to_array().map(|light| display.decode(tone_map.encode(light))))
}
