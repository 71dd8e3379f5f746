//! Shading of a film before its frames: baked light, and the exposure of films in chunks.

#[cfg(feature = "bake")]
use crate::error::Result;
use crate::settings::Settings;
use render_core::scene::Scene;
#[cfg(feature = "bake")]
use renderer::baked_light::BakedLight;
use renderer::plan::Plan;
use renderer::settings::RenderSettings;
use renderer::{Preparation, Shading, exposure_of_first_frame, exposure_of_lit_frames};

/// Returns the exposure of a film in chunks: the exposure of the film's lit frames if the first frame is not
/// representative, otherwise the exposure of a small version of the first frame.
pub(crate) fn exposure_of_chunks(
    preparation: &mut Preparation,
    scene: &Scene,
    settings: &Settings,
    shading: impl for<'a> FnOnce(&RenderSettings, &'a Plan) -> Shading<'a>,
) -> f32 {
    exposure_of_lit_frames(scene, &settings.render).unwrap_or_else(|| exposure_of_first_frame(preparation, shading))
}

/// Reads the baked light of the film; `None` without baked light.
#[cfg(feature = "bake")]
pub(crate) fn read_baked(scene: &Scene, settings: &Settings) -> Result<Option<BakedLight>> {
    let baked = settings.files.baked.as_deref().map(|path| renderer::bake::read(scene, path));
    Ok(baked.transpose()?)
}

#[cfg(feature = "bake")]
pub(crate) fn with_baked<'a>(shading: Shading<'a>, baked: Option<&BakedLight>) -> Shading<'a> {
    match baked {
        Some(baked) => shading.with_baked(baked.clone()),
        None => shading,
    }
}
