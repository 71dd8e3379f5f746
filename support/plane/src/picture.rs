//! Pictures with luma and chroma planes.

use crate::{Plane, SizeError};

/// Y′C_BC_R 4:2:0 picture of 8-bit code values in Rec. ITU-R BT.709, limited range (luma 16 … 235, chroma 16 … 240).
///
/// Chroma has half as many samples as luma in each direction, rounded up. Chroma samples are midway between two luma
/// rows, on even columns. ISO/IEC 13818-2, 6.1.1.8 defines these positions for progressive pictures. Code values
/// outside the limited range are allowed.
///
/// Invariant: both chroma planes have the size implied by the luma plane.
///
/// ```
/// use plane::{Picture, Plane};
///
/// let luma = Plane::from_fn(5, 3, |x, y| (16 + 10 * x + y) as u8);
/// let picture = Picture::new(luma.clone(), Plane::filled(3, 2, 100), Plane::filled(3, 2, 150))?;
/// assert_eq!((picture.width(), picture.height()), (5, 3));
/// assert!(Picture::new(luma, Plane::filled(2, 2, 100), Plane::filled(3, 2, 150)).is_err());
/// # Ok::<(), plane::SizeError>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(try_from = "StoredPicture"))]
pub struct Picture {
    luma: Plane<u8>,
    cb: Plane<u8>,
    cr: Plane<u8>,
}

/// Serialized form of a picture, before the sizes are checked.
#[cfg(feature = "serde")]
#[derive(serde::Deserialize)]
struct StoredPicture {
    luma: Plane<u8>,
    cb: Plane<u8>,
    cr: Plane<u8>,
}

#[cfg(feature = "serde")]
impl TryFrom<StoredPicture> for Picture {
    type Error = SizeError;

    fn try_from(StoredPicture { luma, cb, cr }: StoredPicture) -> Result<Self, SizeError> {
        Self::new(luma, cb, cr)
    }
}

/// Chroma code value of neutral gray.
const NEUTRAL: u8 = 128;
/// Luma code value of black.
const BLACK: u8 = 16;

impl Picture {
    /// Combines planes of luma Y′, blue difference C_B and red difference C_R.
    ///
    /// # Errors
    /// If the size of a chroma plane is not half the luma size, rounded up.
    pub fn new(luma: Plane<u8>, cb: Plane<u8>, cr: Plane<u8>) -> Result<Self, SizeError> {
        let expected = (luma.width().div_ceil(2), luma.height().div_ceil(2));
        SizeError::check("cb", &cb, expected)?;
        SizeError::check("cr", &cr, expected)?;
        Ok(Self { luma, cb, cr })
    }

    /// Returns a gray picture with the given `luma`.
    #[must_use]
    pub fn gray(luma: Plane<u8>) -> Self {
        let chroma = Plane::filled(luma.width().div_ceil(2), luma.height().div_ceil(2), NEUTRAL);
        Self { luma, cb: chroma.clone(), cr: chroma }
    }

    /// Returns a black picture of `width` × `height` luma samples.
    #[must_use]
    pub fn black(width: usize, height: usize) -> Self {
        Self::gray(Plane::filled(width, height, BLACK))
    }

    /// Number of luma samples per row.
    #[must_use]
    pub fn width(&self) -> usize {
        self.luma.width()
    }

    /// Number of luma rows.
    #[must_use]
    pub fn height(&self) -> usize {
        self.luma.height()
    }

    /// Luma plane, Y′.
    #[inline]
    #[must_use]
    pub fn luma(&self) -> &Plane<u8> {
        &self.luma
    }

    /// Blue-difference plane, C_B.
    #[inline]
    #[must_use]
    pub fn cb(&self) -> &Plane<u8> {
        &self.cb
    }

    /// Red-difference plane, C_R.
    #[inline]
    #[must_use]
    pub fn cr(&self) -> &Plane<u8> {
        &self.cr
    }

    /// Planes of luma, C_B and C_R, in the order of uncompressed picture files.
    #[must_use]
    pub fn planes(&self) -> [&Plane<u8>; 3] {
        [&self.luma, &self.cb, &self.cr]
    }

    /// Mutable samples of luma, C_B and C_R in raster order. The sizes cannot change.
    #[must_use]
    pub fn samples_mut(&mut self) -> [&mut [u8]; 3] {
        [self.luma.samples_mut(), self.cb.samples_mut(), self.cr.samples_mut()]
    }

    /// Returns the planes of luma, C_B and C_R without a copy.
    #[must_use]
    pub fn into_planes(self) -> [Plane<u8>; 3] {
        [self.luma, self.cb, self.cr]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn planes_must_belong_together() {
        let black = Picture::black(17, 33);
        assert_eq!((black.cb().width(), black.cb().height()), (9, 17));
        let [luma, cb, cr] = black.clone().into_planes();
        assert_eq!(Picture::new(luma.clone(), cb.clone(), cr.clone()), Ok(black));
        let error = Picture::new(luma.clone(), Plane::filled(8, 17, NEUTRAL), cr).unwrap_err();
        assert_eq!(error.to_string(), "cb has 8x17 samples and needs 9x17");
        let error = Picture::new(luma, cb, Plane::filled(9, 16, NEUTRAL)).unwrap_err();
        assert_eq!(error.to_string(), "cr has 9x16 samples and needs 9x17");
    }

    #[test]
    fn an_empty_picture_has_no_samples() {
        assert_eq!(Picture::black(0, 0), Picture::default());
        assert_eq!(Picture::default().planes().map(|plane| plane.samples().len()), [0; 3]);
    }

    #[test]
    fn samples_change_in_place() {
        let mut picture = Picture::black(3, 1);
        for (samples, value) in picture.samples_mut().into_iter().zip([1, 2, 3]) {
            samples.fill(value);
        }
        assert_eq!(picture.planes().map(|plane| (plane.width(), plane.get(0, 0))), [(3, 1), (2, 2), (2, 3)]);
    }
}
