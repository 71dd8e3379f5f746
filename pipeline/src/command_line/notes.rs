//! Notes on a scene and its film: what users may not expect, and nothing refuses.

use crate::settings::Settings;
use render_core::scene::Scene;

/// Luma of a picture that counts as black, at most: eight codes above the black of video, which hardly any display shows.
const BLACK: u8 = 24;

/// Notes before work begins: warnings of the scene, and frames beyond its end.
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

/// The code that one pixel in a hundred exceeds at most: a lamp alone makes no picture bright.
pub(super) fn bright_code(codes: impl Iterator<Item = u8>) -> u8 {
    let (mut counts, mut all) = ([0usize; 256], 0);
    for code in codes {
        counts[usize::from(code)] += 1;
        all += 1;
    }
    let mut above = 0;
    for code in (1..=255).rev() {
        above += counts[code];
        if above > all / 100 {
            return code as u8;
        }
    }
    0
}

/// Says that all pictures are black, if the largest [`bright_code`] of their luma is.
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
        "99 of 100 pixels are black, or nearly: {exposure}render2mpeg plan {scene} lists lamps and sky; the camera may look elsewhere"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lamp_alone_makes_no_picture_bright() {
        let picture = |lamp: usize| (0..1000).map(move |pixel| if pixel < lamp { 200 } else { 17 });
        assert_eq!([0, 10, 11, 1000].map(|lamp| bright_code(picture(lamp))), [17, 17, 200, 200]);
        assert_eq!(bright_code(std::iter::empty()), 0);
    }
}
