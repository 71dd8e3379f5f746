//! Program streams (13818-1, 2.5; 11172-1, 2.4).

use super::{
    DemuxedData,
    clock::TimeUnwrapper,
    pes::{HEADER_MAX, PesHeader, is_video},
};
use crate::units::find_prefix;

/// Smallest stream identifier of the container. Lower start codes belong to video.
const FIRST_SYSTEM_CODE: u8 = 0xb9;
/// MPEG_program_end_code.
const PROGRAM_END: u8 = 0xb9;
/// pack_start_code.
const PACK: u8 = 0xba;
/// Maximum number of bytes that are copied at once.
const STEP: usize = 1 << 16;

/// Demultiplexer of program streams.
#[derive(Default)]
pub(super) struct ProgramDemuxer {
    /// Bytes that are not processed yet.
    buffer: Vec<u8>,
    clock: TimeUnwrapper,
    /// Identifier of the video stream.
    stream_id: Option<u8>,
    payload: Payload,
    /// Time of the current packet, until its first bytes are passed on.
    time: Option<i64>,
}

/// Bytes at the start of the buffer.
#[derive(Clone, Copy, Default, PartialEq, Eq)]
enum Payload {
    /// Start code, or bytes to skip.
    #[default]
    None,
    /// Payload of a packet with this number of remaining bytes.
    Video(usize),
    /// Payload of a packet without a length, which ends before a start code of the container.
    Unbounded,
    /// Remaining bytes of another stream.
    Skipped(usize),
}

impl ProgramDemuxer {
    pub fn push(&mut self, bytes: &[u8], receive: &mut dyn FnMut(DemuxedData)) {
        for piece in bytes.chunks(STEP) {
            self.buffer.extend_from_slice(piece);
            self.process(false, receive);
        }
    }

    /// Passes on the last bytes.
    pub fn flush(&mut self, receive: &mut dyn FnMut(DemuxedData)) {
        self.process(true, receive);
        self.buffer.clear();
    }

    fn process(&mut self, is_last: bool, receive: &mut dyn FnMut(DemuxedData)) {
        let mut position = 0;
        while let Some(used) = self.step(position, is_last, receive) {
            position += used;
        }
        if position > 0 {
            self.buffer.copy_within(position.., 0);
            self.buffer.truncate(self.buffer.len() - position);
        }
    }

    /// Processes bytes from `position` on and returns their number. `None` if more bytes are needed.
    fn step(&mut self, position: usize, is_last: bool, receive: &mut dyn FnMut(DemuxedData)) -> Option<usize> {
        let bytes = &self.buffer[position..];
        if bytes.is_empty() {
            return None;
        }
        match self.payload {
            Payload::Video(left) | Payload::Skipped(left) => {
                let (used, is_video) = (left.min(bytes.len()), matches!(self.payload, Payload::Video(_)));
                self.payload = match left - used {
                    0 => Payload::None,
                    left if is_video => Payload::Video(left),
                    left => Payload::Skipped(left),
                };
                if is_video {
                    receive(DemuxedData { bytes: &bytes[..used], time: self.time.take() });
                }
                Some(used)
            }
            Payload::Unbounded => {
                let end = next_system_code(bytes);
                if end < bytes.len() && bytes.len() - end > 3 {
                    self.payload = Payload::None;
                }
                let end = if is_last && self.payload == Payload::Unbounded { bytes.len() } else { end };
                if end > 0 {
                    receive(DemuxedData { bytes: &bytes[..end], time: self.time.take() });
                }
                (end > 0 || self.payload == Payload::None).then_some(end)
            }
            Payload::None => self.start_code(position),
        }
    }

    /// Reads a start code, or skips bytes up to the next one.
    fn start_code(&mut self, position: usize) -> Option<usize> {
        let bytes = &self.buffer[position..];
        let &[a, b, c, code] = bytes.first_chunk()?;
        if [a, b, c] != [0, 0, 1] || code < FIRST_SYSTEM_CODE {
            // Skip at least the first byte.
            return Some(1 + next_system_code(&bytes[1..]));
        }
        match code {
            PROGRAM_END => Some(4),
            PACK => match *bytes.get(4)? {
                marker if marker & 0xc0 == 0x40 => Some(14 + usize::from(*bytes.get(13)? & 7)),
                _ => Some(12),
            }
            .filter(|&length| length <= bytes.len()),
            _ => self.packet(position),
        }
    }

    /// Reads the header of a packet.
    fn packet(&mut self, position: usize) -> Option<usize> {
        let bytes = &self.buffer[position..];
        let &[_, _, _, id, high, low] = bytes.first_chunk()?;
        let length = usize::from(u16::from_be_bytes([high, low]));
        if !is_video(id) || self.stream_id.is_some_and(|own| own != id) {
            self.payload = if length > 0 { Payload::Skipped(length) } else { Payload::None };
            return Some(6);
        }
        let end = if length > 0 { 6 + length } else { usize::MAX };
        // A header that does not end within the packet or its maximum size is invalid.
        let available = &bytes[..bytes.len().min(end)];
        let header = match PesHeader::read(available) {
            Some(header) => header,
            None if available.len() == end || available.len() > HEADER_MAX => {
                self.payload = Payload::None;
                return Some(4);
            }
            None => return None,
        };
        self.stream_id = Some(id);
        self.time = header.time.map(|stamp| self.clock.unwrap(stamp));
        self.payload = match end {
            usize::MAX => Payload::Unbounded,
            end if end == header.length => Payload::None,
            end => Payload::Video(end - header.length),
        };
        Some(header.length)
    }
}

/// Returns the position of the next start code of the container, of bytes that may begin one, or the length.
fn next_system_code(bytes: &[u8]) -> usize {
    let mut from = 0;
    while let Some(found) = find_prefix(bytes, from) {
        if bytes.get(found + 3).is_none_or(|&code| code >= FIRST_SYSTEM_CODE) {
            return found;
        }
        from = found + 3;
    }
    match bytes {
        [.., 0, 0] => bytes.len() - 2,
        [.., 0] => bytes.len() - 1,
        _ => bytes.len(),
    }
}
