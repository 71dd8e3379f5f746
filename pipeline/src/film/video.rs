//! The encoder of a film, with the container that its stream is wrapped into.

use super::weights::weights;
use crate::error::{Error, Result};
use crate::parts::{CodedFrame, Coding, Displayed, Encode, Encoded};
use crate::settings::{AdaptiveQuantiser, Settings};
use crate::state::{NONSENSE, decode, encode};
use mpeg2enc::{Container, Encoder, Finish, KnownMotion, Multiplexer, Packet, Picture};
use perceptual::NextPicture;
use plane::{Correspondence, Plane};
use render_core::MACROBLOCK;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Pictures in, bytes of the file out.
pub struct Video {
    encoder: Encoder,
    stream: Stream,
    /// Whether the renderer's motion is used.
    uses_motion: bool,
    /// Whether quantisers follow masking.
    masks: bool,
    /// Whether pictures wait for the motion into the next one, for B pictures.
    waits: bool,
    waiting: Option<Waiting>,
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
    /// Weights of its macroblocks, where they are not all alike.
    weights: Option<Plane<f32>>,
}

impl Video {
    /// The encoder that `settings` describe.
    ///
    /// # Errors
    /// The standard does not have what the settings request; the message names what it has.
    pub fn new(settings: &Settings) -> Result<Self> {
        let config = settings.encoder_config()?;
        let multiplexer = Multiplexer::new(settings.container(), &config);
        Ok(Self {
            encoder: config.encoder()?,
            stream: Stream {
                multiplexer,
                quantiser_scale: settings.qscale as f32,
                tells_outcome: settings.thresholds.follow_coding() && !settings.looks_ahead(),
            },
            uses_motion: settings.motion,
            masks: settings.aq == AdaptiveQuantiser::Masking,
            waits: settings.bframes > 0,
            waiting: None,
        })
    }

    /// At a constant quantiser, each picture as it comes: for renderers of one's own.
    ///
    /// # Errors
    /// The standard does not have such a configuration.
    pub fn immediate(config: mpeg2enc::Config, container: Container, quantiser_scale: u32) -> Result<Self> {
        let config = config.with_lookahead(0).with_quantiser_scale(quantiser_scale);
        let multiplexer = Multiplexer::new(container, &config);
        Ok(Self {
            encoder: config.encoder()?,
            stream: Stream { multiplexer, quantiser_scale: quantiser_scale as f32, tells_outcome: false },
            uses_motion: true,
            masks: false,
            waits: false,
            waiting: None,
        })
    }

    fn push(&mut self, waiting: Waiting, to_next: Option<&Correspondence>) -> Encoded {
        let Waiting { picture, to_previous, weights } = waiting;
        let motion = KnownMotion { to_previous: to_previous.as_deref(), to_next };
        let packets = match weights {
            Some(weights) => self.encoder.push_weighted(&picture, motion, &weights),
            None => self.encoder.push(&picture, motion),
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
        let weights = weights(displayed, self.masks);
        let taken = Waiting { picture: picture.picture.clone(), to_previous, weights };
        let mut coded = if self.waits {
            match self.waiting.replace(taken) {
                Some(before) => self.push(before, forward.as_deref()),
                None => self.stream.wrap(Vec::new()),
            }
        } else {
            self.push(taken, None)
        };
        // As far as the encoder knows now: groups begin at scene cuts too.
        let begins_group = |index: u32| self.encoder.begins_group(index.into()) == Some(true);
        coded.coding.begins_group = begins_group(*index);
        if begins_group(index + 1) {
            coded.coding.next = NextPicture::Intra { group: self.encoder.config().gop() };
        }
        Ok(coded)
    }

    fn finish(mut self) -> Result<Encoded> {
        let last = self.waiting.take().map(|last| self.push(last, None)).unwrap_or_default();
        let Finish { packets, end, .. } = self.encoder.finish();
        let mut stream = self.stream;
        let Encoded { bytes, pictures, coding } = stream.wrap(packets);
        let bytes = [last.bytes, bytes, stream.multiplexer.finish(&end)].concat();
        Ok(Encoded { bytes, pictures: [last.pictures, pictures].concat(), coding })
    }

    /// Everything that the next bytes depend on, besides settings and frames to come.
    fn state(&self) -> Vec<u8> {
        encode(&(self.encoder.state(), &self.stream.multiplexer, self.stream.quantiser_scale, &self.waiting))
    }

    fn restore(&mut self, state: &[u8]) -> Result<()> {
        let (encoder, multiplexer, quantiser_scale, waiting) = decode(state)?;
        let waiting: Option<Waiting> = waiting;

        // Forged weights are those of another picture.
        let fits = |Waiting { picture, weights, .. }: &Waiting| {
            let counts = (picture.width().div_ceil(MACROBLOCK), picture.height().div_ceil(MACROBLOCK));
            weights.as_ref().is_none_or(|weights| (weights.width(), weights.height()) == counts)
        };
        if !waiting.iter().all(fits) {
            return Err(Error::Checkpoint(NONSENSE.into()));
        }
        self.encoder.restore(encoder).map_err(|_| Error::Checkpoint(NONSENSE.into()))?;
        (self.stream.multiplexer, self.stream.quantiser_scale, self.waiting) = (multiplexer, quantiser_scale, waiting);
        Ok(())
    }
}
