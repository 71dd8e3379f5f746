//! A coded picture: coefficient levels, macroblock modes, quantiser scales and decoded luma.

use crate::{Picture, Plane, SizeError};
use std::sync::Arc;

/// Result of encoding a picture. A masking model reads it.
///
/// A macroblock covers 16×16 luma samples, a block 8×8. Macroblocks and blocks at the right and lower border may
/// extend beyond the picture. Names follow ISO/IEC 13818-2.
///
/// ```
/// use plane::{Coded, Picture, Plane};
/// use std::sync::Arc;
///
/// // A gray picture, coded intra with only the DC coefficient of every block.
/// let decoded = Arc::new(Picture::gray(Plane::filled(40, 24, 117)));
/// let coded = Coded::new(decoded, Plane::filled(5, 3, 1), Plane::filled(3, 2, true), Plane::filled(3, 2, 8))?;
/// assert_eq!(coded.luma().get(39, 23), 117);
/// assert_eq!(coded.levels().get(4, 2).count_ones(), 1);
/// # Ok::<(), plane::SizeError>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Coded {
    decoded: Arc<Picture>,
    levels: Plane<u64>,
    intra: Plane<bool>,
    quantiser_scales: Plane<u8>,
}

impl Coded {
    /// Combines a `decoded` picture with the `levels` of every block and, for every macroblock, its `intra` flag and
    /// quantiser_scale.
    ///
    /// # Errors
    /// If the size of `levels` is invalid: it must cover the blocks that begin in the picture, or all blocks of the
    /// macroblocks. If another plane does not have one sample per macroblock.
    pub fn new(
        decoded: Arc<Picture>,
        levels: Plane<u64>,
        intra: Plane<bool>,
        quantiser_scales: Plane<u8>,
    ) -> Result<Self, SizeError> {
        let (width, height) = (decoded.width(), decoded.height());
        let macroblocks = (width.div_ceil(16), height.div_ceil(16));
        SizeError::check("intra", &intra, macroblocks)?;
        SizeError::check("quantiser_scales", &quantiser_scales, macroblocks)?;
        // Accept levels of whole macroblocks, or only of the blocks that begin in the picture.
        let whole = (2 * macroblocks.0, 2 * macroblocks.1);
        SizeError::check("levels", &levels, whole)
            .or_else(|_| SizeError::check("levels", &levels, decoded.luma().block_counts()))?;
        Ok(Self { decoded, levels, intra, quantiser_scales })
    }

    /// Decoded picture, in display form.
    #[must_use]
    pub fn decoded(&self) -> &Arc<Picture> {
        &self.decoded
    }

    /// Decoded luma plane. Code value 16 is black, 235 white.
    #[must_use]
    pub fn luma(&self) -> &Plane<u8> {
        self.decoded.luma()
    }

    /// Nonzero coefficients of every luma block, as a bit set. Bit 8·v + u belongs to horizontal frequency u and
    /// vertical frequency v. The DC bit of an intra block is always set.
    #[must_use]
    pub fn levels(&self) -> &Plane<u64> {
        &self.levels
    }

    /// Intra flag of every macroblock: `true` if it is coded without a prediction.
    #[must_use]
    pub fn intra(&self) -> &Plane<bool> {
        &self.intra
    }

    /// quantiser_scale of every macroblock, 1 … 112.
    #[must_use]
    pub fn quantiser_scales(&self) -> &Plane<u8> {
        &self.quantiser_scales
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn planes_must_fit_the_picture() {
        let with = |levels: (usize, usize), intra: (usize, usize), scales: (usize, usize)| {
            let decoded = Arc::new(Picture::black(17, 9));
            let (levels, intra) = (Plane::filled(levels.0, levels.1, 0), Plane::filled(intra.0, intra.1, true));
            Coded::new(decoded, levels, intra, Plane::filled(scales.0, scales.1, 2))
        };
        assert!(with((3, 2), (2, 1), (2, 1)).is_ok(), "the blocks of the picture");
        assert!(with((4, 2), (2, 1), (2, 1)).is_ok(), "the blocks of its macroblocks");
        let error = |levels, intra, scales| with(levels, intra, scales).unwrap_err().to_string();
        assert_eq!(error((3, 1), (2, 1), (2, 1)), "levels has 3x1 samples and needs 3x2");
        assert_eq!(error((3, 2), (1, 1), (2, 1)), "intra has 1x1 samples and needs 2x1");
        assert_eq!(error((3, 2), (2, 1), (2, 2)), "quantiser_scales has 2x2 samples and needs 2x1");
    }
}
