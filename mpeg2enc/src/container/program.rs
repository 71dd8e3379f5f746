//! Program streams: packs of at most 2048 bytes, each with one PES packet of video (2.5.3).
//!
//! On discs each pack fills a sector. The last pack of a picture is filled with a padding packet, or with stuffing if the gap
//! is too small. Files have no padding. DVD-Video also has a navigation pack before each I picture, which authoring programs
//! fill.

use super::{
    clock::CLOCK,
    pes::{Header, PADDING_LEAST, StreamPicture, VIDEO_STREAM, padding, put_parts},
    schedule::{SLACK, Schedule},
};
use crate::bits::{BitSink, BitWriter};

/// MPEG_program_end_code (2.5.3.1).
pub(super) const END: [u8; 4] = [0, 0, 1, 0xb9];
/// Maximum size of a pack in bytes: a sector of a disc. [`END`] occupies the last four bytes of the last pack.
const PACK: usize = 2048;
const PACK_HEADER: usize = 14;
/// Stream identifiers of system_header() (2.5.3.5, Table 2-18): all video, all audio, private streams 1 and 2.
const ALL_VIDEO: u8 = 0xb9;
const ALL_AUDIO: u8 = 0xb8;
const PRIVATE_STREAM_1: u8 = 0xbd;
const PRIVATE_STREAM_2: u8 = 0xbf;
/// program_mux_rate of DVD-Video: 10.08 Mbit/s.
const DISC_MUX_RATE: u64 = 25_200;
/// Maximum number of header bytes in a pack: pack_header(), system_header(), PES header with both times and the buffer size.
const HEADERS: usize = PACK_HEADER + 15 + 9 + 10 + 3;
/// Minimum number of header bytes in a pack, for packs in the middle of a picture.
const HEADERS_LEAST: usize = PACK_HEADER + 9;

#[derive(Clone)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Writer {
    schedule: Schedule,
    /// Pictures per second, rounded up.
    fps: u64,
    /// program_mux_rate, in units of 50 bytes per second (2.5.3.4).
    mux_rate: u64,
    buffer_kib: u64,
    /// Arrival time of the last pack's last byte.
    passed: u64,
    is_first: bool,
    /// Whether each pack fills a sector and navigation packs are written.
    is_disc: bool,
}

impl Writer {
    pub fn new(schedule: Schedule, fps: f64, is_disc: bool) -> Self {
        let mut writer =
            Self { schedule, fps: fps.ceil() as u64, mux_rate: 0, buffer_kib: 0, passed: 0, is_first: true, is_disc };
        writer.bound();
        writer
    }

    /// Adapts to the bit rate and buffer size of the stream. Returns the decoding time of the first picture.
    pub fn restate(&mut self, bit_rate: u32, buffer_size: u32) -> u64 {
        self.schedule = Schedule::of_stated(bit_rate, buffer_size);
        self.bound();
        self.schedule.start()
    }

    /// Sets mux rate and buffer size according to the schedule.
    fn bound(&mut self) {
        let (schedule, is_disc) = (&self.schedule, self.is_disc);
        // Full packs have the smallest headers. Each picture may end in a partial pack with the largest headers. Small
        // consecutive pictures are in time if two partial packs fit in a frame period. A single picture is in time if one partial
        // pack fits within SLACK.
        let full = (schedule.bytes_per_second as usize * PACK).div_ceil(PACK - HEADERS_LEAST);
        let packs_in_period = if is_disc { 3 } else { 2 };
        let partial = (packs_in_period * self.fps as usize).max((CLOCK / SLACK) as usize) * (PACK + HEADERS);
        let least = if is_disc { DISC_MUX_RATE } else { 0 };
        self.mux_rate = ((full + partial).div_ceil(50) as u64).clamp(least, (1 << 22) - 1);
        // Reserve one more pack: within a pack, bytes arrive faster than the schedule assumes.
        self.buffer_kib = (schedule.buffer + PACK as u64).div_ceil(1024).min((1 << 13) - 1);
    }

    /// Returns the packs of one picture; `end` is appended to the last one and counts towards its 2048 bytes.
    pub fn put(&mut self, picture: &StreamPicture, end: &[u8]) -> Vec<u8> {
        self.schedule.begin(picture.times.decoding);
        let mut out = Vec::with_capacity(picture.data.len() * PACK / (PACK - HEADERS) + PACK);
        let mut rest = &picture.data[..];
        let mut times = Some(picture.times);
        if picture.is_entry && self.is_disc {
            self.put_navigation(&mut out);
        }
        while !rest.is_empty() {
            let begins = times.is_some();
            let buffer_kib = self.is_first.then_some(self.buffer_kib);
            let header = Header { times: times.take(), buffer_kib, stuffing: 0 };
            // Decoding may begin at any I picture, so describe the streams before each one.
            let is_announced = begins && picture.is_entry && !self.is_disc;
            let system_header = if is_announced { self.system_header() } else { Vec::new() };
            let room = PACK - PACK_HEADER - system_header.len() - header.bytes(Some(0)).len();

            // If the data leave no room for `end`, some of them move to an additional pack.
            let (data, later) = rest.split_at(match rest.len() {
                length if length > room => room,
                length => length.min(room - end.len()),
            });
            let tail = if later.is_empty() { end } else { &[] };
            let left = if self.is_disc { room - data.len() - tail.len() } else { 0 };
            let stuffing = if left < PADDING_LEAST { left } else { 0 };

            // Delay the next pack until this one has arrived.
            let arrival = self.schedule.arrive(data.len() as u64).max(self.passed);
            let before = out.len();
            out.extend(self.pack_header(arrival));
            out.extend(system_header);
            out.extend(Header { stuffing, ..header }.bytes(Some(data.len())));
            out.extend(data);
            if left > stuffing {
                out.extend(padding(left));
            }
            out.extend(tail);
            self.pass(arrival, out.len() - before);
            (rest, self.is_first) = (later, false);
        }
        // An empty picture makes no pack.
        if out.is_empty() {
            out.extend(end);
        }
        out
    }

    /// Occupies the channel for a pack of `bytes` from `arrival` on.
    fn pass(&mut self, arrival: u64, bytes: usize) {
        self.passed = arrival + (bytes as u64 * CLOCK).div_ceil(50 * self.mux_rate);
    }

    /// Writes the pack that begins a video object unit of DVD-Video. Its PCI and DSI packets are empty; authoring programs
    /// expect and fill them.
    fn put_navigation(&mut self, out: &mut Vec<u8>) {
        let arrival = self.schedule.wait(0).max(self.passed);
        out.extend(self.pack_header(arrival));
        out.extend(self.system_header());
        for (substream_id, length) in [(0, 980), (1, 1018)] {
            let mut writer = BitWriter::default();
            writer.start_code(PRIVATE_STREAM_2); // packet_start_code_prefix, stream_id
            writer.put(length, 16); // PES_packet_length
            writer.put(substream_id, 8);
            let mut packet = writer.into_bytes();
            packet.resize(6 + length as usize, 0);
            out.extend(packet);
        }
        self.pass(arrival, PACK);
    }

    /// Returns pack_header() (2.5.3.3). `arrival`, the arrival time of the pack, becomes its system_clock_reference; the ten
    /// header bytes after the start code are not counted.
    fn pack_header(&self, arrival: u64) -> Vec<u8> {
        let mut writer = BitWriter::default();
        writer.start_code(0xba); // pack_start_code
        writer.put(0b01, 2);
        put_parts(&mut writer, arrival / 300); // system_clock_reference_base
        writer.put((arrival % 300) as u32, 9); // system_clock_reference_extension
        writer.put(1, 1); // marker_bit
        writer.put(self.mux_rate as u32, 22); // program_mux_rate
        writer.put(0b11, 2); // marker_bit, marker_bit
        writer.put(0b1_1111, 5); // reserved
        writer.put(0, 3); // pack_stuffing_length
        writer.into_bytes()
    }

    /// Returns system_header() (2.5.3.5).
    fn system_header(&self) -> Vec<u8> {
        // stream_id, P-STD_buffer_bound_scale (128 bytes or KiB) and P-STD_buffer_size_bound.
        let bounds = match self.is_disc {
            false => vec![(VIDEO_STREAM, 1, self.buffer_kib)],
            true => vec![
                (ALL_VIDEO, 1, self.buffer_kib),
                (ALL_AUDIO, 0, 32),
                (PRIVATE_STREAM_1, 1, 58),
                (PRIVATE_STREAM_2, 1, 2),
            ],
        };
        let mut writer = BitWriter::default();
        writer.start_code(0xbb); // system_header_start_code
        writer.put(6 + 3 * bounds.len() as u32, 16); // header_length
        writer.put(1, 1); // marker_bit
        writer.put(self.mux_rate as u32, 22); // rate_bound
        writer.put(1, 1); // marker_bit
        writer.put(0, 6); // audio_bound
        writer.put(0, 1); // fixed_flag: variable rate
        writer.put(0, 1); // CSPS_flag
        writer.put(0, 1); // system_audio_lock_flag
        writer.put(1, 1); // system_video_lock_flag: the picture rate is locked to the system clock
        writer.put(1, 1); // marker_bit
        writer.put(1, 5); // video_bound
        writer.put(0, 1); // packet_rate_restriction_flag
        writer.put(0x7f, 7); // reserved
        for (stream_id, scale, size) in bounds {
            writer.put(stream_id.into(), 8); // stream_id
            writer.put(0b11, 2);
            writer.put(scale, 1); // P-STD_buffer_bound_scale
            writer.put(size as u32, 13); // P-STD_buffer_size_bound
        }
        writer.into_bytes()
    }
}
