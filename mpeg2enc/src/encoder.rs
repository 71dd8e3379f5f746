//! Pictures in, packets out, without delay: I and P.

use crate::{
    Config, ConfigError, Picture, PictureType,
    coder::{Coder, Direction, Job, Packet, sequence_end},
    config::quantiser_scale_code,
    header::{VBV_DELAY_VARIABLE, macroblock_counts},
    motion::{CoarseSearch, HalfSample, all_candidates, quarter},
};
use plane::{Correspondence, Plane};
use std::sync::Arc;

/// Encodes pictures one by one, each as soon as it comes in; made by [`Config::encoder`].
pub struct Encoder {
    coder: Coder,
    state: EncoderState,
}

/// What an [`Encoder`] carries from one picture to the next: with it, another one of the same settings goes on.
#[derive(Clone, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct EncoderState {
    /// Pictures coded so far.
    count: u64,
    /// Reconstruction of the last picture, in whole macroblocks.
    reference: Option<Arc<Picture>>,
    /// Vectors of the last picture, or empty.
    vectors: Vec<HalfSample>,
}

impl Encoder {
    pub(crate) fn new(config: Config) -> Self {
        Self { coder: Coder::new(config, false), state: EncoderState::default() }
    }

    /// The settings it was made with.
    pub fn config(&self) -> &Config {
        &self.coder.config
    }

    /// All that the next packets depend on, besides settings and frames.
    pub fn state(&self) -> &EncoderState {
        &self.state
    }

    /// Goes on where an encoder of the same settings was; the state of one with other settings gives a damaged stream or a
    /// panic.
    pub fn restore(&mut self, state: EncoderState) {
        self.state = state;
    }

    /// Uses another quantiser from the next picture on.
    pub fn set_quantiser_scale(&mut self, quantiser_scale: u32) -> Result<(), ConfigError> {
        quantiser_scale_code(quantiser_scale)?;
        let config = self.config();
        config.standard.check(&config.clone().with_quantiser_scale(quantiser_scale))?;
        self.coder.set_quantiser_scale(quantiser_scale);
        Ok(())
    }

    /// Encodes the next frame.
    ///
    /// `motion` tells where each pixel was in the frame before; without it, vectors are searched for.
    /// It changes what is tried, never what is correct, and is not looked at for an I picture.
    ///
    /// # Panics
    /// If frame or motion have another size than the [`Config`].
    pub fn push(&mut self, frame: &Picture, motion: Option<&Correspondence>) -> Packet {
        let config = &self.coder.config;
        config.check_input(frame, motion);
        let (columns, rows) = macroblock_counts(config.width, config.height);
        let place_in_group = self.state.count % u64::from(config.gop);
        let quantiser_scale = config.quantiser_scale;
        let source = self.coder.whole(frame);
        let reference = self.state.reference.take().filter(|_| place_in_group != 0);
        let candidates = match motion.filter(|_| reference.is_some()) {
            Some(known) => all_candidates(known, columns, rows),
            None => Vec::new(),
        };
        let quarters: Option<[Plane<u8>; 2]> = reference
            .as_ref()
            .filter(|_| motion.is_none() || candidates.iter().any(|candidates| candidates.is_uncovered))
            .map(|reference| [quarter(source.luma()), quarter(reference.luma())]);
        let forward = reference.as_ref().map(|reference| Direction {
            reference,
            candidates: &candidates,
            before: &self.state.vectors,
            coarse: quarters.as_ref().map(|[source, reference]| CoarseSearch { source, reference }),
        });
        let coded = self.coder.code(&Job {
            picture_type: if forward.is_some() { PictureType::P } else { PictureType::I },
            display_index: self.state.count,
            temporal_reference: place_in_group as u32,
            vbv_delay: VBV_DELAY_VARIABLE,
            source: &source,
            directions: [forward, None],
            quantiser_scale,
            scales_x16: &vec![16 * quantiser_scale; columns * rows],
        });
        let mut packet = coded.packet;
        if packet.picture_type == PictureType::I {
            packet.prepend(self.coder.group_headers(self.state.count, true));
        }
        let [vectors, _] = coded.vectors;
        self.state.vectors = vectors;
        self.state.reference = coded.reference;
        self.state.count += 1;
        packet
    }

    /// The end of the stream: sequence_end_code.
    pub fn finish(self) -> Vec<u8> {
        sequence_end()
    }
}
