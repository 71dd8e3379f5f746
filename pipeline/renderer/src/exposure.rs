//! Exposure of a film, computed before rendering: from its first frame or from its lit frames.
//!
//! ```text
//! e = 0.18 / exp(mean ln Y)         e  exposure      Y  luminance of the first frame's lit pixels
//! ```
//!
//! The rule requires a first frame about as bright as the other frames. To test this, a few small frames are
//! path-traced. If lamps move or the first frame is black, the lit frames among them determine the exposure.

use super::{Preparation, Shading};
use crate::plan::{Plan, lamp_moves};
use crate::settings::{RenderSettings, SampleCount, Size};
use perceptual::luminance_plane;
use pipeline::exposure::{exposure_for, exposure_for_luminances};
use pipeline::stage::{LastThresholds, Shade};
use render_core::scene::Scene;
use render_core::{PathOptions, Still, path_traced};

/// Larger side of the frame that determines the exposure of a film in chunks \[pixels\].
const SIDE: usize = 128;
/// Larger side of a path-traced test frame \[pixels\]. With [`PATHS`] paths per pixel, the mean over the 1024 pixels of a
/// square first frame is within 5 %.
const SIDE_OF_A_LOOK: usize = 32;
/// Number of paths per pixel of a test frame.
const PATHS: u32 = 16;
/// Number of test frames if the first frame does not suffice and some test frames are lit.
const LOOKS: usize = 5;
/// Maximum number of test frames, if all of them are black.
const MOST_LOOKS: usize = 64;
/// Minimum mean luminance of a lit frame, as a fraction of the brightest frame's mean: six stops less.
const LIT: f32 = 1.0 / 64.0;
/// Maximum ratio between the exposures of the first frame and of the film at which the first frame determines the
/// exposure: two stops.
const NEAR: f32 = 4.0;

/// Returns the exposure of a film in chunks, equal for all chunks. It follows from a first frame with at most 128
/// pixels per side, by the rule for other films.
///
/// `preparation` prepares the film and has not prepared a frame yet; it keeps the light of the film for later frames.
/// `shading` creates the second half of the renderer.
pub fn exposure_of_first_frame(
    preparation: &mut Preparation,
    shading: impl for<'a> FnOnce(&RenderSettings, &'a Plan) -> Shading<'a>,
) -> f32 {
    // Take one sample per pixel, so that all regions of the frame have equal weight.
    let settings = RenderSettings {
        size: within(preparation.settings().size, SIDE),
        frames: 1,
        end: 1,
        chunk: None,
        samples: SampleCount::Each(1),
        importance: None,
        aov: Vec::new(),
        ..preparation.settings().clone()
    };
    let plan = Plan::new(preparation.scene(), &settings);
    let prepared = preparation.frame_0_of_size(settings.size);
    let radiance = shading(&settings, &plan).step(&prepared, LastThresholds::none()).radiance;
    exposure_for(&luminance_plane(&radiance))
}

/// Returns the exposure of a film with an unrepresentative first frame, and `None` for other films. The result depends
/// on the whole film, not on the rendered range.
pub fn exposure_of_lit_frames(scene: &Scene, settings: &RenderSettings) -> Option<f32> {
    // The first frame suffices for a static film.
    if settings.frames < 2 || !may_change(scene) {
        return None;
    }

    // Use only the first frame if it is lit and no lamp moves.
    let first = look(scene, settings, 0);
    let mut looks = vec![first];
    if looks[0].mean > 0.0 && !lamp_moves(scene) {
        return None;
    }

    // Test further frames, halving the gaps, until some are lit.
    for frame in spread(settings.frames).skip(1) {
        let is_lit = looks.iter().any(|look| look.mean > 0.0);
        if looks.len() >= if is_lit { LOOKS } else { MOST_LOOKS } {
            break;
        }
        looks.push(look(scene, settings, frame));
    }

    // Average only the pixels of lit frames.
    let brightest = looks.iter().fold(0.0, |most: f32, look| most.max(look.mean));
    let lit = looks.iter().filter(|look| look.mean > 0.0 && look.mean >= LIT * brightest);
    let pixels: Vec<f32> = lit.flat_map(|look| look.luminances.iter().copied()).collect();
    let of_film = exposure_for_luminances(&pixels)?;
    // Keep the usual rule if the first frame leads to about the same exposure.
    let of_first = exposure_for_luminances(&looks[0].luminances);
    let is_near = |first: f32| (first / of_film).max(of_film / first) <= NEAR;
    let first_is_lit = looks[0].mean >= LIT * brightest;
    (!first_is_lit || !of_first.is_some_and(is_near)).then_some(of_film)
}

/// A small frame, path-traced with few paths: luminance of each pixel, and mean luminance.
struct Look {
    luminances: Vec<f32>,
    mean: f32,
}

fn look(scene: &Scene, settings: &RenderSettings, frame: u32) -> Look {
    let Size { width, height } = within(settings.size, SIDE_OF_A_LOOK);
    let options = PathOptions { samples: PATHS, max_bounces: settings.bounces, ..PathOptions::default() };
    let still = Still { time: settings.time(frame), width, height };
    let radiance = path_traced(scene, still, &options, |_, _| ()).mean;
    let luminances = luminance_plane(&radiance).samples().to_vec();
    let mean = luminances.iter().sum::<f32>() / luminances.len() as f32;
    Look { luminances, mean }
}

/// Returns whether the light of any frame may differ from the first frame, because something moves.
fn may_change(scene: &Scene) -> bool {
    let nodes = scene.moving_nodes();
    let camera_moves = scene.filming_camera().is_some_and(|camera| nodes[camera.node]);
    camera_moves || scene.moving_instances().contains(&true) || lamp_moves(scene)
}

/// Returns all frames of a film once: the first, the middle, the quarters, and so on.
fn spread(frames: u32) -> impl Iterator<Item = u32> {
    // Visit 0, ½, ¼, ¾, ⅛ … of the film, without repeated frames.
    let mut seen = std::collections::BTreeSet::new();
    let bits = 32 - (frames - 1).leading_zeros();
    let count = 1u64 << bits;
    (0..count)
        .map(move |k| ((k.reverse_bits() >> (64 - bits.max(1))) * u64::from(frames) / count) as u32)
        .filter(move |frame| seen.insert(*frame))
}

/// Returns a size with the aspect ratio of the given size and sides of at most `most` pixels.
fn within(Size { width, height }: Size, most: usize) -> Size {
    let larger = width.max(height).max(most);
    let side = |side: usize| (side * most).div_ceil(larger);
    Size { width: side(width), height: side(height) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_pictures_have_the_shape_of_large_ones() {
        for ((width, height), expected) in [
            ((512, 512), (128, 128)),
            ((1920, 1080), (128, 72)),
            ((1080, 1920), (72, 128)),
            ((96, 64), (96, 64)),
            ((16383, 1), (128, 1)),
        ] {
            let Size { width, height } = within(Size { width, height }, SIDE);
            assert_eq!((width, height), expected);
        }
    }

    #[test]
    fn looks_are_spread_over_the_film() {
        assert_eq!(spread(16).take(5).collect::<Vec<u32>>(), [0, 8, 4, 12, 2]);
        assert_eq!(spread(24).take(4).collect::<Vec<u32>>(), [0, 12, 6, 18]);
        for frames in [2, 3, 7, 24, 100] {
            let mut all: Vec<u32> = spread(frames).collect();
            all.sort_unstable();
            assert_eq!(all, (0..frames).collect::<Vec<u32>>());
        }
    }
}
