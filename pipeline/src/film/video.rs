//! The encoder of a film, with the container that its stream is wrapped into.

use crate::error::{Error, Result};
use crate::feedback_loop::checkpoint::{NONSENSE, decode, encode};
use crate::feedback_loop::parts::{CodedFrame, Coding, Displayed, Encode, Encoded};
use crate::settings::Settings;
use mpeg2enc::{Container, Encoder, KnownMotion, LookaheadEncoder, Multiplexer, Packet, Picture};
use perceptual::NextPicture;
use plane::Correspondence;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Pictures in, bytes of the file out.
pub struct Video {
    coder: Coder,
    stream: Stream,
    /// Pictures from one I picture to the next.
    gop: u32,
    /// Whether the renderer's motion is used.
    uses_motion: bool,
    /// Whether pictures wait for the motion into the next one, for B pictures.
    waits: bool,
    waiting: Option<Waiting>,
}

enum Coder {
    /// Each frame as it comes: I and P pictures at a constant quantiser.
    Immediate(Box<Encoder>),
    /// Frames may wait for later ones: B pictures and bit rates.
    Ahead(Box<LookaheadEncoder>),
}

/// The container, and what its packets tell.
struct Stream {
    multiplexer: Multiplexer,
    /// The mean over the finest of the pictures coded last, from which the others are predicted; before any, that of the settings.
    quantiser_scale: f32,
    /// Whether masking sees what became of each picture. An encoder that looks ahead is late: masking is then at another one.
    tells_outcome: bool,
}

/// A picture whose motion into the next one is still to come.
#[derive(Serialize, Deserialize)]
struct Waiting {
    picture: Arc<Picture>,
    to_previous: Option<Arc<Correspondence>>,
}

impl Video {
    /// The encoder that `settings` describe.
    ///
    /// # Errors
    /// The standard does not have what the settings ask for; the message names what it has.
    pub fn new(settings: &Settings) -> Result<Self> {
        let config = settings.encoder_config()?;
        let multiplexer = Multiplexer::new(settings.container(), &config);
        let coder = match settings.looks_ahead() {
            true => Coder::Ahead(Box::new(config.lookahead_encoder()?)),
            false => Coder::Immediate(Box::new(config.encoder()?)),
        };
        Ok(Self {
            coder,
            stream: Stream {
                multiplexer,
                quantiser_scale: settings.qscale as f32,
                tells_outcome: settings.thresholds.follow_coding() && !settings.looks_ahead(),
            },
            gop: settings.gop,
            uses_motion: settings.motion,
            waits: settings.bframes > 0,
            waiting: None,
        })
    }

    /// At a constant quantiser, each picture as it comes: for renderers of one's own.
    ///
    /// # Errors
    /// The standard does not have such a configuration.
    pub fn immediate(config: mpeg2enc::Config, container: Container, quantiser_scale: u32) -> Result<Self> {
        let config = config.with_quantiser_scale(quantiser_scale);
        let multiplexer = Multiplexer::new(container, &config);
        Ok(Self {
            gop: u32::MAX,
            coder: Coder::Immediate(Box::new(config.encoder()?)),
            stream: Stream { multiplexer, quantiser_scale: quantiser_scale as f32, tells_outcome: false },
            uses_motion: true,
            waits: false,
            waiting: None,
        })
    }

    fn push(&mut self, waiting: Waiting, to_next: Option<&Correspondence>) -> Encoded {
        let Waiting { picture, to_previous } = waiting;
        let to_previous = to_previous.as_deref();
        let packets = match &mut self.coder {
            Coder::Immediate(encoder) => vec![encoder.push(&picture, to_previous)],
            Coder::Ahead(encoder) => encoder.push(&picture, KnownMotion { to_previous, to_next }),
        };
        self.stream.wrap(packets)
    }
}

impl Stream {
    /// Puts packets into the file, and notes their quantiser.
    fn wrap(&mut self, packets: Vec<Packet>) -> Encoded {
        let scales = packets.iter().map(|packet| {
            let scales = packet.quantiser_scales.samples();
            scales.iter().map(|&scale| u32::from(scale)).sum::<u32>() as f32 / scales.len() as f32
        });
        // The finest pictures are those that the others are predicted from.
        self.quantiser_scale = scales.reduce(f32::min).unwrap_or(self.quantiser_scale);
        let outcome = packets.last().filter(|_| self.tells_outcome).map(Packet::coded);
        let mut coded =
            Encoded { coding: Coding { outcome, ..Coding::of_quantiser(self.quantiser_scale) }, ..Encoded::default() };
        for packet in packets {
            coded.pictures.push(CodedFrame {
                index: packet.display_index as u32,
                picture_type: packet.picture_type,
                bits: packet.bits,
                quantiser_scale: packet.quantiser_scale,
                psnr_y: packet.psnr_y,
            });
            coded.bytes.extend(self.multiplexer.push(packet));
        }
        coded
    }
}

impl std::fmt::Debug for Video {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Video").field("quantiser_scale", &self.stream.quantiser_scale).finish_non_exhaustive()
    }
}

impl Encode for Video {
    fn step(&mut self, displayed: &Displayed) -> Result<Encoded> {
        let Displayed { index, picture, correspondence, forward, .. } = displayed;
        let to_previous = correspondence.clone().filter(|_| self.uses_motion);
        let taken = Waiting { picture: picture.picture.clone(), to_previous };
        let mut coded = if self.waits {
            match self.waiting.replace(taken) {
                Some(before) => self.push(before, forward.as_deref()),
                None => self.stream.wrap(Vec::new()),
            }
        } else {
            self.push(taken, None)
        };
        let begins_group = |index: u32| index.is_multiple_of(self.gop);
        coded.coding.begins_group = begins_group(*index);
        if begins_group(index + 1) {
            coded.coding.next = NextPicture::Intra { group: self.gop };
        }
        Ok(coded)
    }

    fn finish(mut self) -> Result<Encoded> {
        let last = self.waiting.take().map(|last| self.push(last, None)).unwrap_or_default();
        let (packets, end) = match self.coder {
            Coder::Immediate(encoder) => (Vec::new(), encoder.finish()),
            Coder::Ahead(encoder) => encoder.finish(),
        };
        let mut stream = self.stream;
        let Encoded { bytes, pictures, coding } = stream.wrap(packets);
        let bytes = [last.bytes, bytes, stream.multiplexer.finish(&end)].concat();
        Ok(Encoded { bytes, pictures: [last.pictures, pictures].concat(), coding })
    }

    /// Everything that the next bytes depend on, besides settings and frames to come.
    fn state(&self) -> Vec<u8> {
        let (immediate, ahead) = match &self.coder {
            Coder::Immediate(encoder) => (Some(encoder.state()), None),
            Coder::Ahead(encoder) => (None, Some(encoder.state())),
        };
        encode(&(immediate, ahead, &self.stream.multiplexer, self.stream.quantiser_scale, &self.waiting))
    }

    fn restore(&mut self, state: &[u8]) -> Result<()> {
        let (immediate, ahead, multiplexer, quantiser_scale, waiting) = decode(state)?;
        match (&mut self.coder, immediate, ahead) {
            (Coder::Immediate(encoder), Some(state), None) => encoder.restore(state),
            (Coder::Ahead(encoder), None, Some(state)) => encoder.restore(state),
            _ => return Err(Error::Checkpoint(NONSENSE.into())),
        }
        (self.stream.multiplexer, self.stream.quantiser_scale, self.waiting) = (multiplexer, quantiser_scale, waiting);
        Ok(())
    }
}
