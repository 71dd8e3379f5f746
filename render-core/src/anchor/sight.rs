//! Sight between places of a surface: light is shared out among neighbors, and no wall may stand between these.
//!
//! A kernel over points that are near, alike in normal and height still joins the two sides of a wall that stands on the
//! surface. So of a place x and a point y of the kernel, y takes part only where light could go from x to y:
//!
//! ```text
//! x —— y                straight, both a little off the surface, or
//! x —— (x + y) / 2 + n · h —— y        over what is lower than h: a bump, the curve of the surface itself
//! ```
//! Both ways are free of surfaces. So what is shared out stays in the same room, whatever its walls are made of.

use super::Anchor;
use crate::accel::{Accelerator, PACKET};
use glam::Vec3A;

/// Rays between places of the surfaces of a scene.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sight<'a> {
    /// The scene that they are traced in.
    pub accelerator: &'a Accelerator,
    /// How far off their surface they begin \[m\].
    pub epsilon: f32,
}

impl Sight<'_> {
    /// Bits of those `points`, at most [`PACKET`], that no light gets to from the place at `position` with the unit `normal`;
    /// `height` is h \[m\].
    pub fn hidden(&self, position: Vec3A, normal: Vec3A, points: &[Anchor], height: f32) -> u64 {
        // Straight ways first: they begin at one point, and nearly all are free.
        let from = position + normal * self.epsilon;
        let mut ends = [Vec3A::ZERO; PACKET];
        for (end, point) in ends.iter_mut().zip(points) {
            *end = point.position;
        }
        let all = u64::MAX >> (PACKET - points.len().clamp(1, PACKET));
        let mut hidden = self.accelerator.occluded_packet(from, &ends[..points.len()], all);

        // The others may be reached from above.
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
