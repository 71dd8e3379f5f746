//! Histogram of pixel errors divided by their thresholds (figure 7 of \[Herzog08\]).

use super::film::{Film, FilmFrame};
use perceptual::luminance;
use renderer::settings::Size;
use serde::Serialize;

/// Number of bins between 0 and [`HIGHEST`].
const BINS: usize = 40;
/// Upper end of the last bin, as a ratio. Larger ratios are counted separately.
const HIGHEST: f64 = 2.0;
/// Maximum number of sampled pixels. Larger films are subsampled evenly to fit in memory.
const MOST_PIXELS: usize = 1 << 21;
/// Minimum luminance of counted pixels, as a fraction of the picture's mean: for black pixels the ratio would be 0/0.
const DARK: f64 = 1e-4;

/// Histogram over pixels of the ratio of true error to threshold.
#[derive(Clone, Debug, Serialize)]
pub struct ErrorHistogram {
    /// Width of a bin, as a ratio.
    pub bin: f64,
    /// Fraction of pixels in each bin. These fractions and `above` sum to 1.
    pub shares: Vec<f64>,
    /// Mean ratio of threshold to luminance in each bin; null for empty bins.
    pub thresholds: Vec<Option<f64>>,
    /// Fraction of pixels with a ratio above the last bin.
    pub above: f64,
    /// Fraction of pixels with an error within their threshold.
    pub within: f64,
    /// Median of the ratio.
    pub median: f64,
    /// 95th percentile of the ratio.
    pub p95: f64,
}

/// Collects ratios of error to threshold, frame by frame.
pub struct Ratios {
    /// Ratio of error to threshold, and of threshold to luminance, for each pixel.
    pairs: Vec<(f64, f64)>,
    /// Permitted error of a pixel without a threshold, as a fraction of its luminance.
    otherwise: f64,
    /// Interval between sampled pixels.
    stride: usize,
    pixels: usize,
}

impl Ratios {
    /// Returns an empty collection for `frames` frames of `film`. The film's settings define the fraction for pixels
    /// without a threshold.
    pub fn of(film: &Film, frames: usize) -> Self {
        let otherwise = f64::from(film.settings.render.thresholds.share_elsewhere());
        let Size { width, height } = film.settings.render.size;
        // Make the interval odd, so that the samples do not repeat the same columns.
        let stride = (frames * width * height / MOST_PIXELS) | 1;
        Self { pairs: Vec::new(), otherwise, stride, pixels: 0 }
    }

    /// Adds the lit pixels of a frame, with the ratio |Y − Y_reference| / threshold.
    pub fn add(&mut self, frame: &FilmFrame, reference: &FilmFrame) {
        let truth = reference.radiance.map(|rgb| f64::from(luminance(rgb)));
        // Exclude almost black pixels: both their error and their threshold are near 0.
        let dark = DARK * truth.samples().iter().sum::<f64>() / truth.samples().len().max(1) as f64;
        let pixels = frame.radiance.samples().iter().zip(truth.samples()).zip(frame.thresholds.samples());
        // Continue the sampling interval across frames.
        let first = self.pixels.next_multiple_of(self.stride) - self.pixels;
        self.pixels += truth.samples().len();
        for ((&rgb, &y), &threshold) in pixels.skip(first).step_by(self.stride) {
            if y > dark {
                let threshold = if threshold > 0.0 { f64::from(threshold) } else { self.otherwise * y };
                self.pairs.push(((f64::from(luminance(rgb)) - y).abs() / threshold, threshold / y));
            }
        }
    }

    /// Returns the histogram of the ratios.
    pub fn histogram(self) -> ErrorHistogram {
        ErrorHistogram::from_pairs(self.pairs)
    }
}

impl ErrorHistogram {
    /// Returns the histogram of pairs: the ratio of error to threshold, and of threshold to luminance.
    fn from_pairs(mut pairs: Vec<(f64, f64)>) -> Self {
        // Sort by ratio, as quantiles and fractions below a limit require.
        pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
        let count = pairs.len().max(1) as f64;
        // Count the pixels and sum the thresholds in each bin.
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
        // Use ratios 0, 0.01, … 2.99 and thresholds of 0.1.
        let found = ErrorHistogram::from_pairs((0..300).map(|i| (f64::from(i) / 100.0, 0.1)).collect());
        assert!((found.shares.iter().sum::<f64>() + found.above - 1.0).abs() < 1e-12);
        assert!((found.above - 100.0 / 300.0).abs() < 1e-12 && (found.within - 101.0 / 300.0).abs() < 1e-12);
        assert!((found.median - 1.5).abs() < 1e-9 && (found.p95 - 2.85).abs() < 1e-9);
        assert!(found.thresholds.iter().all(|mean| (mean.unwrap() - 0.1).abs() < 1e-12));
        let nothing = ErrorHistogram::from_pairs(Vec::new());
        assert_eq!((nothing.median, nothing.within), (0.0, 0.0));
    }
}
