//! Tolerable luminance errors per pixel, from invisible changes of luma.
//!
//! ```text
//! (4)  e_xy = max(0.02 Y_xy, |Ŷ_xy − Y_xy|)
//! (5)  ΔY_xy(t) = e_xy                                   if pixel (x, y) has no feasible match at t−1
//!      ΔY_xy(t) = (1−w) e_xy + w ΔY_x′y′(t−1)            otherwise
//!
//!   Y    undistorted luminance, linear                    Ŷ   inverse tone map of the distorted luma ŷ′ of eq. (3)
//!   w    weight of the past, 0.5 in \[Herzog08\]            (x′, y′)   position of the pixel in the previous frame
//! ```
//!
//! [`tolerable_error`] is eq. (4) and [`blend`] is eq. (5). [`reproject`] moves ΔY(t) along the motion to frame t+1.
//!
//! # Differences from the paper
//! - **Color.** The luminance of a color does not follow from its luma. For concave curves, decoding the luma of a
//!   saturated color as gray gives too low a luminance. Let g(y′) be the luminance of gray with luma y′. Eq. (4) is
//!   then evaluated as `f · |g(ŷ′) − g(y′)|` with `f = Y / g(y′)`, clamped to 1…1/0.0722. A power curve maps equal
//!   relative changes of luma to equal relative changes of luminance, so this gives the correct relative error. For
//!   gray it equals eq. (4). The upper limit is the value for pure blue at a display gamma of 2: luma 0.0722, g =
//!   0.0722², Y = 0.0722.
//! - **Black.** e is at least the luminance of half a code value above black. A pixel with Y = 0 therefore has a
//!   positive threshold.
//! - Pixels with luma or luminance that is not finite count as black and are counted.

use crate::{MaskingModel, ToneMap, WHITE_LUMA, bounded, table::LumaDecodeTable};
use plane::{Correspondence, LUMINANCE_WEIGHTS, Plane};
use threads::prelude::*;

/// Minimum tolerable error relative to luminance: Weber's law at the visibility threshold, 2 % \[Herzog08, eq. 4\].
pub const RELATIVE_FLOOR: f32 = 0.02;
/// Largest luminance of a pixel relative to gray with the same luma: pure blue at a display gamma of 2.
const LARGEST_COLOR_FACTOR: f32 = 1.0 / LUMINANCE_WEIGHTS[2];

/// Result of eq. (4) for a picture, with the number of invalid pixels.
#[derive(Clone, Debug, PartialEq)]
pub struct TolerableError {
    /// Tolerable error e_xy of each pixel, in the unit of luminance, finite and positive.
    pub error: Plane<f32>,
    /// Number of pixels that have a luma or luminance that is not finite.
    pub non_finite: usize,
}

/// Inverse tone curve from luma to luminance, built once per tone map.
#[derive(Debug)]
pub(crate) struct LuminanceScale {
    decode: LumaDecodeTable,
    smallest: f32,
}

impl LuminanceScale {
    pub fn new(tone_map: &ToneMap) -> Self {
        let smallest = tone_map.decode(0.5 / WHITE_LUMA).max(f32::MIN_POSITIVE);
        Self { decode: LumaDecodeTable::new(tone_map), smallest }
    }
}

/// Evaluates eq. (4): the largest luminance error of each pixel that stays invisible after compression.
///
/// `luma` is in code values above black (0…219, see [`crate::YCbCr::luma`]). `luminance` is linear and from the same
/// picture. `quantiser_scale` is MPEG-2's quantiser_scale, 1…112. The result is finite and positive.
///
/// # Panics
/// If the two planes have different sizes.
#[must_use]
pub fn tolerable_error(
    luma: &Plane<f32>,
    luminance: &Plane<f32>,
    quantiser_scale: f32,
    tone_map: &ToneMap,
    model: &MaskingModel,
) -> Plane<f32> {
    tolerable_error_counted(luma, luminance, quantiser_scale, tone_map, model).error
}

/// Computes [`tolerable_error`] and counts the pixels replaced by black.
///
/// # Panics
/// If the two planes have different sizes.
#[must_use]
pub fn tolerable_error_counted(
    luma: &Plane<f32>,
    luminance: &Plane<f32>,
    quantiser_scale: f32,
    tone_map: &ToneMap,
    model: &MaskingModel,
) -> TolerableError {
    assert_same_size(luma, luminance);
    let distorted = model.worst_case_luma(luma, quantiser_scale);
    pixelwise_error(luma, luminance, &distorted, 1.0, &LuminanceScale::new(tone_map))
}

/// Evaluates eq. (4) for pixels with luma distorted to `distorted`.
pub(crate) fn pixelwise_error(
    luma: &Plane<f32>,
    luminance: &Plane<f32>,
    distorted: &Plane<f32>,
    kappa: f32,
    scale: &LuminanceScale,
) -> TolerableError {
    assert_same_size(luma, luminance);
    let of_group = |(group, y): (usize, usize), _| eight(&distorted.row(y)[8 * group..]);
    pixelwise(of_group, luma, luminance, kappa, scale)
}

/// Evaluates eq. (4) for a luma error of `tolerable` code values in each 8×8 block.
pub(crate) fn blockwise_error(
    luma: &Plane<f32>,
    luminance: &Plane<f32>,
    tolerable: &Plane<f32>,
    kappa: f32,
    scale: &LuminanceScale,
) -> TolerableError {
    assert_same_size(luma, luminance);
    let of_group = |(group, y): (usize, usize), luma: [f32; 8]| {
        let tolerable = tolerable.get(group, y / 8);
        luma.map(|luma| luma + tolerable)
    };
    pixelwise(of_group, luma, luminance, kappa, scale)
}

/// Evaluates eq. (4) for groups of eight pixels. `distorted` returns ŷ′ of a group from its position and luma.
fn pixelwise(
    distorted: impl Fn((usize, usize), [f32; 8]) -> [f32; 8] + Sync,
    luma: &Plane<f32>,
    luminance: &Plane<f32>,
    kappa: f32,
    scale: &LuminanceScale,
) -> TolerableError {
    let width = luma.width().max(1);
    let mut error = Plane::filled(luma.width(), luma.height(), 0.0);
    let of_row = |(y, error): (usize, &mut [f32])| {
        let mut non_finite = 0;
        let groups = luma.row(y).chunks(8).zip(luminance.row(y).chunks(8)).enumerate();
        for (error, (group, (luma, luminance))) in error.chunks_mut(8).zip(groups) {
            // Count pixels that `eight` replaces by black.
            non_finite += luma.iter().zip(luminance).filter(|(a, b)| !(a.is_finite() && b.is_finite())).count();
            let luma = eight(luma);
            let e = pixel_errors(distorted((group, y), luma), luma, eight(luminance), kappa, scale);
            error.copy_from_slice(&e[..error.len()]);
        }
        non_finite
    };
    let non_finite = error.samples_mut().par_chunks_mut(width).enumerate().with_min_len(8).map(of_row).sum();
    TolerableError { error, non_finite }
}

/// Returns the first eight values. Missing values, and values that are not finite, are 0.
#[inline(always)]
fn eight(values: &[f32]) -> [f32; 8] {
    let finite = |value: f32| if value.is_finite() { value } else { 0.0 };
    match values.first_chunk::<8>() {
        Some(values) => values.map(finite),
        None => std::array::from_fn(|i| values.get(i).copied().map_or(0.0, finite)),
    }
}

/// Evaluates eq. (4) for eight pixels. `kappa` multiplies the masked error |Ŷ − Y|.
#[inline(always)]
fn pixel_errors(
    distorted_luma: [f32; 8],
    luma: [f32; 8],
    luminance: [f32; 8],
    kappa: f32,
    scale: &LuminanceScale,
) -> [f32; 8] {
    let (gray, distorted) = (scale.decode.get(luma), scale.decode.get(distorted_luma));
    std::array::from_fn(|i| {
        // Saturated colors have more luminance than the gray of equal luma.
        let color_factor = (luminance[i] / gray[i].max(f32::MIN_POSITIVE)).clamp(1.0, LARGEST_COLOR_FACTOR);
        let change = kappa * color_factor * (distorted[i] - gray[i]).abs();
        change.max(RELATIVE_FLOOR * luminance[i]).max(scale.smallest)
    })
}

/// Evaluates eq. (5): blends this frame's errors `e` with ΔY(t−1).
///
/// `known` contains the match in frame t−1 of each pixel of frame t. An index outside `previous` is not a match. `w`,
/// the weight of the past, is clamped to 0…1.
///
/// # Panics
/// If `e` and `known` have different sizes.
#[must_use]
pub fn blend(e: &Plane<f32>, previous: &Plane<f32>, known: &Correspondence, w: f32) -> Plane<f32> {
    blend_within(e, previous, known, w, f32::INFINITY)
}

/// Computes [`blend`] with ΔY(t−1) limited to `most` times e.
pub(crate) fn blend_within(
    e: &Plane<f32>,
    previous: &Plane<f32>,
    known: &Correspondence,
    w: f32,
    most: f32,
) -> Plane<f32> {
    let matches = known.matches();
    assert_same_size(e, matches);
    let w = bounded(w, 0.0, 1.0);
    let past = previous.samples();
    // Pixels without a usable previous threshold keep the current error.
    let pixel = |(&e, &index): (&f32, &u32)| match past.get(index as usize) {
        Some(&before) if before > 0.0 && before.is_finite() => (1.0 - w) * e + w * before.min(most * e),
        _ => e,
    };
    let data = e.samples().par_iter().zip(matches.samples()).with_min_len(4096).map(pixel).collect();
    Plane::from_vec(e.width(), e.height(), data)
}

/// Reprojects ΔY(t) along the motion to thresholds of frame t+1.
///
/// `known` contains the match in frame t of each pixel of frame t+1. The threshold of a pixel without a match is 2 % of
/// its luminance.
#[must_use]
pub fn reproject(previous: &Plane<f32>, known: &Correspondence) -> ThresholdMap {
    let (past, matches) = (previous.samples(), known.matches());
    let pixel = |&index: &u32| past.get(index as usize).copied().map_or(RELATIVE, stored);
    let data = matches.samples().par_iter().with_min_len(4096).map(pixel).collect();
    ThresholdMap { absolute: Plane::from_vec(matches.width(), matches.height(), data) }
}

fn assert_same_size<A: Copy, B: Copy>(a: &Plane<A>, b: &Plane<B>) {
    let size = (a.width(), a.height());
    assert_eq!(size, (b.width(), b.height()), "the two planes must have the same size");
}

/// Marker of "2 % of luminance" in a plane of absolute thresholds, which are positive.
const RELATIVE: f32 = 0.0;

/// Returns the value that represents a threshold in a plane.
fn stored(threshold: f32) -> f32 {
    if threshold > 0.0 && threshold.is_finite() { threshold } else { RELATIVE }
}

/// Thresholds for the pixels of a frame to render. Each is an absolute luminance error, or 2 % of luminance if no
/// threshold is known.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct ThresholdMap {
    absolute: Plane<f32>,
}

impl ThresholdMap {
    /// Returns a map with 2 % of luminance everywhere, for the first frame and for frames after a shot change.
    #[must_use]
    pub fn relative(width: usize, height: usize) -> Self {
        Self { absolute: Plane::filled(width, height, RELATIVE) }
    }

    /// Returns a map of absolute thresholds. Values that are not finite and positive become "2 % of luminance".
    pub fn from_plane(absolute: &Plane<f32>) -> Self {
        Self { absolute: absolute.map(stored) }
    }

    /// Absolute threshold of a pixel, or `None` if it is 2 % of luminance.
    ///
    /// # Panics
    /// If the pixel is outside the map.
    #[inline]
    #[must_use]
    pub fn get(&self, x: usize, y: usize) -> Option<f32> {
        let threshold = self.absolute.get(x, y);
        (threshold > 0.0).then_some(threshold)
    }

    /// Threshold of a pixel with the given `luminance`.
    ///
    /// # Panics
    /// If the pixel is outside the map.
    #[inline]
    #[must_use]
    pub fn resolve(&self, x: usize, y: usize, luminance: f32) -> f32 {
        self.get(x, y).unwrap_or(RELATIVE_FLOOR * luminance)
    }

    /// Number of columns.
    #[must_use]
    pub fn width(&self) -> usize {
        self.absolute.width()
    }

    /// Number of rows.
    #[must_use]
    pub fn height(&self) -> usize {
        self.absolute.height()
    }

    /// Absolute thresholds, for storage. The value 0 represents 2 % of luminance. [`ThresholdMap::from_plane`] is the
    /// inverse.
    #[must_use]
    pub fn plane(&self) -> &Plane<f32> {
        &self.absolute
    }
}
