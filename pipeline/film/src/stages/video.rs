//! Encoding stage of a film: the encoder and its container.

use super::weights::weights;
use crate::settings::{AdaptiveQuantiser, CodedRate, Settings};
use mpeg2enc::{AccessUnit, Container, Encoder, Finish, Multiplexer, Packet, Picture, SuppliedMotion};
use perceptual::NextPicture;
use pipeline::chunks::begins_chunk;
use pipeline::error::{Error, Result};
use pipeline::stage::{CodedFrame, CodedUnit, Coding, Displayed, Encode, Encoded};
use pipeline::state::{NONSENSE, decode, encode};
use plane::{Correspondence, Plane};
use render_core::MACROBLOCK;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Encodes pictures into the bytes of the file.
pub struct Video {
    encoder: Encoder,
    /// Index in the film of the first frame that this encoder codes.
    first: u32,
    /// Number of pictures per frame.
    pictures: u32,
    /// Number of frames per chunk; each chunk starts a new encoder.
    chunk: Option<u32>,
    stream: Stream,
    /// Whether the encoder uses the renderer's motion.
    uses_motion: bool,
    /// Whether quantisers are weighted by masking.
    masks: bool,
    /// Whether pictures wait for the motion into the next picture. B pictures need this motion.
    waits: bool,
    waiting: Option<Waiting>,
}

/// Container, and statistics of the packets written to the container.
struct Stream {
    multiplexer: Multiplexer,
    /// Index in the film of the first frame in this file.
    first: u32,
    /// Number of pictures per frame.
    pictures: u32,
    /// Whether pictures are coded as they are pushed.
    is_immediate: bool,
    /// Last frame, to which more pictures may be added.
    held: Option<CodedFrame>,
    /// Mean quantiser_scale of the finest picture in the last step that coded pictures. Later pictures are predicted from
    /// this picture. The initial value comes from the settings.
    quantiser_scale: f32,
    /// Whether masking receives the coded picture. An encoder with lookahead codes it too late for masking.
    tells_outcome: bool,
}

/// Picture that waits for the motion into the next picture.
#[derive(Serialize, Deserialize)]
struct Waiting {
    picture: Arc<Picture>,
    to_previous: Option<Arc<Correspondence>>,
    /// Weights of the picture's macroblocks; `None` if uniform.
    weights: Option<Plane<f32>>,
}

impl Video {
    /// Returns the encoder for `settings`.
    ///
    /// # Errors
    /// If the standard does not support the settings. The message names valid values.
    pub fn new(settings: &Settings) -> crate::Result<Self> {
        let config = settings.encoder_config()?;
        let CodedRate { pictures, .. } = CodedRate::of(settings.render.fps)?;
        let frames = settings.frame_range();
        let (first, count) = (frames.start, frames.len() as u64);
        // Declare the length of this file; its time codes count from the start of the whole film.
        let multiplexer = Multiplexer::new(settings.container(), &config).with_pictures(count * u64::from(pictures));
        let number = u64::from(first) * u64::from(pictures);
        Ok(Self {
            encoder: config.with_first_number(number).encoder()?,
            first,
            pictures,
            chunk: settings.render.chunk,
            stream: Stream {
                multiplexer,
                first,
                pictures,
                is_immediate: !settings.looks_ahead(),
                held: None,
                quantiser_scale: settings.render.qscale as f32,
                tells_outcome: settings.render.thresholds.follow_coding() && !settings.looks_ahead(),
            },
            uses_motion: settings.render.motion,
            masks: settings.coding.aq == AdaptiveQuantiser::Masking,
            waits: settings.render.bframes > 0,
            waiting: None,
        })
    }

    /// Returns an encoder with a constant quantiser that codes each picture at once, for custom renderers.
    ///
    /// # Errors
    /// If the standard does not support the configuration.
    pub fn immediate(config: mpeg2enc::Config, container: Container, quantiser_scale: u32) -> crate::Result<Self> {
        // Disable lookahead, so that each step returns the coded picture.
        let config = config.with_lookahead(0).with_quantiser_scale(quantiser_scale);
        let multiplexer = Multiplexer::new(container, &config);
        Ok(Self {
            encoder: config.encoder()?,
            first: 0,
            pictures: 1,
            chunk: None,
            stream: Stream {
                multiplexer,
                first: 0,
                pictures: 1,
                is_immediate: true,
                held: None,
                quantiser_scale: quantiser_scale as f32,
                tells_outcome: false,
            },
            uses_motion: true,
            masks: false,
            waits: false,
            waiting: None,
        })
    }

    fn push(&mut self, waiting: Waiting, to_next: Option<&Correspondence>) -> Encoded {
        let Waiting { picture, to_previous, weights } = waiting;
        // All pictures of a frame are equal, so code no motion between them.
        let still = (self.pictures > 1).then(|| Correspondence::still(picture.width(), picture.height()));
        let motion = SuppliedMotion { to_previous: to_previous.as_deref(), to_next: still.as_ref().or(to_next) };
        let mut packets = match weights {
            Some(weights) => self.encoder.push_weighted(&picture, motion, &weights),
            None => self.encoder.push(&picture, motion),
        };
        // Repeat the picture; only the last repetition has motion into the next frame.
        for number in 1..self.pictures {
            let to_next = if number + 1 == self.pictures { to_next } else { still.as_ref() };
            packets.extend(self.encoder.push_again(&picture, SuppliedMotion { to_previous: still.as_ref(), to_next }));
        }
        self.stream.wrap(packets, self.first)
    }

    /// Encodes the last waiting picture, without motion into a next picture.
    fn push_last(&mut self) -> Encoded {
        self.waiting.take().map(|last| self.push(last, None)).unwrap_or_default()
    }

    /// Ends the chunk before frame `index`, and starts a new encoder. The stream continues without an end code.
    fn begin_chunk(&mut self, index: u32) -> Result<Encoded> {
        // Code the waiting picture first, because it belongs to the chunk that ends.
        let last = self.push_last();
        let number = u64::from(index) * u64::from(self.pictures);
        let config = self.encoder.config().clone().with_first_number(number);
        let quantiser_scale = config.quantiser_scale() as f32;
        let Finish { packets, .. } =
            std::mem::replace(&mut self.encoder, config.encoder().map_err(Error::other)?).finish();
        let rest = self.stream.wrap_last(packets, self.first);
        (self.first, self.stream.quantiser_scale) = (index, quantiser_scale);
        Ok(joined(last, rest))
    }

    /// Returns whether frame `index` begins a group of pictures, as planned by the encoder so far.
    fn begins_group(&self, index: u32) -> bool {
        // Saturate, because a forged state may contain an encoder that started later.
        let number = u64::from(index.saturating_sub(self.first)) * u64::from(self.pictures);
        self.encoder.begins_group(number) == Some(true)
    }
}

/// Joins two steps: concatenates bytes, pictures and units, and keeps the `coding` of the second step.
fn joined(first: Encoded, then: Encoded) -> Encoded {
    Encoded {
        bytes: [first.bytes, then.bytes].concat(),
        pictures: [first.pictures, then.pictures].concat(),
        units: [first.units, then.units].concat(),
        coding: then.coding,
    }
}

impl Stream {
    /// Adds packets to the file, and records the finest mean quantiser. The encoder of the packets began with frame
    /// `first` of the film.
    fn wrap(&mut self, packets: Vec<Packet>, first: u32) -> Encoded {
        let scales = packets.iter().map(|packet| {
            let scales = packet.quantiser_scales.samples();
            scales.iter().map(|&scale| u32::from(scale)).sum::<u32>() as f32 / scales.len() as f32
        });
        // Record the finest quantiser, because the other pictures are predicted from the finest picture.
        self.quantiser_scale = scales.reduce(f32::min).unwrap_or(self.quantiser_scale);
        // Send masking the first picture of the last frame: the frame's other pictures only repeat it.
        let mut last_first = None;
        for packet in &packets {
            if packet.display_index.is_multiple_of(self.pictures.into()) {
                last_first = Some(packet);
            }
        }
        let outcome = last_first.filter(|_| self.tells_outcome).map(Packet::coded);
        let mut coded =
            Encoded { coding: Coding { outcome, ..Coding::of_quantiser(self.quantiser_scale) }, ..Encoded::default() };

        // Number the pictures from the start of this file, because each encoder counts from its own first picture.
        for packet in packets {
            coded.pictures.extend(self.count(&packet, first));
            let before = u64::from(first.saturating_sub(self.first)) * u64::from(self.pictures);
            let unit = AccessUnit { display_index: before + packet.display_index, ..packet.into() };
            coded.units.push(CodedUnit {
                position: u64::from(self.first) * u64::from(self.pictures) + unit.display_index,
                picture_type: unit.picture_type,
                bytes: unit.data.clone(),
            });
            coded.bytes.extend(self.multiplexer.push(unit));
        }
        // Report the last frame now if no later packet can add pictures to it.
        if self.pictures == 1 || self.is_immediate {
            coded.pictures.extend(self.held.take());
        }
        coded
    }
}

impl Stream {
    /// Adds the last packets of an encoder.
    fn wrap_last(&mut self, packets: Vec<Packet>, first: u32) -> Encoded {
        let mut coded = self.wrap(packets, first);
        coded.pictures.extend(self.held.take());
        coded
    }

    /// Adds a picture's bits to its frame. Returns the previous frame if the picture begins a new one.
    fn count(&mut self, packet: &Packet, first: u32) -> Option<CodedFrame> {
        // Add repetitions of a picture to the report of their frame.
        let pictures = u64::from(self.pictures);
        if let Some(held) = self.held.as_mut().filter(|_| !packet.display_index.is_multiple_of(pictures)) {
            held.bits += packet.bits;
            return None;
        }
        self.held.replace(CodedFrame {
            index: first.saturating_add((packet.display_index / pictures) as u32),
            picture_type: packet.picture_type,
            bits: packet.bits,
            quantiser_scale: packet.quantiser_scale,
            psnr_y: packet.psnr_y,
            decoded: Some(packet.reconstruction.clone()),
        })
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
        // Start a new encoder at each chunk except the first one, which the film already started with.
        let before = match begins_chunk(self.chunk, *index) && *index != self.first {
            true => self.begin_chunk(*index)?,
            false => Encoded::default(),
        };

        // With B pictures, push each picture once the motion into the next picture is known.
        let taken = Waiting { picture: picture.picture.clone(), to_previous, weights };
        let mut coded = if self.waits {
            match self.waiting.replace(taken) {
                Some(before) => self.push(before, forward.as_deref()),
                None => self.stream.wrap(Vec::new(), self.first),
            }
        } else {
            self.push(taken, None)
        };

        // Report the planned quantiser, which rate control will use for the waiting picture.
        if let Some(planned) = self.encoder.planned_quantiser_scale() {
            coded.coding.quantiser_scale = planned;
        }

        // Report the planned types of this picture and the next one, which masking needs.
        coded.coding.begins_group = self.begins_group(*index);
        if self.begins_group(index + 1) {
            coded.coding.next = NextPicture::Intra { group: self.encoder.config().gop() };
        }
        Ok(joined(before, coded))
    }

    fn finish(mut self) -> Result<Encoded> {
        let last = self.push_last();
        let Finish { packets, end, .. } = self.encoder.finish();
        let mut coded = joined(last, self.stream.wrap_last(packets, self.first));
        coded.bytes.extend(self.stream.multiplexer.finish(&end));
        Ok(coded)
    }

    fn ending(&self) -> Vec<u8> {
        self.stream.multiplexer.ending()
    }

    /// Returns the state that determines the next bytes, apart from settings and later frames.
    fn state(&self) -> Vec<u8> {
        let Self { encoder, first, stream, waiting, .. } = self;
        encode(&(first, encoder.state(), &stream.multiplexer, stream.quantiser_scale, waiting, &stream.held))
    }

    fn restore(&mut self, state: &[u8]) -> Result<()> {
        let (first, encoder, multiplexer, quantiser_scale, waiting, held) = decode(state)?;
        let (first, waiting): (u32, Option<Waiting>) = (first, waiting);

        // Reject forged weights for a picture of another size.
        let fits = |Waiting { picture, weights, .. }: &Waiting| {
            let counts = (picture.width().div_ceil(MACROBLOCK), picture.height().div_ceil(MACROBLOCK));
            weights.as_ref().is_none_or(|weights| (weights.width(), weights.height()) == counts)
        };
        // A frame can be held only if frames consist of several pictures.
        let held: Option<CodedFrame> = held;
        let may_hold = self.pictures > 1 && !self.stream.is_immediate;
        if !waiting.iter().all(fits) || held.is_some() && !may_hold {
            return Err(Error::Checkpoint(NONSENSE.into()));
        }

        // Restore a new encoder, and replace this one only if the whole state is valid.
        let mut same = self
            .encoder
            .config()
            .clone()
            .with_first_number(u64::from(first) * u64::from(self.pictures))
            .encoder()
            .map_err(Error::other)?;
        same.restore(encoder).map_err(|_| Error::Checkpoint(NONSENSE.into()))?;
        (self.encoder, self.first, self.waiting) = (same, first, waiting);
        (self.stream.multiplexer, self.stream.quantiser_scale) = (multiplexer, quantiser_scale);
        self.stream.held = held;
        Ok(())
    }
}
