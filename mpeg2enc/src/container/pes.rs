//! Packets of an elementary stream (PES) with timestamps, and padding packets (2.4.3.6, 2.4.3.7).

use super::clock::{CLOCK, Times};
use crate::bits::{BitSink, BitWriter};

/// stream_id of video stream number 0 (Table 2-18).
pub(super) const VIDEO_STREAM: u8 = 0xe0;
/// stream_id of padding_stream (Table 2-18).
const PADDING_STREAM: u8 = 0xbe;
/// Minimum size of a padding packet: start code, length and one byte.
pub(super) const PADDING_LEAST: usize = 7;
/// Units of the system clock per unit of a timestamp, at 90 kHz.
const STAMP: u64 = CLOCK / 90_000;

/// A picture, as bytes of the elementary stream.
#[derive(Clone)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct StreamPicture {
    pub data: Vec<u8>,
    pub times: Times,
    /// Whether decoding can begin at this picture.
    pub is_entry: bool,
    /// Whether the picture is a B picture, on which no other picture depends.
    pub is_disposable: bool,
}

/// Optional fields of a PES packet header.
#[derive(Clone, Copy, Default)]
pub(super) struct Header {
    /// Times of the picture that begins in the packet.
    pub times: Option<Times>,
    /// Size of the decoder's buffer in KiB; present in the first packet of a program stream.
    pub buffer_kib: Option<u64>,
    /// Number of stuffing bytes at the end of the header, at most 32.
    pub stuffing: usize,
}

impl Header {
    /// Returns PES_packet() up to its data. `None` omits the length, which only transport streams may do.
    pub fn bytes(self, data: Option<usize>) -> Vec<u8> {
        let mut fields = BitWriter::default();
        let flags = self.put_fields(&mut fields);
        let mut fields = fields.into_bytes();
        fields.resize(fields.len() + self.stuffing, 0xff); // stuffing_byte
        // Count the bytes after the length field: flags, optional fields and data.
        let length = data.map_or(0, |data| 3 + fields.len() + data);
        let mut writer = BitWriter::default();
        writer.start_code(VIDEO_STREAM); // packet_start_code_prefix, stream_id
        writer.put(length as u32, 16); // PES_packet_length
        writer.put(0b10, 2);
        writer.put(0, 2); // PES_scrambling_control
        writer.put(0, 1); // PES_priority
        writer.put(self.times.is_some().into(), 1); // data_alignment_indicator: the data begin with a picture or headers
        writer.put(0, 2); // copyright, original_or_copy
        writer.put(flags, 2); // PTS_DTS_flags
        writer.put(0, 5); // ESCR, ES_rate, DSM_trick_mode, additional_copy_info, PES_CRC
        writer.put(self.buffer_kib.is_some().into(), 1); // PES_extension_flag
        writer.put(fields.len() as u32, 8); // PES_header_data_length
        let mut bytes = writer.into_bytes();
        bytes.extend(fields);
        bytes
    }

    /// Writes the optional fields and returns PTS_DTS_flags.
    fn put_fields(self, writer: &mut BitWriter) -> u32 {
        let mut flags = 0;
        if let Some(Times { decoding, presentation }) = self.times {
            let (decoding, presentation) = (decoding / STAMP, presentation / STAMP);
            // Omit the decoding time if it equals the presentation time.
            flags = if decoding == presentation { 0b10 } else { 0b11 };
            put_stamp(writer, flags, presentation); // PTS
            if decoding != presentation {
                put_stamp(writer, 0b01, decoding); // DTS
            }
        }
        if let Some(kib) = self.buffer_kib {
            writer.put(0b0001, 4); // flags of five optional fields; only P-STD_buffer is present
            writer.put(0b1110, 4); // reserved, PES_extension_flag_2
            writer.put(0b01, 2);
            writer.put(1, 1); // P-STD_buffer_scale: KiB
            writer.put(kib as u32, 13); // P-STD_buffer_size
        }
        flags
    }
}

/// Returns a padding packet of `bytes` bytes, at least [`PADDING_LEAST`]; decoders skip it.
pub(super) fn padding(bytes: usize) -> Vec<u8> {
    let mut writer = BitWriter::default();
    writer.start_code(PADDING_STREAM); // packet_start_code_prefix, stream_id
    writer.put(bytes as u32 - 6, 16); // PES_packet_length
    let mut packet = writer.into_bytes();
    packet.resize(bytes, 0xff); // padding_byte
    packet
}

/// Writes a timestamp of 33 bits in three pieces, preceded by a 4-bit identifier.
fn put_stamp(writer: &mut BitWriter, kind: u32, stamp: u64) {
    writer.put(kind, 4);
    put_parts(writer, stamp);
}

/// Writes 33 bits, with a marker bit after the first 3 and after each 15.
pub(super) fn put_parts(writer: &mut BitWriter, stamp: u64) {
    writer.put((stamp >> 30) as u32 & 0x7, 3);
    writer.put(1, 1); // marker_bit
    writer.put((stamp >> 15) as u32 & 0x7fff, 15);
    writer.put(1, 1); // marker_bit
    writer.put(stamp as u32 & 0x7fff, 15);
    writer.put(1, 1); // marker_bit
}
