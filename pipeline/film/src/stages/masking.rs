//! Masking stage of a film: computes the largest invisible error of the next frame.

use crate::settings::Settings;
use perceptual::{DEFAULT_WEIGHT, ExpectedCoding, Feedback, MaskingModel, ObservedFrame, QuantiserSteps, ToneMap};
use pipeline::chunks::begins_chunk;
use pipeline::error::Result;
use pipeline::stage::{Coding, Displayed, LuminanceThresholds, Mask};
use pipeline::state::{decode, encode};
use plane::Plane;
use renderer::settings::RenderSettings;
use renderer::settings::Thresholds;
use std::sync::Arc;

/// Computes the luminance thresholds ΔY(t) of each frame t in display order, with the kind of thresholds in the
/// settings.
pub struct Masking {
    thresholds: Thresholds,
    kappa: f32,
    /// Number of frames per chunk; masking is reset at the first frame of each chunk.
    chunk: Option<u32>,
    steps: QuantiserSteps,
    /// Masking feedback, created with the first frame, which may set the exposure.
    feedback: Option<Feedback>,
    /// ΔY and predicted luma of the last frame before a resumed film continues; `None` otherwise.
    last: Option<(Arc<Plane<f32>>, Plane<u8>)>,
}

impl Masking {
    /// Returns the masking stage of a new film.
    ///
    /// # Errors
    /// If no encoder supports the settings.
    pub fn new(settings: &Settings) -> crate::Result<Self> {
        let config = settings.encoder_config()?;
        // Compute the quantiser steps of the film, with the intra DC step for 8 to 11 bits of precision.
        let (intra_matrix, non_intra_matrix) = config.matrices();
        let intra_dc_step = f32::from(8u8 >> (config.intra_dc_precision() - 8));
        let steps = QuantiserSteps { intra_matrix, non_intra_matrix, intra_dc_step };
        let RenderSettings { thresholds, kappa, chunk, .. } = settings.render;
        Ok(Self { thresholds, kappa, chunk, steps, feedback: None, last: None })
    }

    fn begin(kappa: f32, tone_map: ToneMap, last: Option<(Arc<Plane<f32>>, Plane<u8>)>) -> Feedback {
        let mut feedback = Feedback::new(MaskingModel::default(), tone_map, DEFAULT_WEIGHT).with_kappa(kappa);
        // Continue a resumed film from the thresholds and the predicted luma of its last frame.
        if let Some((delta, predicted)) = last {
            feedback.restore(delta);
            feedback.restore_predicted(predicted);
        }
        feedback
    }
}

impl std::fmt::Debug for Masking {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Masking").field("thresholds", &self.thresholds).finish_non_exhaustive()
    }
}

impl Mask for Masking {
    fn step(&mut self, displayed: &Displayed, coding: &Coding) -> Arc<Plane<f32>> {
        let Self { thresholds, kappa, chunk, steps, feedback, last } = self;
        // Reset the feedback at each chunk, because chunks must not depend on earlier frames.
        if begins_chunk(*chunk, displayed.index) {
            (*feedback, *last) = (None, None);
        }
        let feedback = feedback.get_or_insert_with(|| Self::begin(*kappa, displayed.tone_map, last.take()));
        let (luma, luminance) = (&displayed.picture.luma, &displayed.luminance);
        let known = displayed.correspondence.as_deref();
        let frame = ObservedFrame { luma, luminance, known };
        let &Coding { quantiser_scale, ref outcome, begins_group, next } = coding;
        // Derive thresholds from the measured coding loss where the encoder provides it.
        match (*thresholds, outcome) {
            (Thresholds::Codec, Some(coded)) => feedback.observe_coded(frame, steps, coded, next),
            // Predict the coding loss, because the encoder has not coded the picture yet.
            (Thresholds::Codec, None) => {
                let expected = ExpectedCoding { quantiser_scale, begins_group };
                feedback.observe_predicted(frame, steps, expected, next)
            }
            _ => feedback.observe(frame, quantiser_scale),
        };
        feedback.thresholds().clone()
    }

    /// Returns the predicted luma of the last frame as bytes.
    fn state(&self) -> Vec<u8> {
        encode(&self.feedback.as_ref().map(|feedback| feedback.predicted()))
    }

    fn restore(&mut self, state: &[u8], thresholds: &LuminanceThresholds) -> Result<()> {
        let predicted: Option<Plane<u8>> = decode(state)?;
        self.last = Some((thresholds.delta.clone(), predicted.unwrap_or_default()));
        Ok(())
    }
}
