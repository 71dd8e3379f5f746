//! Thresholds of an 8-bit sRGB picture in one call.

use crate::{MaskingModel, ToneMap, YCbCr, luminance_plane, tolerable_error};
use plane::Plane;

/// Returns the largest luminance error of each pixel of an sRGB picture that stays invisible after compression,
/// according to eqs. (1) to (4).
///
/// `picture` contains 8-bit red, green and blue codes of IEC 61966-2-1. Errors are display luminance relative to white
/// (0.01 is a hundredth of white), finite and positive.
///
/// The quantiser is an MPEG-2 intra quantiser with the default matrix. `quantiser_scale` (not its code) is clamped to
/// 1…112. [`tolerable_error`] supports other matrices, tone curves and radiance above white.
/// [`Feedback`](crate::Feedback) supports films.
///
/// ```
/// use perceptual::{Plane, thresholds_of_srgb};
///
/// // Gray, and a checkerboard of equal mean in the right half.
/// let picture = Plane::from_fn(32, 16, |x, y| [if x < 16 { 128 } else { 96 + 64 * ((x + y) % 2) as u8 }; 3]);
/// let thresholds = thresholds_of_srgb(&picture, 8.0);
/// assert!(thresholds.get(24, 8) > thresholds.get(4, 8));
/// ```
#[must_use]
pub fn thresholds_of_srgb(picture: &Plane<[u8; 3]>, quantiser_scale: f32) -> Plane<f32> {
    // Decode each code to display light, 0…1.
    let tone_map = ToneMap::srgb();
    let light: [f32; 256] = std::array::from_fn(|code| tone_map.decode(code as f32 / 255.0));
    let radiance = picture.map(|rgb| rgb.map(|code| light[usize::from(code)]));

    // Convert the picture for an encoder, and compute the errors that its quantiser hides.
    let luma = YCbCr::from_radiance(&radiance, &tone_map).luma;
    tolerable_error(&luma, &luminance_plane(&radiance), quantiser_scale, &tone_map, &MaskingModel::default())
}
