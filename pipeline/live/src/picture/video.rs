//! Encoder of pictures on demand: I and P pictures without delay, each with its own quantiser.

use super::ladder::{COARSEST, nearest_quantiser};
use crate::error::LiveResult;
use mpeg2enc::{Config, Encoder, Packet, PictureType, Rate, SuppliedMotion};
use pipeline::stage::{Coding, Displayed};
use render2mpeg::Settings;

/// Maximum distance between I pictures \[pictures\]. The standard requires that each macroblock is coded as intra at
/// least once in 132 predicted pictures (13818-2, 7.4.4 and Annex A).
const LONGEST_GROUP: u32 = 132;

/// Encoder of a stream whose viewers may join at any I picture.
pub(super) struct LiveVideo {
    config: Config,
    encoder: Encoder,
    /// Number of the first picture of `encoder` in the stream.
    first: u64,
    /// Number of the next picture in the stream.
    next: u64,
}

/// Picture of the stream, and its coding for the masking model.
pub(super) struct CodedLive {
    pub packet: Packet,
    pub coding: Coding,
}

impl LiveVideo {
    /// Creates the encoder for `settings`. Rate and look-ahead of films are ignored.
    pub fn new(settings: &Settings) -> LiveResult<Self> {
        let config = settings.encoder_config()?;
        let config = config.with_lookahead(0).with_rate(Rate::ConstantQuantiser).with_gop(LONGEST_GROUP);
        let encoder = config.clone().encoder().map_err(render2mpeg::Error::from)?;
        Ok(Self { config, encoder, first: 0, next: 0 })
    }

    /// Returns the number of pictures in the stream so far.
    pub fn pictures(&self) -> u64 {
        self.next
    }

    /// Begins the encoder again, with the number of its first picture.
    pub fn begin_at(&mut self, number: u64) -> LiveResult<()> {
        let encoder = self.config.clone().with_first_number(number).encoder();
        self.encoder = encoder.map_err(render2mpeg::Error::from)?;
        (self.first, self.next) = (number, number);
        Ok(())
    }

    pub fn config(&self) -> &Config {
        &self.config
    }

    /// Codes the next picture. A picture of more than `most_bits` is coded again with a coarser quantiser.
    pub fn code(
        &mut self,
        displayed: &Displayed,
        mut quantiser_scale: u32,
        is_intra: bool,
        most_bits: Option<u64>,
    ) -> LiveResult<CodedLive> {
        // An I picture on request begins a new encoder, whose first picture needs no reference.
        if is_intra && self.next > self.first {
            self.begin_at(self.next)?;
        }
        let (before, most) = (most_bits.map(|_| self.encoder.state().clone()), most_bits.unwrap_or(u64::MAX));
        let mut packet = self.coded(displayed, quantiser_scale)?;
        while packet.bits > most && quantiser_scale < COARSEST {
            // Bits are about inversely proportional to the quantiser.
            let needed = f64::from(quantiser_scale) * packet.bits as f64 / most as f64;
            quantiser_scale = nearest_quantiser(needed.max(f64::from(quantiser_scale + 1)));
            if let Some(before) = &before {
                self.encoder.restore(before.clone()).expect("the state is of this encoder");
            }
            packet = self.coded(displayed, quantiser_scale)?;
        }

        // Number pictures in the stream, across encoders.
        packet.display_index += self.first;
        self.next += 1;
        let coding = Coding {
            outcome: Some(packet.coded()),
            begins_group: packet.picture_type == PictureType::I,
            ..Coding::of_quantiser(quantiser_scale as f32)
        };
        Ok(CodedLive { packet, coding })
    }

    /// Codes a picture with the encoder.
    fn coded(&mut self, displayed: &Displayed, quantiser_scale: u32) -> LiveResult<Packet> {
        self.encoder.set_quantiser_scale(quantiser_scale).map_err(render2mpeg::Error::from)?;
        let motion = SuppliedMotion { to_previous: displayed.correspondence.as_deref(), to_next: None };
        let packets = self.encoder.push(&displayed.picture.picture, motion);
        Ok(packets.into_iter().next().expect("an encoder without look-ahead codes each picture at once"))
    }
}
