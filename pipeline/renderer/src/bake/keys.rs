//! Bakes of moving lamps: light at key times, between which films interpolate.
//!
//! Key times are evenly spaced over the scene's animation. Further times are baked to measure the error e of the
//! interpolation: the middle of the interval in which the light changes most, and the time at which the lamps deviate most
//! from interpolated lamps (`roughest.rs`). For smooth motion, e decreases with the square of the interval, so the
//! message about a large error contains a number of keys.
//!
//! ```text
//! e = Σ |Y(E) − Y(E_interpolated)| / Σ Y(E)        over all texels; Y is luminance
//! ```

use super::loops::{BakeLoops, BakeRun, LoopEnd};
use super::roughest::roughest;
use super::{Bake, BakedScene, Extent, stored};
use crate::baked_light::BakedLight;
use crate::plan::lamp_moves;
use crate::settings::RenderSettings;
use crate::texels::BakedTexels;
use pipeline::error::{Error, Result};
use render_core::luminance;
use render_core::scene::Scene;
use std::cell::Cell;
use std::path::Path;
use std::sync::Arc;

/// Maximum error e of the interpolation between key times.
const MOST_ERROR: f32 = 0.02;

/// Light at key times, and its error.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct KeyedBake {
    /// Light at the key times.
    pub light: BakedLight,
    /// Light and statistics of the first key.
    pub first: Bake,
    /// Largest measured error e of the interpolation.
    pub error: f32,
}

/// Resolution of light in space and time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct KeyedResolution {
    /// Number of texels; `None` for as many as [`Atlas::automatic`](render_core::Atlas::automatic) chooses.
    pub texels: Option<usize>,
    /// Number of key times, at least 2.
    pub keys: u32,
}

/// Computes the light of `scene` at several times, for films with moving lamps. The other parameters are
/// those of [`bake`](super::bake). Returns `None` if the `run` was stopped.
///
/// # Errors
/// If no lamp moves, or no surface is static. If the error of the interpolation exceeds 2 %. If the checkpoint is
/// invalid or cannot be written.
///
/// # Panics
/// If there are fewer than two keys.
pub fn bake_keys(
    scene: &Scene,
    settings: &RenderSettings,
    resolution: KeyedResolution,
    run: &BakeRun,
    progress: &dyn Fn(usize, usize),
) -> Result<Option<KeyedBake>> {
    let KeyedResolution { texels, keys } = resolution;
    assert!(keys >= 2, "{keys} key times");
    if !lamp_moves(scene) {
        let text = "--keys: no lamp of this scene moves; bake it without key times";
        return Err(Error::Options(text.into()));
    }
    let work = KeyedWork { scene, settings, texels, keys };
    match work.bake(run, progress) {
        Ok(bake) => Ok(Some(bake)),
        Err(LoopEnd::Stopped) => Ok(None),
        Err(LoopEnd::Failed(error)) => Err(error),
    }
}

impl KeyedBake {
    /// Writes the light of `scene` to a file and returns its length in bytes.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write(&self, scene: &Scene, path: &Path) -> Result<u64> {
        stored::write(scene, path, &self.light)
    }
}

/// A scene to bake at key times.
struct KeyedWork<'a> {
    scene: &'a Scene,
    settings: &'a RenderSettings,
    texels: Option<usize>,
    keys: u32,
}

impl KeyedWork<'_> {
    fn bake(&self, run: &BakeRun, progress: &dyn Fn(usize, usize)) -> Result<KeyedBake, LoopEnd> {
        let mut loops = BakeLoops::new(run)?;
        let baked = BakedScene::new(self.scene, self.settings, self.texels)?;

        // Bake the keys. The two further times count as keys in the progress.
        let (duration, intervals) = (self.scene.duration(), self.keys - 1);
        let time_of = |key: f32| duration * key / intervals as f32;
        let done = Cell::new(0);
        let mut bake_at = |time: f32, extent: Extent| {
            let before = done.get();
            let bake = baked.light_at(time, extent, &mut loops, &|now, all| {
                done.set(before + now);
                progress(before + now, all * (self.keys as usize + 2));
            });
            done.set(before + bake.as_ref().map_or(0, |bake| bake.work));
            bake
        };
        let mut first = None;
        let (mut times, mut lights) = (Vec::new(), Vec::new());
        for key in 0..self.keys {
            let time = time_of(key as f32);
            let bake = bake_at(time, Extent::Whole)?;
            if key == 0 {
                first = Some(bake.clone());
            }
            times.push(time);
            lights.push(Arc::new(bake.texels));
        }
        let light = BakedLight::new(times, lights).expect("key times are ascending, and all keys have the same texels");

        // Compare the interpolated light with the middle of the largest change, and with the roughest time of the lamps.
        let change = |key: u32| difference(&light.keys()[key as usize], &light.keys()[key as usize + 1]).0;
        let most = (0..intervals).max_by(|&a, &b| change(a).total_cmp(&change(b)).then(b.cmp(&a))).unwrap_or_default();
        let mut error = 0.0f32;
        for time in [Some(time_of(most as f32 + 0.5)), roughest(self.scene, light.times())].into_iter().flatten() {
            let found = bake_at(time, Extent::Matte)?.texels;
            let (wrong, whole) = difference(&light.at(time), &found);
            error = error.max(if whole > 0.0 { (wrong / whole) as f32 } else { 0.0 });
            if error > MOST_ERROR {
                return Err(self.too_few_keys(error, time).into());
            }
        }
        let first = first.expect("there are at least two keys");
        Ok(KeyedBake { light, first, error })
    }

    /// Returns the error of keys that are too far apart for the light at a `time` \[s\].
    fn too_few_keys(&self, error: f32, time: f32) -> Error {
        let intervals = (self.keys - 1) as f32 * (error / MOST_ERROR).sqrt();
        let (enough, percent) = (intervals.ceil() as u32 + 1, 100.0 * error);
        Error::Options(format!(
            "--keys {}: at {time:.2} s, interpolated light differs by {percent:.1} % from the light; use --keys {enough}, \
             or no baked light if lamps flash",
            self.keys
        ))
    }
}

/// Returns the sum of the luminance differences of two lights' texels, and the sum of the luminances of `second`.
fn difference(first: &BakedTexels, second: &BakedTexels) -> (f64, f64) {
    let (mut wrong, mut whole) = (0.0, 0.0);
    for (&first, &second) in first.indirect.iter().zip(&second.indirect) {
        let [a, b] = [first, second].map(|light| f64::from(luminance(light.into())));
        (wrong, whole) = (wrong + (a - b).abs(), whole + b);
    }
    (wrong, whole)
}
