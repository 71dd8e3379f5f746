//! Budget of light for pictures in motion, so that they follow inputs soon.

/// Target time of a picture in motion \[s\].
const TARGET: f64 = 0.06;
/// Minimum, first and maximum fraction of the pixels for which each layer of light is computed in a picture in motion.
/// With 1 %, `conference` shows no more blotches in motion than without a budget.
const SHARES: [f32; 3] = [0.01, 0.02, 0.25];
/// Bounds of the change of the fraction from picture to picture.
const CHANGES: (f64, f64) = (0.5, 1.25);
/// Multiple of the fraction for static views, and its minimum. Such pictures may take longer.
const AT_REST: (f32, f32) = (3.0, 0.05);

/// Budget of pictures in motion and of the first pictures of a static view, from the time that earlier pictures took.
#[derive(Clone, Copy, Debug)]
pub(super) struct Budget {
    share: f32,
}

impl Default for Budget {
    fn default() -> Self {
        Self { share: SHARES[1] }
    }
}

impl Budget {
    /// Returns the fraction of the pixels for which each layer of light is computed.
    pub fn in_motion(&self) -> f32 {
        self.share
    }

    /// Returns the fraction for pictures of a static view, until all pixels are lit within their thresholds.
    pub fn at_rest(&self) -> f32 {
        (AT_REST.0 * self.share).max(AT_REST.1)
    }

    /// Adapts the budget to a picture in motion that took `seconds`. `open_share` is the fraction of the pixels that it
    /// left with larger errors than permitted.
    pub fn note(&mut self, seconds: f64, open_share: f64) {
        let change = (TARGET / seconds.max(1e-3)).clamp(CHANGES.0, CHANGES.1) as f32;
        // A picture without open pixels did not use its budget.
        if open_share > 0.0 || change < 1.0 {
            self.share = (self.share * change).clamp(SHARES[0], SHARES[2]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slow_pictures_reduce_the_budget_down_to_a_minimum() {
        let mut budget = Budget::default();
        (0..20).for_each(|_| budget.note(0.5, 0.3));
        assert_eq!((budget.in_motion(), budget.at_rest()), (SHARES[0], AT_REST.1));
        (0..20).for_each(|_| budget.note(0.01, 0.3));
        assert_eq!(budget.in_motion(), SHARES[2]);
        // A budget that was not used up does not grow.
        budget.note(0.12, 0.0);
        budget.note(0.01, 0.0);
        assert_eq!(budget.in_motion(), SHARES[2] / 2.0);
    }
}
