//! Quantisers of pictures on demand.

use mpeg2enc::quantiser_scale_code;

/// Coarsest quantiser_scale.
pub const COARSEST: u32 = 112;

/// Returns the finest existing quantiser_scale that is at least `quantiser`, or the coarsest one. NaN is the coarsest.
#[must_use]
pub fn nearest_quantiser(quantiser: f64) -> u32 {
    // The conversion saturates, so values below 1 become 0, which does not exist.
    let least = if quantiser.is_nan() { COARSEST } else { quantiser.ceil() as u32 };
    (least..COARSEST).find(|&scale| quantiser_scale_code(scale).is_ok()).unwrap_or(COARSEST)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantisers_are_rounded_up_to_existing_ones() {
        assert!(quantiser_scale_code(COARSEST).is_ok() && quantiser_scale_code(COARSEST + 1).is_err());
        let around = [-3.0, 0.0, 8.2, 62.5, 105.0, 112.0, 500.0, f64::INFINITY, f64::NAN].map(nearest_quantiser);
        assert_eq!(around, [1, 1, 10, 64, 112, 112, 112, 112, 112]);
    }
}
