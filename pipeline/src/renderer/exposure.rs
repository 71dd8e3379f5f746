//! The exposure of a film whose first frame is made elsewhere.

use super::{Preparation, Shading};
use crate::film::display::exposure_for;
use crate::parts::{LastThresholds, Shade};
use crate::plan::Plan;
use crate::settings::{RenderSettings, Size};
use perceptual::luminance_plane;
use render_core::scene::Scene;

/// Larger side of the picture that an exposure is found from \[pixels\].
const SIDE: usize = 128;

/// The exposure of a film in chunks by `settings`, and of each part of it: by the rule of other films, from the first frame at no
/// more than 128 pixels a side. `shading` makes the second half of the renderer for it.
pub(crate) fn exposure_of_first_frame(
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
}
