//! What may be wrong in the next frame without being seen: the way back from the codec to the renderer.

use crate::checkpoint::{Checkpoints, Part};
use crate::message::{LuminanceThresholds, MaskingTime, ToMask};
use crate::observe::Observer;
use crate::settings::Settings;
use anyhow::Result;
use crossbeam_channel::{Receiver, Sender};
use perceptual::{DEFAULT_WEIGHT, Feedback, MaskingModel};
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
    let quantisers = std::iter::repeat(settings.qscale as f32);
    run_from(&Checkpoints::off(), &(), settings, quantisers, frames, thresholds, times)
}

/// The same from where `checkpoints` say. `quantisers` gives the quantiser_scale of each frame in turn, or what is known of it
/// when the frame comes to the encoder.
///
/// # Errors
/// As those of [`run`], or a checkpoint cannot be read or written.
pub fn run_from(
    checkpoints: &Checkpoints,
    observer: &dyn Observer,
    settings: &Settings,
    mut quantisers: impl Iterator<Item = f32>,
    frames: &Receiver<ToMask>,
    thresholds: &Sender<LuminanceThresholds>,
    times: &Sender<MaskingTime>,
) -> Result<()> {
    let pool = super::pool_of_one()?;
    let mut feedback: Option<Feedback> = None;
    let known: Option<(Plane<f32>, Plane<f32>, Vec<MaskingTime>)> = checkpoints.part(Part::Mask)?;
    let (mut resumed, mut spent) = (None, Vec::new());
    if let Some((delta, luminance, times)) = known {
        (resumed, spent) = (Some(delta.clone()), times);
        let _ = thresholds.send(LuminanceThresholds { of: checkpoints.first_frame() - 1, delta, luminance });
    }
    for &time in &spent {
        let _ = times.send(time);
    }
    // The last thresholds, for a run that ends early: what was sent is not seen again.
    let mut last: Option<(u32, Plane<f32>, Plane<f32>)> = None;
    for message in frames {
        // None: the encoder has failed, and will say so.
        let Some(quantiser_scale) = quantisers.next() else { return Ok(()) };
        let span = tracing::debug_span!("mask", frame = message.frame).entered();
        let busy = Busy::default();
        let feedback = feedback.get_or_insert_with(|| {
            let mut feedback =
                Feedback::new(MaskingModel::default(), message.tone_map, DEFAULT_WEIGHT).with_kappa(settings.kappa);
            resumed.take().into_iter().for_each(|delta| feedback.restore(delta));
            feedback
        });
        let matches = message.correspondence.as_ref().map(|correspondence| &correspondence.matches);
        let delta = pool.install(|| {
            busy.measure(|| {
                feedback.observe(&message.picture.luma, &message.luminance, quantiser_scale, matches).clone()
            })
        });
        observer.thresholds(message.frame, &delta);
        let seconds = busy.seconds();
        let time = MaskingTime { of: message.frame, seconds };
        spent.push(time);
        if message.checkpoint {
            checkpoints.leave(message.frame, Part::Mask, &(&delta, &message.luminance, &spent))?;
        }
        if checkpoints.are_on() {
            last = Some((message.frame, delta.clone(), message.luminance.clone()));
        }
        let _ = times.send(time);
        drop(span);
        let _ = thresholds.send(LuminanceThresholds { of: message.frame, delta, luminance: message.luminance });
    }
    match last.filter(|(frame, ..)| checkpoints.ends_behind(*frame)) {
        Some((frame, delta, luminance)) => checkpoints.leave(frame, Part::Mask, &(delta, luminance, spent)),
        None => Ok(()),
    }
}
