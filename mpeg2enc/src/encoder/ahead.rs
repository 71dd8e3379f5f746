//! Codes pictures after a look-ahead: I, P and B, optionally within a bit rate.

use crate::{
    Config, Picture, PictureType, Rate, RestoreError, SuppliedMotion,
    bounds::Bounds,
    coder::{CodedPacket, Coder, Direction, Packet, PictureJob},
    header::VBV_DELAY_VARIABLE,
    lookahead::{Lookahead, plan::Span, weights},
    motion::Candidates,
    quantiser_scale::spread_over_rows,
    rate_control::{RateControl, Upcoming},
    restore::{ensure, is_whole},
};
use std::sync::Arc;

/// State between two pictures, including waiting frames.
#[derive(Clone)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Ahead {
    lookahead: Lookahead,
    rate: Option<RateControl>,
    bounds: Bounds,
    /// The last two I or P pictures, older first.
    anchors: [Option<Anchor>; 2],
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

/// Parameters of the next picture to code.
struct NextCoded<'a> {
    /// Display index of the picture.
    index: usize,
    picture_type: PictureType,
    /// Factors of quantiser_scale of all macroblocks, in 256ths.
    factors: &'a [u32],
    /// Headers that precede the picture.
    headers: Vec<u8>,
    /// Whether the group that begins with the picture is closed.
    is_closed: bool,
    /// This picture and the known pictures that follow it, in the order of coding; empty if bits are not bounded.
    upcoming: &'a [Upcoming],
    /// Whether `upcoming` extends to the end of the film.
    complete: bool,
}

impl Ahead {
    pub fn new(config: &Config) -> Self {
        let (columns, rows) = config.macroblock_counts();
        Self {
            rate: RateControl::new(config, columns * rows),
            bounds: Bounds::default(),
            lookahead: Lookahead::new(config.effort),
            anchors: [None, None],
            group_start: 0,
        }
    }

    /// Accepts the next frame, and `weights` as factors of quantiser_scale in 256ths.
    pub fn push(
        &mut self,
        coder: &mut Coder,
        frame: &Picture,
        motion: SuppliedMotion,
        weights: Option<Vec<u32>>,
    ) -> Vec<Packet> {
        let source = coder.whole(frame);
        let config = &coder.config;
        let weights = weights
            .or_else(|| config.adaptive_quantisation.then(|| weights::by_activity(source.luma())))
            .filter(|_| config.varies());
        self.lookahead.push(config, source, motion, weights);
        self.code(coder, coder.config.delay())
    }

    /// Codes the waiting frames.
    pub fn finish(&mut self, coder: &mut Coder) -> Vec<Packet> {
        self.code(coder, 0)
    }

    /// Returns whether a frame begins a group; see [`Encoder::begins_group`](crate::Encoder::begins_group).
    pub fn begins_group(&self, index: usize, gop: usize) -> Option<bool> {
        self.lookahead.begins_group(index, gop)
    }

    /// Returns the quantiser_scale of the waiting frames if no frames followed them; see
    /// [`Encoder::planned_quantiser_scale`](crate::Encoder::planned_quantiser_scale).
    pub fn planned_quantiser_scale(&mut self, config: &Config) -> Option<f32> {
        let last = self.last_anchor();
        let rate = self.rate.as_ref().filter(|_| self.lookahead.end() > next_after(last))?;
        let spans = self.lookahead.plan(config, last);
        let mut upcoming = self.lookahead.upcoming(last, &spans);

        // An I picture borrows bits from later pictures. Assume that these resemble the waiting predicted ones.
        let mut predicted: Vec<Upcoming> = Vec::new();
        for &picture in upcoming.iter().rev() {
            if picture.picture_type != PictureType::I {
                predicted.push(picture);
            }
        }
        let missing = config.delay().saturating_sub(upcoming.len());
        upcoming.extend(predicted.iter().cycle().take(missing));
        if predicted.is_empty() {
            return None;
        }
        Some(rate.quantiser_x16(&upcoming, None) as f32 / 16.0)
    }

    /// Adopts the quantiser of changed settings.
    pub fn set_quantiser(&mut self, config: &Config) {
        if let Some(rate) = &mut self.rate {
            rate.set_quantiser(config);
        }
    }

    /// Codes pictures while more than `keep` frames wait.
    fn code(&mut self, coder: &mut Coder, keep: usize) -> Vec<Packet> {
        let mut packets = Vec::new();
        loop {
            let last = self.last_anchor();
            if self.lookahead.end() <= next_after(last) + keep {
                return packets;
            }
            let spans = self.lookahead.plan(&coder.config, last);
            self.code_span(coder, &spans, keep == 0, &mut packets);
            self.lookahead.drop_before(spans[0].anchor);
        }
    }

    /// Returns the display index of the last coded I or P picture.
    fn last_anchor(&self) -> Option<usize> {
        self.anchors[1].as_ref().map(|anchor| anchor.index)
    }

    /// Codes the first of `spans`: its anchor, then its B pictures. `complete` is true if no frame follows the spans.
    fn code_span(&mut self, coder: &mut Coder, spans: &[Span], complete: bool, packets: &mut Vec<Packet>) {
        let span = spans[0];
        let last = self.last_anchor();
        let count = self.lookahead.macroblocks();
        // The tree decides the quality of anchors; otherwise I pictures have a fixed factor.
        let factors = match (coder.config.uses_tree(), span.is_intra && coder.config.varies()) {
            (true, _) => self.lookahead.factors(last, spans),
            (false, true) => vec![INTRA_FACTOR_256THS; count],
            (false, false) => vec![256; count],
        };
        // Code the anchor first; a group's headers precede it.
        let upcoming = if self.rate.is_some() { self.lookahead.upcoming(last, spans) } else { Vec::new() };
        let mut headers = Vec::new();
        if span.is_intra {
            self.group_start = span.anchor - span.b_pictures;
            headers = self.group_headers(coder, span.b_pictures == 0);
        }
        let is_closed = span.b_pictures == 0;
        let picture_type = if span.is_intra { PictureType::I } else { PictureType::P };
        let anchor = NextCoded {
            index: span.anchor,
            picture_type,
            factors: &factors,
            headers,
            is_closed,
            upcoming: &upcoming,
            complete,
        };
        let coded = self.code_within_rate(coder, anchor);
        packets.push(coded.packet);
        // Replace the older of the two reference pictures.
        self.anchors.swap(0, 1);
        self.anchors[1] = coded.reference.map(|reconstruction| Anchor { index: span.anchor, reconstruction });
        // B pictures follow their anchor in the stream.
        let b_factors = vec![16 * B_SCALE_SIXTEENTHS; count];
        for (i, index) in (span.anchor - span.b_pictures..span.anchor).enumerate() {
            let next = NextCoded {
                index,
                picture_type: PictureType::B,
                factors: &b_factors,
                headers: Vec::new(),
                is_closed,
                upcoming: upcoming.get(i + 1..).unwrap_or_default(),
                complete,
            };
            packets.push(self.code_within_rate(coder, next).packet);
        }
    }

    /// Codes one picture with the quantiser that the rate allows, times its factors. Codes it again if it does not fit.
    fn code_within_rate(&mut self, coder: &mut Coder, next: NextCoded) -> CodedPacket {
        let wanted_x256 = coder.config.quantiser_x256();
        let Some(mut rate) = self.rate.take() else {
            return self.code_within_bounds(coder, next);
        };
        let NextCoded { picture_type, upcoming, complete, .. } = next;
        let header_bits = 8 * next.headers.len() as i64;
        let vbv_delay = match coder.config.rate {
            Rate::Constant { .. } => rate.buffer.delay(header_bits + 32), // picture_start_code has 32 bits
            _ => VBV_DELAY_VARIABLE,
        };
        let mut base_x16 = rate.quantiser_x16(upcoming, None);
        // Code a picture again if its bits miss their prediction by a sixteenth of the buffer. The corrected model must
        // also change the quantiser by more than a sixteenth. I pictures, the first picture of each type and the last
        // four pictures need no miss. A third attempt follows only if the second attempt takes too many bits.
        let is_looked_at =
            !rate.knows(picture_type) || picture_type == PictureType::I || complete && upcoming.len() <= 4;
        let mut looks = 0;
        let mut coded = loop {
            // The quantiser of the settings may lie between sixteenths.
            let base_x256 = if base_x16 == wanted_x256 / 16 { wanted_x256 } else { 16 * base_x16 };
            let coded = self.code_picture(coder, &next, base_x256, vbv_delay);
            // Compare the bits with their prediction, then correct the model.
            let bits = coded.packet.bits as i64 + header_bits;
            let surprise = bits - rate.predicted(upcoming[0], base_x16).bits();
            let is_surprise =
                if looks == 0 { surprise.abs() } else { surprise } > rate.buffer.size / SURPRISE_OF_BUFFER;
            let taken = rate.taken(bits, &coded.packet.statistics);
            rate.learn(upcoming[0], base_x16, taken);
            looks += 1;
            // Code the picture again if the corrected model changes the quantiser.
            if is_surprise && looks < MOST_LOOKS || is_looked_at && looks == 1 {
                let informed = rate.quantiser_x16(upcoming, Some((base_x16, taken)));
                if informed.abs_diff(base_x16) * 16 > base_x16 {
                    base_x16 = informed;
                    continue;
                }
            }
            // A picture that would underflow the buffer is always coded again.
            match rate.coarser_after(base_x16, bits) {
                Some(coarser) => base_x16 = coarser,
                None => break coded,
            }
        };
        // Pad pictures that are too small, so that the buffer does not overflow.
        coded.fill_to(rate.buffer.least() - header_bits);
        coded.packet.prepend(next.headers);
        rate.take(coded.packet.bits as i64, base_x16);
        self.rate = Some(rate);
        coded
    }

    /// Codes one picture with the quantiser of the settings times its factors, or a coarser one if the level's buffer requires
    /// it.
    fn code_within_bounds(&mut self, coder: &mut Coder, next: NextCoded) -> CodedPacket {
        let mut base_x256 = coder.config.quantiser_x256();
        let mut coded = loop {
            let coded = self.code_picture(coder, &next, base_x256, VBV_DELAY_VARIABLE);
            let bits = coded.packet.bits + 8 * next.headers.len() as u64;
            self.bounds.begin(&mut coder.config, bits);
            match self.bounds.coarser(base_x256, bits) {
                Some(coarser) => base_x256 = coarser,
                None => break coded,
            }
        };
        // The first picture has now determined the level in the headers.
        let is_first = !next.headers.is_empty();
        let headers = if is_first { self.group_headers(coder, next.is_closed) } else { Vec::new() };
        coded.packet.prepend(headers);
        self.bounds.take(coded.packet.bits);
        coded
    }

    fn group_headers(&self, coder: &Coder, is_closed: bool) -> Vec<u8> {
        coder.group_headers(self.group_start as u64, is_closed)
    }

    /// Sets the level of `config` to the level in the stream's existing headers.
    pub fn restate(&self, config: &mut Config) {
        self.bounds.restate(config);
    }

    /// Codes one picture; `base_x256` is quantiser_scale before factors, in 256ths.
    fn code_picture(&mut self, coder: &mut Coder, next: &NextCoded, base_x256: u32, vbv_delay: u32) -> CodedPacket {
        let &NextCoded { index, picture_type, factors, .. } = next;
        let columns = coder.config.macroblock_counts().0;
        // A factor common to all macroblocks would round all of them to the same existing quantiser.
        let spreads = coder.config.has_mean_quantiser() && factors.iter().all(|&factor| factor == factors[0]);
        let q_scale_type = coder.q_scale_type();
        let weights = self.lookahead.get(index).weights.as_ref();
        let mut scales_x16 = Vec::with_capacity(factors.len());
        for (i, factor) in factors.iter().enumerate() {
            let weight = weights.map_or(256, |weights| weights[i]);
            let scale_x16 = (base_x256 * factor / 4096 * weight / 256).clamp(16, 112 * 16);
            let row = i / columns;
            scales_x16.push(if spreads { spread_over_rows(q_scale_type, scale_x16, row) } else { scale_x16 });
        }
        // P pictures predict from the newest anchor, and B pictures from the last two anchors.
        let references = match picture_type {
            PictureType::I => [None, None],
            PictureType::P => [self.anchors[1].as_ref(), None],
            PictureType::B => [self.anchors[0].as_ref(), self.anchors[1].as_ref()],
        };
        let mut candidates: [Arc<[Candidates]>; 2] = Default::default();
        for (s, reference) in references.iter().enumerate() {
            if let Some(reference) = reference {
                candidates[s] = self.lookahead.for_coding(index, reference.index as isize - index as isize);
            }
        }
        let source = &self.lookahead.get(index).source;
        // Skip the coarse search, because the look-ahead has supplied all candidates.
        coder.code(&PictureJob {
            picture_type,
            display_index: index as u64,
            temporal_reference: (index - self.group_start) as u32,
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

    /// Checks that an encoder with these settings can continue from this state.
    pub fn check(&self, config: &Config) -> Result<(), RestoreError> {
        let (columns, rows) = config.macroblock_counts();
        self.lookahead.check(config)?;
        // The look-ahead begins with the last anchor.
        let (first, end) = (self.lookahead.first(), self.lookahead.end());
        let last = self.last_anchor();
        ensure(last.unwrap_or(0) == first && (last.is_none() || first < end), "last anchor")?;
        ensure(end <= next_after(last) + config.delay(), "number of waiting frames")?;
        let before = self.anchors[0].as_ref().map(|anchor| anchor.index);
        // Only the first frame has no earlier anchor.
        ensure(before.is_some() == last.is_some_and(|last| last > 0), "previous anchor")?;
        let distance = config.b_pictures as usize + 1;
        ensure(before.is_none_or(|before| before < first && first - before <= distance), "previous anchor")?;
        let whole = |anchor: &Anchor| is_whole(&anchor.reconstruction, columns, rows);
        ensure(self.anchors.iter().flatten().all(whole), "size of an anchor")?;
        let longest = (config.gop + config.b_pictures) as usize;
        ensure(self.group_start <= first && first - self.group_start <= longest, "beginning of the group")?;
        let fresh = RateControl::new(config, columns * rows);
        ensure(self.rate.is_some() == fresh.is_some(), "rate control")?;
        self.bounds.check(config, last.is_some())?;
        self.rate.iter().zip(fresh).try_for_each(|(rate, fresh)| rate.check(&fresh))
    }
}

/// Returns the display index of the frame after the last anchor.
fn next_after(anchor: Option<usize>) -> usize {
    anchor.map_or(0, |anchor| anchor + 1)
}

/// Inverse of a fraction of the buffer. A picture is coded again if its bits miss their prediction by more than this fraction,
/// which equals the reserve of the planning.
const SURPRISE_OF_BUFFER: i64 = 16;
/// Maximum number of attempts at a picture if the prediction of its bits was wrong. The value was chosen, not tuned: the second
/// attempt corrects the prediction, and the third corrects an overshoot of the second.
const MOST_LOOKS: u32 = 3;
/// Factor of quantiser_scale of I pictures without a macroblock tree. It is below 1 because other pictures inherit their quality.
/// The standard does not define this value; it was tuned on the clips of README.md. With 190, moving clips take more bits and
/// static ones fewer.
const INTRA_FACTOR_256THS: u32 = 208;
/// Factor of quantiser_scale of B pictures. It is above 1 because no picture predicts from them. The standard does not define
/// this value; it was tuned on the clips of README.md.
const B_SCALE_SIXTEENTHS: u32 = 18;
