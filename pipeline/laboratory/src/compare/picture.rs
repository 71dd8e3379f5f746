//! A picture in all the forms that measures need, whatever file it came from.

use perceptual::{ColorMatrix, ToneMap, WHITE_LUMA, YCbCr, luminance, luminance_plane, to_rgb8_by};
use pipeline::exposure::exposure_for;
use plane::Plane;
use std::sync::Arc;

/// Code value of black in 8-bit luma, Rec. 709.
const BLACK: f32 = 16.0;

/// A picture as it was read.
#[derive(Clone, Debug)]
pub enum Picture {
    /// Linear light \[W·m⁻²·sr⁻¹\], of any brightness.
    Linear {
        /// R, G, B.
        radiance: Plane<[f32; 3]>,
        /// Variance of the noise in it, where that is known.
        variance: Option<Plane<[f32; 3]>>,
    },
    /// R′G′B′ as a display takes it, sRGB.
    Display(Plane<[u8; 3]>),
    /// A picture of a video: Y′C_BC_R, and its matrix.
    Video(plane::Picture, ColorMatrix),
}

/// The same, ready to be measured.
#[derive(Clone, Debug)]
pub struct View {
    /// Linear light; of displayed pictures, with white at 1.
    pub linear: Plane<[f32; 3]>,
    /// Variance of the noise in `linear`.
    pub variance: Option<Plane<[f32; 3]>>,
    /// Luma as shown, 16…235.
    pub luma: Plane<u8>,
    /// The same before rounding, above black: 0…219.
    pub fine_luma: Plane<f32>,
    /// Linear light that a display sends, 0…1.
    pub shown: Plane<[f32; 3]>,
}

impl Picture {
    /// Width and height in pixels.
    pub fn size(&self) -> (usize, usize) {
        match self {
            Self::Linear { radiance, .. } => (radiance.width(), radiance.height()),
            Self::Display(picture) => (picture.width(), picture.height()),
            Self::Video(frame, _) => (frame.width(), frame.height()),
        }
    }

    /// Whether it is linear light and not what a display takes.
    pub fn is_linear(&self) -> bool {
        matches!(self, Self::Linear { .. })
    }

    /// The exposure that shows the picture with its middle, the geometric mean of what is lit, at middle gray; 1 for
    /// pictures that are exposed already.
    pub fn exposure(&self) -> f32 {
        match self {
            Self::Linear { radiance, .. } => exposure_for(&luminance_plane(radiance)),
            _ => 1.0,
        }
    }

    /// Everything that is measured; linear light is shown with `exposure` and the sRGB curve.
    pub fn view(self, exposure: f32) -> View {
        let srgb = ToneMap::srgb();
        match self {
            Self::Linear { radiance, variance } => {
                let YCbCr { picture, luma: fine_luma, .. } =
                    YCbCr::from_radiance(&radiance, &srgb.with_exposure(exposure));
                let [luma, ..] = Arc::unwrap_or_clone(picture).into_planes();
                let shown = radiance.map(|rgb| rgb.map(|c| (c * exposure).clamp(0.0, 1.0)));
                // What is not finite is shown black.
                let shown = shown.map(|rgb| if rgb.iter().all(|c| c.is_finite()) { rgb } else { [0.0; 3] });
                View { linear: radiance, variance, luma, fine_luma, shown }
            }
            Self::Display(picture) => {
                let decode: [f32; 256] = std::array::from_fn(|code| srgb.decode(code as f32 / 255.0));
                let shown = picture.map(|rgb| rgb.map(|code| decode[usize::from(code)]));
                let fine_luma = picture.map(|rgb| WHITE_LUMA * luminance(rgb.map(|code| f32::from(code) / 255.0)));
                let luma = fine_luma.map(|luma| (BLACK + luma).round() as u8);
                View { linear: shown.clone(), variance: None, luma, fine_luma, shown }
            }
            Self::Video(frame, ColorMatrix::Bt601) => {
                Self::Display(to_rgb8_by(&frame, ColorMatrix::Bt601)).view(exposure)
            }
            Self::Video(frame, matrix) => {
                let fine_luma = frame.luma().map(|code| f32::from(code) - BLACK);
                let display = Self::Display(to_rgb8_by(&frame, matrix)).view(exposure);
                let [luma, ..] = frame.into_planes();
                View { luma, fine_luma, ..display }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_gray_looks_the_same_from_every_file() {
        // Linear 0.18 is R′ = 0.4614 in sRGB: code 118 of 255, luma 16 + 219 · 0.4614 = 117.
        let linear = Picture::Linear { radiance: Plane::filled(16, 16, [0.18f32; 3]), variance: None };
        assert!((linear.exposure() - 1.0).abs() < 1e-5);
        let display = Picture::Display(Plane::filled(16, 16, [118u8; 3]));
        let frame = plane::Picture::gray(Plane::filled(16, 16, 117));
        for picture in [linear, display, Picture::Video(frame, ColorMatrix::Bt709)] {
            let view = picture.view(1.0);
            assert_eq!(view.luma.get(3, 3), 117);
            assert!((view.fine_luma.get(3, 3) - 101.1).abs() < 0.4);
            assert!(view.shown.get(3, 3).iter().all(|c| (c - 0.18).abs() < 0.002), "{:?}", view.shown.get(3, 3));
        }
    }
}
