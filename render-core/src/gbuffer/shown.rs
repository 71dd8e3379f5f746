//! The surface that a ray from the camera shows.
//!
//! glTF's materials are single-sided unless they say otherwise: their backs are not shown (glTF 2.0, 3.9.6), so that one looks
//! into a room through its walls. Light meets them all the same: backs throw shadows and absorb.

use super::CameraRay;
use crate::PosedScene;
use crate::accel::Hit;
use crate::surface::Interaction;
use glam::Vec3A;

impl CameraRay {
    /// The surface that the ray shows whose first hit is `hit`: the first front, or the first back of a double-sided
    /// surface. `width` is that of a pixel at a hit, meters; 0 for sharp textures, and outlines as rays meet them.
    pub(crate) fn shown<'a>(
        self,
        scene: PosedScene<'a>,
        hit: Hit,
        width: impl Fn(&Hit) -> f32,
    ) -> Option<(Hit, Interaction<'a>)> {
        self.shown_within((0.0, f32::INFINITY), scene, hit, width)
    }

    /// As [`CameraRay::shown`], between these distances along the ray \[m\].
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
        // From the same origin: a front that lies as far as the back is met too.
        let (near, far) = distances;
        let hit = self.cut(near, far, scene.accelerator.closest_shown(origin, direction), |origin| {
            scene.accelerator.closest_shown(origin, direction)
        })?;
        Some((hit, scene.surfaces.point(&hit, direction, width(&hit))))
    }

    /// The first hit between the distances `near` and `far` along the ray \[m\], where `hit` is the first of all; `closest` finds
    /// others.
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
