//! The loop over frames: what was seen in frame t decides how exact frame t+1 has to be.

use crate::coded::{CodedMasking, CodedPicture, NextPicture, QuantiserSteps};
use crate::foretold::ForetoldCoding;
use crate::threshold_map::{
    LuminanceScale, ThresholdMap, TolerableError, blend_within, blockwise_error, carry, scaled_error,
};
use crate::{MaskingModel, ToneMap};
use plane::Plane;

/// Weight of the past in eq. (5), \[Herzog08, §5.2\].
pub const DEFAULT_WEIGHT: f32 = 0.5;

/// Weight of the past where e′ is what the encoder did: that changes from picture to picture with every level that is written
/// or not, and a cut that changes with it flickers. On `cornell` at quantiser 48 (128×128, 12 frames) the decoded film flickers
/// 7.6 % more than with cuts at 2 % for a weight of 0.5, 2.7 % more for 0.8, 3.2 % more for 0.95.
const CODED_WEIGHT: f32 = 0.8;

/// ΔY(t−1) counts as no more than so many times e there. Behind a flash, what was allowed in its light is soon of no use, and the
/// weight alone would let it fade for dozens of frames. On `cornell`, `nave` and `atrium` (160×160, quantisers 8 and 48) cuts are as large
/// as without this bound, and 2 % larger on `atrium` at 48, where bits and flicker fall by as much.
const CODED_PAST_MAX: f32 = 4.0;

/// Holds ΔY(t) from frame to frame.
///
/// Frames are observed in display order. Equal inputs give equal thresholds, bit by bit, whatever the number of threads.
///
/// ```
/// use perceptual::{DEFAULT_WEIGHT, Feedback, MaskingModel, ToneMap, YCbCr, luminance_plane, still_matches};
/// use plane::Plane;
///
/// let tone_map = ToneMap::default();
/// let mut feedback = Feedback::new(MaskingModel::default(), tone_map, DEFAULT_WEIGHT);
/// let still = still_matches(32, 16);
/// assert_eq!(feedback.thresholds_for_next(&still).get(3, 4), None, "2 % of luminance before anything was seen");
///
/// let radiance = Plane::from_fn(32, 16, |x, _| [0.1 + 0.01 * x as f32; 3]);
/// let picture = YCbCr::from_radiance(&radiance, &tone_map);
/// feedback.observe(&picture.luma, &luminance_plane(&radiance), 8.0, None);
/// assert!(feedback.thresholds_for_next(&still).get(3, 4).unwrap() >= 0.02 * 0.13);
/// ```
pub struct Feedback {
    model: MaskingModel,
    scale: LuminanceScale,
    weight: f32,
    kappa: f32,
    thresholds: Plane<f32>,
    foretold: ForetoldCoding,
    non_finite: usize,
}

impl Feedback {
    /// No frame seen yet. `weight` is w of eq. (5), 0…1: how much of the past is kept.
    pub fn new(model: MaskingModel, tone_map: ToneMap, weight: f32) -> Self {
        let scale = LuminanceScale::new(&tone_map);
        Self {
            model,
            scale,
            weight,
            kappa: 1.0,
            thresholds: Plane::default(),
            foretold: ForetoldCoding::default(),
            non_finite: 0,
        }
    }

    /// Multiplies what masking allows by κ, 0…1 and more: `e = max(0.02 · Y, κ · |Ŷ − Y|)` in place of eq. (4), which has
    /// κ = 1. NaN and negative values count as 0.
    ///
    /// A renderer that holds each of many contributions to the threshold, as a lightcut does each of its clusters, is wrong
    /// by more than the threshold in their sum: κ makes room for that.
    pub fn with_kappa(self, kappa: f32) -> Self {
        Self { kappa: kappa.max(0.0), ..self }
    }

    /// Takes in frame t and returns ΔY(t).
    ///
    /// `luma` in code values above black, `luminance` linear, `quantiser_scale` 1…112. `matches` says where each pixel was in
    /// the frame observed before (see [`blend`](crate::blend)); `None` says that nothing is known of it, as after a cut.
    /// A change of picture size starts afresh.
    ///
    /// # Panics
    /// If the planes differ in size.
    pub fn observe(
        &mut self,
        luma: &Plane<f32>,
        luminance: &Plane<f32>,
        quantiser_scale: f32,
        matches: Option<&Plane<u32>>,
    ) -> &Plane<f32> {
        let e = scaled_error(luma, luminance, quantiser_scale, self.kappa, &self.scale, &self.model);
        self.take_in(e, matches, self.weight, f32::INFINITY)
    }

    /// The same from what the encoder made of the frame, and will make of the next: κ multiplies e′ of eq. (8) in
    /// [`coded`](crate::CodedPicture), and w is 0.8 whatever [`Feedback::new`] was given, with no more than 4 e′ of the past. What an intra picture may be wrong by
    /// is not blended with the past, in which pictures were predicted and might be wrong by more.
    ///
    /// # Panics
    /// If the planes differ in size.
    pub fn observe_coded(
        &mut self,
        luma: &Plane<f32>,
        luminance: &Plane<f32>,
        steps: &QuantiserSteps,
        (coded, next): (&CodedPicture, NextPicture),
        matches: Option<&Plane<u32>>,
    ) -> &Plane<f32> {
        let tolerable = CodedMasking::new(steps.clone()).tolerable_luma(luma, coded, next);
        self.take_in_tolerable(luma, luminance, &tolerable, next, matches)
    }

    /// The same where the encoder has not coded the frame yet: what it will do is foretold from the frame, where its pixels
    /// come from, and the quantiser in force. `begins_group` says that the frame will be coded by itself.
    ///
    /// # Panics
    /// If the planes differ in size.
    pub fn observe_foretold(
        &mut self,
        luma: &Plane<f32>,
        luminance: &Plane<f32>,
        steps: &QuantiserSteps,
        (quantiser_scale, begins_group, next): (f32, bool, NextPicture),
        matches: Option<&Plane<u32>>,
    ) -> &Plane<f32> {
        let known = matches.filter(|_| !begins_group);
        let coded = self.foretold.code(luma, known, quantiser_scale, steps);
        let tolerable = CodedMasking::new(steps.clone()).tolerable_luma(luma, &coded, next);
        self.take_in_tolerable(luma, luminance, &tolerable, next, matches)
    }

    fn take_in_tolerable(
        &mut self,
        luma: &Plane<f32>,
        luminance: &Plane<f32>,
        tolerable: &Plane<f32>,
        next: NextPicture,
        matches: Option<&Plane<u32>>,
    ) -> &Plane<f32> {
        let e = blockwise_error(luma, luminance, tolerable, self.kappa, &self.scale);
        let weight = if matches!(next, NextPicture::Intra { .. }) { 0.0 } else { CODED_WEIGHT };
        self.take_in(e, matches, weight, CODED_PAST_MAX)
    }

    fn take_in(&mut self, e: TolerableError, matches: Option<&Plane<u32>>, weight: f32, most: f32) -> &Plane<f32> {
        self.non_finite = e.non_finite;
        let size = (self.thresholds.width(), self.thresholds.height());
        let same_size = size == (e.error.width(), e.error.height());
        self.thresholds = match matches {
            Some(matches) if same_size => blend_within(&e.error, &self.thresholds, matches, weight, most),
            _ => e.error,
        };
        &self.thresholds
    }

    /// ΔY(t) fetched along the motion of frame t+1: `matches` says where each of its pixels was in the last observed frame.
    ///
    /// Before the first frame, 2 % of luminance everywhere.
    pub fn thresholds_for_next(&self, matches: &Plane<u32>) -> ThresholdMap {
        carry(&self.thresholds, matches)
    }

    /// ΔY of the last observed frame; an empty plane before the first.
    pub fn thresholds(&self) -> &Plane<f32> {
        &self.thresholds
    }

    /// Pixels of the last observed frame whose luma or luminance was not finite.
    pub fn non_finite(&self) -> usize {
        self.non_finite
    }

    /// Luma as [`Feedback::observe_foretold`] takes the last frame to be decoded; an empty plane where that was not asked.
    pub fn foretold(&self) -> &Plane<u8> {
        self.foretold.decoded()
    }

    /// Forgets all frames.
    pub fn reset(&mut self) {
        self.thresholds = Plane::default();
        self.foretold = ForetoldCoding::default();
        self.non_finite = 0;
    }

    /// Puts back ΔY of the last observed frame, as [`Feedback::thresholds`] gave it: for continuing an interrupted film.
    pub fn restore(&mut self, thresholds: Plane<f32>) {
        self.thresholds = thresholds;
    }

    /// Puts back what [`Feedback::foretold`] gave, where frames are observed so.
    pub fn restore_foretold(&mut self, decoded: Plane<u8>) {
        self.foretold = ForetoldCoding::behind(decoded);
    }
}
