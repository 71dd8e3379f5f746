//! Notes on a scene and its film: what users may not expect, and nothing refuses.

use crate::settings::Settings;
use render_core::scene::Scene;

/// Largest luma of a picture that counts as black: eight codes above the black of video, which hardly any display shows.
const BLACK: u8 = 24;

/// What is worth knowing before work begins.
pub(super) fn before(scene: &Scene, settings: &Settings) -> Vec<String> {
    let mut notes = scene.warnings.clone();
    notes.extend(beyond_the_end(scene, settings));
    notes
}

/// Says that frames are beyond the end of what moves, if any are.
fn beyond_the_end(scene: &Scene, settings: &Settings) -> Option<String> {
    let (renderer, duration) = (settings.renderer(), f64::from(scene.duration()));
    let last = settings.frame_range().end.checked_sub(1)?;
    let late = f64::from(renderer.time(last)) - duration;
    if duration == 0.0 || late * settings.fps <= 1.0 {
        return None;
    }
    let end = (duration * settings.fps).round();
    Some(format!("the animation ends after {duration:.2} s, before frame {end}: later frames stand still"))
}

/// Says that all pictures are black, if the `brightest` luma of them is.
pub(super) fn on_darkness(brightest: Option<u8>, settings: &Settings) -> Option<String> {
    if brightest? > BLACK {
        return None;
    }
    let exposure = match settings.auto_exposure {
        true => String::new(),
        false => format!("the exposure is {}, --set exposure=… changes it; ", settings.tone_map.exposure),
    };
    let scene = settings.scene.display();
    Some(format!(
        "every pixel is black, or nearly: {exposure}render2mpeg plan {scene} lists lamps and sky; the camera may look elsewhere"
    ))
}
