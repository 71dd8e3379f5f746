//! Kinds of motion compensation: frame, field, 16×8 and dual-prime (7.6.2, 7.6.3).

use crate::{
    coding::{PictureCoding, References},
    frame::{FrameMemory, LineSet},
    predict::{BlockPrediction, MacroblockBuffer},
    vectors::{MotionKind, MotionVectors, opposite_parity},
};

/// Sources of the prediction of a macroblock.
pub(crate) struct Compensation<'a> {
    pub coding: &'a PictureCoding,
    pub references: References<'a>,
    /// Frame in decoding, of which the second field may refer to the first.
    pub current: &'a FrameMemory,
    pub motion: &'a MotionVectors,
}

impl<'a> Compensation<'a> {
    /// Returns the reference frame that contains the field of `parity`, for a field picture.
    fn field_reference(&self, direction: usize, parity: usize) -> &'a FrameMemory {
        let in_current = self.coding.is_second_field && !self.coding.is_b() && parity != self.coding.parity();
        if in_current { self.current } else { self.frame_reference(direction) }
    }

    fn frame_reference(&self, direction: usize) -> &'a FrameMemory {
        self.references.of(direction).unwrap_or(self.current)
    }
}

/// Predicts macroblock `at` in one direction, 0 for forward and 1 for backward. `average` combines it with the buffer.
pub(crate) fn compensate(
    sources: &Compensation,
    direction: usize,
    at: [usize; 2],
    average: bool,
    buffer: &mut MacroblockBuffer,
) {
    let Compensation { coding, motion, .. } = sources;
    let own_lines = coding.lines();
    let [x, y] = [16 * at[0], 16 * at[1]];
    let whole = BlockPrediction {
        lines: own_lines,
        at: [x, y],
        vector: motion.vectors[0][direction],
        rows: LineSet::ALL,
        height: 16,
        average,
    };
    let field_of = |r: usize| motion.field[r][direction];
    match motion.kind {
        MotionKind::Frame => whole.run(sources.frame_reference(direction), buffer),
        MotionKind::FrameFields => {
            for r in 0..2 {
                let lines = LineSet::field(field_of(r));
                let vector = motion.vectors[r][direction];
                let part =
                    BlockPrediction { lines, at: [x, y / 2], vector, rows: LineSet::field(r), height: 8, average };
                part.run(sources.frame_reference(direction), buffer);
            }
        }
        MotionKind::Field => {
            let parity = field_of(0);
            let part = BlockPrediction { lines: LineSet::field(parity), ..whole };
            part.run(sources.field_reference(direction, parity), buffer);
        }
        MotionKind::Halves => {
            for r in 0..2 {
                let (parity, vector) = (field_of(r), motion.vectors[r][direction]);
                let rows = LineSet { first: 8 * r, step: 1 };
                let lines = LineSet::field(parity);
                let part = BlockPrediction { lines, at: [x, y + 8 * r], vector, rows, height: 8, average };
                part.run(sources.field_reference(direction, parity), buffer);
            }
        }
        MotionKind::Dual if coding.is_frame() => {
            for parity in 0..2 {
                let rows = LineSet::field(parity);
                let same = BlockPrediction { lines: rows, at: [x, y / 2], rows, height: 8, ..whole };
                same.run(sources.frame_reference(0), buffer);
                // The opposite field is one field away if it is the nearer one, else three.
                let distance = if coding.header.top_field_first == (parity == 0) { 1 } else { 3 };
                let vector = opposite_parity(motion, distance, parity);
                let lines = LineSet::field(1 - parity);
                BlockPrediction { lines, vector, average: true, ..same }.run(sources.frame_reference(0), buffer);
            }
        }
        MotionKind::Dual => {
            let parity = coding.parity();
            whole.run(sources.field_reference(0, parity), buffer);
            let (lines, vector) = (LineSet::field(1 - parity), opposite_parity(motion, 1, parity));
            let opposite = BlockPrediction { lines, vector, average: true, ..whole };
            opposite.run(sources.field_reference(0, 1 - parity), buffer);
        }
    }
}
