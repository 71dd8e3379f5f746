//! Bit rate and buffer size from the first sequence header of a stream.

use crate::{Level, header::SEQUENCE_HEADER_CODE};

/// Start code and identifier of sequence_extension() (13818-2, 6.2.2.3).
const SEQUENCE_EXTENSION: [u8; 5] = [0, 0, 1, 0xb5, 0x10];
/// bit_rate of an MPEG-1 stream with a variable bit rate (11172-2, 2.4.3.2).
const BIT_RATE_VARIABLE: u32 = 0x3_ffff;

/// Reads bit_rate in units of 400 bits per second and vbv_buffer_size in units of 16 384 bits from the `data` of the first
/// picture. MPEG-1 codes no value for a variable rate; the rate of the level with this buffer is used instead.
pub(super) fn stated_rate(data: &[u8]) -> Option<(u32, u32)> {
    if !data.starts_with(&[0, 0, 1, SEQUENCE_HEADER_CODE]) {
        return None;
    }
    // Read bit_rate_value and vbv_buffer_size_value at their fixed positions.
    let fields = data.get(8..12)?;
    let fields = u32::from_be_bytes([fields[0], fields[1], fields[2], fields[3]]);
    let (mut bit_rate, mut buffer) = (fields >> 14, fields >> 3 & 0x3ff);
    let extension =
        data.windows(5).take(200).position(|bytes| bytes[..4] == SEQUENCE_EXTENSION[..4] && bytes[4] >> 4 == 1);
    match extension.and_then(|at| data.get(at + 6..at + 10)) {
        Some(extension) => {
            let fields = u32::from_be_bytes([extension[0], extension[1], extension[2], extension[3]]);
            bit_rate |= (fields >> 17 & 0xfff) << 18; // bit_rate_extension
            buffer |= (fields >> 8 & 0xff) << 10; // vbv_buffer_size_extension
        }
        None if bit_rate == BIT_RATE_VARIABLE => bit_rate = Level::rate_of_buffer(buffer)?,
        None => {}
    }
    Some((bit_rate, buffer))
}
