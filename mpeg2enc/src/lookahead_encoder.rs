//! Pictures in, packets out, some pictures later: I, P and B.

use crate::{
    Config, KnownMotion, Picture, PictureType, Rate,
    coder::{Coded, Coder, Direction, Job, Packet, sequence_end},
    config::spread_over_rows,
    header::{VBV_DELAY_VARIABLE, macroblock_counts},
    lookahead::{Lookahead, plan::Span, weights},
    motion::Candidates,
    rate::{RateControl, Upcoming},
};
use plane::Plane;
use std::sync::Arc;

/// Encodes pictures that may wait for later ones; made by [`Config::lookahead_encoder`].
///
/// Packets come in the order of coding, which is that of the stream: a B picture follows the I or P picture that is
/// shown after it. [`Packet::display_index`] says which frame a packet is.
pub struct LookaheadEncoder {
    coder: Coder,
    state: LookaheadState,
}

/// What a [`LookaheadEncoder`] carries from one picture to the next, frames that wait included: with it, another one of the
/// same settings goes on.
#[derive(Clone)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct LookaheadState {
    lookahead: Lookahead,
    rate: Option<RateControl>,
    /// The last two I or P pictures.
    anchors: [Option<Anchor>; 2],
    /// Display index of the last I picture.
    last_intra: usize,
    /// Display index of the first picture of the group.
    group_start: usize,
}

/// A coded I or P picture.
#[derive(Clone)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Anchor {
    index: usize,
    reconstruction: Arc<Picture>,
}

impl LookaheadEncoder {
    pub(crate) fn new(config: Config) -> Self {
        let (columns, rows) = macroblock_counts(config.width, config.height);
        let state = LookaheadState {
            rate: RateControl::new(&config, columns * rows),
            lookahead: Lookahead::new(config.effort),
            anchors: [None, None],
            last_intra: 0,
            group_start: 0,
        };
        Self { coder: Coder::new(config, true), state }
    }

    /// The settings it was made with.
    pub fn config(&self) -> &Config {
        &self.coder.config
    }

    /// All that the next packets depend on, besides settings and frames to come.
    pub fn state(&self) -> &LookaheadState {
        &self.state
    }

    /// Goes on where an encoder of the same settings was; the state of one with other settings gives a damaged stream or a
    /// panic.
    pub fn restore(&mut self, state: LookaheadState) {
        self.state = state;
    }

    /// Takes the next frame, and gives the packets that can be coded now: none at first, later some.
    ///
    /// `motion` changes what is tried, never what is correct; without it, vectors are searched for.
    ///
    /// # Panics
    /// If frame or motion have another size than the [`Config`].
    pub fn push(&mut self, frame: &Picture, motion: KnownMotion) -> Vec<Packet> {
        self.push_frame(frame, motion, None)
    }

    /// The same with a factor of quantiser_scale for every macroblock: below 1 where errors show, above 1 where they do not.
    /// They take the place of those of [`Config::with_adaptive_quantisation`].
    ///
    /// # Panics
    /// If frame or motion have another size than the [`Config`], or `weights` is not a sample for each 16×16 samples of
    /// luma, what is begun counted as whole.
    pub fn push_weighted(&mut self, frame: &Picture, motion: KnownMotion, weights: &Plane<f32>) -> Vec<Packet> {
        let counts = macroblock_counts(self.config().width, self.config().height);
        assert_eq!((weights.width(), weights.height()), counts, "weights that are not one for each macroblock");
        self.push_frame(frame, motion, Some(weights::given(weights)))
    }

    fn push_frame(&mut self, frame: &Picture, motion: KnownMotion, weights: Option<Vec<u32>>) -> Vec<Packet> {
        let config = &self.coder.config;
        config.check_input(frame, motion.to_previous);
        config.check_input(frame, motion.to_next);
        let source = self.coder.whole(frame);
        let config = &self.coder.config;
        let weights = weights
            .or_else(|| config.adaptive_quantisation.then(|| weights::by_activity(source.luma())))
            .filter(|_| config.varies());
        self.state.lookahead.push(source, motion, weights);
        self.code(self.coder.config.lookahead())
    }

    /// Codes what still waits; and the end of the stream, sequence_end_code.
    pub fn finish(mut self) -> (Vec<Packet>, Vec<u8>) {
        (self.code(0), sequence_end())
    }

    /// Codes as long as more than `keep` frames wait.
    fn code(&mut self, keep: usize) -> Vec<Packet> {
        let mut packets = Vec::new();
        loop {
            let last = self.state.anchors[1].as_ref().map(|anchor| anchor.index);
            let next = last.map_or(0, |last| last + 1);
            if self.state.lookahead.end() <= next + keep {
                return packets;
            }
            let spans = self.state.lookahead.plan(&self.coder.config, last.map(|last| (last, self.state.last_intra)));
            self.code_span(&spans, keep == 0, &mut packets);
            self.state.lookahead.drop_before(spans[0].anchor);
        }
    }

    /// Codes the first of `spans`: its anchor, then its B pictures. `complete` if no frame comes after them all.
    fn code_span(&mut self, spans: &[Span], complete: bool, packets: &mut Vec<Packet>) {
        let span = spans[0];
        let last = self.state.anchors[1].as_ref().map(|anchor| anchor.index);
        let count = self.state.lookahead.macroblocks();
        let factors = match (self.coder.config.uses_tree(), span.is_intra && self.coder.config.varies()) {
            (true, _) => self.state.lookahead.factors(last, spans),
            (false, true) => vec![INTRA_FACTOR_256THS; count],
            (false, false) => vec![256; count],
        };
        let upcoming = if self.state.rate.is_some() { self.state.lookahead.upcoming(last, spans) } else { Vec::new() };
        let mut headers = Vec::new();
        if span.is_intra {
            self.state.last_intra = span.anchor;
            self.state.group_start = span.anchor - span.b_pictures;
            headers = self.coder.group_headers(self.state.group_start as u64, span.b_pictures == 0);
        }
        let picture_type = if span.is_intra { PictureType::I } else { PictureType::P };
        let coded = self.code_within_rate(span.anchor, picture_type, &factors, headers, &upcoming, complete);
        packets.push(coded.packet);
        self.state.anchors.swap(0, 1);
        self.state.anchors[1] = coded.reference.map(|reconstruction| Anchor { index: span.anchor, reconstruction });
        let b_factors = vec![16 * B_SCALE_SIXTEENTHS; count];
        for (i, index) in (span.anchor - span.b_pictures..span.anchor).enumerate() {
            let upcoming = upcoming.get(i + 1..).unwrap_or_default();
            let coded = self.code_within_rate(index, PictureType::B, &b_factors, Vec::new(), upcoming, complete);
            packets.push(coded.packet);
        }
    }

    /// Codes one picture with the quantiser that the rate allows, times `factors` in 256ths; again if it does not fit.
    fn code_within_rate(
        &mut self,
        index: usize,
        picture_type: PictureType,
        factors: &[u32],
        headers: Vec<u8>,
        upcoming: &[Upcoming],
        complete: bool,
    ) -> Coded {
        let Some(mut rate) = self.state.rate.take() else {
            let base_x256 = self.coder.config.quantiser_x256();
            let mut coded = self.code_picture(index, picture_type, base_x256, factors, VBV_DELAY_VARIABLE);
            coded.packet.prepend(headers);
            return coded;
        };
        let header_bits = 8 * headers.len() as i64;
        let vbv_delay = match self.coder.config.rate {
            Rate::Constant { .. } => rate.buffer.delay(header_bits + 32), // picture_start_code has 32 bits
            _ => VBV_DELAY_VARIABLE,
        };
        let mut base_x16 = rate.quantiser_x16(upcoming);
        // What is dear or soon over is looked at again if the forecast was far off.
        let mut second_look =
            !rate.knows(picture_type) || picture_type == PictureType::I || complete && upcoming.len() <= 4;
        let wanted_x256 = self.coder.config.quantiser_x256();
        let mut coded = loop {
            // What was asked for may lie between sixteenths.
            let base_x256 = if base_x16 == wanted_x256 / 16 { wanted_x256 } else { 16 * base_x16 };
            let coded = self.code_picture(index, picture_type, base_x256, factors, vbv_delay);
            let bits = coded.packet.bits as i64 + header_bits;
            rate.learn(upcoming[0], base_x16, bits);
            if second_look {
                second_look = false;
                let informed = rate.quantiser_x16(upcoming);
                if informed.abs_diff(base_x16) * 16 > base_x16 {
                    base_x16 = informed;
                    continue;
                }
            }
            match rate.coarser_after(base_x16, bits) {
                Some(coarser) => base_x16 = coarser,
                None => break coded,
            }
        };
        coded.fill_to(rate.buffer.least() - header_bits);
        coded.packet.prepend(headers);
        rate.buffer.take(coded.packet.bits as i64);
        self.state.rate = Some(rate);
        coded
    }

    fn code_picture(
        &mut self,
        index: usize,
        picture_type: PictureType,
        base_x256: u32,
        factors: &[u32],
        vbv_delay: u32,
    ) -> Coded {
        let columns = macroblock_counts(self.coder.config.width, self.coder.config.height).0;
        // What all macroblocks share would jump from one quantiser that exists to the next.
        let spreads = self.coder.config.asks_for_a_mean() && factors.iter().all(|&factor| factor == factors[0]);
        let q_scale_type = self.coder.q_scale_type();
        let scale_x16 = |(i, factor): (usize, &u32)| {
            let weight = self.state.lookahead.get(index).weights.as_ref().map_or(256, |weights| weights[i]);
            let scale_x16 = (base_x256 * factor / 4096 * weight / 256).clamp(16, 112 * 16);
            if spreads { spread_over_rows(q_scale_type, scale_x16, i / columns) } else { scale_x16 }
        };
        let scales_x16: Vec<u32> = factors.iter().enumerate().map(scale_x16).collect();
        // Forward from the newest anchor in a P picture, from the one before in a B picture.
        let references = match picture_type {
            PictureType::I => [None, None],
            PictureType::P => [self.state.anchors[1].as_ref(), None],
            PictureType::B => [self.state.anchors[0].as_ref(), self.state.anchors[1].as_ref()],
        };
        let mut candidates: [Arc<[Candidates]>; 2] = Default::default();
        for (s, reference) in references.iter().enumerate() {
            if let Some(reference) = reference {
                candidates[s] = self.state.lookahead.for_coding(index, reference.index as isize - index as isize);
            }
        }
        let source = &self.state.lookahead.get(index).source;
        self.coder.code(&Job {
            picture_type,
            display_index: index as u64,
            temporal_reference: (index - self.state.group_start) as u32,
            vbv_delay,
            source,
            directions: std::array::from_fn(|s| {
                let reference = &references[s]?.reconstruction;
                Some(Direction { reference, candidates: &candidates[s], before: &[], coarse: None })
            }),
            quantiser_scale: (base_x256 + 128) / 256,
            scales_x16: &scales_x16,
        })
    }
}

/// How much finer I pictures are where no tree says it: others inherit from them. Ours, tuned on the clips of README.md: with
/// 190 moving ones take more bits, still ones less.
const INTRA_FACTOR_256THS: u32 = 208;
/// How much coarser B pictures are: nothing is predicted from them. Ours, tuned on the clips of README.md.
const B_SCALE_SIXTEENTHS: u32 = 18;
