//! A scene at one time, ready for ray queries.

use crate::accel::Accelerator;
use crate::surface::Surfaces;

/// The acceleration structure and the surfaces of a scene in the same pose.
#[derive(Clone, Copy, Debug)]
pub struct PosedScene<'a> {
    /// Answers ray queries.
    pub accelerator: &'a Accelerator,
    /// Evaluates hits.
    pub surfaces: &'a Surfaces<'a>,
}

impl<'a> PosedScene<'a> {
    /// Combines both; they must have the same [`Pose`](crate::scene::Pose).
    #[must_use]
    pub fn new(accelerator: &'a Accelerator, surfaces: &'a Surfaces<'a>) -> Self {
        Self { accelerator, surfaces }
    }
}
