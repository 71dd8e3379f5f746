//! From invisible changes of luma to tolerable errors of luminance, pixel by pixel.
//!
//! ```text
//! (4)  e_xy = max(0.02 Y_xy, |Ŷ_xy − Y_xy|)
//! (5)  ΔY_xy(t) = e_xy                                   where pixel (x, y) has no feasible match at t−1
//!      ΔY_xy(t) = (1−w) e_xy + w ΔY_x′y′(t−1)            otherwise
//!
//!   Y    undistorted luminance, linear                    Ŷ   inverse tone map of the distorted luma ŷ′ of eq. (3)
//!   w    weight of the past, 0.5 in \[Herzog08\]            (x′, y′)   where the pixel was in the frame before
//! ```
//!
//! [`tolerable_error`] is eq. (4), [`blend`] is eq. (5); [`reproject`] fetches ΔY(t) along the motion into frame t+1.
//!
//! # Differs from the paper
//! - **Color.** Luma alone does not tell the luminance of a color: the luma of a saturated color decodes, as a gray, to
//!   less than its luminance (never to more, for concave curves). With g(y′) the luminance of gray of luma y′, eq. (4) is
//!   evaluated as `f · |g(ŷ′) − g(y′)|` with `f = Y / g(y′)`, kept within 1…1/0.0722. For a curve that is a power, where relative
//!   changes of luma are relative changes of luminance, that is the right relative error; for gray it is eq. (4)
//!   as it stands. The upper bound is what pure blue at a display gamma of 2 needs: luma 0.0722, g = 0.0722², Y = 0.0722.
//! - **Black.** e is at least the luminance of half a code value above black, so that a pixel with Y = 0 has a threshold above zero.
//! - Pixels whose luma or luminance is not finite count as black and are counted.

use crate::{MaskingModel, ToneMap, WHITE_LUMA, bounded, table::LumaDecodeTable};
use plane::{Correspondence, LUMINANCE_WEIGHTS, Plane};
use rayon::prelude::*;

/// The error that is tolerable everywhere, as a part of luminance: Weber's law at the visibility threshold, 2 % \[Herzog08, eq. 4\].
pub const RELATIVE_FLOOR: f32 = 0.02;
/// Largest luminance of a pixel relative to the gray of its luma: pure blue at a display gamma of 2.
const LARGEST_COLOR_FACTOR: f32 = 1.0 / LUMINANCE_WEIGHTS[2];

/// Eq. (4) for a picture.
#[derive(Clone, Debug, PartialEq)]
pub struct TolerableError {
    /// e_xy in the unit of luminance: finite and above zero everywhere.
    pub error: Plane<f32>,
    /// Pixels whose luma or luminance was not finite.
    pub non_finite: usize,
}

/// The curve's way back from luma to luminance, made once per tone map.
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

/// Eq. (4): how wrong the luminance of each pixel may be and still stay invisible after compression.
///
/// `luma` in code values above black (0…219, see [`crate::YCbCr::luma`]), `luminance` linear, of the same picture;
/// `quantiser_scale` 1…112 as MPEG-2 applies it. The result is finite and above zero everywhere.
///
/// # Panics
/// If the two planes differ in size.
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

/// [`tolerable_error`], together with the number of pixels that had to be replaced.
///
/// # Panics
/// If the two planes differ in size.
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

/// Eq. (4) where the luma of each pixel may become that of `distorted`.
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

/// Eq. (4) where each 8×8 block of luma may be wrong by `tolerable` code values.
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

/// Eq. (4) with ŷ′ of the eight pixels of a row from 8 · group on by `distorted`, given their place and luma.
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

/// The first eight values where they are finite; 0 stands for what is not finite and for what is not there.
#[inline(always)]
fn eight(values: &[f32]) -> [f32; 8] {
    let finite = |value: f32| if value.is_finite() { value } else { 0.0 };
    match values.first_chunk::<8>() {
        Some(values) => values.map(finite),
        None => std::array::from_fn(|i| values.get(i).copied().map_or(0.0, finite)),
    }
}

/// Eq. (4) for eight pixels, with `kappa` on what masking allows beyond the floor of 2 %.
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
        let color_factor = (luminance[i] / gray[i].max(f32::MIN_POSITIVE)).clamp(1.0, LARGEST_COLOR_FACTOR);
        let change = kappa * color_factor * (distorted[i] - gray[i]).abs();
        change.max(RELATIVE_FLOOR * luminance[i]).max(scale.smallest)
    })
}

/// Eq. (5): this frame's errors `e` blended with ΔY(t−1).
///
/// `known` holds, for each pixel of frame t, its match in frame t−1; indices outside of `previous` count as no match. `w`, the
/// weight of the past, is taken into 0…1.
///
/// # Panics
/// If `e` and `known` differ in size.
#[must_use]
pub fn blend(e: &Plane<f32>, previous: &Plane<f32>, known: &Correspondence, w: f32) -> Plane<f32> {
    blend_within(e, previous, known, w, f32::INFINITY)
}

/// [`blend`], where ΔY(t−1) counts as no more than `most` times e.
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
    let pixel = |(&e, &index): (&f32, &u32)| match past.get(index as usize) {
        Some(&before) if before > 0.0 && before.is_finite() => (1.0 - w) * e + w * before.min(most * e),
        _ => e,
    };
    let data = e.samples().par_iter().zip(matches.samples()).with_min_len(4096).map(pixel).collect();
    Plane::from_vec(e.width(), e.height(), data)
}

/// Thresholds of frame t+1: ΔY(t) reprojected along the motion.
///
/// `known` holds, for each pixel of frame t+1, its match in frame t; pixels without match get 2 % of their luminance.
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

/// Stands for "2 % of luminance" in a plane of absolute thresholds, which are above zero.
const RELATIVE: f32 = 0.0;

/// A threshold as it is stored.
fn stored(threshold: f32) -> f32 {
    if threshold > 0.0 && threshold.is_finite() { threshold } else { RELATIVE }
}

/// Thresholds for the pixels of a frame yet to be rendered: an absolute error of luminance, or 2 % where nothing is known.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct ThresholdMap {
    absolute: Plane<f32>,
}

impl ThresholdMap {
    /// 2 % of luminance everywhere: the first frame, and the one after a cut.
    #[must_use]
    pub fn relative(width: usize, height: usize) -> Self {
        Self { absolute: Plane::filled(width, height, RELATIVE) }
    }

    /// Takes absolute thresholds; values that are not finite and above zero become "2 % of luminance".
    pub fn from_plane(absolute: &Plane<f32>) -> Self {
        Self { absolute: absolute.map(stored) }
    }

    /// The absolute threshold of a pixel, or `None` where it is 2 % of luminance.
    ///
    /// # Panics
    /// Outside of the map.
    #[inline]
    #[must_use]
    pub fn get(&self, x: usize, y: usize) -> Option<f32> {
        let threshold = self.absolute.get(x, y);
        (threshold > 0.0).then_some(threshold)
    }

    /// The threshold of a pixel whose luminance is `luminance`.
    ///
    /// # Panics
    /// Outside of the map.
    #[inline]
    #[must_use]
    pub fn resolve(&self, x: usize, y: usize, luminance: f32) -> f32 {
        self.get(x, y).unwrap_or(RELATIVE_FLOOR * luminance)
    }

    /// Columns.
    #[must_use]
    pub fn width(&self) -> usize {
        self.absolute.width()
    }

    /// Rows.
    #[must_use]
    pub fn height(&self) -> usize {
        self.absolute.height()
    }

    /// Absolute thresholds, 0 where 2 % of luminance holds: for writing a map away; [`ThresholdMap::from_plane`] reads it back.
    #[must_use]
    pub fn plane(&self) -> &Plane<f32> {
        &self.absolute
    }
}
