//! Camera that a viewer moves: it orbits around a point, turns, and walks.

use render_core::glam::{Affine3A, Quat, Vec2, Vec3};
use render_core::scene::{Scene, View};
use serde::Deserialize;
use std::f32::consts::{FRAC_PI_2, PI};

/// Largest angle above or below the horizon \[rad\].
const STEEPEST: f32 = 0.98 * FRAC_PI_2;
/// Walking speed \[radii of the scene per second\].
const SPEED: f32 = 0.35;
/// Factor on the speed while the key for fast movement is held.
const FAST: f32 = 3.0;
/// Turning speed of keys \[rad/s\].
const TURNING: f32 = 1.2;
/// Maximum distance from the scene's center \[radii of the scene\].
const FARTHEST: f32 = 100.0;
/// Minimum distance from the orbit's center \[radii of the scene\].
const NEAREST: f32 = 1e-3;
/// Maximum angle, pan or zoom of one message.
const LARGEST_STEP: f32 = 2.0 * PI;

/// Keys that move the camera as long as they are held.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(transparent)]
pub struct Keys(pub u16);

impl Keys {
    /// Moves forward.
    pub const FORWARD: u16 = 1;
    /// Moves backward.
    pub const BACK: u16 = 2;
    /// Moves to the left.
    pub const LEFT: u16 = 4;
    /// Moves to the right.
    pub const RIGHT: u16 = 8;
    /// Moves up.
    pub const UP: u16 = 16;
    /// Moves down.
    pub const DOWN: u16 = 32;
    /// Turns to the left.
    pub const TURN_LEFT: u16 = 64;
    /// Turns to the right.
    pub const TURN_RIGHT: u16 = 128;
    /// Looks up.
    pub const LOOK_UP: u16 = 256;
    /// Looks down.
    pub const LOOK_DOWN: u16 = 512;
    /// Moves three times as fast.
    pub const FAST: u16 = 1024;

    /// Returns −1, 0 or 1, depending on two opposite keys.
    fn axis(self, [less, more]: [u16; 2]) -> f32 {
        let held = |key| f32::from(u8::from(self.0 & key != 0));
        held(more) - held(less)
    }

    /// Returns whether any held key moves the camera.
    #[must_use]
    pub fn move_camera(self) -> bool {
        self.0 & !Self::FAST != 0
    }
}

/// Camera of a viewer, at a position and with angles relative to the horizon.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WalkCamera {
    /// View of the lens, which `view` moves.
    lens: View,
    /// Rotation from coordinates with y up to the scene's.
    upright: Quat,
    eye: Vec3,
    /// Angle of the direction about the up axis, from −z towards −x \[rad\].
    yaw: f32,
    /// Angle of the direction above the horizon \[rad\].
    pitch: f32,
    /// Distance from the orbit's center \[m\].
    reach: f32,
    center: Vec3,
    /// Radius of the scene \[m\].
    radius: f32,
}

impl WalkCamera {
    /// Starts from a `view` of `scene`. The orbit's center is at the depth of the scene's center.
    #[must_use]
    pub fn new(scene: &Scene, view: View) -> Self {
        let bounds = scene.bounds(&scene.pose(0.0));
        let (center, radius) = bounds.map_or((Vec3::ZERO, 1.0), |(low, high)| {
            (((low + high) / 2.0).into(), ((high - low).length() / 2.0).max(f32::MIN_POSITIVE))
        });
        let up = scene.settings.camera.up.map_or(Vec3::Y, Vec3::from_array).try_normalize().unwrap_or(Vec3::Y);
        let upright = Quat::from_rotation_arc(Vec3::Y, up);

        // Split the direction into angles, without the camera's roll.
        let eye = Vec3::from(view.position());
        let direction = upright.inverse() * Vec3::from(-view.world_from_camera().matrix3.z_axis);
        let reach = (center - eye).dot(upright * direction).clamp(0.1 * radius, FARTHEST * radius);
        let pitch = direction.y.clamp(-1.0, 1.0).asin().clamp(-STEEPEST, STEEPEST);
        Self { lens: view, upright, eye, yaw: (-direction.x).atan2(-direction.z), pitch, reach, center, radius }
    }

    /// Returns the view.
    #[must_use]
    pub fn view(&self) -> View {
        self.lens.moved_to(Affine3A::from_rotation_translation(self.rotation(), self.eye))
    }

    fn rotation(&self) -> Quat {
        self.upright * Quat::from_rotation_y(self.yaw) * Quat::from_rotation_x(self.pitch)
    }

    /// Turns the camera to the right and up \[rad\].
    pub fn turn(&mut self, angles: Vec2) {
        let Some(angles) = step(angles) else { return };
        self.yaw = (self.yaw - angles.x).rem_euclid(2.0 * PI);
        self.pitch = (self.pitch + angles.y).clamp(-STEEPEST, STEEPEST);
    }

    /// Moves the camera around the orbit's center, as if the scene turned to the right and up \[rad\].
    pub fn orbit(&mut self, angles: Vec2) {
        let pivot = self.eye + self.rotation() * Vec3::NEG_Z * self.reach;
        self.turn(angles);
        self.go_to(pivot + self.rotation() * Vec3::Z * self.reach);
    }

    /// Moves the camera sideways \[multiples of the distance from the orbit's center\].
    pub fn pan(&mut self, by: Vec2) {
        let Some(by) = step(by) else { return };
        self.go_to(self.eye + self.rotation() * by.extend(0.0) * self.reach);
    }

    /// Moves the camera towards the orbit's center; `by` is the logarithm of the ratio of distances.
    pub fn zoom(&mut self, by: f32) {
        let Some(by) = step(Vec2::new(by, 0.0)) else { return };
        let pivot = self.eye + self.rotation() * Vec3::NEG_Z * self.reach;
        self.reach = (self.reach * (-by.x).exp()).clamp(NEAREST * self.radius, FARTHEST * self.radius);
        self.go_to(pivot + self.rotation() * Vec3::Z * self.reach);
    }

    /// Moves the camera by held `keys` for some `seconds`. Forward is horizontal.
    pub fn walk(&mut self, keys: Keys, seconds: f32) {
        let faster = if keys.0 & Keys::FAST != 0 { FAST } else { 1.0 };
        let turned =
            Vec2::new(keys.axis([Keys::TURN_LEFT, Keys::TURN_RIGHT]), keys.axis([Keys::LOOK_DOWN, Keys::LOOK_UP]));
        self.turn(turned * TURNING * seconds);
        let way = Vec3::new(
            keys.axis([Keys::LEFT, Keys::RIGHT]),
            keys.axis([Keys::DOWN, Keys::UP]),
            keys.axis([Keys::FORWARD, Keys::BACK]),
        );
        let level = self.upright * Quat::from_rotation_y(self.yaw);
        self.go_to(self.eye + level * way.normalize_or_zero() * SPEED * faster * self.radius * seconds);
    }

    /// Moves the eye, not farther than the limit.
    fn go_to(&mut self, eye: Vec3) {
        if eye.is_finite() {
            self.eye = self.center + (eye - self.center).clamp_length_max(FARTHEST * self.radius);
        }
    }
}

/// Returns a step within its limits; `None` if it is not finite.
fn step(by: Vec2) -> Option<Vec2> {
    by.is_finite().then(|| by.clamp(Vec2::splat(-LARGEST_STEP), Vec2::splat(LARGEST_STEP)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use render_core::scene::{Material, Mesh};

    fn camera() -> WalkCamera {
        let positions = [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0]].map(Vec3::from).into();
        let mesh = Mesh { positions, triangles: vec![[0, 1, 2]], ..Mesh::default() };
        let scene = Scene::of_mesh(mesh, Material::default());
        WalkCamera::new(&scene, scene.view(&scene.pose(0.0), 64, 48))
    }

    #[test]
    fn an_orbit_keeps_its_center_in_the_middle() {
        let mut camera = camera();
        let pivot = camera.eye + camera.rotation() * Vec3::NEG_Z * camera.reach;
        for angles in [[0.3, 0.2], [2.0, -3.0], [-1.0, 9.0]] {
            camera.orbit(Vec2::from_array(angles));
            let seen = camera.view().project(pivot.into()).unwrap();
            assert!(seen.pixel.distance(Vec2::new(32.0, 24.0)) < 0.01, "{seen:?}");
        }
        camera.zoom(0.5);
        let seen = camera.view().project(pivot.into()).unwrap();
        assert!((seen.depth - camera.reach).abs() < 1e-3 && seen.pixel.distance(Vec2::new(32.0, 24.0)) < 0.01);
    }

    #[test]
    fn a_camera_starts_at_its_view_and_walks_ahead() {
        let mut camera = camera();
        let difference = camera.view().world_from_camera().matrix3 - camera.lens.world_from_camera().matrix3;
        assert!(difference.x_axis.length() + difference.z_axis.length() < 1e-5, "{difference:?}");
        let before = camera.eye;
        camera.walk(Keys(Keys::FORWARD | Keys::FAST), 0.1);
        let way = camera.eye - before;
        assert!(way.y.abs() < 1e-6 && way.z < 0.0 && (way.length() - 0.105 * camera.radius).abs() < 1e-4, "{way:?}");
    }

    #[test]
    fn rubbish_moves_nothing_and_no_step_is_endless() {
        let mut camera = camera();
        let before = camera;
        for number in [f32::NAN, f32::INFINITY] {
            camera.turn(Vec2::new(number, 0.0));
            camera.pan(Vec2::new(0.0, number));
            camera.zoom(number);
            camera.walk(Keys(1), number);
        }
        assert_eq!(camera, before);
        for _ in 0..100 {
            camera.pan(Vec2::splat(1e30));
            camera.zoom(-1e30);
        }
        assert!(camera.eye.length() <= 1.01 * FARTHEST * camera.radius);
    }
}
