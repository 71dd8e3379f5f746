//! A scene at one time, ready for rays.

use crate::accel::Accelerator;
use crate::surface::Surfaces;

/// The acceleration structure and the surfaces of a scene in the same pose.
#[derive(Clone, Copy, Debug)]
pub struct PosedScene<'a> {
    /// For ray queries.
    pub accelerator: &'a Accelerator,
    /// For what rays hit.
    pub surfaces: &'a Surfaces<'a>,
}

impl<'a> PosedScene<'a> {
    /// Both have to be made from the same [`Pose`](crate::scene::Pose).
    #[must_use]
    pub fn new(accelerator: &'a Accelerator, surfaces: &'a Surfaces<'a>) -> Self {
        Self { accelerator, surfaces }
    }
}
