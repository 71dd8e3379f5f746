//! Check for cameras with depth limits that exclude the whole scene.

use super::{PointBox, Scene};

/// Number of times in the animation at which a camera is checked.
const MOMENTS: usize = 5;

impl Scene {
    /// Returns a note if the filming camera never shows a surface, because all surfaces are nearer than `znear` or
    /// beyond `zfar`.
    pub(super) fn clipped_note(&self) -> Option<String> {
        let camera = self.filming_camera()?;
        let (mut too_near, mut too_far) = (true, true);
        // Check several times, because the depths change while the camera moves.
        for moment in 0..MOMENTS {
            let pose = self.pose(self.duration() * moment as f32 / (MOMENTS - 1) as f32);
            let (low, high) = self.bounds(&pose)?;
            let (nearest, farthest, depths) = self.view(&pose, 1, 1).depths_of(&PointBox { low, high }.corners());
            // Geometry behind the camera is invisible with any depth range.
            too_near &= farthest > 0.0 && farthest < depths.near;
            too_far &= nearest > depths.far;
        }
        let (name, depths) = (&camera.name, camera.depths);
        let cut = match (too_near, too_far) {
            (true, _) => format!("nearer than its znear of {} m", depths.near),
            (_, true) => format!("beyond its zfar of {} m", depths.far),
            _ => return None,
        };
        Some(format!("the camera \"{name}\" shows no surface: all are {cut}"))
    }
}
