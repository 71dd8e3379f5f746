//! The encoder: accepts pictures and returns packets, immediately or after a look-ahead.

mod ahead;
mod immediate;
mod weighted;

use crate::{
    Config, ConfigError, Picture, RestoreError, SuppliedMotion,
    coder::{Coder, Packet, sequence_end},
    lookahead::weights,
    quantiser_scale::quantiser_scale_code,
};
use ahead::Ahead;
use immediate::Immediate;
use plane::{Correspondence, Plane};
use std::fmt;

/// Encodes pictures; made by [`Config::encoder`].
///
/// Without a look-ahead each frame immediately yields one packet, an I or P picture. All its macroblocks have one quantiser
/// unless weights are given.
///
/// With [`Config::with_lookahead`], packets are delayed and follow the order of coding, which is the order of the stream. A B
/// picture follows the I or P picture displayed after it. [`Packet::display_index`] identifies the frame.
#[must_use = "an encoder only codes the frames pushed to it"]
pub struct Encoder {
    coder: Coder,
    state: EncoderState,
}

/// State of an [`Encoder`] between two pictures, including waiting frames.
///
/// [`Encoder::restore`] continues from this state. With the feature `serde`, another process can continue from it.
#[derive(Clone)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct EncoderState {
    /// [`Config::fingerprint`] of the settings.
    settings: u64,
    mode: CodingMode,
}

#[derive(Clone)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
enum CodingMode {
    Immediate(Immediate),
    Ahead(Box<Ahead>),
}

/// The end of a stream, returned by [`Encoder::finish`].
#[derive(Clone, Debug)]
#[must_use = "the stream is incomplete without these packets and its end"]
#[non_exhaustive]
pub struct Finish {
    /// Packets of the waiting pictures, in the order of coding.
    pub packets: Vec<Packet>,
    /// Bytes after the last packet: sequence_end_code.
    pub end: Vec<u8>,
}

impl Config {
    /// Validates all settings and makes an encoder.
    ///
    /// # Errors
    /// If [`Config::validate`] refuses the settings.
    pub fn encoder(self) -> Result<Encoder, ConfigError> {
        self.validate()?;
        Ok(Encoder::new(self))
    }
}

impl Encoder {
    fn new(config: Config) -> Self {
        let mode = match config.lookahead {
            0 => CodingMode::Immediate(Immediate::default()),
            _ => CodingMode::Ahead(Box::new(Ahead::new(&config))),
        };
        let state = EncoderState { settings: config.fingerprint(), mode };
        Self { coder: Coder::new(config), state }
    }

    /// Returns the settings of this encoder.
    pub fn config(&self) -> &Config {
        &self.coder.config
    }

    /// Returns the state that determines the next packets, together with settings and later frames.
    #[must_use]
    pub fn state(&self) -> &EncoderState {
        &self.state
    }

    /// Continues from the state of an encoder with the same settings; only quantiser_scale may differ.
    ///
    /// # Errors
    /// If the state belongs to other settings or is inconsistent. The encoder is then unchanged.
    pub fn restore(&mut self, state: EncoderState) -> Result<(), RestoreError> {
        if state.settings != self.state.settings {
            return Err(RestoreError::OtherSettings);
        }
        match (&self.state.mode, &state.mode) {
            (CodingMode::Immediate(_), CodingMode::Immediate(immediate)) => immediate.check(self.config())?,
            (CodingMode::Ahead(_), CodingMode::Ahead(ahead)) => ahead.check(self.config())?,
            _ => return Err(RestoreError::OtherSettings),
        }
        // Adopt the state, and the level that the stream already contains.
        self.state = state;
        match &self.state.mode {
            CodingMode::Immediate(immediate) => immediate.restate(&mut self.coder.config),
            CodingMode::Ahead(ahead) => ahead.restate(&mut self.coder.config),
        }
        Ok(())
    }

    /// Uses another quantiser_scale from the next coded picture on, even in place of a mean quantiser.
    ///
    /// # Errors
    /// If the standard does not have this quantiser_scale.
    pub fn set_quantiser_scale(&mut self, quantiser_scale: u32) -> Result<(), ConfigError> {
        quantiser_scale_code(quantiser_scale)?;
        let config = self.config().clone().with_quantiser_scale(quantiser_scale);
        config.validate()?;
        self.coder.set_config(config);
        if let CodingMode::Ahead(ahead) = &mut self.state.mode {
            ahead.set_quantiser(&self.coder.config);
        }
        Ok(())
    }

    /// Accepts the next frame and returns the packets that can be coded now. Without a look-ahead this is one packet.
    ///
    /// `motion` only affects which vectors are tried, so wrong motion costs bits, not correctness. Without given motion, the
    /// encoder searches.
    ///
    /// # Panics
    /// If the size of the frame or of a motion field differs from the [`Config`].
    #[must_use = "the packets form the stream"]
    pub fn push(&mut self, frame: &Picture, motion: SuppliedMotion) -> Vec<Packet> {
        self.push_frame(frame, motion, None)
    }

    /// Accepts the next frame, with a factor of quantiser_scale for each macroblock: below 1 where errors are visible, above 1
    /// where they are not.
    ///
    /// Factors are clamped to 1/16 to 16; NaN counts as 1. They replace the factors of [`Config::with_adaptive_quantisation`].
    /// [`Config::with_uniform_quantiser`] disables them.
    ///
    /// Without a look-ahead only the ratios between factors have an effect. They are normalized so that the geometric mean of the
    /// scales stays quantiser_scale. A scale between two existing values becomes one of them, chosen by row. Equal factors
    /// produce the same bits as [`Encoder::push`].
    ///
    /// With a look-ahead the factors are not normalized, and each scale is rounded to the nearest existing value. Only a bit
    /// rate then compensates for their mean.
    ///
    /// # Panics
    /// If the size of the frame or of a motion field differs from the [`Config`]. If `weights` does not have one sample for each
    /// 16×16 luma samples, with width and height rounded up.
    #[must_use = "the packets form the stream"]
    pub fn push_weighted(&mut self, frame: &Picture, motion: SuppliedMotion, weights: &Plane<f32>) -> Vec<Packet> {
        let counts = self.config().shown_macroblocks();
        assert_eq!((weights.width(), weights.height()), counts, "the weights must have one sample for each macroblock");
        self.push_frame(frame, motion, Some(weights))
    }

    /// Repeats the last frame as a new one. Without a look-ahead, all macroblocks are skipped as far as the standard allows. With
    /// a look-ahead, `frame` is coded normally, and only its changes take bits.
    ///
    /// # Panics
    /// If [`Encoder::push`] would panic, or no frame was pushed before.
    #[must_use = "the packets form the stream"]
    pub fn push_again(&mut self, frame: &Picture, motion: SuppliedMotion) -> Vec<Packet> {
        match &mut self.state.mode {
            CodingMode::Immediate(immediate) => vec![immediate.push_again(&mut self.coder)],
            CodingMode::Ahead(_) => self.push_frame(frame, motion, None),
        }
    }

    fn push_frame(&mut self, frame: &Picture, motion: SuppliedMotion, weights: Option<&Plane<f32>>) -> Vec<Packet> {
        let SuppliedMotion { to_previous, to_next } = motion;
        check_input(self.config(), frame, [to_previous, to_next]);
        let coded = self.config().macroblock_counts();
        let weights = weights.map(|weights| weights::given(weights, coded));
        match &mut self.state.mode {
            CodingMode::Immediate(immediate) => vec![immediate.push(&mut self.coder, frame, to_previous, weights)],
            CodingMode::Ahead(ahead) => ahead.push(&mut self.coder, frame, motion, weights),
        }
    }

    /// Returns the planned quantiser_scale of the waiting frames, for the current bit rate and buffer fullness.
    ///
    /// `None` if bits are not bounded or fewer than two frames wait. Later frames and the statistics of frames coded in between
    /// may still change the plan.
    pub fn planned_quantiser_scale(&mut self) -> Option<f32> {
        match &mut self.state.mode {
            CodingMode::Immediate(_) => None,
            CodingMode::Ahead(ahead) => ahead.planned_quantiser_scale(&self.coder.config),
        }
    }

    /// Codes the waiting frames and ends the stream.
    pub fn finish(mut self) -> Finish {
        let packets = match &mut self.state.mode {
            CodingMode::Immediate(_) => Vec::new(),
            CodingMode::Ahead(ahead) => ahead.finish(&mut self.coder),
        };
        Finish { packets, end: sequence_end() }
    }

    /// Returns whether a frame, counted from 0 in display order, is the I picture of a group of pictures.
    ///
    /// For pushed frames the result is exact and includes shot changes. Groups of later frames are counted from the start of
    /// the latest group; only a shot change can begin one earlier. `None` if the frame precedes the last coded I or P picture;
    /// see the type of its packet instead.
    #[must_use]
    pub fn begins_group(&self, display_index: u64) -> Option<bool> {
        let gop = self.config().gop;
        match &self.state.mode {
            CodingMode::Immediate(_) => Some(display_index.is_multiple_of(gop.into())),
            CodingMode::Ahead(ahead) => ahead.begins_group(usize::try_from(display_index).ok()?, gop as usize),
        }
    }
}

fn check_input(config: &Config, frame: &Picture, fields: [Option<&Correspondence>; 2]) {
    let size = (config.width, config.height);
    assert_eq!((frame.width(), frame.height()), size, "the size of the frame differs from the settings");
    for field in fields.into_iter().flatten() {
        assert_eq!((field.width(), field.height()), size, "the size of the motion field differs from the settings");
    }
}

impl fmt::Debug for Encoder {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.debug_struct("Encoder").field("config", self.config()).finish_non_exhaustive()
    }
}

impl fmt::Debug for EncoderState {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.debug_struct("EncoderState").finish_non_exhaustive()
    }
}
