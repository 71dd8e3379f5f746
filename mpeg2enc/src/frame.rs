//! Picture copies of another size, and differences between pictures.

use plane::{Picture, Plane};

/// Copies a picture to one of another size: repeats the last row and column, or crops.
pub(crate) fn copy(picture: &Picture, out: &mut Picture) {
    let width = out.width();
    let widths = [width, width.div_ceil(2), width.div_ceil(2)];
    for ((plane, out), width) in picture.planes().into_iter().zip(out.samples_mut()).zip(widths) {
        copy_plane(plane, out, width);
    }
}

fn copy_plane(plane: &Plane<u8>, out: &mut [u8], width: usize) {
    if (plane.width(), plane.samples().len()) == (width, out.len()) {
        return out.copy_from_slice(plane.samples());
    }
    // Beyond the plane, repeat its last sample and row.
    let kept = width.min(plane.width());
    for (y, out) in out.chunks_exact_mut(width).enumerate() {
        let row = plane.row(y.min(plane.height() - 1));
        out[..kept].copy_from_slice(&row[..kept]);
        out[kept..].fill(row[kept - 1]);
    }
}

/// Returns the peak signal-to-noise ratio of two planes of equal size, in dB; infinite if they are equal.
pub fn psnr(a: &Plane<u8>, b: &Plane<u8>) -> f64 {
    assert_eq!((a.width(), a.height()), (b.width(), b.height()), "the planes must have equal size");
    let sum = (0..a.height()).map(|y| squared_error(a.row(y), b.row(y))).sum();
    psnr_of(sum, a.width() * a.height())
}

/// Returns the PSNR in dB of `samples` samples with this sum of squared errors.
pub(crate) fn psnr_of(squared_error: u64, samples: usize) -> f64 {
    if squared_error == 0 {
        return f64::INFINITY;
    }
    10.0 * (255.0f64.powi(2) * samples as f64 / squared_error as f64).log10()
}

vectorized! {
    /// Returns the sum of squared differences of at most 2^16 samples, which fits in 32 bits.
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
    fn padding_repeats_the_border_and_cropping_undoes_it() {
        let luma = Plane::from_fn(5, 3, |x, y| (10 * y + x) as u8);
        let frame = Picture::new(luma, Plane::filled(3, 2, 7), Plane::filled(3, 2, 9)).unwrap();
        let mut padded = Picture::black(16, 16);
        copy(&frame, &mut padded);
        assert_eq!((padded.luma().get(15, 0), padded.luma().get(15, 15), padded.cb().get(7, 7)), (4, 24, 7));
        let mut cropped = Picture::black(5, 3);
        copy(&padded, &mut cropped);
        assert_eq!(cropped, frame);
    }

    #[test]
    fn psnr_of_a_known_error() {
        let (a, b) = (Plane::filled(4, 4, 10), Plane::filled(4, 4, 11));
        assert!((psnr(&a, &b) - 48.1308).abs() < 1e-3);
        assert_eq!(psnr(&a, &a), f64::INFINITY);
    }
}
