//! Pictures that go in and come back.

use crate::ConfigError;
use plane::Plane;

/// A Y′CbCr 4:2:0 picture of 8-bit code values: Rec. 709, limited range (16 … 235, 16 … 240).
///
/// Chroma has half of the luma samples in each direction, rounded up, and lies midway between two luma rows
/// on even columns, as 6.1.1.8 draws it for progressive pictures.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Frame {
    /// Luma, Y′.
    pub luma: Plane<u8>,
    /// Blue difference, Cb.
    pub cb: Plane<u8>,
    /// Red difference, Cr.
    pub cr: Plane<u8>,
}

impl Frame {
    /// A frame of three planes whose sizes belong together.
    pub fn new(luma: Plane<u8>, cb: Plane<u8>, cr: Plane<u8>) -> Result<Self, ConfigError> {
        let frame = Self { luma, cb, cr };
        frame.check()?;
        Ok(frame)
    }

    /// A black frame of `width × height` luma samples.
    pub fn black(width: usize, height: usize) -> Self {
        let chroma = Plane::filled(width.div_ceil(2), height.div_ceil(2), 128);
        Self { luma: Plane::filled(width, height, 16), cb: chroma.clone(), cr: chroma }
    }

    /// Luma samples in a row.
    pub fn width(&self) -> usize {
        self.luma.width()
    }

    /// Luma rows.
    pub fn height(&self) -> usize {
        self.luma.height()
    }

    /// Do the chroma planes have the size that belongs to the luma plane?
    pub(crate) fn check(&self) -> Result<(), ConfigError> {
        let (expected_width, expected_height) = (self.width().div_ceil(2), self.height().div_ceil(2));
        for (name, plane) in [("cb", &self.cb), ("cr", &self.cr)] {
            let (width, height) = (plane.width(), plane.height());
            if (width, height) != (expected_width, expected_height) {
                return Err(ConfigError::PlaneSize { plane: name, width, height, expected_width, expected_height });
            }
        }
        Ok(())
    }

    /// Copies the frame to one of another size: the last row and column repeat, or are cut off.
    pub(crate) fn copy_to(&self, out: &mut Self) {
        copy_plane(&self.luma, &mut out.luma);
        copy_plane(&self.cb, &mut out.cb);
        copy_plane(&self.cr, &mut out.cr);
    }
}

fn copy_plane(plane: &Plane<u8>, out: &mut Plane<u8>) {
    if (plane.width(), plane.height()) == (out.width(), out.height()) {
        return out.samples_mut().copy_from_slice(plane.samples());
    }
    let kept = out.width().min(plane.width());
    for y in 0..out.height() {
        let (row, out) = (plane.row(y.min(plane.height() - 1)), out.row_mut(y));
        out[..kept].copy_from_slice(&row[..kept]);
        out[kept..].fill(row[kept - 1]);
    }
}

/// Peak signal-to-noise ratio of two planes of one size, dB; infinite if they are equal.
pub fn psnr(a: &Plane<u8>, b: &Plane<u8>) -> f64 {
    assert_eq!((a.width(), a.height()), (b.width(), b.height()), "planes of different size");
    let sum = (0..a.height()).map(|y| squared_error(a.row(y), b.row(y))).sum();
    psnr_of(sum, a.width() * a.height())
}

/// PSNR where the squared errors of so many samples add up to this.
pub(crate) fn psnr_of(squared_error: u64, samples: usize) -> f64 {
    if squared_error == 0 {
        return f64::INFINITY;
    }
    10.0 * (255.0f64.powi(2) * samples as f64 / squared_error as f64).log10()
}

vectorised! {
    /// Sum of squared differences of at most 2^16 samples, so that 32 bits hold it.
    fn squared_error, squared_error_plain(a: &[u8], b: &[u8]) -> u64 {
        let mut sum = 0;
        for (&a, &b) in a.iter().zip(b) {
            let difference = i32::from(a) - i32::from(b);
            sum += (difference * difference) as u32;
        }
        sum.into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn planes_must_belong_together() {
        let frame = Frame::black(17, 33);
        assert_eq!((frame.cb.width(), frame.cb.height()), (9, 17));
        let error = Frame::new(frame.luma, Plane::filled(8, 17, 128), frame.cr).unwrap_err();
        assert_eq!(error.to_string(), "cb has 8x17 samples; with this luma it needs 9x17");
    }

    #[test]
    fn padding_repeats_the_border_and_cropping_undoes_it() {
        let luma = Plane::from_fn(5, 3, |x, y| (10 * y + x) as u8);
        let frame = Frame::new(luma, Plane::filled(3, 2, 7), Plane::filled(3, 2, 9)).unwrap();
        let mut padded = Frame::black(16, 16);
        frame.copy_to(&mut padded);
        assert_eq!((padded.luma.get(15, 0), padded.luma.get(15, 15), padded.cb.get(7, 7)), (4, 24, 7));
        let mut cropped = Frame::black(5, 3);
        padded.copy_to(&mut cropped);
        assert_eq!(cropped, frame);
    }

    #[test]
    fn psnr_of_a_known_error() {
        let (a, b) = (Plane::filled(4, 4, 10), Plane::filled(4, 4, 11));
        assert!((psnr(&a, &b) - 48.1308).abs() < 1e-3);
        assert_eq!(psnr(&a, &a), f64::INFINITY);
    }
}
