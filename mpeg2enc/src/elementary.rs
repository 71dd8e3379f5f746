//! Parser of existing elementary streams, for programs that join streams.
//!
//! It reads only start codes and the headers after them (6.2.2, 6.2.3). Streams must follow this crate's layout: sequence and
//! group headers before every I picture.

use crate::{
    AccessUnit, PictureType,
    header::{GROUP_START_CODE, PICTURE_START_CODE, SEQUENCE_END_CODE, SEQUENCE_HEADER_CODE},
};

/// The pictures and headers of an elementary stream.
#[derive(Clone, Debug)]
pub struct ElementaryStream {
    /// Pictures in the order of coding; their display indices count from 0.
    pub units: Vec<AccessUnit>,
    /// Sequence header and its extensions, which are equal before every group of pictures.
    pub sequence_header: Vec<u8>,
    /// Hours, minutes, seconds and pictures of the first group's time code (6.3.8).
    pub time_code: [u32; 4],
    /// Whether the first group is closed, so that it depends on no earlier pictures (closed_gop, 6.3.8).
    pub begins_closed: bool,
    /// Whether sequence_end_code ends the stream; without it the stream is incomplete.
    pub is_ended: bool,
}

/// Reason why bytes are not a stream in this crate's layout.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum StreamError {
    /// The bytes do not begin with a sequence header.
    #[error("begins with no sequence header: it is not an elementary stream of MPEG-1 or MPEG-2 video")]
    NoSequenceHeader,
    /// The stream has a header but no picture.
    #[error("contains no picture")]
    NoPicture,
    /// A header is incomplete, or a picture type is not I, P or B.
    #[error("is damaged at byte {at}")]
    Damaged {
        /// Byte offset of the start code.
        at: usize,
    },
    /// The sequence header of a group differs from the first one.
    #[error("has a different sequence header at byte {at}: it consists of several streams")]
    OtherHeader {
        /// Byte offset of the header.
        at: usize,
    },
    /// Bytes follow the end of the stream.
    #[error("continues after its end at byte {at}")]
    AfterEnd {
        /// Byte offset of sequence_end_code.
        at: usize,
    },
}

impl ElementaryStream {
    /// sequence_end_code (6.2.2), which ends a stream.
    pub const END: [u8; 4] = [0, 0, 1, SEQUENCE_END_CODE];

    /// Parses `bytes` into pictures.
    ///
    /// # Errors
    /// If the bytes are not a stream in this crate's layout. A truncated stream is accepted if its headers are complete.
    pub fn parse(bytes: &[u8]) -> Result<Self, StreamError> {
        let mut stream = Self {
            units: Vec::new(),
            sequence_header: Vec::new(),
            time_code: [0; 4],
            begins_closed: false,
            is_ended: false,
        };
        let codes = start_codes(bytes);
        if codes.first() != Some(&(0, SEQUENCE_HEADER_CODE)) {
            return Err(StreamError::NoSequenceHeader);
        }

        // A picture begins with the first header before it and ends at the first header of the next picture.
        let (mut begin, mut has_picture, mut end) = (0, false, bytes.len());
        let (mut group, mut shown) = (0, 0);
        for (place, &(at, code)) in codes.iter().enumerate() {
            let is_boundary = [SEQUENCE_HEADER_CODE, GROUP_START_CODE, PICTURE_START_CODE, SEQUENCE_END_CODE];
            if !is_boundary.contains(&code) {
                continue;
            }
            // Every boundary ends the current picture.
            if has_picture {
                stream.close(&bytes[begin..at]);
                (begin, has_picture) = (at, false);
            }
            let after = codes.get(place + 1..).unwrap_or_default();
            match code {
                SEQUENCE_HEADER_CODE => stream.note_sequence_header(bytes, at, after)?,
                GROUP_START_CODE => {
                    // temporal_reference restarts in each group, so add the pictures of earlier groups.
                    group += shown;
                    shown = 0;
                    let header = bytes.get(at + 4..at + 8).ok_or(StreamError::Damaged { at })?;
                    if stream.units.is_empty() {
                        (stream.time_code, stream.begins_closed) = group_header(header);
                    }
                }
                PICTURE_START_CODE => {
                    let header = bytes.get(at + 4..at + 6).ok_or(StreamError::Damaged { at })?;
                    let (temporal_reference, picture_type) =
                        picture_header(header).ok_or(StreamError::Damaged { at })?;
                    let display_index = group + temporal_reference;
                    stream.units.push(AccessUnit { data: Vec::new(), display_index, picture_type });
                    (has_picture, shown) = (true, shown + 1);
                }
                _ => {
                    // No bytes may follow sequence_end_code.
                    if at + 4 != bytes.len() {
                        return Err(StreamError::AfterEnd { at });
                    }
                    (stream.is_ended, end) = (true, at);
                }
            }
        }
        // Without sequence_end_code, the last picture extends to the end of the bytes.
        if has_picture {
            stream.close(&bytes[begin..end]);
        }
        if stream.units.is_empty() { Err(StreamError::NoPicture) } else { Ok(stream) }
    }

    /// Stores `data` as the bytes of the last picture.
    fn close(&mut self, data: &[u8]) {
        if let Some(last) = self.units.last_mut() {
            last.data = data.into();
        }
    }

    /// Stores the sequence header at byte `at`. It ends before the first start code in `after` that is not an extension.
    fn note_sequence_header(&mut self, bytes: &[u8], at: usize, after: &[(usize, u8)]) -> Result<(), StreamError> {
        let next =
            after.iter().find(|(_, code)| [GROUP_START_CODE, PICTURE_START_CODE, SEQUENCE_END_CODE].contains(code));
        let header = &bytes[at..next.map_or(bytes.len(), |&(next, _)| next)];
        if self.sequence_header.is_empty() {
            self.sequence_header = header.into();
        }
        if self.sequence_header == header { Ok(()) } else { Err(StreamError::OtherHeader { at }) }
    }
}

/// Returns the positions and values of all start codes (5.2.3): the bytes 0, 0, 1 and the value.
fn start_codes(bytes: &[u8]) -> Vec<(usize, u8)> {
    let mut codes = Vec::new();
    let mut at = 0;
    while at + 3 < bytes.len() {
        match bytes[at..at + 3] {
            [0, 0, 1] => {
                codes.push((at, bytes[at + 3]));
                at += 4;
            }
            // A byte above 1 is not part of a start code prefix, so skip all three bytes.
            [_, _, last] if last > 1 => at += 3,
            _ => at += 1,
        }
    }
    codes
}

/// Returns temporal_reference and picture_coding_type (6.2.3).
fn picture_header(header: &[u8]) -> Option<(u64, PictureType)> {
    let bits = u16::from_be_bytes([header[0], header[1]]);
    let picture_type = match bits >> 3 & 7 {
        1 => PictureType::I,
        2 => PictureType::P,
        3 => PictureType::B,
        _ => return None,
    };
    Some(((bits >> 6).into(), picture_type))
}

/// Returns the hours, minutes, seconds and pictures of time_code, and closed_gop (6.2.2.6).
fn group_header(header: &[u8]) -> ([u32; 4], bool) {
    let bits = u32::from_be_bytes([header[0], header[1], header[2], header[3]]);
    let field = |first: u32, length: u32| bits << first >> (32 - length);
    ([field(1, 5), field(6, 6), field(13, 6), field(19, 6)], field(25, 1) == 1)
}
