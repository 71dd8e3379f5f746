//! Budget of light for pictures in motion and for the first pictures of a static view.

/// Target time of a picture in motion \[s\], so that pictures follow inputs soon.
const IN_MOTION: f64 = 0.06;
/// Minimum, first and maximum fraction of the pixels for which light is computed in a picture in motion. Indirect
/// light has a quarter of it: with 1 %, ceilings of `conference` are blotchy in motion, but pictures take 0.1 s.
const SHARES: [f32; 3] = [0.01, 0.02, 0.25];
/// Target time of a picture of a static view that computes the light left out in motion \[s\].
const AT_REST: f64 = 1.0;
/// Minimum fraction of the pixels in such a picture.
const LEAST_AT_REST: f32 = 0.05;
/// Bounds of the change of a fraction from picture to picture.
const CHANGES: (f64, f64) = (0.5, 1.25);

/// Budget of pictures in motion and of the first pictures of a static view, from the time that earlier pictures took.
#[derive(Clone, Copy, Debug)]
pub(super) struct Budget {
    in_motion: f32,
    at_rest: f32,
}

impl Default for Budget {
    fn default() -> Self {
        Self { in_motion: SHARES[1], at_rest: 1.0 }
    }
}

impl Budget {
    /// Returns the fraction of the pixels for which light is computed in a picture in motion.
    pub fn in_motion(&self) -> f32 {
        self.in_motion
    }

    /// Returns the fraction for pictures of a static view, until all pixels are lit within their thresholds; `None` to
    /// light all of them at once. All of them share more records than the same pixels in several pictures.
    pub fn at_rest(&self) -> Option<f32> {
        (self.at_rest < 1.0).then_some(self.at_rest)
    }

    /// Adapts the budget to a picture in motion that took `seconds`. `open_share` is the fraction of the pixels that it
    /// left with larger errors than permitted.
    pub fn note_in_motion(&mut self, seconds: f64, open_share: f64) {
        let change = change(IN_MOTION, seconds);
        // A picture without open pixels did not use its budget.
        if open_share > 0.0 || change < 1.0 {
            self.in_motion = (self.in_motion * change).clamp(SHARES[0], SHARES[2]);
        }
    }

    /// Adapts the budget to a picture of a static view that took `seconds`.
    pub fn note_at_rest(&mut self, seconds: f64) {
        self.at_rest = (self.at_rest * change(AT_REST, seconds)).clamp(LEAST_AT_REST, 1.0);
    }
}

/// Returns the factor for the fraction of a picture that took `seconds` instead of `target`.
fn change(target: f64, seconds: f64) -> f32 {
    (target / seconds.max(1e-3)).clamp(CHANGES.0, CHANGES.1) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slow_pictures_reduce_the_budget_down_to_a_minimum() {
        let mut budget = Budget::default();
        (0..20).for_each(|_| budget.note_in_motion(0.5, 0.3));
        assert_eq!(budget.in_motion(), SHARES[0]);
        (0..20).for_each(|_| budget.note_in_motion(0.01, 0.3));
        assert_eq!(budget.in_motion(), SHARES[2]);
        // A budget that was not used up does not grow.
        budget.note_in_motion(0.12, 0.0);
        budget.note_in_motion(0.01, 0.0);
        assert_eq!(budget.in_motion(), SHARES[2] / 2.0);
    }

    #[test]
    fn static_views_are_lit_at_once_unless_that_takes_long() {
        let mut budget = Budget::default();
        budget.note_at_rest(0.5);
        assert_eq!(budget.at_rest(), None);
        budget.note_at_rest(1.6);
        assert_eq!(budget.at_rest(), Some(0.625));
        (0..20).for_each(|_| budget.note_at_rest(5.0));
        assert_eq!(budget.at_rest(), Some(LEAST_AT_REST));
        (0..20).for_each(|_| budget.note_at_rest(0.1));
        assert_eq!(budget.at_rest(), None);
    }
}
