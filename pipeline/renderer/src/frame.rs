//! Prepared frame: all data that needs no thresholds (posed scene, lights and visible surfaces).

use lighttree::LightTree;
use render_core::scene::View;
use render_core::{Accelerator, DirectLights, FinalGather, GBuffer, Surfaces};
use std::sync::Arc;

/// Time and camera of a frame, chosen by the caller.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moment {
    /// Time in the scene's animation \[s\].
    pub time: f32,
    /// View of the camera; `None` for the filming camera of the scene.
    pub view: Option<View>,
}

/// Prepared frame of a scene.
pub struct Frame<'s> {
    /// Frame number, from 0.
    pub index: u32,
    /// The scene in the pose of the frame.
    pub surfaces: Surfaces<'s>,
    /// Acceleration structure for rays.
    pub accelerator: Arc<Accelerator>,
    /// Lights that are sampled directly.
    pub direct: Arc<DirectLights>,
    /// Light tree with all other lights.
    pub tree: Arc<LightTree>,
    /// Final gather: rays into the surroundings of points, and bias compensation for the tree's lights.
    pub gather: Arc<FinalGather>,
    /// Visible surface of each pixel.
    pub seen: Arc<GBuffer>,
    /// Offset of ray origins from surfaces \[m\].
    pub epsilon: f32,
}

impl std::fmt::Debug for Frame<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Frame").field("index", &self.index).finish_non_exhaustive()
    }
}

/// Prepared frame with its motion, ready for [`Shading`](super::Shading).
pub type PreparedFrame<'s> = pipeline::stage::Prepared<Frame<'s>>;
