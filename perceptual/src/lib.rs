//! Perceptual error thresholds for pictures that are watched as MPEG-2 video.
//!
//! The input is a picture and the codec's quantiser scale. The output is the largest luminance error of each pixel that
//! stays invisible after compression. [`tolerable_error`] follows \[Herzog08\] with Watson's masking model
//! \[Watson93\]. [`thresholds_of_srgb`] processes an sRGB picture in one call. [`Feedback`] reprojects thresholds from
//! frame to frame along the motion.
//!
//! The crate also contains:
//!
//! * [`ToneMap`]: invertible tone curves
//! * [`YCbCr`]: conversion of pictures to the input of MPEG-2 encoders
//! * [`saliency()`]: importance for a viewer without a task
//! * [`task_map()`]: importance for a viewer with a task
//! * [`psnr`], [`ssim`] and other metrics for reports
//!
//! The README lists the references and the behavior for extreme input.
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
pub use crate::tonemap::{Display, Operator, OutOfRange, PixelFragment, ToneMap, UnknownOperator};
pub use crate::ycbcr::{ColorMatrix, YCbCr, luminance_plane, to_rgb8, to_rgb8_by};
pub use plane::matrices::DEFAULT_INTRA_MATRIX;
pub use plane::{LUMINANCE_WEIGHTS, luminance};

/// Planes, pictures, correspondences and codings: the input and output of this crate.
pub use plane::{Coded, Correspondence, NO_MATCH, Picture, Plane};

/// Luma of white in code values above black.
pub const WHITE_LUMA: f32 = 219.0;

/// Clamps `value` to `low…high`. NaN becomes `low`.
#[inline]
fn bounded(value: f32, low: f32, high: f32) -> f32 {
    if value > low { value.min(high) } else { low }
}

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
