//! What may be wrong in the next frame without being seen: the way back from the codec to the renderer.

use crate::checkpoint::{Checkpoints, Part};
use crate::error::Result;
use crate::message::{Coding, LuminanceThresholds, MaskingTime, ToMask};
use crate::observe::Observer;
use crate::settings::{Settings, Thresholds};
use crate::video::CodingOutcome;
use crossbeam_channel::{Receiver, Sender};
use perceptual::{
    CodedPicture, DEFAULT_WEIGHT, ExpectedCoding, Feedback, MaskingModel, ObservedFrame, QuantiserSteps, still_matches,
};
use plane::Plane;
use render_core::Busy;

/// Derives ΔY(t) from each frame t, in display order, and sends it back stamped with t.
///
/// The renderer needs no thresholds after its last frame: that nobody takes them then is no failure.
///
/// # Errors
/// The system gives no thread.
pub fn run(
    settings: &Settings,
    frames: &Receiver<ToMask>,
    thresholds: &Sender<LuminanceThresholds>,
    times: &Sender<MaskingTime>,
) -> Result<()> {
    let codings = std::iter::repeat_with(|| Coding::of_quantiser(settings.qscale as f32));
    run_from(&Checkpoints::off(), &(), settings, codings, frames, thresholds, times)
}

/// The same from where `checkpoints` say. `codings` gives how each frame in turn was coded, or what is known of it when the
/// frame has come to the encoder.
///
/// # Errors
/// As those of [`run`], or a checkpoint cannot be read or written.
pub fn run_from(
    checkpoints: &Checkpoints,
    observer: &dyn Observer,
    settings: &Settings,
    mut codings: impl Iterator<Item = Coding>,
    frames: &Receiver<ToMask>,
    thresholds: &Sender<LuminanceThresholds>,
    times: &Sender<MaskingTime>,
) -> Result<()> {
    let pool = super::pool_of_one()?;
    let mut feedback: Option<Feedback> = None;
    let steps = quantiser_steps(settings)?;
    let known = known(checkpoints)?;
    let (mut resumed, mut spent) = (None, Vec::new());
    if let Some(((delta, luminance, predicted), times)) = known {
        (resumed, spent) = (Some((delta.clone(), predicted)), times);
        let _ = thresholds.send(LuminanceThresholds { of: checkpoints.first_frame() - 1, delta, luminance });
    }
    for &time in &spent {
        let _ = times.send(time);
    }
    // The last thresholds, for a run that ends early: what was sent is not seen again.
    let mut last: Option<(u32, Masked)> = None;
    for message in frames {
        // None: the encoder has failed, and will say so.
        let Some(coding) = codings.next() else { return Ok(()) };
        let span = tracing::debug_span!("mask", frame = message.frame).entered();
        let busy = Busy::default();
        let feedback = feedback.get_or_insert_with(|| {
            let mut feedback =
                Feedback::new(MaskingModel::default(), message.tone_map, DEFAULT_WEIGHT).with_kappa(settings.kappa);
            if let Some((delta, predicted)) = resumed.take() {
                feedback.restore(delta);
                feedback.restore_predicted(predicted);
            }
            feedback
        });
        let matches = message.correspondence.as_ref().map(|correspondence| &correspondence.matches);
        let delta = pool.install(|| {
            busy.measure(|| match settings.thresholds {
                Thresholds::Uniform(share) => message.luminance.map(|luminance| share * luminance),
                _ => observe(feedback, settings, &steps, &message, &coding, matches).clone(),
            })
        });
        observer.thresholds(message.frame, &delta);
        let seconds = busy.seconds();
        let time = MaskingTime { of: message.frame, seconds };
        spent.push(time);
        if message.checkpoint {
            checkpoints.leave(
                message.frame,
                Part::Mask,
                &((&delta, &message.luminance, feedback.predicted()), &spent),
            )?;
        }
        if checkpoints.are_on() {
            last = Some((message.frame, (delta.clone(), message.luminance.clone(), feedback.predicted().clone())));
        }
        let _ = times.send(time);
        drop(span);
        let _ = thresholds.send(LuminanceThresholds { of: message.frame, delta, luminance: message.luminance });
    }
    match last.filter(|(frame, ..)| checkpoints.ends_behind(*frame)) {
        Some((frame, masked)) => checkpoints.leave(frame, Part::Mask, &(masked, spent)),
        None => Ok(()),
    }
}

/// ΔY and luminance of the last frame that is done, and its decoded luma where its coding is predicted.
type Masked = (Plane<f32>, Plane<f32>, Plane<u8>);
/// And what masking took so far.
type Known = (Masked, Vec<MaskingTime>);

/// What a checkpoint has of it.
pub(super) fn known(checkpoints: &Checkpoints) -> Result<Option<Known>> {
    checkpoints.part(Part::Mask)
}

/// ΔY(t): by what the encoder did, or will do where it has not come so far; or by what any might do with its quantiser.
fn observe<'a>(
    feedback: &'a mut Feedback,
    settings: &Settings,
    steps: &QuantiserSteps,
    message: &ToMask,
    coding: &Coding,
    matches: Option<&Plane<u32>>,
) -> &'a Plane<f32> {
    let (luma, luminance) = (&message.picture.luma, &message.luminance);
    let frame = ObservedFrame { luma, luminance, matches };
    let &Coding { quantiser_scale, ref outcome, next } = coding;
    match (settings.thresholds, outcome) {
        (Thresholds::Codec, Some(CodingOutcome { decoded, levels, intra, quantiser_scales })) => {
            let coded = CodedPicture { decoded, levels, intra, quantiser_scales };
            feedback.observe_coded(frame, steps, &coded, next)
        }
        (Thresholds::Quantised, Some(CodingOutcome { decoded, .. })) => {
            let quantised = decoded.map(|sample| f32::from(sample) - 16.0);
            let still = still_matches(luma.width(), luma.height());
            let matches = matches.map(|_| &still);
            feedback.observe(ObservedFrame { luma: &quantised, luminance, matches }, quantiser_scale)
        }
        (Thresholds::Codec, None) => {
            let begins_group = message.frame.is_multiple_of(settings.gop);
            let expected = ExpectedCoding { quantiser_scale, begins_group };
            feedback.observe_predicted(frame, steps, expected, next)
        }
        _ => feedback.observe(frame, quantiser_scale),
    }
}

/// What the encoder of a film quantises with.
fn quantiser_steps(settings: &Settings) -> Result<QuantiserSteps> {
    let config = settings.encoder_config()?;
    let (intra_matrix, non_intra_matrix) = config.matrices();
    let intra_dc_step = f32::from(8u8 >> (config.intra_dc_precision() - 8));
    Ok(QuantiserSteps { intra_matrix, non_intra_matrix, intra_dc_step })
}
