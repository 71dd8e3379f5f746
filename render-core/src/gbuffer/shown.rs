//! Surface that a camera ray shows.
//!
//! glTF's materials are single-sided by default and their backs are invisible (glTF 2.0, 3.9.6), so a viewer sees into
//! a room through its walls. Light still hits backs: they cast shadows and absorb.

use super::CameraRay;
use crate::PosedScene;
use crate::accel::Hit;
use crate::surface::Interaction;
use glam::Vec3A;

impl CameraRay {
    /// Returns the surface that a ray shows, given its first `hit`: the first front, or the first back of a
    /// double-sided surface. `width` is the width of a pixel at a hit \[m\]. With width 0, textures are not filtered
    /// and outlines are not corrected.
    pub(crate) fn shown<'a>(
        self,
        scene: PosedScene<'a>,
        hit: Hit,
        width: impl Fn(&Hit) -> f32,
    ) -> Option<(Hit, Interaction<'a>)> {
        self.shown_within((0.0, f32::INFINITY), scene, hit, width)
    }

    /// Returns the surface that a ray shows between these distances \[m\], determined as in [`CameraRay::shown`].
    pub(crate) fn shown_within<'a>(
        self,
        distances: (f32, f32),
        scene: PosedScene<'a>,
        hit: Hit,
        width: impl Fn(&Hit) -> f32,
    ) -> Option<(Hit, Interaction<'a>)> {
        let Self { origin, direction } = self;
        let pixel = width(&hit);
        // Return early for a front, which most rays hit.
        let surface = scene.surfaces.point(&hit, direction, pixel);
        if surface.front {
            return Some((hit, surface));
        }

        // At an outline, rounding may hide the front at the same edge.
        let beside = self.front_beside(scene, &hit, &surface, pixel);
        let beside = beside.filter(|(hit, _)| hit.distance >= distances.0);
        if beside.is_some() || !surface.is_back() {
            return beside.or(Some((hit, surface)));
        }

        // Trace from the same origin, to include a front at the same distance as the back.
        let (near, far) = distances;
        let hit = self.cut(near, far, scene.accelerator.closest_shown(origin, direction), |origin| {
            scene.accelerator.closest_shown(origin, direction)
        })?;
        Some((hit, scene.surfaces.point(&hit, direction, width(&hit))))
    }

    /// Returns the first hit between the distances `near` and `far` along the ray \[m\]. `hit` is the ray's first hit;
    /// `closest` finds other hits.
    pub(crate) fn cut(
        self,
        near: f32,
        far: f32,
        hit: Option<Hit>,
        closest: impl Fn(Vec3A) -> Option<Hit>,
    ) -> Option<Hit> {
        // Trace again from the near plane if the first hit is in front of it.
        let hit = match hit {
            Some(hit) if hit.distance < near => {
                closest(self.origin + self.direction * near).map(|hit| Hit { distance: hit.distance + near, ..hit })
            }
            hit => hit,
        };
        hit.filter(|hit| hit.distance <= far)
    }
}
