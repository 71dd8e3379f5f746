//! Thresholds of a picture that is only known as codes for displays, in one call.

use crate::{MaskingModel, ToneMap, YCbCr, luminance_plane, tolerable_error};
use plane::Plane;

/// Error that the luminance of each pixel of an sRGB picture may have until it is seen after compression: eqs. (1) to (4).
///
/// `picture` has red, green and blue of IEC 61966-2-1, codes of 8 bits. Errors are in luminance of the display relative to
/// its white: 0.01 is a hundredth of white. All are finite and above zero.
///
/// The quantiser is that of an MPEG-2 intra picture with the default matrix, at `quantiser_scale` 1…112 (not its code);
/// values outside are brought into that range. For other matrices, tone curves and radiance above white there is
/// [`tolerable_error`], for films [`Feedback`](crate::Feedback).
///
/// ```
/// use perceptual::{Plane, thresholds_of_srgb};
///
/// // Gray, and a checkerboard of the same mean in its right half.
/// let picture = Plane::from_fn(32, 16, |x, y| [if x < 16 { 128 } else { 96 + 64 * ((x + y) % 2) as u8 }; 3]);
/// let thresholds = thresholds_of_srgb(&picture, 8.0);
/// assert!(thresholds.get(24, 8) > thresholds.get(4, 8));
/// ```
#[must_use]
pub fn thresholds_of_srgb(picture: &Plane<[u8; 3]>, quantiser_scale: f32) -> Plane<f32> {
    // Display light of each code, 0…1.
    let tone_map = ToneMap::srgb();
    let light: [f32; 256] = std::array::from_fn(|code| tone_map.decode(code as f32 / 255.0));
    let radiance = picture.map(|rgb| rgb.map(|code| light[usize::from(code)]));

    // The picture as an encoder takes it, and what its quantiser hides.
    let luma = YCbCr::from_radiance(&radiance, &tone_map).luma;
    tolerable_error(&luma, &luminance_plane(&radiance), quantiser_scale, &tone_map, &MaskingModel::default())
}
