//! Program streams: packs of at most 2048 bytes with one PES packet of video each (2.5.3).
//!
//! For discs, each pack is a sector: the last pack of a picture is filled by a packet of padding, or by stuffing where there is no
//! room for one. Files have no such bytes. DVD-Video has a pack for navigation in front of each I picture, which authoring fills.

use super::{
    clock::CLOCK,
    pes::{Header, PADDING_LEAST, StreamPicture, VIDEO_STREAM, padding, put_parts},
    schedule::{SLACK, Schedule},
};
use crate::bits::{BitSink, BitWriter};

/// MPEG_program_end_code (2.5.3.1).
pub(super) const END: [u8; 4] = [0, 0, 1, 0xb9];
/// Bytes of a pack, at most: a sector of a disc. [`END`] takes the last four of the last one.
const PACK: usize = 2048;
const PACK_HEADER: usize = 14;
/// Stream identifiers of system_header() (2.5.3.5, Table 2-18): all video, all audio, private streams 1 and 2.
const ALL_VIDEO: u8 = 0xb9;
const ALL_AUDIO: u8 = 0xb8;
const PRIVATE_STREAM_1: u8 = 0xbd;
const PRIVATE_STREAM_2: u8 = 0xbf;
/// program_mux_rate of DVD-Video: 10.08 Mbit/s.
const DISC_MUX_RATE: u64 = 25_200;
/// The most bytes of headers in a pack: pack_header(), system_header(), PES header with both times and the buffer.
const HEADERS: usize = PACK_HEADER + 15 + 9 + 10 + 3;
/// The fewest: those of packs in the middle of a picture.
const HEADERS_LEAST: usize = PACK_HEADER + 9;

#[derive(Clone)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Writer {
    schedule: Schedule,
    /// Pictures a second, rounded up.
    fps: u64,
    /// program_mux_rate, in units of 50 bytes a second (2.5.3.4).
    mux_rate: u64,
    buffer_kib: u64,
    /// When the last pack has passed.
    passed: u64,
    is_first: bool,
    /// Whether each pack fills a sector, and there are packs for navigation.
    is_disc: bool,
}

impl Writer {
    pub fn new(schedule: Schedule, fps: f64, is_disc: bool) -> Self {
        let mut writer =
            Self { schedule, fps: fps.ceil() as u64, mux_rate: 0, buffer_kib: 0, passed: 0, is_first: true, is_disc };
        writer.bound();
        writer
    }

    /// Fills a buffer that the stream states. Gives when the first picture is decoded then.
    pub fn restate(&mut self, bit_rate: u32, buffer_size: u32) -> u64 {
        self.schedule = Schedule::of_stated(bit_rate, buffer_size);
        self.bound();
        self.schedule.start()
    }

    /// Sets the rate of the program and the buffer to those of the schedule.
    fn bound(&mut self) {
        let (schedule, is_disc) = (&self.schedule, self.is_disc);
        // Full packs have the fewest headers. Each picture may leave a pack that is not full, with the most headers. Small
        // pictures that come close together are in time if two such packs pass in a frame period, and a single picture if
        // one passes within SLACK.
        let full = (schedule.bytes_per_second as usize * PACK).div_ceil(PACK - HEADERS_LEAST);
        let packs_in_period = if is_disc { 3 } else { 2 };
        let partial = (packs_in_period * self.fps as usize).max((CLOCK / SLACK) as usize) * (PACK + HEADERS);
        let least = if is_disc { DISC_MUX_RATE } else { 0 };
        self.mux_rate = ((full + partial).div_ceil(50) as u64).clamp(least, (1 << 22) - 1);
        // Room for a pack more: within one, bytes come faster than the schedule knows.
        self.buffer_kib = (schedule.buffer + PACK as u64).div_ceil(1024).min((1 << 13) - 1);
    }

    /// The packs of one picture; `end` follows the last one, within its 2048 bytes at most.
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
            // Whoever begins to listen at an I picture learns what there is.
            let is_announced = begins && picture.is_entry && !self.is_disc;
            let system_header = if is_announced { self.system_header() } else { Vec::new() };
            let room = PACK - PACK_HEADER - system_header.len() - header.bytes(Some(0)).len();

            // Where data leave no room for the end, the last of them go into a pack more.
            let (data, later) = rest.split_at(match rest.len() {
                length if length > room => room,
                length => length.min(room - end.len()),
            });
            let tail = if later.is_empty() { end } else { &[] };
            let left = if self.is_disc { room - data.len() - tail.len() } else { 0 };
            let stuffing = if left < PADDING_LEAST { left } else { 0 };

            // The next pack cannot come before this one has passed.
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
        // A picture of no bytes makes no pack.
        if out.is_empty() {
            out.extend(end);
        }
        out
    }

    /// A pack of `bytes` comes in, and nothing else until it has passed.
    fn pass(&mut self, arrival: u64, bytes: usize) {
        self.passed = arrival + (bytes as u64 * CLOCK).div_ceil(50 * self.mux_rate);
    }

    /// The pack that begins a video object unit of DVD-Video: empty PCI and DSI packets at the places where authoring
    /// programs look for them. They fill in the contents.
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

    /// pack_header() (2.5.3.3); `arrival` is when it comes in: system_clock_reference counts up to its last byte but the
    /// ten that follow it.
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

    /// system_header() (2.5.3.5).
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
        writer.put(0, 1); // fixed_flag: the rate varies
        writer.put(0, 1); // CSPS_flag
        writer.put(0, 1); // system_audio_lock_flag
        writer.put(1, 1); // system_video_lock_flag: pictures come at a rate of the same clock
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
