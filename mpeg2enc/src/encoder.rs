//! Pictures in, packets out: at once, or after a look at later pictures.

mod ahead;
mod immediate;
mod weighted;

use crate::{
    Config, ConfigError, KnownMotion, Picture, RestoreError,
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
/// Without a look-ahead every frame gives its packet at once: I and P pictures, one quantiser for all macroblocks unless
/// weights are given. With
/// [`Config::with_lookahead`], packets come later and in the order of coding, which is that of the stream: a B picture
/// follows the I or P picture that is shown after it. [`Packet::display_index`] says which frame a packet is.
#[must_use = "an encoder codes the frames that are pushed"]
pub struct Encoder {
    coder: Coder,
    state: EncoderState,
}

/// All that an [`Encoder`] carries from one picture to the next, waiting frames included.
///
/// [`Encoder::restore`] continues from it, in another process where the feature `serde` is on.
#[derive(Clone)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct EncoderState {
    /// The [`Config::fingerprint`] of the settings.
    settings: u64,
    mode: CodingMode,
}

#[derive(Clone)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
enum CodingMode {
    Immediate(Immediate),
    Ahead(Box<Ahead>),
}

/// The end of a stream: what [`Encoder::finish`] gives.
#[derive(Clone, Debug)]
#[must_use = "the stream lacks these packets and its end"]
#[non_exhaustive]
pub struct Finish {
    /// Pictures that waited, in the order of coding.
    pub packets: Vec<Packet>,
    /// The bytes after the last packet: sequence_end_code.
    pub end: Vec<u8>,
}

impl Config {
    /// Checks all settings and starts an encoder.
    ///
    /// # Errors
    /// The settings are refused by [`Config::validate`].
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

    /// The settings it was made with.
    pub fn config(&self) -> &Config {
        &self.coder.config
    }

    /// All that the next packets depend on, besides settings and frames to come.
    #[must_use]
    pub fn state(&self) -> &EncoderState {
        &self.state
    }

    /// Continues where an encoder of the same settings was. Only quantiser_scale may differ.
    ///
    /// # Errors
    /// The state is of an encoder with other settings, or contradicts itself. The encoder is as before then.
    pub fn restore(&mut self, state: EncoderState) -> Result<(), RestoreError> {
        if state.settings != self.state.settings {
            return Err(RestoreError::OtherSettings);
        }
        match (&self.state.mode, &state.mode) {
            (CodingMode::Immediate(_), CodingMode::Immediate(immediate)) => immediate.check(self.config())?,
            (CodingMode::Ahead(_), CodingMode::Ahead(ahead)) => ahead.check(self.config())?,
            _ => return Err(RestoreError::OtherSettings),
        }
        self.state = state;
        match &self.state.mode {
            CodingMode::Immediate(immediate) => immediate.restate(&mut self.coder.config),
            CodingMode::Ahead(ahead) => ahead.restate(&mut self.coder.config),
        }
        Ok(())
    }

    /// Uses another quantiser_scale from the next coded picture on, in place of a mean too.
    ///
    /// # Errors
    /// The standard does not have this quantiser_scale.
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

    /// Takes the next frame and gives the packets that can be coded now. Without a look-ahead that is one.
    ///
    /// `motion` changes what is tried, never what is correct. Without it, vectors are searched for.
    ///
    /// # Panics
    /// If frame or motion fields have another size than the [`Config`].
    #[must_use = "packets are the stream"]
    pub fn push(&mut self, frame: &Picture, motion: KnownMotion) -> Vec<Packet> {
        self.push_frame(frame, motion, None)
    }

    /// The same with a factor of quantiser_scale for every macroblock: below 1 where errors show, above 1 where they do not.
    ///
    /// Factors go from 1/16 to 16, and what is not a number counts as 1. They replace those of
    /// [`Config::with_adaptive_quantisation`], and have no effect with [`Config::with_uniform_quantiser`].
    ///
    /// Without a look-ahead only the ratios of factors count: all are multiplied by one number, so that the geometric mean of the
    /// scales stays quantiser_scale. In each row of macroblocks, a scale between those that exist becomes one of the two around.
    /// Factors that are all the same give the bits of [`Encoder::push`]. With a look-ahead factors are taken as they are, each scale
    /// becomes the nearest, and only a bit rate makes up for the mean of the factors.
    ///
    /// # Panics
    /// If frame or motion fields have another size than the [`Config`], or `weights` is not one sample for each 16×16 luma
    /// samples, width and height rounded up.
    #[must_use = "packets are the stream"]
    pub fn push_weighted(&mut self, frame: &Picture, motion: KnownMotion, weights: &Plane<f32>) -> Vec<Packet> {
        let counts = self.config().shown_macroblocks();
        assert_eq!((weights.width(), weights.height()), counts, "weights that are not one for each macroblock");
        self.push_frame(frame, motion, Some(weights))
    }

    /// Shows the last frame again, as another one. Without a look-ahead all of its macroblocks are skipped, as far as the standard
    /// allows; with one, `frame` is coded with what changed meanwhile, which may be nothing.
    ///
    /// # Panics
    /// As [`Encoder::push`], or if there was no frame.
    #[must_use = "packets are the stream"]
    pub fn push_again(&mut self, frame: &Picture, motion: KnownMotion) -> Vec<Packet> {
        match &mut self.state.mode {
            CodingMode::Immediate(immediate) => vec![immediate.push_again(&mut self.coder)],
            CodingMode::Ahead(_) => self.push_frame(frame, motion, None),
        }
    }

    fn push_frame(&mut self, frame: &Picture, motion: KnownMotion, weights: Option<&Plane<f32>>) -> Vec<Packet> {
        let KnownMotion { to_previous, to_next } = motion;
        check_input(self.config(), frame, [to_previous, to_next]);
        let coded = self.config().macroblock_counts();
        let weights = weights.map(|weights| weights::given(weights, coded));
        match &mut self.state.mode {
            CodingMode::Immediate(immediate) => vec![immediate.push(&mut self.coder, frame, to_previous, weights)],
            CodingMode::Ahead(ahead) => ahead.push(&mut self.coder, frame, motion, weights),
        }
    }

    /// quantiser_scale that the frames which wait are to be coded with, as far as bit rate and buffer tell now; `None` where bits are
    /// not bounded, and where fewer than two frames wait. What is learnt from the frames coded until then, and later frames, may still change it.
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

    /// Whether a frame, counted from 0 in display order, is the I picture of a group of pictures.
    ///
    /// For frames that were pushed the result is exact, scene cuts included. Groups of later frames are counted from the last
    /// group that has begun: only a scene cut can begin another one earlier. `None` stands for frames before the last coded
    /// I or P picture, whose packets tell.
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
    assert_eq!((frame.width(), frame.height()), size, "a frame of another size than the encoder's");
    for field in fields.into_iter().flatten() {
        assert_eq!((field.width(), field.height()), size, "a motion field of another size than the encoder's");
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
