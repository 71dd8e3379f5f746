//! Quantisers of pictures on demand: the values of both tables of the standard, in ascending order.

/// Finest quantiser_scale.
pub const FINEST: u32 = 1;
/// Coarsest quantiser_scale.
pub const COARSEST: u32 = 112;

/// Values of quantiser_scale: even values to 62, and the non-linear ones (13818-2, Table 7-6).
const LADDER: [u32; 42] = [
    1, 2, 3, 4, 5, 6, 7, 8, 10, 12, 14, 16, 18, 20, 22, 24, 26, 28, 30, 32, 34, 36, 38, 40, 42, 44, 46, 48, 50, 52, 54,
    56, 58, 60, 62, 64, 72, 80, 88, 96, 104, 112,
];

/// Returns the finest existing quantiser_scale that is at least `quantiser`, or the coarsest one. NaN is the coarsest.
#[must_use]
pub fn nearest_quantiser(quantiser: f64) -> u32 {
    LADDER.into_iter().find(|&scale| f64::from(scale) >= quantiser).unwrap_or(COARSEST)
}

/// Returns the next coarser quantiser_scale, or the coarsest one.
#[must_use]
pub fn coarser_than(quantiser_scale: u32) -> u32 {
    nearest_quantiser(f64::from(quantiser_scale) + 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_value_exists_in_a_table_of_the_standard() {
        assert!(LADDER.is_sorted());
        for scale in LADDER {
            assert!(mpeg2enc::quantiser_scale_code(scale).is_ok(), "{scale}");
        }
        assert_eq!((LADDER[0], LADDER[41]), (FINEST, COARSEST));
        let around = [0.0, 8.2, 62.5, 105.0, 500.0, f64::NAN].map(nearest_quantiser);
        assert_eq!(around, [1, 10, 64, 112, 112, 112]);
        assert_eq!((coarser_than(8), coarser_than(112)), (10, 112));
    }
}
