//! A frame up to where thresholds are needed: the scene in its pose, its lights, and the visible surfaces.

use lighttree::LightTree;
use render_core::{Accelerator, DirectLights, FinalGather, GBuffer, Surfaces};
use std::sync::Arc;

/// A prepared frame of a scene.
pub struct Frame<'s> {
    /// Its number, from 0.
    pub index: u32,
    /// The scene in this frame's pose.
    pub surfaces: Surfaces<'s>,
    /// The scene, ready for shadow rays.
    pub accelerator: Arc<Accelerator>,
    /// The lights that are sampled directly.
    pub direct: Arc<DirectLights>,
    /// All other lights.
    pub tree: Arc<LightTree>,
    /// The surroundings of points, and the bias compensation of the tree's lights.
    pub gather: Arc<FinalGather>,
    /// The visible surface of each pixel.
    pub seen: Arc<GBuffer>,
    /// Offset of ray origins from their surface \[m\].
    pub epsilon: f32,
}

impl std::fmt::Debug for Frame<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Frame").field("index", &self.index).finish_non_exhaustive()
    }
}

/// A frame for [`Shading`](super::Shading), with its motion.
pub type PreparedFrame<'s> = pipeline::parts::Prepared<Frame<'s>>;
