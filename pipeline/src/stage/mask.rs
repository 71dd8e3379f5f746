//! What may be wrong in the next frame without being seen: the way back from the codec to the renderer.

use crate::message::{LuminanceThresholds, MaskingTime, ToMask};
use crate::settings::Settings;
use anyhow::Result;
use crossbeam_channel::{Receiver, Sender};
use perceptual::{DEFAULT_WEIGHT, Feedback, MaskingModel};
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
    let pool = super::pool_of_one()?;
    let mut feedback: Option<Feedback> = None;
    for message in frames {
        let busy = Busy::default();
        let feedback = feedback.get_or_insert_with(|| {
            Feedback::new(MaskingModel::default(), message.tone_map, DEFAULT_WEIGHT).with_kappa(settings.kappa)
        });
        let matches = message.correspondence.as_ref().map(|correspondence| &correspondence.matches);
        let delta = pool.install(|| {
            let quantiser_scale = settings.qscale as f32;
            busy.measure(|| {
                feedback.observe(&message.picture.luma, &message.luminance, quantiser_scale, matches).clone()
            })
        });
        let seconds = busy.seconds();
        let _ = times.send(MaskingTime { of: message.frame, seconds });
        let _ = thresholds.send(LuminanceThresholds { of: message.frame, delta, luminance: message.luminance });
    }
    Ok(())
}
