//! Finds the quantiser with which a whole film has a given bit rate, by coding the film several times.
//!
//! ```text
//! ln(rate) is nearly a linear function of ln(quantiser_scale). The next pass is where the line through the two nearest passes
//! meets the rate, within the interval that all passes have left.
//! ```

/// A quantiser_scale and the resulting bit rate.
#[derive(Clone, Copy, Debug)]
struct Pass {
    quantiser_scale: f64,
    bits_per_second: f64,
}

impl Pass {
    /// Returns the logarithm of the ratio of this pass's rate to `rate`.
    fn excess(&self, rate: f64) -> f64 {
        (self.bits_per_second / rate).ln()
    }
}

/// Searches for the quantiser_scale with which a film has a given mean bit rate.
///
/// Each pass codes the film at constant quality. A good first guess needs two passes, and more than four are rare. Constant
/// quality is the best use of bits unless a channel with constant rate and small buffer limits them.
/// [`Rate::Capped`](crate::Rate::Capped) additionally limits a decoder's reading rate.
///
/// ```
/// use mpeg2enc::{Config, FrameRate, Passes, Picture};
/// use plane::Plane;
///
/// let noise = |x: usize, y: usize, time: usize| (x * 37 + y * 91 + x * y * (7 + time)) as u8 / 2;
/// let frames: Vec<Picture> = (0..12)
///     .map(|time| {
///         let luma = Plane::from_fn(64, 64, |x, y| noise(x, y, time));
///         Picture::new(luma, Plane::filled(32, 32, 128), Plane::filled(32, 32, 128))
///     })
///     .collect::<Result<_, _>>()?;
/// let mut passes = Passes::new(300_000);
/// let mut next = Some(8.0);
/// while let Some(quantiser_scale) = next {
///     let config = Config::new(64, 64, FrameRate::FPS_25).with_lookahead(30).with_mean_quantiser_scale(quantiser_scale);
///     let mut encoder = config.encoder()?;
///     let mut bits: u64 = frames.iter().flat_map(|frame| encoder.push(frame, Default::default())).map(|p| p.bits).sum();
///     bits += encoder.finish().packets.iter().map(|packet| packet.bits).sum::<u64>();
///     next = passes.next(quantiser_scale, bits as f64 / 12.0 * 25.0);
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
#[must_use = "passes compute the next quantiser"]
pub struct Passes {
    bits_per_second: f64,
    done: Vec<Pass>,
}

impl Passes {
    /// Acceptable relative deviation from the requested rate.
    pub const NEAR: f64 = 0.005;
    /// Maximum number of passes.
    const MOST: usize = 8;
    /// Relative difference between two quantisers below which their codes are equal.
    const SAME: f64 = 1.0 / 4096.0;

    /// Starts a search for this rate.
    pub fn new(bits_per_second: u32) -> Self {
        Self { bits_per_second: f64::from(bits_per_second.max(1)), done: Vec::new() }
    }

    /// Records the bit rate of a pass and returns the quantiser_scale of the next one. `None` ends the search: the last pass was
    /// near enough, or no better pass exists.
    pub fn next(&mut self, quantiser_scale: f64, bits_per_second: f64) -> Option<f64> {
        let pass = Pass { quantiser_scale, bits_per_second: bits_per_second.max(1.0) };
        self.done.push(pass);
        if self.distance(&pass) <= Self::NEAR {
            return None;
        }
        let tried = |scale: f64| self.done.iter().any(|pass| (pass.quantiser_scale / scale).ln().abs() < Self::SAME);
        let next = self.estimate();
        if self.done.len() < Self::MOST && !tried(next) {
            return Some(next);
        }
        // The best pass cannot be improved: repeat it, unless it was the last.
        let best = self.done.iter().min_by(|a, b| self.distance(a).total_cmp(&self.distance(b))).copied()?;
        (best.quantiser_scale != quantiser_scale).then_some(best.quantiser_scale)
    }

    fn distance(&self, pass: &Pass) -> f64 {
        (pass.bits_per_second / self.bits_per_second - 1.0).abs()
    }

    fn estimate(&self) -> f64 {
        let excess = |pass: &Pass| pass.excess(self.bits_per_second);
        // Find the coarsest quantiser that took too many bits, and the finest one that took too few.
        let too_fine = self.done.iter().filter(|pass| excess(pass) > 0.0).map(|pass| pass.quantiser_scale);
        let too_coarse = self.done.iter().filter(|pass| excess(pass) <= 0.0).map(|pass| pass.quantiser_scale);
        let (low, high) = (too_fine.reduce(f64::max), too_coarse.reduce(f64::min));
        let mut nearest = self.done.clone();
        nearest.sort_by(|a, b| excess(a).abs().total_cmp(&excess(b).abs()));
        // Until two passes exist, assume that bits are inversely proportional to the quantiser.
        let slope = match nearest[..] {
            [a, b, ..] => (excess(&a) - excess(&b)) / (a.quantiser_scale / b.quantiser_scale).ln(),
            _ => -1.0,
        };
        // Replace a slope that is too flat to be plausible.
        let slope = if slope < -0.2 { slope } else { -1.0 };
        let next = nearest[0].quantiser_scale * (-excess(&nearest[0]) / slope).exp();
        // Bisect the interval in logarithms if the line leaves it.
        match (low, high) {
            (Some(low), Some(high)) if next <= low || high <= next => (low * high).sqrt(),
            _ => next.clamp(1.0, 112.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Runs passes over a film with the bit rate `rate(quantiser_scale)`.
    fn search(wanted: u32, rate: impl Fn(f64) -> f64) -> Vec<(f64, f64)> {
        let (mut passes, mut next, mut all) = (Passes::new(wanted), Some(8.0), Vec::new());
        while let Some(scale) = next {
            assert!((1.0..=112.0).contains(&scale));
            all.push((scale, rate(scale)));
            next = passes.next(scale, rate(scale));
        }
        all
    }

    #[test]
    fn powers_are_found_at_once() {
        for power in [0.6, 1.0, 1.4] {
            for scale in [2.0f64, 5.0, 30.0, 100.0] {
                let rate = |q: f64| 8e6 / q.powf(power);
                let passes = search(rate(scale) as u32, rate);
                assert!((passes.last().unwrap().0 / scale - 1.0).abs() <= 0.01 && passes.len() <= 4, "{passes:?}");
            }
        }
    }

    #[test]
    fn what_bends_and_has_steps_is_come_near() {
        // Test a constant rate of headers, and quantisers in steps of a 64th.
        let rate = |q: f64| 2e5 + 6e6 / (64.0 * q).round() * 64.0;
        for wanted in [300_000, 500_000, 2_000_000, 5_000_000] {
            let passes = search(wanted, rate);
            assert!((passes.last().unwrap().1 / f64::from(wanted) - 1.0).abs() <= 0.016, "{passes:?}");
        }
        // With integer quantisers only, the last pass uses the nearest one tried.
        let whole = |q: f64| 6e6 / q.round();
        let passes = search(1_400_000, whole);
        assert_eq!(passes.last().unwrap().1, whole(4.0), "{passes:?}");
        assert!(passes.len() <= Passes::MOST + 1);
    }

    #[test]
    fn what_no_quantiser_reaches_ends_at_the_last() {
        for (wanted, scale) in [(100_000_000, 1.0), (100, 112.0)] {
            let passes = search(wanted, |q| 8e6 / q);
            assert!(passes.last().unwrap().0 == scale && passes.len() <= 3, "{passes:?}");
        }
    }
}
