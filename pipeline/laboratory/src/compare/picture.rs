//! Pictures in all forms that the measures need, independent of the file format.

use perceptual::{ColorMatrix, ToneMap, WHITE_LUMA, YCbCr, luminance, luminance_plane, to_rgb8_by};
use pipeline::exposure::exposure_for;
use plane::Plane;
use std::sync::Arc;

/// Code value of black in 8-bit luma, Rec. 709.
const BLACK: f32 = 16.0;

/// Picture as read from a file.
#[derive(Clone, Debug)]
pub enum Picture {
    /// Linear light \[W·m⁻²·sr⁻¹\], without an upper limit.
    Linear {
        /// Radiance as R, G, B.
        radiance: Plane<[f32; 3]>,
        /// Variance of the noise in `radiance`, if known.
        variance: Option<Plane<[f32; 3]>>,
    },
    /// Picture for a display: sRGB as R′G′B′ codes.
    Display(Plane<[u8; 3]>),
    /// Picture of a video: Y′C_BC_R samples and their color matrix.
    Video(plane::Picture, ColorMatrix),
}

/// Picture ready for measurement.
#[derive(Clone, Debug)]
pub struct View {
    /// Linear light. For displayed pictures, white is 1.
    pub linear: Plane<[f32; 3]>,
    /// Variance of the noise in `linear`, if known.
    pub variance: Option<Plane<[f32; 3]>>,
    /// Displayed luma, 16…235.
    pub luma: Plane<u8>,
    /// Displayed luma before rounding, above black: 0…219.
    pub fine_luma: Plane<f32>,
    /// Linear light emitted by the display, 0…1.
    pub shown: Plane<[f32; 3]>,
}

impl Picture {
    /// Returns width and height \[pixels\].
    pub fn size(&self) -> (usize, usize) {
        match self {
            Self::Linear { radiance, .. } => (radiance.width(), radiance.height()),
            Self::Display(picture) => (picture.width(), picture.height()),
            Self::Video(frame, _) => (frame.width(), frame.height()),
        }
    }

    /// Returns whether the picture is linear light rather than a picture for a display.
    pub fn is_linear(&self) -> bool {
        matches!(self, Self::Linear { .. })
    }

    /// Returns the exposure that maps the geometric mean of the lit pixels to middle gray. Returns 1 for pictures that
    /// are already exposed.
    pub fn exposure(&self) -> f32 {
        match self {
            Self::Linear { radiance, .. } => exposure_for(&luminance_plane(radiance)),
            _ => 1.0,
        }
    }

    /// Returns all data for measurement. Linear light is displayed with `exposure` and the sRGB curve.
    pub fn view(self, exposure: f32) -> View {
        let srgb = ToneMap::srgb();
        match self {
            Self::Linear { radiance, variance } => {
                let YCbCr { picture, luma: fine_luma, .. } =
                    YCbCr::from_radiance(&radiance, &srgb.with_exposure(exposure));
                let [luma, ..] = Arc::unwrap_or_clone(picture).into_planes();
                let shown = radiance.map(|rgb| rgb.map(|c| (c * exposure).clamp(0.0, 1.0)));
                // Show non-finite pixels as black.
                let shown = shown.map(|rgb| if rgb.iter().all(|c| c.is_finite()) { rgb } else { [0.0; 3] });
                View { linear: radiance, variance, luma, fine_luma, shown }
            }
            Self::Display(picture) => {
                // Decode each of the 256 codes once.
                let decode: [f32; 256] = std::array::from_fn(|code| srgb.decode(code as f32 / 255.0));
                let shown = picture.map(|rgb| rgb.map(|code| decode[usize::from(code)]));
                // Compute luma from nonlinear codes, as a video encoder does.
                let fine_luma = picture.map(|rgb| WHITE_LUMA * luminance(rgb.map(|code| f32::from(code) / 255.0)));
                let luma = fine_luma.map(|luma| (BLACK + luma).round() as u8);
                View { linear: shown.clone(), variance: None, luma, fine_luma, shown }
            }
            Self::Video(frame, ColorMatrix::Bt601) => {
                // Compute Rec. 709 luma through R′G′B′, so that the luma of all pictures is comparable.
                Self::Display(to_rgb8_by(&frame, ColorMatrix::Bt601)).view(exposure)
            }
            Self::Video(frame, matrix) => {
                // Keep the coded luma, without a round trip through R′G′B′.
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
        // In sRGB, linear 0.18 is R′ = 0.4614 and has code 118 of 255. Luma is 16 + 219 · 0.4614 = 117.
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
