//! What may be wrong in the next frame without being seen: the way back from the codec to the renderer.

use crate::message::{LuminanceThresholds, MaskingTime, ToMask};
use crate::settings::Settings;
use crossbeam_channel::{Receiver, Sender};
use perceptual::{DEFAULT_WEIGHT, Feedback, MaskingModel};
use std::time::Instant;

/// Derives ΔY(t) from each frame t, in display order, and sends it back stamped with t.
///
/// The renderer needs no thresholds after its last frame: that nobody takes them then is no failure.
pub fn run(
    settings: &Settings,
    frames: &Receiver<ToMask>,
    thresholds: &Sender<LuminanceThresholds>,
    times: &Sender<MaskingTime>,
) {
    let mut feedback: Option<Feedback> = None;
    for message in frames {
        let start = Instant::now();
        let feedback =
            feedback.get_or_insert_with(|| Feedback::new(MaskingModel::default(), message.tone_map, DEFAULT_WEIGHT));
        let matches = message.correspondence.as_ref().map(|correspondence| &correspondence.matches);
        let delta =
            feedback.observe(&message.picture.luma, &message.luminance, settings.qscale as f32, matches).clone();
        let seconds = start.elapsed().as_secs_f64();
        let _ = times.send(MaskingTime { of: message.frame, seconds });
        let _ = thresholds.send(LuminanceThresholds { of: message.frame, delta });
    }
}
