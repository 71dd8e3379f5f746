//! The surface that a camera ray shows.
//!
//! glTF's materials are single-sided by default: their backs are invisible (glTF 2.0, 3.9.6), so a viewer looks into a
//! room through its walls. Light still hits them: backs cast shadows and absorb.

use super::CameraRay;
use crate::PosedScene;
use crate::accel::Hit;
use crate::surface::Interaction;
use glam::Vec3A;

impl CameraRay {
    /// The surface that a ray shows, given its first `hit`: the first front, or the first back of a double-sided
    /// surface. `width` is the width of a pixel at a hit \[m\]. Width 0 gives unfiltered textures and uncorrected
    /// outlines.
    pub(crate) fn shown<'a>(
        self,
        scene: PosedScene<'a>,
        hit: Hit,
        width: impl Fn(&Hit) -> f32,
    ) -> Option<(Hit, Interaction<'a>)> {
        self.shown_within((0.0, f32::INFINITY), scene, hit, width)
    }

    /// The surface that a ray shows between these distances \[m\], otherwise like [`CameraRay::shown`].
    pub(crate) fn shown_within<'a>(
        self,
        distances: (f32, f32),
        scene: PosedScene<'a>,
        hit: Hit,
        width: impl Fn(&Hit) -> f32,
    ) -> Option<(Hit, Interaction<'a>)> {
        let Self { origin, direction } = self;
        let pixel = width(&hit);
        let surface = scene.surfaces.point(&hit, direction, pixel);
        if surface.front {
            return Some((hit, surface));
        }
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

    /// The first hit between the distances `near` and `far` along the ray \[m\]. `hit` is the ray's first hit;
    /// `closest` finds others.
    pub(crate) fn cut(
        self,
        near: f32,
        far: f32,
        hit: Option<Hit>,
        closest: impl Fn(Vec3A) -> Option<Hit>,
    ) -> Option<Hit> {
        let hit = match hit {
            Some(hit) if hit.distance < near => {
                closest(self.origin + self.direction * near).map(|hit| Hit { distance: hit.distance + near, ..hit })
            }
            hit => hit,
        };
        hit.filter(|hit| hit.distance <= far)
    }
}
