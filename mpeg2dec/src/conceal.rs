//! Concealment of macroblocks that were not decoded.

use crate::{
    coding::{PictureCoding, References},
    compensate::{Compensation, compensate},
    frame::FrameMemory,
    predict::MacroblockBuffer,
    progress::MacroblockRecord,
    vectors::{MotionKind, MotionVectors},
};

/// Predicts all macroblocks that were not decoded, and returns their number.
///
/// The source is the forward reference, or the first field of the same frame. The vector is the vector of the macroblock above
/// if that was decoded, else zero. Without a reference, macroblocks become gray.
pub(crate) fn conceal(
    coding: &PictureCoding,
    references: References,
    frame: &mut FrameMemory,
    record: &MacroblockRecord,
) -> u32 {
    let columns = coding.shape.macroblocks[0];
    let mut buffer = MacroblockBuffer::new(coding.shape.shifts);
    let mut count = 0;
    for address in 0..record.len() {
        if record.vector(address).is_some() {
            continue;
        }
        count += 1;
        let at = [address % columns, address / columns];
        let above = address.checked_sub(columns).and_then(|above| record.vector(above));
        if references.of(0).is_some() {
            let kind = if coding.is_frame() { MotionKind::Frame } else { MotionKind::Field };
            let mut motion = MotionVectors::zero(kind, coding.parity());
            motion.vectors[0][0] = above.unwrap_or_default();
            let sources = Compensation { coding, references, current: frame, motion: &motion };
            compensate(&sources, 0, at, false, &mut buffer);
        } else if coding.is_second_field {
            let motion = MotionVectors::zero(MotionKind::Field, 1 - coding.parity());
            let sources = Compensation { coding, references, current: frame, motion: &motion };
            compensate(&sources, 0, at, false, &mut buffer);
        } else {
            buffer.samples.fill(128);
        }
        buffer.store(frame, coding.lines(), at);
    }
    count
}
