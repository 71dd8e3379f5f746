//! Recognition of stream formats.

use super::{StreamFormat, pes::is_video};
use crate::units::find_prefix;

/// Maximum number of bytes for a decision.
pub(super) const BYTES_MAX: usize = 1 << 16;
/// Number of bytes that are enough to recognize a transport stream after some garbage.
const BYTES_ENOUGH: usize = 4096;
/// Number of packets with a sync byte that are required.
const PACKETS: usize = 5;
/// sync_byte of transport packets.
pub(super) const SYNC: u8 = 0x47;
/// pack_start_code.
const PACK: u8 = 0xba;

/// Returns the format of a stream that begins with `start`, or `None` if more bytes are needed. Always decides if `is_last`.
pub(super) fn probe(start: &[u8], is_last: bool) -> Option<StreamFormat> {
    // Streams without garbage are recognized at once.
    match start {
        [0, 0, 1, 0..=0xb8, ..] => return Some(StreamFormat::Elementary),
        [0, 0, 1, PACK, ..] => return Some(StreamFormat::Program),
        [0, 0, 1, id, ..] if is_video(*id) => return Some(StreamFormat::Program),
        _ => {}
    }
    if let Some(packet_size) = transport_packet_size(start, is_last) {
        return Some(StreamFormat::Transport { packet_size });
    }
    if start.len() < BYTES_ENOUGH && !is_last {
        return None;
    }
    // The first start code of a pack, of a video packet or of a sequence decides.
    let mut from = 0;
    while let Some(found) = find_prefix(start, from) {
        match start.get(found + 3) {
            Some(&PACK) => return Some(StreamFormat::Program),
            Some(&id) if is_video(id) => return Some(StreamFormat::Program),
            Some(0xb3) => return Some(StreamFormat::Elementary),
            _ => from = found + 3,
        }
    }
    is_last.then_some(StreamFormat::Elementary)
}

/// Returns the packet size of a transport stream that begins after less than [`BYTES_ENOUGH`] bytes.
fn transport_packet_size(start: &[u8], is_last: bool) -> Option<usize> {
    for size in [188, 192, 204] {
        for first in 0..BYTES_ENOUGH.min(start.len()) {
            let mut sync_bytes = start[first..].iter().step_by(size).take(PACKETS);
            let is_enough = sync_bytes.len() == PACKETS || is_last && sync_bytes.len() >= 2 && first < size;
            if is_enough && sync_bytes.all(|&byte| byte == SYNC) {
                return Some(size);
            }
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn formats_are_recognized_after_garbage() {
        for size in [188, 192, 204] {
            let mut stream = vec![7; 300];
            for _ in 0..6 {
                stream.push(SYNC);
                stream.resize(stream.len() + size - 1, 1);
            }
            assert_eq!(probe(&stream, false), Some(StreamFormat::Transport { packet_size: size }));
        }
        assert_eq!(probe(&[9, 9, 0, 0, 1, 0xb3], true), Some(StreamFormat::Elementary));
        assert_eq!(probe(&[9, 0, 0, 1, 0xba], true), Some(StreamFormat::Program));
        assert_eq!(probe(&[9; 100], false), None);
        assert_eq!(probe(&[9; 100], true), Some(StreamFormat::Elementary));
    }
}
