//! Scene at one time, ready for ray queries.

use crate::accel::Accelerator;
use crate::surface::Surfaces;

/// Acceleration structure and surfaces of a scene in the same pose.
#[derive(Clone, Copy, Debug)]
pub struct PosedScene<'a> {
    /// Acceleration structure, which answers ray queries.
    pub accelerator: &'a Accelerator,
    /// Surfaces, which evaluate hits.
    pub surfaces: &'a Surfaces<'a>,
}

impl<'a> PosedScene<'a> {
    /// Combines an acceleration structure and surfaces. Both must have the same [`Pose`](crate::scene::Pose).
    #[must_use]
    pub fn new(accelerator: &'a Accelerator, surfaces: &'a Surfaces<'a>) -> Self {
        Self { accelerator, surfaces }
    }
}
