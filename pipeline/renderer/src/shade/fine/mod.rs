//! Further samples of single pixels, where light changes within a pixel.
//!
//! ```text
//! n = 1       if the pixel is not rough (`rough.rs`)
//! n = 4       if it is
//! n = 8       if the first four samples differ by more than S
//! ```
//! The first sample is at the center. Further samples compute direct light and reflections in smooth coats, with a
//! quarter of the points and rays, because a pixel has at least four. Other light varies slowly, and comes from the first
//! samples (`first.rs`), without isolated points (`isolated.rs`). A pixel shows the mean of its samples after tone
//! mapping, like the surfaces in a pixel at an outline.

mod first;
mod isolated;
mod rough;

use super::sample::Sample;
pub(super) use first::FirstSample;
use glam::Vec3;
pub(super) use isolated::even_out_points;
use perceptual::PixelFragment;
use pipeline::stage::Outline;
use plane::Plane;
use render_core::{PixelSample, sample_offsets};
pub(super) use rough::{CodeCurve, rough_pixels};
use serde::{Deserialize, Serialize};

/// Number of samples of a rough pixel, and of a pixel in which these differ.
const COUNTS: [usize; 2] = [4, 8];
/// Difference S between the first samples above which a pixel has more \[codes\]. With 48 instead of 24, `atrium` at
/// 256×256 has 345 instead of 305 pixels that differ from 16 rays per pixel by more than 30 codes.
const SPREAD: f32 = 24.0;

/// Pixels with several samples, and the light of these.
#[derive(Serialize, Deserialize)]
pub(super) struct FinePixels {
    /// Indices of the pixels, ascending.
    pixels: Vec<u32>,
    /// Number of samples of each pixel.
    counts: Vec<u8>,
    /// Light of each sample, in rows of one value per pixel.
    samples: Vec<Sample>,
}

impl FinePixels {
    /// Creates the fine `pixels`, given by ascending index. `first` is the light of the pixel centers.
    pub fn new(pixels: Vec<u32>, first: &Sample) -> Self {
        let counts = vec![1; pixels.len()];
        let mut fine = Self { pixels, counts, samples: Vec::new() };
        fine.keep(first);
        fine
    }

    /// Returns the number of samples so far.
    pub fn count(&self) -> usize {
        self.samples.len()
    }

    /// Returns the position of the next sample, and the pixels of a picture of this size that have it; `None` if all
    /// pixels are complete.
    pub fn next(&self, width: usize, height: usize, curve: &CodeCurve) -> Option<(PixelSample, Plane<bool>)> {
        let number = self.samples.len();
        let count = *COUNTS.iter().find(|&&count| number < count)?;
        // After the first samples, continue only where these differ.
        let spread = (number == COUNTS[0]).then(|| self.spread(curve));
        let mut wanted = Plane::filled(width, height, false);
        let mut is_any = false;
        for (place, &pixel) in self.pixels.iter().enumerate() {
            let has_previous = usize::from(self.counts[place]) == number;
            if has_previous && spread.as_ref().is_none_or(|spread| spread[place] > SPREAD) {
                wanted.samples_mut()[pixel as usize] = true;
                is_any = true;
            }
        }
        is_any.then(|| (PixelSample::one_of(count, sample_offsets(count)[number]), wanted))
    }

    /// Adds the light of the next sample for the `wanted` pixels.
    pub fn add(&mut self, light: &Sample, wanted: &Plane<bool>) {
        for (count, &pixel) in self.counts.iter_mut().zip(&self.pixels) {
            *count += u8::from(wanted.samples()[pixel as usize]);
        }
        self.keep(light);
    }

    fn keep(&mut self, light: &Sample) {
        let of = |light: &Plane<Vec3>| {
            let values = self.pixels.iter().map(|&pixel| light.samples()[pixel as usize]).collect();
            Plane::from_vec(self.pixels.len(), 1, values)
        };
        self.samples.push(Sample { direct: of(&light.direct), indirect: of(&light.indirect) });
    }

    /// Returns whether all pixels are in a picture of `pixels` pixels, with light for each.
    pub fn fits(&self, pixels: usize) -> bool {
        let is_row = |row: &Plane<Vec3>| (row.width(), row.height()) == (self.pixels.len(), 1);
        self.pixels.iter().all(|&pixel| (pixel as usize) < pixels)
            && self.counts.len() == self.pixels.len()
            && self.counts.iter().all(|&count| (1..=self.samples.len()).contains(&count.into()))
            && self.samples.iter().all(|sample| is_row(&sample.direct) && is_row(&sample.indirect))
    }

    /// Replaces the fine pixels of `picture` by the mean of their samples.
    pub fn put(&self, of: &impl Fn(&Sample) -> Plane<Vec3>, picture: &mut Plane<[f32; 3]>) {
        let rows: Vec<Plane<Vec3>> = self.samples.iter().map(of).collect();
        for (place, (&pixel, &count)) in self.pixels.iter().zip(&self.counts).enumerate() {
            let sum: Vec3 = rows[..count.into()].iter().map(|row| row.samples()[place]).sum();
            picture.samples_mut()[pixel as usize] = (sum / f32::from(count)).to_array();
        }
    }

    /// Returns whether `pixel` is a fine pixel.
    pub fn contains(&self, pixel: usize) -> bool {
        self.pixels.binary_search(&(pixel as u32)).is_ok()
    }

    /// Returns the fine pixels, with an equal share for each sample.
    pub fn outlines(&self) -> impl Iterator<Item = Outline> {
        let rows: Vec<Plane<Vec3>> = self.samples.iter().map(Sample::whole).collect();
        self.pixels.iter().zip(&self.counts).enumerate().map(move |(place, (&pixel, &count))| {
            let share = 1.0 / f32::from(count);
            let part = |row: &Plane<Vec3>| PixelFragment { share, radiance: row.samples()[place].to_array() };
            Outline { pixel: pixel as usize, parts: rows[..count.into()].iter().map(part).collect() }
        })
    }

    /// Returns the mean number of samples in a picture of `pixels` pixels.
    pub fn mean_count(&self, pixels: usize) -> f64 {
        let further: u64 = self.counts.iter().map(|&count| u64::from(count) - 1).sum();
        1.0 + further as f64 / pixels.max(1) as f64
    }

    /// Returns the range of each pixel's first samples \[codes\].
    fn spread(&self, curve: &CodeCurve) -> Vec<f32> {
        let rows: Vec<Plane<f32>> = self.samples[..COUNTS[0]].iter().map(|row| curve.codes(&row.whole())).collect();
        let mut spread = Vec::new();
        for place in 0..self.pixels.len() {
            let of_pixel = || rows.iter().map(|row| row.samples()[place]);
            spread.push(of_pixel().fold(0.0, f32::max) - of_pixel().fold(f32::INFINITY, f32::min));
        }
        spread
    }
}
