//! Decodes the slices of pictures and combines fields.

use super::{DecoderCounts, DecoderOptions, order::ReferencePictures};
use crate::{
    coding::PictureCoding,
    conceal::conceal,
    frame::{FrameMemory, FramePool, FrameShape},
    header::{CodedHeader, PictureStructure},
    picture::{DecodedPicture, PictureDamage, PictureFlags},
    progress::MacroblockRecord,
    sequence::{Matrices, Sequence},
    slice::SliceDecoder,
};
use mpeg2::Standard;
use plane::PictureType;
use std::sync::Arc;

/// Parameters of a picture at its first slice.
pub(super) struct Started<'a> {
    pub header: CodedHeader,
    pub sequence: &'a Sequence,
    pub matrices: &'a Matrices,
    pub time: Option<i64>,
}

/// State of the frame in decoding.
#[derive(Clone, Copy, PartialEq, Eq)]
enum FrameStage {
    /// The slices of a picture are being decoded.
    Slices,
    /// The first field is complete.
    SecondFieldMissing,
}

/// Frame in decoding.
struct CurrentFrame {
    picture: DecodedPicture,
    coding: PictureCoding,
    stage: FrameStage,
}

/// Decoder of pictures from slices.
pub(super) struct PictureDecoder {
    options: DecoderOptions,
    counts: DecoderCounts,
    sequence: Option<Sequence>,
    references: ReferencePictures,
    pool: FramePool,
    record: MacroblockRecord,
    current: Option<CurrentFrame>,
    /// Whether B pictures before the second reference picture of the group may be decoded, with backward vectors only.
    group_is_closed: bool,
    /// Whether B pictures before the second reference picture of the group lack their past reference.
    link_is_broken: bool,
    /// Number of I or P pictures since the start of the group, at most 2.
    group_references: u32,
}

impl Default for PictureDecoder {
    fn default() -> Self {
        Self::new(DecoderOptions::default())
    }
}

impl PictureDecoder {
    pub fn new(options: DecoderOptions) -> Self {
        Self {
            options,
            counts: DecoderCounts::default(),
            sequence: None,
            references: ReferencePictures::default(),
            pool: FramePool::new(),
            record: MacroblockRecord::default(),
            current: None,
            group_is_closed: false,
            link_is_broken: false,
            group_references: 0,
        }
    }

    pub fn counts(&self) -> DecoderCounts {
        self.counts
    }

    pub fn sequence(&self) -> Option<&Sequence> {
        self.sequence.as_ref()
    }

    /// Starts a group of pictures with closed_gop and broken_link.
    pub fn start_group(&mut self, is_closed: bool, is_broken: bool) {
        (self.group_is_closed, self.link_is_broken, self.group_references) = (is_closed, is_broken, 0);
    }

    /// Counts a picture that cannot be decoded.
    pub fn drop_picture(&mut self) {
        self.counts.dropped += 1;
    }

    /// Starts a picture or the second field of one. Drops it if its references are missing.
    pub fn start(&mut self, started: Started, user_data: &mut Vec<u8>, show: &mut dyn FnMut(DecodedPicture)) {
        let Started { header, sequence, matrices, .. } = started;
        self.change_sequence(sequence, show);
        let is_second_field = self.completes_current(&header);
        if !is_second_field {
            self.show_current(show);
        }
        let coding = PictureCoding::new(header, sequence, matrices, is_second_field);
        let columns = coding.shape.macroblocks[0];
        if let Some(current) = self.current.as_mut().filter(|_| is_second_field) {
            if let Some(frame) = Arc::get_mut(&mut current.picture.frame) {
                frame.user_data.append(user_data);
            }
            self.record.start(columns * coding.rows);
            (current.coding, current.stage) = (coding, FrameStage::Slices);
            return;
        }
        let is_b = header.kind == PictureType::B;
        if !is_b {
            self.group_references = (self.group_references + 1).min(2);
            self.references.show_last(show);
        }
        if 256 * columns * coding.shape.macroblocks[1] > self.options.samples_max || !self.has_references(&header) {
            user_data.clear();
            return self.drop_picture();
        }
        self.record.start(columns * coding.rows);
        let mut frame = self.frame(coding.shape, &header);
        if let Some(frame) = Arc::get_mut(&mut frame) {
            frame.user_data.append(user_data);
        }
        let picture = DecodedPicture {
            frame,
            sequence: *sequence,
            flags: flags(&header, sequence),
            time: started.time,
            damage: PictureDamage::default(),
        };
        self.current = Some(CurrentFrame { picture, coding, stage: FrameStage::Slices });
    }

    /// Returns free frame memory. It is gray if a picture without references was requested.
    fn frame(&mut self, shape: FrameShape, header: &CodedHeader) -> Arc<FrameMemory> {
        let mut frame = self.pool.take(shape);
        if header.kind != PictureType::I
            && !self.references.has_one()
            && let Some(frame) = Arc::get_mut(&mut frame)
        {
            frame.fill_gray();
        }
        frame
    }

    /// Returns whether the references of a picture exist, or are not required by the options.
    fn has_references(&self, header: &CodedHeader) -> bool {
        let leads = self.group_references < 2;
        self.options.show_incomplete
            || match header.kind {
                PictureType::I => true,
                PictureType::P => self.references.has_one(),
                PictureType::B if leads && self.group_is_closed => self.references.has_one(),
                PictureType::B => self.references.has_two() && !(leads && self.link_is_broken),
            }
    }

    /// Adopts the properties of a sequence. Pictures of another size begin without references.
    fn change_sequence(&mut self, sequence: &Sequence, show: &mut dyn FnMut(DecodedPicture)) {
        let low_delay = self.sequence.is_some_and(|old| old.low_delay) && sequence.low_delay;
        let is_same = self.sequence.is_some_and(|old| {
            (old.width, old.height, old.chroma, old.macroblocks())
                == (sequence.width, sequence.height, sequence.chroma, sequence.macroblocks())
        });
        if !is_same {
            self.show_current(show);
            self.end_sequence(show);
        }
        let is_new = self.sequence.is_none() || !is_same;
        self.sequence = Some(Sequence { low_delay: if is_new { sequence.low_delay } else { low_delay }, ..*sequence });
    }

    /// Returns whether a picture is the second field of the current frame.
    fn completes_current(&self, header: &CodedHeader) -> bool {
        let Some(current) = self.current.as_ref().filter(|current| current.stage == FrameStage::SecondFieldMissing)
        else {
            return false;
        };
        let first = &current.coding.header;
        let are_fields = first.structure != PictureStructure::Frame && header.structure != PictureStructure::Frame;
        let both_b = (first.kind == PictureType::B) == (header.kind == PictureType::B);
        are_fields && both_b && first.structure != header.structure
    }

    /// Decodes a slice with the last byte of its start code.
    pub fn slice(&mut self, code: u8, data: &[u8]) {
        let Some(CurrentFrame { picture, coding, stage: FrameStage::Slices }) = &mut self.current else { return };
        let Some(frame) = Arc::get_mut(&mut picture.frame) else { return };
        let references = self.references.of(coding.is_b());
        let slice = SliceDecoder::new(coding, references, frame, &mut self.record, data);
        if slice.decode(code).is_err() {
            self.record.damaged_slices += 1;
        }
    }

    /// Ends the slices of a picture: conceals missing macroblocks, and shows the frame unless a field is missing.
    pub fn finish(&mut self, show: &mut dyn FnMut(DecodedPicture)) {
        let Some(current) = self.current.as_mut().filter(|current| current.stage == FrameStage::Slices) else { return };
        let CurrentFrame { picture, coding, stage } = current;
        let references = self.references.of(coding.is_b());
        if let Some(frame) = Arc::get_mut(&mut picture.frame) {
            picture.damage.macroblocks += conceal(coding, references, frame, &self.record);
        }
        picture.damage.slices += self.record.damaged_slices;
        if coding.is_frame() || coding.is_second_field {
            self.show_current(show);
        } else {
            *stage = FrameStage::SecondFieldMissing;
        }
    }

    /// Ends the current frame, and doubles the lines of a field without the other one.
    fn show_current(&mut self, show: &mut dyn FnMut(DecodedPicture)) {
        let Some(CurrentFrame { mut picture, coding, stage }) = self.current.take() else { return };
        if stage == FrameStage::SecondFieldMissing
            && let Some(frame) = Arc::get_mut(&mut picture.frame)
        {
            frame.double_lines(coding.parity());
            picture.damage.macroblocks += self.record.len() as u32;
        }
        self.pool.give(Arc::clone(&picture.frame));
        self.counts.damaged_slices += u64::from(picture.damage.slices);
        self.counts.concealed_macroblocks += u64::from(picture.damage.macroblocks);
        let sequence = self.sequence.as_mut();
        if coding.is_b() {
            // A sequence with B pictures has no low delay.
            if let Some(sequence) = sequence {
                sequence.low_delay = false;
            }
            return show(picture);
        }
        let is_shown = sequence.is_some_and(|sequence| sequence.low_delay);
        if is_shown {
            show(picture.clone());
        }
        self.references.add(picture, is_shown);
    }

    /// Shows the last reference picture and removes all references.
    pub fn end_sequence(&mut self, show: &mut dyn FnMut(DecodedPicture)) {
        self.show_current(show);
        self.references.show_last(show);
        self.references.clear();
        self.group_references = 0;
    }
}

/// Returns the flags of a picture.
fn flags(header: &CodedHeader, sequence: &Sequence) -> PictureFlags {
    let is_mpeg1 = sequence.standard == Standard::Mpeg1;
    PictureFlags {
        kind: header.kind,
        is_dc_only: header.is_dc_only,
        temporal_reference: header.temporal_reference,
        is_field_pair: header.structure != PictureStructure::Frame,
        // The first field of a field pair is the first one displayed.
        top_field_first: match header.structure {
            PictureStructure::Field { parity } => parity == 0,
            PictureStructure::Frame => header.top_field_first,
        },
        repeat_first_field: header.repeat_first_field,
        progressive_frame: header.progressive_frame || is_mpeg1,
    }
}
