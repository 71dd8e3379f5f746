//! How the errors of pixels lie beside the thresholds that they were allowed (figure 7 of \[Herzog08\]).

use super::film::{Film, FilmFrame};
use perceptual::luminance;
use renderer::settings::Size;
use serde::Serialize;

/// Bins between 0 and [`HIGHEST`].
const BINS: usize = 40;
/// Ratio where the last bin ends; what lies above is counted apart.
const HIGHEST: f64 = 2.0;
/// Most pixels that are taken; of more, some are left out, evenly: all of a film would not fit.
const MOST_PIXELS: usize = 1 << 21;
/// Pixels darker than this share of the picture's mean do not count: 0/0 says nothing.
const DARK: f64 = 1e-4;

/// Shares of pixels by the ratio of true error to threshold.
#[derive(Clone, Debug, Serialize)]
pub struct ErrorHistogram {
    /// Width of a bin.
    pub bin: f64,
    /// Share of pixels in each; they sum to 1 with `above`.
    pub shares: Vec<f64>,
    /// Mean threshold by luminance in each bin; null in empty ones.
    pub thresholds: Vec<Option<f64>>,
    /// Share of pixels beyond the last bin.
    pub above: f64,
    /// Share of pixels that keep their threshold.
    pub within: f64,
    /// Half of the pixels lie below.
    pub median: f64,
    /// 95 in a hundred lie below.
    pub p95: f64,
}

/// Gathers ratios of error to threshold, frame by frame.
pub struct Ratios {
    /// Each with its threshold by luminance.
    pairs: Vec<(f64, f64)>,
    /// Share of its luminance that a pixel without a threshold may be wrong by.
    otherwise: f64,
    /// One pixel in this number is taken.
    stride: usize,
    pixels: usize,
}

impl Ratios {
    /// For `frames` of `film`. A film of fixed thresholds has its own share.
    pub fn of(film: &Film, frames: usize) -> Self {
        let otherwise = f64::from(film.settings.render.thresholds.share_elsewhere());
        let Size { width, height } = film.settings.render.size;
        // Odd, so that not the same columns are taken again and again.
        let stride = (frames * width * height / MOST_PIXELS) | 1;
        Self { pairs: Vec::new(), otherwise, stride, pixels: 0 }
    }

    /// Takes the lit pixels of a frame: |Y − Y of the reference| by threshold.
    pub fn add(&mut self, frame: &FilmFrame, reference: &FilmFrame) {
        let truth = reference.radiance.map(|rgb| f64::from(luminance(rgb)));
        let dark = DARK * truth.samples().iter().sum::<f64>() / truth.samples().len().max(1) as f64;
        let pixels = frame.radiance.samples().iter().zip(truth.samples()).zip(frame.thresholds.samples());
        let first = self.pixels.next_multiple_of(self.stride) - self.pixels;
        self.pixels += truth.samples().len();
        let taken = pixels.skip(first).step_by(self.stride);
        self.pairs.extend(taken.filter(|((_, y), _)| **y > dark).map(|((&rgb, &y), &threshold)| {
            let threshold = if threshold > 0.0 { f64::from(threshold) } else { self.otherwise * y };
            ((f64::from(luminance(rgb)) - y).abs() / threshold, threshold / y)
        }));
    }

    /// The histogram of the ratios.
    pub fn histogram(self) -> ErrorHistogram {
        ErrorHistogram::from_pairs(self.pairs)
    }
}

impl ErrorHistogram {
    /// From ratios of error to threshold, each with its threshold by luminance.
    fn from_pairs(mut pairs: Vec<(f64, f64)>) -> Self {
        pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
        let count = pairs.len().max(1) as f64;
        let (mut members, mut sums) = ([0usize; BINS], [0.0; BINS]);
        for &(ratio, threshold) in pairs.iter().filter(|(ratio, _)| *ratio < HIGHEST) {
            let bin = ((ratio / HIGHEST * BINS as f64) as usize).min(BINS - 1);
            members[bin] += 1;
            sums[bin] += threshold;
        }
        let below = |limit: f64| pairs.partition_point(|&(ratio, _)| ratio <= limit) as f64 / count;
        let quantile =
            |share: f64| pairs.get((share * count) as usize).or(pairs.last()).map_or(0.0, |&(ratio, _)| ratio);
        Self {
            bin: HIGHEST / BINS as f64,
            shares: members.iter().map(|&n| n as f64 / count).collect(),
            thresholds: members.iter().zip(sums).map(|(&n, sum)| (n > 0).then(|| sum / n as f64)).collect(),
            above: 1.0 - members.iter().sum::<usize>() as f64 / count,
            within: below(1.0),
            median: quantile(0.5),
            p95: quantile(0.95),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_and_quantiles_of_known_ratios() {
        // Ratios 0, 0.01, … 2.99; thresholds of 0.1.
        let found = ErrorHistogram::from_pairs((0..300).map(|i| (f64::from(i) / 100.0, 0.1)).collect());
        assert!((found.shares.iter().sum::<f64>() + found.above - 1.0).abs() < 1e-12);
        assert!((found.above - 100.0 / 300.0).abs() < 1e-12 && (found.within - 101.0 / 300.0).abs() < 1e-12);
        assert!((found.median - 1.5).abs() < 1e-9 && (found.p95 - 2.85).abs() < 1e-9);
        assert!(found.thresholds.iter().all(|mean| (mean.unwrap() - 0.1).abs() < 1e-12));
        let nothing = ErrorHistogram::from_pairs(Vec::new());
        assert_eq!((nothing.median, nothing.within), (0.0, 0.0));
    }
}
