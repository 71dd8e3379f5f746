//! Pictures in, packets out, some pictures later: I, P and B.

use crate::{
    Config, Frame, KnownMotion, PictureType,
    coder::{Coder, Direction, Job, Packet, sequence_end},
    header::{VBV_DELAY_VARIABLE, macroblock_counts},
    lookahead::{Lookahead, plan::Span},
    motion::Candidates,
};

/// Encodes pictures that may wait for later ones; made by [`Config::lookahead_encoder`].
///
/// Packets come in the order of coding, which is that of the stream: a B picture follows the I or P picture that is
/// shown after it. [`Packet::display_index`] says which frame a packet is.
pub struct LookaheadEncoder {
    coder: Coder,
    lookahead: Lookahead,
    /// The last two I or P pictures.
    anchors: [Option<Anchor>; 2],
    /// Display index of the last I picture.
    last_intra: usize,
    /// Display index of the first picture of the group.
    group_start: usize,
}

/// A coded I or P picture.
struct Anchor {
    index: usize,
    reconstruction: Frame,
}

impl LookaheadEncoder {
    pub(crate) fn new(config: Config) -> Self {
        Self {
            coder: Coder::new(config, true),
            lookahead: Lookahead::new(),
            anchors: [None, None],
            last_intra: 0,
            group_start: 0,
        }
    }

    /// The settings it was made with.
    pub fn config(&self) -> &Config {
        &self.coder.config
    }

    /// Takes the next frame, and gives the packets that can be coded now: none at first, later some.
    ///
    /// `motion` changes what is tried, never what is correct; without it, vectors are searched for.
    ///
    /// # Panics
    /// If frame or motion fields have another size than the [`Config`].
    pub fn push(&mut self, frame: &Frame, motion: KnownMotion) -> Vec<Packet> {
        let config = &self.coder.config;
        config.check_input(frame, motion.to_previous);
        config.check_input(frame, motion.to_next);
        let (columns, rows) = macroblock_counts(config.width, config.height);
        self.lookahead.push(frame.resized(16 * columns, 16 * rows), motion);
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
            let last = self.anchors[1].as_ref().map(|anchor| anchor.index);
            let next = last.map_or(0, |last| last + 1);
            if self.lookahead.end() <= next + keep {
                return packets;
            }
            let spans = self.lookahead.plan(&self.coder.config, last.map(|last| (last, self.last_intra)));
            self.code_span(&spans, &mut packets);
            self.lookahead.drop_before(spans[0].anchor);
        }
    }

    /// Codes the first of `spans`: its anchor, then its B pictures.
    fn code_span(&mut self, spans: &[Span], packets: &mut Vec<Packet>) {
        let span = spans[0];
        let last = self.anchors[1].as_ref().map(|anchor| anchor.index);
        let count = self.lookahead.get(span.anchor).intra_costs.len();
        let base_x16 = 16 * self.coder.config.quantiser_scale;
        let scales_x16: Vec<u32> = if self.coder.config.uses_tree() {
            let factors = self.lookahead.factors(last, spans);
            factors.iter().map(|factor| (base_x16 * factor / 256).max(16)).collect()
        } else {
            vec![base_x16; count]
        };
        if span.is_intra {
            self.last_intra = span.anchor;
            self.group_start = span.anchor - span.b_pictures;
        }
        let picture_type = if span.is_intra { PictureType::I } else { PictureType::P };
        let mut coded = self.code_picture(span.anchor, picture_type, &scales_x16);
        if span.is_intra {
            self.coder.begin_group(&mut coded.0, self.group_start as u64, span.b_pictures == 0);
        }
        packets.push(coded.0);
        self.anchors.swap(0, 1);
        self.anchors[1] = Some(Anchor { index: span.anchor, reconstruction: coded.1 });
        let b_scales_x16 = vec![base_x16 * B_SCALE_SIXTEENTHS / 16; count];
        for index in span.anchor - span.b_pictures..span.anchor {
            packets.push(self.code_picture(index, PictureType::B, &b_scales_x16).0);
        }
    }

    /// The packet of one picture and its reconstruction in whole macroblocks.
    fn code_picture(&mut self, index: usize, picture_type: PictureType, scales_x16: &[u32]) -> (Packet, Frame) {
        // Forward from the newest anchor in a P picture, from the one before in a B picture.
        let references = match picture_type {
            PictureType::I => [None, None],
            PictureType::P => [self.anchors[1].as_ref(), None],
            PictureType::B => [self.anchors[0].as_ref(), self.anchors[1].as_ref()],
        };
        let mut candidates: [Vec<Candidates>; 2] = [Vec::new(), Vec::new()];
        for (s, reference) in references.iter().enumerate() {
            if let Some(reference) = reference {
                candidates[s] = self.lookahead.for_coding(index, reference.index as isize - index as isize);
            }
        }
        let source = &self.lookahead.get(index).source;
        let coded = self.coder.code(&Job {
            picture_type,
            display_index: index as u64,
            temporal_reference: (index - self.group_start) as u32,
            vbv_delay: VBV_DELAY_VARIABLE,
            source,
            directions: std::array::from_fn(|s| {
                let reference = &references[s]?.reconstruction;
                Some(Direction { reference, candidates: &candidates[s], before: &[], coarse: None })
            }),
            quantiser_scale: self.coder.config.quantiser_scale,
            scales_x16,
        });
        (coded.packet, coded.reconstruction)
    }
}

/// How much coarser B pictures are: nothing is predicted from them. Ours, tuned on the clips of README.md.
const B_SCALE_SIXTEENTHS: u32 = 18;
