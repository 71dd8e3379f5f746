//! Motion vectors to any pose, regardless of visibility in that pose.

use super::GBuffer;
use crate::Surfaces;
use crate::scene::View;
use glam::{Affine3A, Vec2};
use plane::Plane;

impl GBuffer {
    /// Returns the motion of each pixel's surface point to another picture \[pixels\], x to the right and y down. The
    /// other picture shows `surfaces`, the same scene at another time, in `view`. The motion is `None` if the point is
    /// behind the camera of `view`.
    ///
    /// [`reproject`](Self::reproject) also checks whether the point is visible in the other picture.
    #[must_use]
    pub fn motion_to(&self, surfaces: &Surfaces, view: &View) -> Plane<Option<[f32; 2]>> {
        let other = Self::placed(Plane::filled(0, 0, super::PixelSurface::EMPTY), surfaces, view);
        let carry: Vec<Affine3A> = self.carry_to(&other);
        Plane::from_fn(self.pixels.width(), self.pixels.height(), |x, y| {
            let center = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
            let moved = super::moved(&self.pixels.row(y)[x], self, &carry, &other);
            moved.map(|moved| (moved.place - center).to_array())
        })
    }
}
