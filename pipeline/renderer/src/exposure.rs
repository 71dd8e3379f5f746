//! The exposure of a film that is found before its frames: from its first frame, or from those that are lit.
//!
//! ```text
//! e = 0.18 / exp(mean ln Y)         Y  luminance of the lit pixels of the first frame
//! ```
//!
//! That holds for a film whose first frame is as bright as the others, about. Paths look at a few small frames to see whether it is:
//! where a film's lamps move, or its first frame is black, the lit frames among them set the exposure.

use super::{Preparation, Shading};
use crate::plan::{Plan, lamp_moves};
use crate::settings::{RenderSettings, Size};
use perceptual::luminance_plane;
use pipeline::exposure::{exposure_for, exposure_for_luminances};
use pipeline::parts::{LastThresholds, Shade};
use render_core::scene::Scene;
use render_core::{PathOptions, Still, path_traced};

/// Larger side of the picture that an exposure is found from \[pixels\].
const SIDE: usize = 128;
/// The same for a look by paths, and paths for each pixel: the mean of 1024 pixels of a film's first frame is then within 5 %.
const SIDE_OF_A_LOOK: usize = 32;
const PATHS: u32 = 16;
/// Frames that are looked at where the first tells too little; and the most of them, if all are black.
const LOOKS: usize = 5;
const MOST_LOOKS: usize = 64;
/// A frame is lit if it has this share of the mean luminance of the brightest: six stops less.
const LIT: f32 = 1.0 / 64.0;
/// The first frame's exposure is kept if the film's is no more than two stops away.
const NEAR: f32 = 4.0;

/// The exposure of a film in chunks by `settings`, and of each part of it: by the rule of other films, from the first frame at no
/// more than 128 pixels a side. `shading` makes the second half of the renderer for it.
pub fn exposure_of_first_frame(
    scene: &Scene,
    settings: &RenderSettings,
    shading: impl for<'a> FnOnce(&RenderSettings, &'a Plan) -> Shading<'a>,
) -> f32 {
    // One sample of all pixels: no part of the picture weighs more than another.
    let settings = RenderSettings {
        size: within(settings.size, SIDE),
        frames: 1,
        end: 1,
        chunk: None,
        samples: 1,
        importance: None,
        aov: Vec::new(),
        ..settings.clone()
    };
    let plan = Plan::new(scene, &settings);
    let prepared = Preparation::new(scene, &settings, &plan).frame(0);
    let radiance = shading(&settings, &plan).step(&prepared, LastThresholds::none()).radiance;
    exposure_for(&luminance_plane(&radiance))
}

/// The exposure of a film whose first frame is no measure of the others; `None` where it is. It depends on the whole film, whatever
/// range of it is made.
pub fn exposure_of_lit_frames(scene: &Scene, settings: &RenderSettings) -> Option<f32> {
    if settings.frames < 2 || !may_change(scene) {
        return None;
    }

    // The first frame is enough if it is lit, and stays so.
    let first = look(scene, settings, 0);
    let mut looks = vec![first];
    if looks[0].mean > 0.0 && !lamp_moves(scene) {
        return None;
    }

    // Others in an order that halves gaps, until some are lit.
    for frame in spread(settings.frames).skip(1) {
        let is_lit = looks.iter().any(|look| look.mean > 0.0);
        if looks.len() >= if is_lit { LOOKS } else { MOST_LOOKS } {
            break;
        }
        looks.push(look(scene, settings, frame));
    }

    // Pixels of the lit frames alone.
    let brightest = looks.iter().fold(0.0, |most: f32, look| most.max(look.mean));
    let lit = looks.iter().filter(|look| look.mean > 0.0 && look.mean >= LIT * brightest);
    let pixels: Vec<f32> = lit.flat_map(|look| look.luminances.iter().copied()).collect();
    let of_film = exposure_for_luminances(&pixels)?;
    let of_first = exposure_for_luminances(&looks[0].luminances);
    let is_near = |first: f32| (first / of_film).max(of_film / first) <= NEAR;
    let first_is_lit = looks[0].mean >= LIT * brightest;
    (!first_is_lit || !of_first.is_some_and(is_near)).then_some(of_film)
}

/// A frame, small and by few paths.
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

/// Whether any frame may have other light than the first: something moves.
fn may_change(scene: &Scene) -> bool {
    let nodes = scene.moving_nodes();
    let camera_moves = scene.filming_camera().is_some_and(|camera| nodes[camera.node]);
    camera_moves || scene.moving_instances().contains(&true) || lamp_moves(scene)
}

/// All frames of a film, once each: the first, then quarters of it, and ever finer.
fn spread(frames: u32) -> impl Iterator<Item = u32> {
    // 0, ½, ¼, ¾, ⅛ … of the film, as far as these are other frames.
    let mut seen = std::collections::BTreeSet::new();
    let bits = 32 - (frames - 1).leading_zeros();
    let count = 1u64 << bits;
    (0..count)
        .map(move |k| ((k.reverse_bits() >> (64 - bits.max(1))) * u64::from(frames) / count) as u32)
        .filter(move |frame| seen.insert(*frame))
}

/// A size of the same shape whose sides are `most` pixels at most.
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
