//! Importance: the likelihood that viewers look at a pixel, 0…1. One map determines samples per pixel, thresholds and
//! the bits of macroblocks.
//!
//! ```text
//! v  = min(1, w_s S' + w_t T + w_e E + w_c C + w_f F)      importance
//! S' = steady([(S − M) / (P − M)]⁺)             S  saliency      M  its mean      P  its maximum, at least M + 0.01
//! |S'_t(x) − S'_(t−1)(x')| ≤ 1/8                x' the position of x in the previous frame
//! n  = 1 + round((N − 1) v)                     samples of a pixel      N  maximum number
//! g  = G^(2v − 1)                               gain, which divides thresholds      G  gain at importance 1
//! ```
//! The user sets the weights w. T is the task map, E the [`edges`], C the predicted [`cost`], and F a map from a file.
//! Saliency comes from the previous frame's light, reprojected along the motion, and costs come from the previous frame.
//! Without a previous frame, both come from the first sample of the current frame, and thresholds have no gain.

mod cost;
mod edges;

use crate::frame::{Frame, PreparedFrame};
use crate::settings::{Importance, RenderSettings};
use cost::cost_map;
use edges::edge_map;
use perceptual::{ToneMap, luminance_plane, saliency, steady_saliency, task_map};
use pipeline::error::{Error, Result};
use pipeline::exposure::exposure_for;
use pipeline::state::NONSENSE;
use plane::{Correspondence, Plane};
use render_core::scene::Scene;
use serde::{Deserialize, Serialize};

/// Minimum of P − M, so that a frame of noise is not stretched to the full range. Noise with a standard deviation of
/// 0.01 has 0.001, a frame of Sibenik 0.0105 and one of `nave` 0.08 (128×128).
const LEAST_CONTRAST: f32 = 0.01;
/// Maximum change of a surface's S' between frames. A full change then takes 0.3 s at 25 frames/s, about the duration
/// of a fixation. S itself may jump when another region becomes as salient as the maximum.
const MOST_CHANGE: f32 = 0.125;

/// Importance of a frame's pixels, and the number of samples that follows from it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct ImportanceMap {
    /// Importance v of each pixel.
    pub importance: Plane<f32>,
    /// Number of samples n of each pixel.
    pub samples: Plane<u8>,
}

impl ImportanceMap {
    fn new(importance: Plane<f32>, most_samples: u32) -> Self {
        let samples = importance.map(|v| 1 + ((most_samples - 1) as f32 * v).round() as u8);
        Self { importance, samples }
    }

    /// Returns the pixels that have sample number `sample`, from 0.
    pub fn wanted(&self, sample: usize) -> Plane<bool> {
        self.samples.map(|count| usize::from(count) > sample)
    }

    /// Returns the gain g of each pixel. `most` is G.
    pub fn gain(&self, most: f32) -> Plane<f32> {
        self.importance.map(|v| most.powf(2.0 * v - 1.0))
    }

    /// Returns whether the map has `width` × `height` pixels.
    pub fn fits(&self, width: usize, height: usize) -> bool {
        let (importance, samples) = (&self.importance, &self.samples);
        [(importance.width(), importance.height()), (samples.width(), samples.height())] == [(width, height); 2]
    }
}

/// Computes the importance map of each frame.
pub(super) struct Looking {
    weights: Importance,
    most_samples: u32,
    tone_map: ToneMap,
    before: Option<Before>,
    /// Smoothed saliency S' of the current frame.
    now: Option<Plane<f32>>,
    /// Predicted costs C of the current frame.
    cost: Option<Plane<f32>>,
}

/// State of the previous frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Before {
    /// Number of samples n of each pixel.
    samples: Plane<u8>,
    /// Radiance and S' of each pixel; `None` if importance does not use saliency.
    seen: Option<(Plane<[f32; 3]>, Plane<f32>)>,
    /// Cost C of each pixel; `None` if importance does not use costs.
    cost: Option<Plane<f32>>,
}

/// Light of a frame from which importance is computed.
pub(super) struct SeenLight<'a> {
    /// Radiance of each pixel.
    pub radiance: &'a Plane<[f32; 3]>,
    /// Sizes of lightcuts at each pixel; `None` if no layer of light provides them.
    pub cut_sizes: Option<Vec<f32>>,
}

impl SeenLight<'_> {
    /// Returns the cost map of the light.
    fn cost(&self) -> Option<Plane<f32>> {
        let (width, height) = (self.radiance.width(), self.radiance.height());
        self.cut_sizes.as_ref().map(|sizes| cost_map(sizes, width, height))
    }
}

impl Looking {
    /// Creates the state of a film in which the maps are summed with `weights`.
    pub fn new(weights: &Importance, settings: &RenderSettings) -> Self {
        let RenderSettings { samples, tone_map, .. } = *settings;
        Self { weights: weights.clone(), most_samples: samples.most(), tone_map, before: None, now: None, cost: None }
    }

    /// Returns whether the cost map is in use, which needs the sizes of lightcuts.
    pub fn weighs_costs(&self) -> bool {
        self.weights.cost > 0.0
    }

    /// Returns the map of a frame before the frame is lit; `None` if the map requires the frame's own light.
    pub fn ahead(&mut self, prepared: &PreparedFrame) -> Option<ImportanceMap> {
        let before = self.before.as_ref().filter(|_| prepared.correspondence.is_some());
        if self.weights.needs_light() && before.is_none() {
            return None;
        }
        self.cost = before.and_then(|before| before.cost.clone());
        if self.weights.saliency > 0.0 {
            // Reproject the previous frame's light: the light of this frame is not computed yet.
            let (radiance, _) = self.before.as_ref()?.seen.as_ref()?;
            let reprojected = reprojected(radiance, prepared.correspondence.as_deref()?);
            self.now = Some(self.salient(&reprojected, prepared.correspondence.as_deref()));
        }
        Some(self.map(&prepared.frame))
    }

    /// Returns the map of a frame from its first sample.
    pub fn at(&mut self, prepared: &PreparedFrame, light: &SeenLight) -> ImportanceMap {
        if self.weights.saliency > 0.0 {
            self.now = Some(self.salient(light.radiance, prepared.correspondence.as_deref()));
        }
        self.cost = light.cost();
        self.map(&prepared.frame)
    }

    /// Keeps the state for the next frame. A frame with reused light keeps the previous S'.
    pub fn keep(&mut self, map: &ImportanceMap, light: &SeenLight) {
        let seen = match self.now.take() {
            Some(saliency) => Some((light.radiance.clone(), saliency)),
            None => self.before.take().and_then(|before| before.seen),
        };
        self.before = Some(Before { samples: map.samples.clone(), seen, cost: light.cost() });
    }

    /// Returns the mean absolute change in a surface's number of samples since the previous frame; `None` if no surface
    /// was visible in both frames.
    pub fn change(&self, map: &ImportanceMap, known: Option<&Correspondence>) -> Option<f64> {
        let before = self.before.as_ref()?.samples.samples();
        // Compare each surface with the pixel that showed it in the previous frame.
        let (mut sum, mut count) = (0u64, 0u64);
        for (&now, &index) in map.samples.samples().iter().zip(known?.matches().samples()) {
            if let Some(&then) = before.get(index as usize) {
                sum += u64::from(now.abs_diff(then));
                count += 1;
            }
        }
        (count > 0).then(|| sum as f64 / count as f64)
    }

    /// Returns the state for a checkpoint.
    pub fn state(&self) -> Option<&Before> {
        self.before.as_ref()
    }

    /// Continues from the [`state`](Self::state) after a frame of this `size`.
    pub fn restore(&mut self, before: Option<Before>, size: (usize, usize)) -> Result<()> {
        // Check the sizes: a forged state may contain planes of any size.
        let fits = |before: &Before| {
            let seen = before.seen.as_ref();
            (before.samples.width(), before.samples.height()) == size
                && before.cost.as_ref().is_none_or(|cost| (cost.width(), cost.height()) == size)
                && seen.is_none_or(|(radiance, saliency)| {
                    [(radiance.width(), radiance.height()), (saliency.width(), saliency.height())] == [size; 2]
                })
        };
        if !before.iter().all(fits) {
            return Err(Error::Checkpoint(NONSENSE.into()));
        }
        self.before = before;
        Ok(())
    }

    /// Returns v and n from the maps of `frame`, with the current saliency and costs.
    fn map(&self, frame: &Frame) -> ImportanceMap {
        let Importance { saliency, task, edges, cost, ref files } = self.weights;
        let (width, height) = (frame.seen.pixels.width(), frame.seen.pixels.height());
        let mut importance = Plane::filled(width, height, 0.0);
        if let Some(now) = &self.now {
            add(&mut importance, saliency, now);
        }
        if task > 0.0 {
            add(&mut importance, task, &watched(frame));
        }
        if edges > 0.0 {
            add(&mut importance, edges, &edge_map(&frame.seen));
        }
        if let Some(costs) = &self.cost {
            add(&mut importance, cost, costs);
        }
        if let Some(files) = files {
            add(&mut importance, files.weight(), &files.map(frame.index, width, height));
        }
        ImportanceMap::new(importance.map(|v| v.min(1.0)), self.most_samples)
    }

    /// Returns S' of a frame with this `radiance`, smoothed along the motion from the previous frame.
    fn salient(&self, radiance: &Plane<[f32; 3]>, known: Option<&Correspondence>) -> Plane<f32> {
        // Compute saliency from display values, with the frame's own exposure: the film's exposure is set later.
        let tone_map = self.tone_map.with_exposure(exposure_for(&luminance_plane(radiance)));
        let display = radiance.map(|rgb| rgb.map(|linear| tone_map.encode(linear)));
        let found = saliency(&display, known.map(motion).as_ref());

        // Stretch saliency to 0…1: values up to the mean become 0.
        let mean = found.samples().iter().sum::<f32>() / found.samples().len().max(1) as f32;
        let peak = found.samples().iter().copied().fold(0.0, f32::max);
        let range = (peak - mean).max(LEAST_CONTRAST);
        let stretched = found.map(|s| ((s - mean) / range).clamp(0.0, 1.0));
        match (self.before.as_ref().and_then(|before| before.seen.as_ref()), known) {
            (Some((_, before)), Some(known)) => limited(steady_saliency(&stretched, before, known), before, known),
            _ => stretched,
        }
    }
}

/// Limits the change from the map `before` on surfaces that were visible then.
fn limited(mut map: Plane<f32>, before: &Plane<f32>, known: &Correspondence) -> Plane<f32> {
    for (value, &index) in map.samples_mut().iter_mut().zip(known.matches().samples()) {
        if let Some(then) = before.samples().get(index as usize) {
            *value = value.clamp(then - MOST_CHANGE, then + MOST_CHANGE);
        }
    }
    map
}

/// Adds `map`, multiplied by `weight`, to `sum`.
fn add(sum: &mut Plane<f32>, weight: f32, map: &Plane<f32>) {
    for (sum, value) in sum.samples_mut().iter_mut().zip(map.samples()) {
        *sum += weight * value;
    }
}

/// Returns the task map T of a frame, for the nodes named in the scene's settings.
fn watched(frame: &Frame) -> Plane<f32> {
    let scene: &Scene = frame.surfaces.scene();
    let mut is_watched = vec![false; scene.instances.len()];
    for name in &scene.settings.importance.nodes {
        // Include all instances below the named node.
        for (watched, is_under) in is_watched.iter_mut().zip(scene.instances_under(name)) {
            *watched |= is_under;
        }
    }
    let pixels = &frame.seen.pixels;
    let shown = pixels.map(|pixel| is_watched.get(pixel.instance as usize) == Some(&true));
    task_map(&shown, scene.settings.importance.pixels_per_degree(pixels.width()))
}

/// Returns the previous frame's light at the current positions of the surfaces. Newly visible pixels keep their
/// previous light.
fn reprojected(before: &Plane<[f32; 3]>, known: &Correspondence) -> Plane<[f32; 3]> {
    let samples = before.samples();
    Plane::from_fn(before.width(), before.height(), |x, y| {
        let own = (y * before.width() + x) as u32;
        samples[known.match_of(x, y).unwrap_or(own) as usize]
    })
}

/// Returns the motion of every pixel. Newly visible pixels have the motion of the last visible pixel before them in
/// raster order.
fn motion(known: &Correspondence) -> Plane<[f32; 2]> {
    let mut last = [0.0; 2];
    Plane::from_fn(known.width(), known.height(), |x, y| {
        last = known.motion_of(x, y).unwrap_or(last);
        last
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_and_gain_follow_importance() {
        let importance = Plane::from_vec(5, 1, vec![0.0, 0.12, 0.13, 0.5, 1.0]);
        let map = ImportanceMap::new(importance, 5);
        assert_eq!(map.samples.samples(), [1, 1, 2, 3, 5]);
        assert_eq!(map.wanted(1).samples(), [false, false, true, true, true]);
        assert_eq!(map.wanted(4).samples(), [false, false, false, false, true]);
        let gain = map.gain(4.0);
        assert_eq!((gain.get(0, 0), gain.get(3, 0), gain.get(4, 0)), (0.25, 1.0, 4.0));
        assert!(map.gain(1.0).samples().iter().all(|&gain| gain == 1.0));
        assert!(map.fits(5, 1) && !map.fits(1, 5));
    }

    /// Checks that a newly visible surface has the previous light at its pixel, and the motion of its neighbor.
    #[test]
    fn light_and_motion_are_carried_where_they_are_known() {
        let before = Plane::from_fn(3, 1, |x, _| [x as f32; 3]);
        let known = Correspondence::from_motion(Plane::from_vec(3, 1, vec![[1.0, 0.0], [1.0, 0.0], [f32::NAN; 2]]));
        assert_eq!(reprojected(&before, &known).samples(), [[1.0; 3], [2.0; 3], [2.0; 3]]);
        assert_eq!(motion(&known).samples(), [[1.0, 0.0]; 3]);
    }
}
