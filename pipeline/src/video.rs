//! The encoder of a run, with what its stream is wrapped into.

use crate::checkpoint::{decode, encode};
use crate::error::{Error, Result};
use crate::settings::Settings;
use mpeg2enc::{
    Container, Encoder, KnownMotion, LookaheadEncoder, MacroblockKind, MotionField, Multiplexer, Packet, Picture,
    PictureType,
};
use plane::Plane;

/// Frames in, bytes of the file out.
pub struct Video {
    coder: Coder,
    multiplexer: Multiplexer,
    quantiser_scale: f32,
    tells_outcome: bool,
}

enum Coder {
    /// Each frame as it comes: I and P pictures at a constant quantiser.
    Immediate(Box<Encoder>),
    /// Frames may wait for later ones: B pictures and bit rates.
    Ahead(Box<LookaheadEncoder>),
}

/// What a step of encoding gave.
#[derive(Clone, Debug, Default)]
pub struct Coded {
    /// For the file.
    pub bytes: Vec<u8>,
    /// The pictures that were coded, in the order of coding.
    pub pictures: Vec<CodedPicture>,
}

/// A coded picture, as the report tells of it.
#[derive(Clone, Debug)]
pub struct CodedPicture {
    /// Which frame it is.
    pub index: u32,
    /// I, P or B.
    pub picture_type: PictureType,
    /// Of the elementary stream, headers included.
    pub bits: u64,
    /// quantiser_scale asked for.
    pub quantiser_scale: u32,
    /// Of luma \[dB\]; infinite when nothing is lost.
    pub psnr_y: f64,
    /// What masking asks for where it goes by what the encoder did.
    pub outcome: Option<CodingOutcome>,
}

/// What the encoder did to a picture.
#[derive(Clone, Debug)]
pub struct CodingOutcome {
    /// Luma as a decoder shows it.
    pub decoded: Plane<u8>,
    /// Of each 8×8 block of luma, the coefficients that were written: see [`Packet::luma_levels`].
    pub levels: Plane<u64>,
    /// Of each macroblock: whether it was coded by itself.
    pub intra: Plane<bool>,
    /// Of each macroblock: quantiser_scale.
    pub quantiser_scales: Plane<u8>,
}

impl Video {
    /// As `settings` ask for.
    ///
    /// # Errors
    /// What the standard does not have; the message names what it has.
    pub fn new(settings: &Settings) -> Result<Self> {
        let config = settings.encoder_config()?;
        let multiplexer = Multiplexer::new(settings.container(), &config);
        let coder = match settings.looks_ahead() {
            true => Coder::Ahead(Box::new(config.lookahead_encoder()?)),
            false => Coder::Immediate(Box::new(config.encoder()?)),
        };
        // An encoder that looks ahead is late: masking is then at another frame.
        let tells_outcome = settings.thresholds.follow_coding() && !settings.looks_ahead();
        Ok(Self { coder, multiplexer, quantiser_scale: settings.qscale as f32, tells_outcome })
    }

    /// At a constant quantiser, each picture as it comes: for encoders that have nothing to do with a scene.
    ///
    /// # Errors
    /// What the standard does not have.
    pub fn immediate(config: mpeg2enc::Config, container: Container, quantiser_scale: u32) -> Result<Self> {
        let config = config.with_quantiser_scale(quantiser_scale);
        let multiplexer = Multiplexer::new(container, &config);
        let coder = Coder::Immediate(Box::new(config.encoder()?));
        Ok(Self { coder, multiplexer, quantiser_scale: quantiser_scale as f32, tells_outcome: false })
    }

    /// Takes the next frame. `previous` says where its pixels were in the frame before, `next` where they will be in the
    /// frame after; without them, motion is searched for.
    ///
    /// # Panics
    /// If frame or motion have another size than the video.
    pub fn push(&mut self, frame: &Picture, previous: Option<&MotionField>, next: Option<&MotionField>) -> Coded {
        let packets = match &mut self.coder {
            Coder::Immediate(encoder) => vec![encoder.push(frame, previous)],
            Coder::Ahead(encoder) => encoder.push(frame, KnownMotion { to_previous: previous, to_next: next }),
        };
        wrap(packets, &mut self.multiplexer, &mut self.quantiser_scale, self.tells_outcome)
    }

    /// Codes what waits, and ends the stream.
    pub fn finish(self) -> Coded {
        let Self { coder, mut multiplexer, mut quantiser_scale, .. } = self;
        let (packets, end) = match coder {
            Coder::Immediate(encoder) => (Vec::new(), encoder.finish()),
            Coder::Ahead(encoder) => encoder.finish(),
        };
        let mut coded = wrap(packets, &mut multiplexer, &mut quantiser_scale, false);
        coded.bytes.extend(multiplexer.finish(&end));
        coded
    }

    /// The quantiser_scale that the pictures coded last had: the mean over the finest of them, from which the others are
    /// predicted. Before any, the one that was asked for.
    pub fn quantiser_scale(&self) -> f32 {
        self.quantiser_scale
    }
}

impl Video {
    /// All that the next bytes depend on, besides settings and frames to come.
    pub(crate) fn state(&self) -> Vec<u8> {
        let (immediate, ahead) = match &self.coder {
            Coder::Immediate(encoder) => (Some(encoder.state()), None),
            Coder::Ahead(encoder) => (None, Some(encoder.state())),
        };
        encode(&(immediate, ahead, &self.multiplexer, self.quantiser_scale))
    }

    /// Goes on where a video of the same settings was.
    pub(crate) fn restore(&mut self, state: &[u8]) -> Result<()> {
        let (immediate, ahead, multiplexer, quantiser_scale) = decode(state)?;
        match (&mut self.coder, immediate, ahead) {
            (Coder::Immediate(encoder), Some(state), None) => encoder.restore(state),
            (Coder::Ahead(encoder), None, Some(state)) => encoder.restore(state),
            _ => return Err(Error::Checkpoint("the state of another encoder".into())),
        }
        (self.multiplexer, self.quantiser_scale) = (multiplexer, quantiser_scale);
        Ok(())
    }
}

impl CodingOutcome {
    fn of(packet: &Packet) -> Self {
        Self {
            decoded: packet.reconstruction.luma().clone(),
            levels: packet.luma_levels(),
            intra: packet.macroblock_kinds.map(|kind| kind == MacroblockKind::Intra),
            quantiser_scales: packet.quantiser_scales.clone(),
        }
    }
}

/// Puts packets into the file, and notes their quantiser.
fn wrap(packets: Vec<Packet>, multiplexer: &mut Multiplexer, quantiser_scale: &mut f32, tells_outcome: bool) -> Coded {
    let scales = packets.iter().map(|packet| {
        let scales = packet.quantiser_scales.samples();
        scales.iter().map(|&scale| u32::from(scale)).sum::<u32>() as f32 / scales.len() as f32
    });
    *quantiser_scale = scales.reduce(f32::min).unwrap_or(*quantiser_scale);
    let mut coded = Coded::default();
    for packet in packets {
        coded.pictures.push(CodedPicture {
            index: packet.display_index as u32,
            picture_type: packet.picture_type,
            bits: packet.bits,
            quantiser_scale: packet.quantiser_scale,
            psnr_y: packet.psnr_y,
            outcome: tells_outcome.then(|| CodingOutcome::of(&packet)),
        });
        coded.bytes.extend(multiplexer.push(packet));
    }
    coded
}
