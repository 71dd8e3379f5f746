//! Transport streams: packets of 188 bytes, with one program of one video (2.4.3, 2.4.4).

use super::{
    clock::CLOCK,
    pes::{Header, StreamPicture},
    schedule::{SLACK, Schedule},
};
use crate::{
    Config, Level, Rate, Standard,
    bits::{BitSink, BitWriter},
};

const PACKET: usize = 188;
const SYNC_BYTE: u32 = 0x47;
/// Packet identifier of the program association table. Identifiers below 0x10 are reserved (Table 2-3).
const PAT_PID: u32 = 0;
/// Packet identifier of the program map table.
const PMT_PID: u32 = 0x1000;
/// Packet identifier of the video.
const VIDEO_PID: u32 = 0x100;
/// Packet identifier of null packets (Table 2-3).
const NULL_PID: u32 = 0x1fff;
/// program_number of the only program.
const PROGRAM: u32 = 1;
/// Index of the packet byte with the last bit of program_clock_reference_base.
const REFERENCE_BYTE: usize = 10;
/// Interval after which the next packet has a clock reference. The tables follow at every third interval, so that receivers
/// synchronize quickly.
const CLOCK_INTERVAL: u64 = CLOCK / 30;
/// Maximum interval between clock references, 0.04 s, as in DVB (ETSI TS 101 154, 4.1.5.3). The standard allows 0.1 s (2.7.2).
const CLOCK_INTERVAL_MOST: u64 = CLOCK / 25;
const TABLE_INTERVAL: u64 = CLOCK / 10;
/// Minimum number of packets: ffmpeg does not recognize streams of less than 2040 bytes, ten packets of the largest size.
const LEAST_PACKETS: usize = 11;

#[derive(Clone)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Writer {
    schedule: Schedule,
    standard: Standard,
    /// continuity_counter of PAT, PMT and video.
    counters: [u32; 3],
    /// Time at which the tables were last sent.
    tables_sent: Option<u64>,
    /// Time at which a clock reference was last sent.
    clock_sent: Option<u64>,
    /// Number of packets so far.
    packets: usize,
    /// Times of the packets at a constant rate; `None` at a variable rate.
    slots: Option<Slots>,
}

/// Times of consecutive packets at a constant rate.
#[derive(Clone, Copy)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Slots {
    bytes_per_second: u64,
}

impl Slots {
    /// Returns the packet times for video at `bytes_per_second` and `fps`.
    fn new(bytes_per_second: u64, fps: f64) -> Self {
        // Each picture may add two tables, one partial packet, and timestamps.
        let extra = (4 * fps.ceil() as u64 + CLOCK / CLOCK_INTERVAL * 2).max(4 * CLOCK / SLACK);
        let full = (bytes_per_second * PACKET as u64).div_ceil((PACKET - 4) as u64);
        Self { bytes_per_second: full + extra * PACKET as u64 }
    }

    /// Returns the arrival time of a packet's first byte, rounded down.
    fn begin(self, number: usize) -> u64 {
        self.time(number, 0)
    }

    /// Returns the program_clock_reference in a packet: the arrival time of the byte that ends program_clock_reference_base
    /// (2.4.2.2).
    fn reference_after(self, number: usize) -> u64 {
        self.time(number, REFERENCE_BYTE)
    }

    fn time(self, number: usize, byte: usize) -> u64 {
        // In long streams the product exceeds 64 bits.
        (u128::from(CLOCK) * (number * PACKET + byte) as u128 / u128::from(self.bytes_per_second)) as u64
    }
}

/// Adaptation field before the payload of a packet (2.4.3.4).
#[derive(Clone, Copy, Default)]
struct Adaptation {
    /// Whether decoding can begin at this packet.
    random_access: bool,
    /// program_clock_reference, in units of 1/27 000 000 s.
    clock: Option<u64>,
}

/// Header of a transport packet.
#[derive(Clone, Copy)]
struct PacketHeader {
    /// Packet identifier.
    pid: u32,
    /// Whether a picture or section begins in this packet (payload_unit_start_indicator).
    begins: bool,
    adaptation: Adaptation,
}

impl Writer {
    pub fn new(mut schedule: Schedule, config: &Config) -> Self {
        let (standard, limits) = (config.standard, config.level().limits());
        let (bit_rate, buffer_size) = config.stated_rate();
        // Up to Main Level, a buffer below the level's maximum leaves room for multiplexing.
        let buffer_size = match limits.level <= Level::Main {
            true => limits.vbv_buffer_size.max(buffer_size.into()),
            false => buffer_size.into(),
        };
        let constant = matches!(config.rate, Rate::Constant { .. });
        let slots = constant.then(|| Slots::new(schedule.bytes_per_second, config.stated_frame_rate().fps()));
        schedule.bound(most_waiting(limits.bits_per_second.max(400 * u64::from(bit_rate)), buffer_size));
        Self { schedule, standard, counters: [0; 3], tables_sent: None, clock_sent: None, packets: 0, slots }
    }

    /// Adapts to the bit rate and buffer size of the stream. Returns the decoding time of the first picture.
    pub fn restate(&mut self, bit_rate: u32, buffer_size: u32) -> u64 {
        self.schedule = Schedule::of_stated(bit_rate, buffer_size);
        self.schedule.bound(most_waiting(400 * u64::from(bit_rate), buffer_size.into()));
        self.schedule.start()
    }

    /// Returns the packets of one picture.
    pub fn put(&mut self, picture: &StreamPicture) -> Vec<u8> {
        self.schedule.begin(picture.times.decoding);
        // A picture is one PES packet, and its header counts as payload.
        let mut data = Header { times: Some(picture.times), ..Header::default() }.bytes(None);
        let header = data.len();
        data.extend(&picture.data);
        let mut out = Vec::with_capacity(data.len() * PACKET / (PACKET - 12) + 4 * PACKET);
        let mut rest = &data[..];
        let (mut begins, mut was_paused) = (true, false);
        while !rest.is_empty() {
            let free = self.schedule.now();
            let due = self.schedule.wait(rest.len().min(PACKET - 4) as u64);
            // Bytes between two references arrive at one rate. A pause therefore ends with a reference, and the next packet has
            // one for the new rate.
            let is_paused = due > free;
            self.fill(&mut out, due);
            let is_due = |sent: Option<u64>, interval, now| sent.is_none_or(|sent| now >= sent + interval);
            if begins && (picture.is_entry || is_due(self.tables_sent, TABLE_INTERVAL, due)) {
                self.put_tables(&mut out);
                self.tables_sent = Some(due);
            }
            // Receivers need a reference at least once per interval, and at every change of the rate.
            let now = self.slots.map_or(due, |slots| slots.reference_after(self.packets + out.len() / PACKET));
            let has_clock = begins || is_paused || was_paused || is_due(self.clock_sent, self.clock_interval(), now);
            let clock = has_clock.then_some(now);
            self.clock_sent = clock.or(self.clock_sent);
            let adaptation = Adaptation { random_access: begins && picture.is_entry, clock };
            let taken =
                put_packet(&mut out, PacketHeader { pid: VIDEO_PID, begins, adaptation }, &mut self.counters[2], rest);
            // Only the elementary stream passes through the buffer.
            self.schedule.take(taken.saturating_sub(if begins { header } else { 0 }) as u64);
            (rest, begins, was_paused) = (&rest[taken..], false, is_paused && !begins);
        }
        self.packets += out.len() / PACKET;
        out
    }

    /// Returns the interval after which the next packet has a clock reference.
    fn clock_interval(&self) -> u64 {
        // Tables in between delay the next reference.
        if self.slots.is_some() { CLOCK_INTERVAL / 2 } else { CLOCK_INTERVAL }
    }

    /// Writes packets without video until the video is `due`: clock references, and null packets at a constant rate.
    fn fill(&mut self, out: &mut Vec<u8>, due: u64) {
        // At a constant rate, fill every slot until the video is due.
        if let Some(slots) = self.slots {
            loop {
                let number = self.packets + out.len() / PACKET;
                if slots.begin(number) >= due {
                    return;
                }
                let now = slots.reference_after(number);
                if self.clock_sent.is_some_and(|sent| now >= sent + self.clock_interval()) {
                    self.put_clock(out, now);
                } else {
                    put_null(out);
                }
            }
        }
        // At a variable rate, divide long pauses evenly by clock references.
        while let Some(sent) = self.clock_sent
            && due > sent + CLOCK_INTERVAL_MOST
        {
            let gap = due - sent;
            self.put_clock(out, sent + gap / gap.div_ceil(CLOCK_INTERVAL_MOST));
        }
    }

    /// Writes a packet with only a clock reference, which does not advance continuity_counter (2.4.3.3).
    fn put_clock(&mut self, out: &mut Vec<u8>, clock: u64) {
        let adaptation = Adaptation { random_access: false, clock: Some(clock) };
        let mut counter = (self.counters[2] + 15) % 16;
        put_packet(out, PacketHeader { pid: VIDEO_PID, begins: false, adaptation }, &mut counter, &[]);
        self.clock_sent = Some(clock);
    }

    /// Returns null packets (Table 2-3) if the stream is too short for programs to recognize it as a transport stream.
    pub fn finish(self) -> Vec<u8> {
        let mut out = Vec::new();
        for _ in self.packets..LEAST_PACKETS {
            put_null(&mut out);
        }
        out
    }

    /// Writes program_association_section() and TS_program_map_section() (2.4.4.3, 2.4.4.8).
    fn put_tables(&mut self, out: &mut Vec<u8>) {
        // The program association table refers to the program map table.
        let mut association = BitWriter::default();
        association.put(PROGRAM, 16); // program_number
        association.put(0b111, 3); // reserved
        association.put(PMT_PID, 13); // program_map_PID
        put_section(out, PAT_PID, &mut self.counters[0], 0x00, &association.into_bytes());

        // The program map table describes the video.
        let mut map = BitWriter::default();
        map.put(0b111, 3); // reserved
        map.put(VIDEO_PID, 13); // PCR_PID
        map.put(0b1111, 4); // reserved
        map.put(0, 12); // program_info_length
        let stream_type = match self.standard {
            Standard::Mpeg1 => 0x01, // Table 2-29
            Standard::Mpeg2 => 0x02,
        };
        map.put(stream_type, 8); // stream_type
        map.put(0b111, 3); // reserved
        map.put(VIDEO_PID, 13); // elementary_PID
        map.put(0b1111, 4); // reserved
        map.put(0, 12); // ES_info_length
        put_section(out, PMT_PID, &mut self.counters[1], 0x02, &map.into_bytes());
    }
}

/// Returns the maximum number of bytes that may wait in a decoder (2.4.2.3). They are 4 ms and 1/750 s of the level's bit rate,
/// and `buffer_size` in units of 16 384 bits.
fn most_waiting(bits_per_second: u64, buffer_size: u64) -> u64 {
    (bits_per_second / 250 + bits_per_second / 750 + 16_384 * buffer_size) / 8
}

/// Writes a null packet (Table 2-3).
fn put_null(out: &mut Vec<u8>) {
    let header = PacketHeader { pid: NULL_PID, begins: false, adaptation: Adaptation::default() };
    put_packet(out, header, &mut 0, &[0xff; PACKET - 4]);
}

/// Writes a section in its own packet. The identifier after its length is 1, for the stream as well as for the program.
fn put_section(out: &mut Vec<u8>, pid: u32, counter: &mut u32, table_id: u32, body: &[u8]) {
    let mut writer = BitWriter::default();
    writer.put(table_id, 8);
    writer.put(0b10_11, 4); // section_syntax_indicator, '0', reserved
    writer.put(body.len() as u32 + 9, 12); // section_length
    writer.put(PROGRAM, 16); // transport_stream_id, program_number
    writer.put(0b11, 2); // reserved
    writer.put(0, 5); // version_number
    writer.put(1, 1); // current_next_indicator
    writer.put(0, 16); // section_number, last_section_number
    let mut section = writer.into_bytes();
    section.extend(body);
    // The checksum covers the section, without pointer_field and stuffing.
    let check = crc_32(&section).to_be_bytes();
    let mut payload = vec![0]; // pointer_field: the section begins immediately
    payload.extend(section);
    payload.extend(check);
    payload.resize(PACKET - 4, 0xff); // stuffing after the section (2.4.4)
    put_packet(out, PacketHeader { pid, begins: true, adaptation: Adaptation::default() }, counter, &payload);
}

/// Writes transport_packet() (2.4.3.2) with as much of `payload` as fits. Returns the number of payload bytes.
fn put_packet(
    out: &mut Vec<u8>,
    PacketHeader { pid, begins, adaptation }: PacketHeader,
    counter: &mut u32,
    payload: &[u8],
) -> usize {
    // A short payload enlarges the adaptation field to fill the packet.
    let needed = match adaptation {
        Adaptation { clock: Some(_), .. } => 8,
        Adaptation { random_access: true, .. } => 2,
        _ => 0,
    };
    let taken = payload.len().min(PACKET - 4 - needed);
    let field = PACKET - 4 - taken;
    let mut writer = BitWriter::default();
    writer.put(SYNC_BYTE, 8);
    writer.put(0, 1); // transport_error_indicator
    writer.put(begins.into(), 1); // payload_unit_start_indicator
    writer.put(0, 1); // transport_priority
    writer.put(pid, 13); // PID
    writer.put(0, 2); // transport_scrambling_control
    let has_payload = !payload.is_empty();
    writer.put((field > 0).into(), 1); // adaptation_field_control: field and payload present
    writer.put(has_payload.into(), 1);
    writer.put(*counter, 4); // continuity_counter
    *counter = (*counter + 1) % 16;
    // A length of 0 is an adaptation field of one byte, without flags.
    if field > 0 {
        writer.put(field as u32 - 1, 8); // adaptation_field_length
    }
    if field > 1 {
        writer.put(0, 1); // discontinuity_indicator
        writer.put(adaptation.random_access.into(), 1); // random_access_indicator
        writer.put(0, 1); // elementary_stream_priority_indicator
        writer.put(adaptation.clock.is_some().into(), 1); // PCR_flag
        writer.put(0, 4); // OPCR, splicing_point, transport_private_data, adaptation_field_extension
    }
    // Split the clock reference into a 90 kHz base and a 27 MHz extension.
    if let Some(clock) = adaptation.clock {
        let base = clock / 300;
        writer.put((base >> 1) as u32, 32); // program_clock_reference_base, 33 bits
        writer.put(base as u32 & 1, 1);
        writer.put(0b11_1111, 6); // reserved
        writer.put((clock % 300) as u32, 9); // program_clock_reference_extension
    }
    // Stuffing belongs to the adaptation field, so it precedes the payload.
    let start = out.len();
    out.extend(writer.into_bytes());
    out.resize(start + PACKET - taken, 0xff); // stuffing_byte
    out.extend(&payload[..taken]);
    taken
}

/// Returns the CRC_32 (Annex A), most significant bit first, with the polynomial
/// `x³² + x²⁶ + x²³ + x²² + x¹⁶ + x¹² + x¹¹ + x¹⁰ + x⁸ + x⁷ + x⁵ + x⁴ + x² + x + 1`.
fn crc_32(bytes: &[u8]) -> u32 {
    const POLYNOMIAL: u32 = 0x04c1_1db7;
    let mut crc = u32::MAX;
    for &byte in bytes {
        crc ^= u32::from(byte) << 24;
        // Each step divides by the polynomial and keeps the remainder.
        for _ in 0..8 {
            crc = crc << 1 ^ if crc >> 31 == 1 { POLYNOMIAL } else { 0 };
        }
    }
    crc
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_check_of_a_checked_section_is_zero() {
        // Check value of CRC-32/MPEG-2 in the catalog of parametrized CRC algorithms.
        assert_eq!(crc_32(b"123456789"), 0x0376_e6e7);
    }

    #[test]
    fn packets_are_188_bytes_whatever_is_left_for_them() {
        for length in [1, 2, 3, 170, 175, 176, 177, 181, 182, 183, 184, 185, 400] {
            for adaptation in [
                Adaptation::default(),
                Adaptation { random_access: true, clock: None },
                Adaptation { random_access: true, clock: Some(123_456_789) },
            ] {
                let (mut out, mut counter) = (Vec::new(), 15);
                let payload: Vec<u8> = (0..length).map(|i| i as u8).collect();
                let taken = put_packet(
                    &mut out,
                    PacketHeader { pid: VIDEO_PID, begins: true, adaptation },
                    &mut counter,
                    &payload,
                );
                assert_eq!((out.len(), counter), (PACKET, 0));
                assert_eq!(out[PACKET - taken..], payload[..taken]);
                assert!(taken == length || taken >= PACKET - 12);
                let field = if out[3] >> 4 & 0b10 != 0 { 1 + usize::from(out[4]) } else { 0 };
                assert_eq!(4 + field + taken, PACKET);
            }
        }
    }
}
