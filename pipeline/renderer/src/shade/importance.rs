//! Importance: how much people look at each pixel, 0…1. One map steers the samples of pixels, their thresholds and the bits of
//! macroblocks.
//!
//! ```text
//! v  = min(1, w_s S' + w_t T)                   importance
//! S' = steady([(S − M) / (P − M)]⁺)             S  saliency      M  its mean      P  its largest value, at least 0.1
//! |S'_t(x) − S'_(t−1)(x')| ≤ 1/8                x' the place of x in the frame before
//! n  = 1 + round((N − 1) v)                     samples of a pixel      N  the most
//! g  = G^(2v − 1)                               gain: thresholds are divided by it      G  gain of the most important pixels
//! ```
//! w_s and w_t are the user's, T is the task map. Saliency is that of the frame before, its light carried along the motion; where
//! nothing went before, that of the frame's own first sample, and thresholds are without gain.

use crate::frame::{Frame, PreparedFrame};
use crate::settings::{Importance, RenderSettings};
use perceptual::{ToneMap, luminance_plane, saliency, steady_saliency, task_map};
use pipeline::error::{Error, Result};
use pipeline::exposure::exposure_for;
use pipeline::state::NONSENSE;
use plane::{Correspondence, Plane};
use render_core::scene::Scene;
use serde::{Deserialize, Serialize};

/// The least P: no frame of noise, whose S is below 0.01, is stretched to the range of others. Frames of the shipped scenes have
/// 0.18 to 0.35.
const LEAST_PEAK: f32 = 0.1;
/// S' of a surface changes by no more from frame to frame: nothing becomes everything in 0.3 s at 25 frames a second, about as long
/// as the eye stays where it is. Saliency itself may jump where a second place comes up to the most salient one.
const MOST_CHANGE: f32 = 0.125;

/// Where people look in a frame, and the samples that its pixels have for it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct ImportanceMap {
    /// v.
    pub importance: Plane<f32>,
    /// n.
    pub samples: Plane<u8>,
}

impl ImportanceMap {
    fn new(importance: Plane<f32>, most_samples: u32) -> Self {
        let samples = importance.map(|v| 1 + ((most_samples - 1) as f32 * v).round() as u8);
        Self { importance, samples }
    }

    /// Pixels that have a sample with this number, from 0.
    pub fn wanted(&self, sample: usize) -> Plane<bool> {
        self.samples.map(|count| usize::from(count) > sample)
    }

    /// g.
    pub fn gain(&self, most: f32) -> Plane<f32> {
        self.importance.map(|v| most.powf(2.0 * v - 1.0))
    }

    /// Whether it is one of a picture of this size.
    pub fn fits(&self, width: usize, height: usize) -> bool {
        let (importance, samples) = (&self.importance, &self.samples);
        [(importance.width(), importance.height()), (samples.width(), samples.height())] == [(width, height); 2]
    }
}

/// Makes the importance map of frame after frame.
pub(super) struct Looking {
    weights: Importance,
    most_samples: u32,
    tone_map: ToneMap,
    before: Option<Before>,
    /// S' of the frame that is being lit.
    now: Option<Plane<f32>>,
}

/// The frame before, as its successor needs it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Before {
    /// n.
    samples: Plane<u8>,
    /// Radiance and S', where saliency is a part of importance.
    seen: Option<(Plane<[f32; 3]>, Plane<f32>)>,
}

impl Looking {
    /// For a film from its beginning.
    pub fn new(weights: Importance, settings: &RenderSettings) -> Self {
        let RenderSettings { samples, tone_map, .. } = *settings;
        Self { weights, most_samples: samples, tone_map, before: None, now: None }
    }

    /// The map of a frame that has no light yet; none where that takes its own light.
    pub fn ahead(&mut self, prepared: &PreparedFrame) -> Option<ImportanceMap> {
        if self.weights.saliency > 0.0 {
            let (radiance, _) = self.before.as_ref()?.seen.as_ref()?;
            let carried = carried(radiance, prepared.correspondence.as_deref()?);
            self.now = Some(self.salient(&carried, prepared.correspondence.as_deref()));
        }
        Some(self.map(&prepared.frame))
    }

    /// The map of a frame whose pixels show this radiance, in its first sample.
    pub fn at(&mut self, prepared: &PreparedFrame, radiance: &Plane<[f32; 3]>) -> ImportanceMap {
        self.now = Some(self.salient(radiance, prepared.correspondence.as_deref()));
        self.map(&prepared.frame)
    }

    /// Keeps what the next frame needs of this one. A frame whose light stayed has the saliency of the one before.
    pub fn keep(&mut self, map: &ImportanceMap, radiance: &Plane<[f32; 3]>) {
        let seen = match self.now.take() {
            Some(saliency) => Some((radiance.clone(), saliency)),
            None => self.before.take().and_then(|before| before.seen),
        };
        self.before = Some(Before { samples: map.samples.clone(), seen });
    }

    /// Mean difference of the samples of pixels from those that the same surface had in the frame before; none where nothing was
    /// seen before.
    pub fn change(&self, map: &ImportanceMap, known: Option<&Correspondence>) -> Option<f64> {
        let before = self.before.as_ref()?.samples.samples();
        let (mut sum, mut count) = (0u64, 0u64);
        for (&now, &index) in map.samples.samples().iter().zip(known?.matches().samples()) {
            if let Some(&then) = before.get(index as usize) {
                sum += u64::from(now.abs_diff(then));
                count += 1;
            }
        }
        (count > 0).then(|| sum as f64 / count as f64)
    }

    /// For a checkpoint.
    pub fn state(&self) -> Option<&Before> {
        self.before.as_ref()
    }

    /// Continues after a frame of this size from its [`state`](Self::state).
    pub fn restore(&mut self, before: Option<Before>, size: (usize, usize)) -> Result<()> {
        // Forged planes are of other sizes.
        let fits = |before: &Before| {
            let seen = before.seen.as_ref();
            (before.samples.width(), before.samples.height()) == size
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

    /// v and n, by the saliency of now and the task map of `frame`.
    fn map(&self, frame: &Frame) -> ImportanceMap {
        let Importance { saliency, task } = self.weights;
        let (width, height) = (frame.seen.pixels.width(), frame.seen.pixels.height());
        let mut importance = Plane::filled(width, height, 0.0);
        if let Some(now) = &self.now {
            add(&mut importance, saliency, now);
        }
        if task > 0.0 {
            add(&mut importance, task, &watched(frame));
        }
        ImportanceMap::new(importance.map(|v| v.min(1.0)), self.most_samples)
    }

    /// S' of a picture of this radiance, steady along the motion from the frame before.
    fn salient(&self, radiance: &Plane<[f32; 3]>, known: Option<&Correspondence>) -> Plane<f32> {
        // Display values, at an exposure of the picture's own: the film's is set later.
        let tone_map = self.tone_map.with_exposure(exposure_for(&luminance_plane(radiance)));
        let display = radiance.map(|rgb| rgb.map(|linear| tone_map.encode(linear)));
        let found = saliency(&display, known.map(motion).as_ref());

        // Stretched to 0…1: what is no more salient than the mean has nothing.
        let mean = found.samples().iter().sum::<f32>() / found.samples().len().max(1) as f32;
        let peak = found.samples().iter().copied().fold(LEAST_PEAK, f32::max);
        let range = (peak - mean).max(f32::MIN_POSITIVE);
        let stretched = found.map(|s| ((s - mean) / range).clamp(0.0, 1.0));
        match (self.before.as_ref().and_then(|before| before.seen.as_ref()), known) {
            (Some((_, before)), Some(known)) => limited(steady_saliency(&stretched, before, known), before, known),
            _ => stretched,
        }
    }
}

/// A map that differs from that of the frame `before` by no more than it may, where a surface was seen there.
fn limited(mut map: Plane<f32>, before: &Plane<f32>, known: &Correspondence) -> Plane<f32> {
    for (value, &index) in map.samples_mut().iter_mut().zip(known.matches().samples()) {
        if let Some(then) = before.samples().get(index as usize) {
            *value = value.clamp(then - MOST_CHANGE, then + MOST_CHANGE);
        }
    }
    map
}

/// Adds a map with its weight.
fn add(sum: &mut Plane<f32>, weight: f32, map: &Plane<f32>) {
    for (sum, value) in sum.samples_mut().iter_mut().zip(map.samples()) {
        *sum += weight * value;
    }
}

/// T of a frame, for the nodes that the scene's settings name.
fn watched(frame: &Frame) -> Plane<f32> {
    let scene: &Scene = frame.surfaces.scene();
    let mut is_watched = vec![false; scene.instances.len()];
    for name in &scene.settings.importance.nodes {
        for (watched, is_under) in is_watched.iter_mut().zip(scene.instances_under(name)) {
            *watched |= is_under;
        }
    }
    let pixels = &frame.seen.pixels;
    let shown = pixels.map(|pixel| is_watched.get(pixel.instance as usize) == Some(&true));
    task_map(&shown, scene.settings.importance.pixels_per_degree(pixels.width()))
}

/// The picture before, where its surfaces are now. A pixel whose surface was not seen has what was at its place.
fn carried(before: &Plane<[f32; 3]>, known: &Correspondence) -> Plane<[f32; 3]> {
    let samples = before.samples();
    Plane::from_fn(before.width(), before.height(), |x, y| {
        let own = (y * before.width() + x) as u32;
        samples[known.match_of(x, y).unwrap_or(own) as usize]
    })
}

/// Motion of every pixel. One that was not seen before moves like the last one that was, in raster order.
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

    /// A surface that was not seen before takes the light that was at its place, and moves like its neighbor.
    #[test]
    fn light_and_motion_are_carried_where_they_are_known() {
        let before = Plane::from_fn(3, 1, |x, _| [x as f32; 3]);
        let known = Correspondence::from_motion(Plane::from_vec(3, 1, vec![[1.0, 0.0], [1.0, 0.0], [f32::NAN; 2]]));
        assert_eq!(carried(&before, &known).samples(), [[1.0; 3], [2.0; 3], [2.0; 3]]);
        assert_eq!(motion(&known).samples(), [[1.0, 0.0]; 3]);
    }
}
