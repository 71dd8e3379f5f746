//! Default weighting matrices of MPEG-2 (ISO/IEC 13818-2, 6.3.11), in raster order. The weight of horizontal
//! frequency u and vertical frequency v has index 8 · v + u.
//!
//! A quantiser step is weight · quantiser_scale / 16 code values of the orthonormal [`dct`](crate::dct()).
//!
//! ```
//! use plane::matrices::{DEFAULT_INTRA_MATRIX, DEFAULT_NON_INTRA_MATRIX};
//! assert_eq!((DEFAULT_INTRA_MATRIX[63], DEFAULT_NON_INTRA_MATRIX[63]), (83, 16));
//! ```

/// Default weighting matrix of intra blocks.
#[rustfmt::skip]
pub const DEFAULT_INTRA_MATRIX: [u8; 64] = [
     8, 16, 19, 22, 26, 27, 29, 34,
    16, 16, 22, 24, 27, 29, 34, 37,
    19, 22, 26, 27, 29, 34, 34, 38,
    22, 22, 26, 27, 29, 34, 37, 40,
    22, 26, 27, 29, 32, 35, 40, 48,
    26, 27, 29, 32, 35, 40, 48, 58,
    26, 27, 29, 34, 38, 46, 56, 69,
    27, 29, 35, 38, 46, 56, 69, 83,
];

/// Default weighting matrix of predicted (non-intra) blocks.
pub const DEFAULT_NON_INTRA_MATRIX: [u8; 64] = [16; 64];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_grow_with_frequency() {
        for (i, &weight) in DEFAULT_INTRA_MATRIX.iter().enumerate() {
            assert!(i % 8 == 7 || weight <= DEFAULT_INTRA_MATRIX[i + 1], "{i}");
            assert!(i / 8 == 7 || weight <= DEFAULT_INTRA_MATRIX[i + 8], "{i}");
        }
        assert_eq!(DEFAULT_INTRA_MATRIX[..2], [8, 16]);
    }
}
