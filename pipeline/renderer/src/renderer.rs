//! Renderer of single frames of a scene, without an encoder.

use crate::plan::Plan;
use crate::settings::RenderSettings;
use crate::{Preparation, Shading};
use pipeline::stage::{LastThresholds, Shade, Shaded};
use render_core::scene::Scene;

/// Both halves of the renderer, for use without an encoder.
#[derive(Debug)]
pub struct Renderer<'a> {
    prepare: Preparation<'a>,
    shade: Shading<'a>,
}

impl<'a> Renderer<'a> {
    /// Creates a renderer for `scene` with `settings` that runs the stages of `plan`.
    #[must_use]
    pub fn new(scene: &'a Scene, settings: &RenderSettings, plan: &'a Plan) -> Self {
        Self { prepare: Preparation::new(scene, settings, plan), shade: Shading::new(settings, plan) }
    }

    /// Renders frame `index`. Returns linear radiance \[W·m⁻²·sr⁻¹\] and figures.
    ///
    /// The `thresholds` of the previous frame determine the permitted error of each pixel. Without thresholds, the
    /// permitted error is 2 % of the luminance.
    pub fn frame(&mut self, index: u32, thresholds: LastThresholds<'_>) -> Shaded {
        let prepared = self.prepare.frame(index);
        self.shade.step(&prepared, thresholds)
    }
}
