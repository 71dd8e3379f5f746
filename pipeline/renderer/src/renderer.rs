//! Frames of a scene, one after the other, without a film around them.

use crate::plan::Plan;
use crate::settings::RenderSettings;
use crate::{Preparation, Shading};
use pipeline::parts::{LastThresholds, Shade, Shaded};
use render_core::scene::Scene;

/// Both halves of the renderer, for callers without an encoder.
#[derive(Debug)]
pub struct Renderer<'a> {
    prepare: Preparation<'a>,
    shade: Shading<'a>,
}

impl<'a> Renderer<'a> {
    /// Renders `scene` by `settings`, with the work that `plan` lists.
    #[must_use]
    pub fn new(scene: &'a Scene, settings: &RenderSettings, plan: &'a Plan) -> Self {
        Self { prepare: Preparation::new(scene, settings, plan), shade: Shading::new(settings, plan) }
    }

    /// Frame `index`: linear radiance \[W·m⁻²·sr⁻¹\] and figures.
    ///
    /// With `thresholds` of the frame before, each pixel may be wrong by its threshold; without, by 2 % of its luminance.
    pub fn frame(&mut self, index: u32, thresholds: LastThresholds<'_>) -> Shaded {
        let prepared = self.prepare.frame(index);
        self.shade.step(&prepared, thresholds)
    }
}
