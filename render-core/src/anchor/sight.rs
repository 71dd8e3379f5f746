//! Visibility between points on a surface. Light is distributed among neighboring points that no wall separates.
//!
//! The points of a kernel are close together, with similar normal and height. A wall on the surface may still separate
//! them. A point y therefore receives light from x only along a free path:
//!
//! ```text
//! x —— y                straight path slightly off the surface, or
//! x —— (x + y) / 2 + n · h —— y        path over obstacles lower than h: a bump, a curved surface
//! ```
//!
//! Light therefore stays in its room, regardless of how the walls are modeled.

use super::Anchor;
use crate::accel::{Accelerator, PACKET};
use glam::Vec3A;

/// Visibility tests between points on the surfaces of a scene.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sight<'a> {
    /// The scene for ray tracing.
    pub accelerator: &'a Accelerator,
    /// Offset of ray origins from their surface \[m\].
    pub epsilon: f32,
}

impl Sight<'_> {
    /// Returns the mask of the `points`, at most [`PACKET`], that light cannot reach from `position` with the unit
    /// `normal`. `height` is h \[m\].
    pub fn hidden(&self, position: Vec3A, normal: Vec3A, points: &[Anchor], height: f32) -> u64 {
        // Test straight paths first, as one packet: nearly all are free.
        let from = position + normal * self.epsilon;
        let mut ends = [Vec3A::ZERO; PACKET];
        for (end, point) in ends.iter_mut().zip(points) {
            *end = point.position;
        }
        let all = u64::MAX >> (PACKET - points.len().clamp(1, PACKET));
        let mut hidden = self.accelerator.occluded_packet(from, &ends[..points.len()], all);

        // Test paths over an obstacle for points without a free straight path.
        let mut left = hidden;
        while left != 0 {
            let index = left.trailing_zeros() as usize;
            left &= left - 1;
            let to = &points[index];
            let above = (from + to.position) / 2.0 + (normal + to.normal).normalize_or_zero() * height;
            if !self.accelerator.occluded(from, above) && !self.accelerator.occluded(above, to.position) {
                hidden &= !(1 << index);
            }
        }
        hidden
    }
}
