//! The loop over frames: frame t sets the thresholds of frame t+1.

use crate::coded::{CodedMasking, NextPicture, QuantiserSteps};
use crate::predicted::PredictedCoding;
use crate::threshold_map::{
    LuminanceScale, ThresholdMap, TolerableError, blend_within, blockwise_error, pixelwise_error, reproject,
};
use crate::{MaskingModel, ToneMap};
use plane::{Coded, Correspondence, Plane};
use std::sync::Arc;

/// Weight w of the past in eq. (5), as in \[Herzog08, §5.2\].
pub const DEFAULT_WEIGHT: f32 = 0.5;

/// Weight w of the past if e′ follows from the encoder's coding. This e′ changes from picture to picture with every
/// written level. A lightcut that follows these changes flickers. The table lists the excess flicker on `cornell` at
/// quantiser 48 (128×128, 12 frames), compared with lightcuts at 2 %:
///
/// | weight | excess flicker |
/// |---|---|
/// | 0.5 | 7.6 % |
/// | 0.8 | 2.7 % |
/// | 0.95 | 3.2 % |
const CODED_WEIGHT: f32 = 0.8;

/// Upper limit of ΔY(t−1), as a multiple of the current e. Thresholds from a flash are obsolete when the flash ends.
/// With the weight alone they would fade over dozens of frames.
///
/// On `cornell` and `nave` at quantisers 8 and 48, and on `atrium` at 8 (160×160), lightcuts are as large as without
/// this limit. On `atrium` at 48, lightcuts are 2 % larger, and bits and flicker are 2 % smaller.
const CODED_PAST_MAX: f32 = 4.0;

/// A frame for which tolerable errors are computed.
#[derive(Clone, Copy, Debug)]
pub struct ObservedFrame<'a> {
    /// Luma before rounding, in code values above black: see [`YCbCr::luma`](crate::YCbCr::luma).
    pub luma: &'a Plane<f32>,
    /// Linear luminance. The plane has the size of `luma`.
    pub luminance: &'a Plane<f32>,
    /// Correspondence to the previously observed frame. `None` if it is unknown, for example after a shot change.
    pub known: Option<&'a Correspondence>,
}

/// Expected coding of a frame that is not encoded yet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExpectedCoding {
    /// Expected MPEG-2 quantiser_scale, 1…112.
    pub quantiser_scale: f32,
    /// Whether the frame will be an intra picture, the first picture of its group.
    pub begins_group: bool,
}

/// Threshold state ΔY(t) of the loop over frames.
///
/// Frames are observed in display order. Equal inputs give bit-identical thresholds for any number of threads.
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
    /// Creates the state before the first frame. `weight` is w of eq. (5), the weight of the past, 0…1.
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

    /// Sets a factor κ ≥ 0 on the masked error: eq. (4) becomes `e = max(0.02 · Y, κ · |Ŷ − Y|)`. NaN and negative
    /// values become 0.
    ///
    /// A lightcut compares the error bound of each cluster with the threshold, so the sum of all errors may exceed the
    /// threshold. A smaller κ compensates for this.
    #[must_use]
    pub fn with_kappa(self, kappa: f32) -> Self {
        Self { kappa: kappa.max(0.0), ..self }
    }

    /// Observes frame t and returns ΔY(t) according to eqs. (1) to (5).
    ///
    /// `quantiser_scale` is MPEG-2's quantiser_scale, 1…112. A change of picture size resets the state.
    ///
    /// # Panics
    /// If the planes of `frame` have different sizes.
    pub fn observe(&mut self, frame: ObservedFrame, quantiser_scale: f32) -> &Plane<f32> {
        let ObservedFrame { luma, luminance, known } = frame;
        let distorted = self.model.worst_case_luma(luma, quantiser_scale);
        let e = pixelwise_error(luma, luminance, &distorted, self.kappa, &self.scale);
        self.take_in(e, known, self.weight, f32::INFINITY)
    }

    /// Observes frame t and returns ΔY(t) according to eqs. (4) to (8), from the coding of this frame and the mode of
    /// the next.
    ///
    /// κ multiplies e′ of eq. (8). w is 0.8. The weight of [`Feedback::new`] does not apply. ΔY(t−1) is limited to 4 e.
    /// Before an intra picture the past is not blended in, because its thresholds are for predicted pictures and would
    /// be too large.
    ///
    /// # Panics
    /// If the planes of `frame` have different sizes.
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

    /// Observes a frame that is not encoded yet, like [`Feedback::observe_coded`]. The coding is predicted from the
    /// frame, its matches and the `expected` coding parameters.
    ///
    /// # Panics
    /// If the planes of `frame` have different sizes.
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

    /// Returns ΔY(t) reprojected to frame t+1. `known` is the correspondence from the pixels of frame t+1 to the last
    /// observed frame.
    ///
    /// Before the first frame, thresholds are 2 % of luminance everywhere.
    #[must_use]
    pub fn thresholds_for_next(&self, known: &Correspondence) -> ThresholdMap {
        reproject(&self.thresholds, known)
    }

    /// ΔY of the last observed frame, or an empty plane before the first frame.
    #[must_use]
    pub fn thresholds(&self) -> &Arc<Plane<f32>> {
        &self.thresholds
    }

    /// Number of pixels of the last observed frame that have a luma or luminance that is not finite.
    #[must_use]
    pub fn non_finite(&self) -> usize {
        self.non_finite
    }

    /// Decoded luma of the last frame as predicted by [`Feedback::observe_predicted`]. Code value 16 is black. Empty if
    /// no coding was predicted.
    #[must_use]
    pub fn predicted(&self) -> &Plane<u8> {
        self.predicted.decoded()
    }

    /// Resets the state to the state before the first frame.
    pub fn reset(&mut self) {
        self.thresholds = Arc::default();
        self.predicted = PredictedCoding::default();
        self.non_finite = 0;
    }

    /// Restores ΔY of the last observed frame, from [`Feedback::thresholds`], to continue an interrupted film.
    pub fn restore(&mut self, thresholds: impl Into<Arc<Plane<f32>>>) {
        self.thresholds = thresholds.into();
    }

    /// Restores the decoded luma, from [`Feedback::predicted`], to continue an interrupted film with predicted coding.
    pub fn restore_predicted(&mut self, decoded: Plane<u8>) {
        self.predicted = PredictedCoding::after(decoded);
    }
}
