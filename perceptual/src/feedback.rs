//! The loop over frames: frame t decides how exact frame t+1 has to be.

use crate::coded::{CodedMasking, NextPicture, QuantiserSteps};
use crate::predicted::PredictedCoding;
use crate::threshold_map::{
    LuminanceScale, ThresholdMap, TolerableError, blend_within, blockwise_error, pixelwise_error, reproject,
};
use crate::{MaskingModel, ToneMap};
use plane::{Coded, Correspondence, Plane};
use std::sync::Arc;

/// Weight of the past in eq. (5), \[Herzog08, §5.2\].
pub const DEFAULT_WEIGHT: f32 = 0.5;

/// Weight of the past where e′ is what the encoder did: that changes from picture to picture with every level that is written
/// or not, and a cut that changes with it flickers. On `cornell` at quantiser 48 (128×128, 12 frames) the decoded film flickers
/// 7.6 % more than with cuts at 2 % for a weight of 0.5, 2.7 % more for 0.8, 3.2 % more for 0.95.
const CODED_WEIGHT: f32 = 0.8;

/// ΔY(t−1) counts as no more than this multiple of e there. After a flash, what its light allowed is soon of no use, and the
/// weight alone would let it fade for dozens of frames. On `cornell`, `nave` and `atrium` (160×160, quantisers 8 and 48) cuts are as large
/// as without this bound, and 2 % larger on `atrium` at 48, where bits and flicker fall by as much.
const CODED_PAST_MAX: f32 = 4.0;

/// A frame whose thresholds are wanted.
#[derive(Clone, Copy, Debug)]
pub struct ObservedFrame<'a> {
    /// Luma in code values above black, before rounding: see [`YCbCr::luma`](crate::YCbCr::luma).
    pub luma: &'a Plane<f32>,
    /// Linear luminance of the same size.
    pub luminance: &'a Plane<f32>,
    /// Where each pixel was in the frame observed before; `None` where nothing is known of that frame, as after a cut.
    pub known: Option<&'a Correspondence>,
}

/// Expected coding of a frame that the encoder has not coded yet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExpectedCoding {
    /// MPEG-2's quantiser_scale in force, 1…112.
    pub quantiser_scale: f32,
    /// Whether the frame will be an intra picture, the first of its group.
    pub begins_group: bool,
}

/// Holds ΔY(t) from frame to frame.
///
/// Frames are observed in display order. Equal inputs give equal thresholds, bit by bit, whatever the number of threads.
///
/// ```
/// use perceptual::{DEFAULT_WEIGHT, Feedback, MaskingModel, ObservedFrame, ToneMap, YCbCr, luminance_plane};
/// use plane::{Correspondence, Plane};
///
/// let tone_map = ToneMap::default();
/// let mut feedback = Feedback::new(MaskingModel::default(), tone_map, DEFAULT_WEIGHT);
/// let still = Correspondence::still(32, 16);
/// assert_eq!(feedback.thresholds_for_next(&still).get(3, 4), None, "2 % of luminance before anything was seen");
///
/// let radiance = Plane::from_fn(32, 16, |x, _| [0.1 + 0.01 * x as f32; 3]);
/// let picture = YCbCr::from_radiance(&radiance, &tone_map);
/// let luminance = luminance_plane(&radiance);
/// feedback.observe(ObservedFrame { luma: &picture.luma, luminance: &luminance, known: None }, 8.0);
/// assert!(feedback.thresholds_for_next(&still).get(3, 4).unwrap() >= 0.02 * 0.13);
/// ```
#[derive(Debug)]
pub struct Feedback {
    model: MaskingModel,
    scale: LuminanceScale,
    weight: f32,
    kappa: f32,
    thresholds: Arc<Plane<f32>>,
    predicted: PredictedCoding,
    non_finite: usize,
}

impl Feedback {
    /// No frame seen yet. `weight` is w of eq. (5), 0…1: how much of the past is kept.
    #[must_use]
    pub fn new(model: MaskingModel, tone_map: ToneMap, weight: f32) -> Self {
        let scale = LuminanceScale::new(&tone_map);
        Self {
            model,
            scale,
            weight,
            kappa: 1.0,
            thresholds: Arc::default(),
            predicted: PredictedCoding::default(),
            non_finite: 0,
        }
    }

    /// Multiplies what masking allows by κ, 0…1 and more: `e = max(0.02 · Y, κ · |Ŷ − Y|)` in place of eq. (4), which has
    /// κ = 1. NaN and negative values count as 0.
    ///
    /// A renderer that holds each of many contributions to the threshold, as a lightcut does each of its clusters, is wrong
    /// by more than the threshold in their sum: κ makes room for that.
    #[must_use]
    pub fn with_kappa(self, kappa: f32) -> Self {
        Self { kappa: kappa.max(0.0), ..self }
    }

    /// Takes in frame t and returns ΔY(t), by eqs. (1) to (5).
    ///
    /// `quantiser_scale` is that of MPEG-2, 1…112. A change of picture size starts afresh.
    ///
    /// # Panics
    /// If the planes of `frame` differ in size.
    pub fn observe(&mut self, frame: ObservedFrame, quantiser_scale: f32) -> &Plane<f32> {
        let ObservedFrame { luma, luminance, known } = frame;
        let distorted = self.model.worst_case_luma(luma, quantiser_scale);
        let e = pixelwise_error(luma, luminance, &distorted, self.kappa, &self.scale);
        self.take_in(e, known, self.weight, f32::INFINITY)
    }

    /// Takes in frame t and returns ΔY(t), from how the encoder coded the frame and will code the next: eqs. (6) to (8).
    ///
    /// κ multiplies e′ of eq. (8), and w is 0.8 whatever [`Feedback::new`] was given. The past counts as no more than 4 e′.
    /// Before an intra picture nothing is blended with the past: its pictures were predicted and might be wrong by more.
    ///
    /// # Panics
    /// If the planes of `frame` differ in size.
    pub fn observe_coded(
        &mut self,
        frame: ObservedFrame,
        steps: &QuantiserSteps,
        coded: &Coded,
        next: NextPicture,
    ) -> &Plane<f32> {
        let tolerable = CodedMasking::new(steps.clone()).tolerable_luma(frame.luma, coded, next);
        self.take_in_tolerable(frame, &tolerable, next)
    }

    /// [`Feedback::observe_coded`] for a frame that the encoder has not coded yet: its coding is predicted from the frame,
    /// its matches, and what is `expected` of the encoder.
    ///
    /// # Panics
    /// If the planes of `frame` differ in size.
    pub fn observe_predicted(
        &mut self,
        frame: ObservedFrame,
        steps: &QuantiserSteps,
        expected: ExpectedCoding,
        next: NextPicture,
    ) -> &Plane<f32> {
        let known = frame.known.filter(|_| !expected.begins_group);
        let coded = self.predicted.code(frame.luma, known, expected.quantiser_scale, steps);
        let tolerable = CodedMasking::new(steps.clone()).tolerable_luma(frame.luma, &coded, next);
        self.take_in_tolerable(frame, &tolerable, next)
    }

    fn take_in_tolerable(&mut self, frame: ObservedFrame, tolerable: &Plane<f32>, next: NextPicture) -> &Plane<f32> {
        let ObservedFrame { luma, luminance, known } = frame;
        let e = blockwise_error(luma, luminance, tolerable, self.kappa, &self.scale);
        let weight = if matches!(next, NextPicture::Intra { .. }) { 0.0 } else { CODED_WEIGHT };
        self.take_in(e, known, weight, CODED_PAST_MAX)
    }

    fn take_in(&mut self, e: TolerableError, known: Option<&Correspondence>, weight: f32, most: f32) -> &Plane<f32> {
        self.non_finite = e.non_finite;
        let size = (self.thresholds.width(), self.thresholds.height());
        let same_size = size == (e.error.width(), e.error.height());
        self.thresholds = Arc::new(match known {
            Some(known) if same_size => blend_within(&e.error, &self.thresholds, known, weight, most),
            _ => e.error,
        });
        &self.thresholds
    }

    /// ΔY(t) fetched along the motion of frame t+1: `known` says where each of its pixels was in the last observed frame.
    ///
    /// Before the first frame, 2 % of luminance everywhere.
    #[must_use]
    pub fn thresholds_for_next(&self, known: &Correspondence) -> ThresholdMap {
        reproject(&self.thresholds, known)
    }

    /// ΔY of the last observed frame; an empty plane before the first.
    #[must_use]
    pub fn thresholds(&self) -> &Arc<Plane<f32>> {
        &self.thresholds
    }

    /// Pixels of the last observed frame whose luma or luminance was not finite.
    #[must_use]
    pub fn non_finite(&self) -> usize {
        self.non_finite
    }

    /// Luma that [`Feedback::observe_predicted`] predicts for the last frame when decoded, 16 for black; an empty plane where
    /// no coding was predicted.
    #[must_use]
    pub fn predicted(&self) -> &Plane<u8> {
        self.predicted.decoded()
    }

    /// Forgets all frames.
    pub fn reset(&mut self) {
        self.thresholds = Arc::default();
        self.predicted = PredictedCoding::default();
        self.non_finite = 0;
    }

    /// Puts back ΔY of the last observed frame, as [`Feedback::thresholds`] gave it: for continuing an interrupted film.
    pub fn restore(&mut self, thresholds: impl Into<Arc<Plane<f32>>>) {
        self.thresholds = thresholds.into();
    }

    /// Puts back what [`Feedback::predicted`] gave: for continuing an interrupted film whose coding is predicted.
    pub fn restore_predicted(&mut self, decoded: Plane<u8>) {
        self.predicted = PredictedCoding::after(decoded);
    }
}
