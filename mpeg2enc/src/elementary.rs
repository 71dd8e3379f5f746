//! An elementary stream that was written before, taken apart into its pictures: for what puts streams together.
//!
//! Only start codes and the headers behind them are read (6.2.2, 6.2.3), for streams as this crate writes them: sequence and group
//! headers in front of every I picture.

use crate::{
    AccessUnit, PictureType,
    header::{GROUP_START_CODE, PICTURE_START_CODE, SEQUENCE_END_CODE, SEQUENCE_HEADER_CODE},
};

/// The pictures of an elementary stream, and what its headers say of all of them.
#[derive(Clone, Debug)]
pub struct ElementaryStream {
    /// Pictures in the order of coding. Their display indices count from 0.
    pub units: Vec<AccessUnit>,
    /// Sequence header and its extensions, which are the same in front of every group of pictures.
    pub sequence_header: Vec<u8>,
    /// Hours, minutes, seconds and pictures of the first group's time code (6.3.8).
    pub time_code: [u32; 4],
    /// closed_gop of the first group: it needs no pictures before it (6.3.8).
    pub begins_closed: bool,
    /// Whether sequence_end_code ends the stream. Without one it was cut short.
    pub is_ended: bool,
}

/// Bytes that are no stream of this crate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum StreamError {
    /// The first bytes are of something else.
    #[error("begins with no sequence header: it is no elementary stream of MPEG-1 or MPEG-2 video")]
    NoSequenceHeader,
    /// There is a header, and no picture.
    #[error("holds no picture")]
    NoPicture,
    /// A header ends early, or a picture is none of I, P and B.
    #[error("is damaged at byte {at}")]
    Damaged {
        /// The place of the start code.
        at: usize,
    },
    /// A group whose sequence header is not that of the first.
    #[error("has another sequence header at byte {at}: it is several streams, one after the other")]
    OtherHeader {
        /// The place of the header.
        at: usize,
    },
    /// Something follows the end.
    #[error("goes on after its end at byte {at}")]
    AfterEnd {
        /// The place of sequence_end_code.
        at: usize,
    },
}

impl ElementaryStream {
    /// sequence_end_code (6.2.2), which ends a stream once.
    pub const END: [u8; 4] = [0, 0, 1, SEQUENCE_END_CODE];

    /// Takes `bytes` apart.
    ///
    /// # Errors
    /// The bytes are no such stream. One that was cut short is no error as long as its headers are whole.
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

        // A picture begins with the first header in front of it, and ends where that of the next begins.
        let (mut begin, mut has_picture, mut end) = (0, false, bytes.len());
        let (mut group, mut shown) = (0, 0);
        for (place, &(at, code)) in codes.iter().enumerate() {
            let is_boundary = [SEQUENCE_HEADER_CODE, GROUP_START_CODE, PICTURE_START_CODE, SEQUENCE_END_CODE];
            if !is_boundary.contains(&code) {
                continue;
            }
            if has_picture {
                stream.close(&bytes[begin..at]);
                (begin, has_picture) = (at, false);
            }
            let after = codes.get(place + 1..).unwrap_or_default();
            match code {
                SEQUENCE_HEADER_CODE => stream.note_sequence_header(bytes, at, after)?,
                GROUP_START_CODE => {
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
                    if at + 4 != bytes.len() {
                        return Err(StreamError::AfterEnd { at });
                    }
                    (stream.is_ended, end) = (true, at);
                }
            }
        }
        if has_picture {
            stream.close(&bytes[begin..end]);
        }
        if stream.units.is_empty() { Err(StreamError::NoPicture) } else { Ok(stream) }
    }

    /// Gives the last picture its bytes.
    fn close(&mut self, data: &[u8]) {
        if let Some(last) = self.units.last_mut() {
            last.data = data.into();
        }
    }

    /// Keeps the sequence header at byte `at`, which ends before the first of the start codes `after` it that is no extension.
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

/// Places and values of all start codes (5.2.3): the bytes 0, 0, 1 and the value.
fn start_codes(bytes: &[u8]) -> Vec<(usize, u8)> {
    let mut codes = Vec::new();
    let mut at = 0;
    while at + 3 < bytes.len() {
        match bytes[at..at + 3] {
            [0, 0, 1] => {
                codes.push((at, bytes[at + 3]));
                at += 4;
            }
            [_, _, last] if last > 1 => at += 3,
            _ => at += 1,
        }
    }
    codes
}

/// temporal_reference and picture_coding_type (6.2.3).
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

/// Hours, minutes, seconds and pictures of time_code, and closed_gop (6.2.2.6).
fn group_header(header: &[u8]) -> ([u32; 4], bool) {
    let bits = u32::from_be_bytes([header[0], header[1], header[2], header[3]]);
    let field = |first: u32, length: u32| bits << first >> (32 - length);
    ([field(1, 5), field(6, 6), field(13, 6), field(19, 6)], field(25, 1) == 1)
}
