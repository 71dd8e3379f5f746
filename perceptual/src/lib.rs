//! How exact a picture has to be when it will be watched as an MPEG-2 video.
//!
//! A picture and the codec's quantiser scale go in; out comes, pixel by pixel, how wrong its luminance may be without anybody seeing
//! it after compression: [`tolerable_error`], after \[Herzog08\] with Watson's masking model \[Watson93\]; of an sRGB picture in one call,
//! [`thresholds_of_srgb`]. [`Feedback`] carries
//! that from frame to frame along the motion. Around it: [`ToneMap`], curves that can be undone; [`YCbCr`], the picture that an
//! MPEG-2 encoder takes; [`saliency()`], where a viewer looks first, and [`task_map()`], where one looks who watches something; and metrics ([`psnr`], [`ssim`], …) for reports. The README lists the references and what is known of extremes.
//!
//! ```
//! use perceptual::{MaskingModel, Plane, ToneMap, YCbCr, luminance_plane, tolerable_error};
//!
//! let radiance = Plane::from_fn(32, 16, |x, y| [0.1 + 0.2 * ((x ^ y) % 2) as f32; 3]);
//! let (tone_map, model) = (ToneMap::default(), MaskingModel::default());
//! let picture = YCbCr::from_radiance(&radiance, &tone_map);
//! let luminance = luminance_plane(&radiance);
//! let fine = tolerable_error(&picture.luma, &luminance, 2.0, &tone_map, &model);
//! let coarse = tolerable_error(&picture.luma, &luminance, 32.0, &tone_map, &model);
//! assert!(coarse.samples().iter().sum::<f32>() > fine.samples().iter().sum::<f32>());
//! ```
#![forbid(unsafe_code)]

mod coded;
mod feedback;
mod masking;
mod masking_weights;
mod metric;
mod predicted;
mod saliency;
mod srgb_picture;
mod table;
mod task_map;
mod threshold_map;
mod tonemap;
mod ycbcr;

pub use crate::coded::{NextPicture, QuantiserSteps};
pub use crate::feedback::{DEFAULT_WEIGHT, ExpectedCoding, Feedback, ObservedFrame};
pub use crate::masking::{CONTRAST_MASKING_EXPONENT, LUMINANCE_MASKING_EXPONENT, MaskingModel, mean_dc};
pub use crate::masking_weights::masking_weights;
pub use crate::metric::{Components, flicker, mse, psnr, relative_mse, rmse, ssim};
pub use crate::saliency::{saliency, steady_saliency};
pub use crate::srgb_picture::thresholds_of_srgb;
pub use crate::task_map::task_map;
pub use crate::threshold_map::{
    RELATIVE_FLOOR, ThresholdMap, TolerableError, blend, reproject, tolerable_error, tolerable_error_counted,
};
pub use crate::tonemap::{Display, Operator, OutOfRange, PixelPart, ToneMap, UnknownOperator};
pub use crate::ycbcr::{ColorMatrix, YCbCr, luminance_plane, to_rgb8, to_rgb8_by};
pub use plane::matrices::DEFAULT_INTRA_MATRIX;
pub use plane::{LUMINANCE_WEIGHTS, luminance};

/// Input and output: planes, pictures, where their pixels were, and what an encoder did to them.
pub use plane::{Coded, Correspondence, NO_MATCH, Picture, Plane};

/// Luma of white in code values above black.
pub const WHITE_LUMA: f32 = 219.0;

/// `value` taken into `low…high`; NaN becomes `low`.
#[inline]
fn bounded(value: f32, low: f32, high: f32) -> f32 {
    if value > low { value.min(high) } else { low }
}

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
