//! Camera and animation as the controller's inputs set them, in place of the clock of a film.

use crate::camera::{Keys, WalkCamera};
use crate::controls::Controls;
use render_core::glam::Vec2;
use render_core::scene::{Scene, View};
use renderer::Moment;
use renderer::settings::{RenderSettings, Size};
use std::sync::Arc;
use std::time::Duration;

/// Longest time between two pictures for which held keys move the camera.
const LONGEST_STEP: Duration = Duration::from_millis(150);

/// Time for which a key moves the camera at once \[s\].
const FIRST_STEP: f32 = 0.03;

/// Camera and animation of a session.
#[derive(Debug)]
pub struct LiveStage {
    scene: Arc<Scene>,
    size: Size,
    pixel_aspect: f32,
    fps: f64,
    /// Length of the animation \[frames\]; 1 for a static scene.
    frames: u64,
    /// Camera of the viewer; `None` for the camera of the scene.
    camera: Option<WalkCamera>,
    keys: Keys,
    is_playing: bool,
    /// Played time of the animation.
    played: Duration,
    /// Time of the last step.
    last: Option<Duration>,
}

impl LiveStage {
    /// Creates the stage at the first frame of a film with `settings`. The animation is paused.
    #[must_use]
    pub fn new(scene: Arc<Scene>, settings: &RenderSettings) -> Self {
        let frames = if scene.duration() == 0.0 { 1 } else { settings.frames.into() };
        Self {
            scene,
            size: settings.size,
            pixel_aspect: settings.pixel_aspect,
            fps: settings.fps,
            frames,
            camera: None,
            keys: Keys::default(),
            is_playing: false,
            played: Duration::ZERO,
            last: None,
        }
    }

    /// Applies a message of the controller at time `now`.
    pub fn control(&mut self, now: Duration, controls: Controls) {
        // Move by the keys held so far, before they change.
        self.advance(now);
        let Controls { turn, orbit, pan, zoom, keys, play, reset } = controls;
        if reset {
            self.camera = None;
        }
        let moves = [turn, orbit, pan].iter().flatten().any(|&by| by != 0.0) || zoom != 0.0;
        if moves {
            let camera = self.own_camera();
            camera.turn(Vec2::from_array(turn));
            camera.orbit(Vec2::from_array(orbit));
            camera.pan(Vec2::from_array(pan));
            camera.zoom(zoom);
        }
        if let Some(keys) = keys {
            // Move at once when a key is pressed, so that the next picture shows it.
            let pressed = Keys(keys.0 & !self.keys.0);
            if pressed.move_camera() {
                self.own_camera().walk(pressed, FIRST_STEP);
            }
            self.keys = keys;
        }
        self.is_playing = play.unwrap_or(self.is_playing) && self.frames > 1;
    }

    /// Releases all keys, such as when the controller leaves.
    pub fn release(&mut self) {
        self.keys = Keys::default();
    }

    /// Returns whether the picture changes without further inputs.
    #[must_use]
    pub fn is_moving(&self) -> bool {
        self.is_playing || self.keys.move_camera()
    }

    /// Returns whether the scene has an animation.
    #[must_use]
    pub fn is_animated(&self) -> bool {
        self.frames > 1
    }

    /// Returns whether the animation plays.
    #[must_use]
    pub fn is_playing(&self) -> bool {
        self.is_playing
    }

    /// Moves camera and animation to time `now`, and returns the moment to render.
    pub fn step(&mut self, now: Duration) -> Moment {
        self.advance(now);
        let time = self.time();
        Moment { time, view: Some(self.camera.map_or_else(|| self.view_at(time), |camera| camera.view())) }
    }

    /// Returns the time in the animation \[s\]: the time of a frame of the film, for which photon paths were prepared.
    fn time(&self) -> f32 {
        let frame = (self.played.as_secs_f64() * self.fps) as u64 % self.frames.max(1);
        (frame as f64 / self.fps) as f32
    }

    fn advance(&mut self, now: Duration) {
        let passed = self.last.map_or(Duration::ZERO, |last| now.saturating_sub(last)).min(LONGEST_STEP);
        self.last = Some(now);
        if self.is_playing {
            self.played += passed;
        }
        if self.keys.move_camera() {
            let keys = self.keys;
            self.own_camera().walk(keys, passed.as_secs_f32());
        }
    }

    /// Returns the viewer's camera, which begins at the camera of the scene.
    fn own_camera(&mut self) -> &mut WalkCamera {
        let from = self.time();
        let (scene, view) = (self.scene.clone(), || self.view_at(from));
        let begin = self.camera.unwrap_or_else(|| WalkCamera::new(&scene, view()));
        self.camera.insert(begin)
    }

    fn view_at(&self, time: f32) -> View {
        let pose = self.scene.pose(time);
        self.scene.view(&pose, self.size.width, self.size.height).with_pixel_aspect(self.pixel_aspect)
    }
}
