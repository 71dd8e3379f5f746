//! Transport streams (13818-1, 2.4.3): packets, tables and clock references.

use super::bits::Bits;
use super::elementary::Elementary;
use super::extracted::Extracted;
use super::program_stream::read_stamps;
use super::video::level_bounds;
use std::collections::BTreeMap;

const PACKET: usize = 188;
const CLOCK: f64 = 27_000_000.0;
/// Longest interval between clock references \[s\]: DVB's limit (ETSI TS 101 154, 4.1.5.3), stricter than the standard's.
const REFERENCE_INTERVAL: f64 = 0.040;
/// Longest interval between tables \[s\]: DVB's limit for program associations (ETSI TR 101 290, 5.2.1).
const TABLE_INTERVAL: f64 = 0.5;
/// Largest deviation of a clock reference from its byte's time at a constant rate \[s\] (13818-1, 2.4.2.2).
const ACCURACY: f64 = 500e-9;
/// Capacity of multiplexing and transport buffers, in seconds at the level's rate (13818-1, 2.4.2.3).
const MULTIPLEXING: f64 = 0.004 + 1.0 / 750.0;
/// Index of the packet's byte with the last bit of program_clock_reference_base.
const REFERENCE_BYTE: usize = 10;

/// Clock reference with its position.
#[derive(Clone, Copy, Debug)]
struct Reference {
    /// Offset in the file of the byte that arrives at this time.
    at: usize,
    /// Time of arrival \[s\].
    time: f64,
}

/// Demultiplexes a transport stream; returns the video and all faults.
pub(super) fn read(file: &[u8]) -> (Extracted, Elementary, Vec<String>) {
    let mut faults = Vec::new();
    if !file.len().is_multiple_of(PACKET) {
        faults.push(format!("{} bytes are no whole packets", file.len()));
    }
    let references = references(file);
    faults.extend(reference_faults(&references));
    let (mut extracted, mut counters, mut tables) = (Extracted::default(), BTreeMap::new(), BTreeMap::new());
    let mut nulls = 0;
    for (number, packet) in file.chunks_exact(PACKET).enumerate() {
        let Packet { pid, begins, counter, payload } = header(packet);
        // Count null packets, which have no counter.
        if pid == 0x1fff {
            nulls += 1;
            continue;
        }
        // A packet without a payload repeats the counter of the previous packet.
        let expected = counters.get(&pid).map(|counter: &u64| (counter + u64::from(payload.is_some())) % 16);
        if expected.is_some_and(|expected| expected != counter) {
            faults.push(format!("continuity_counter of packet {number}"));
        }
        counters.insert(pid, counter);
        let Some(begin) = payload else { continue };
        let at = number * PACKET;
        // Check the CRC and the interval of tables.
        if pid < 0x10 || pid == 0x1000 {
            faults.extend(table_faults(&packet[begin..]));
            let time = time_of(&references, at);
            if tables.insert(pid, time).is_some_and(|before| time - before > TABLE_INTERVAL) {
                faults.push(format!("no table {pid} for long before packet {number}"));
            }
            continue;
        }
        // Read the PES header that precedes a picture, then the video.
        let mut data = begin;
        if begins {
            let mut bits = Bits::new(&packet[begin + 4..]);
            bits.skip(16 + 8);
            let has = bits.take(2);
            bits.skip(6);
            data += 9 + bits.take(8) as usize;
            read_stamps(&mut bits, has, &mut extracted);
        }
        let arrival = (time_of(&references, at + data), time_of(&references, at + PACKET));
        extracted.add(&packet[data..], arrival);
    }

    // Constant rates need exact clocks and null packets.
    let video = Elementary::read(&extracted.stream);
    let sequence = &video.sequences[0];
    let is_constant = sequence.bit_rate.is_some() && video.pictures[0].vbv_delay != 0xffff;
    if is_constant {
        faults.extend(accuracy_fault(&references));
        if nulls == 0 {
            faults.push("a constant rate without null packets".into());
        }
    }

    // Low and Main Level use the level's buffer size; higher levels use the size in the header.
    let buffer = level_bounds(sequence).map_or(f64::INFINITY, |(rate, buffer)| {
        let buffer = if sequence.profile_and_level & 15 >= 8 { buffer } else { sequence.buffer };
        (buffer as f64 + MULTIPLEXING * rate as f64) / 8.0
    });
    faults.extend(extracted.faults(&video, buffer));
    (extracted, video, faults)
}

/// Header of a packet.
struct Packet {
    pid: u64,
    begins: bool,
    counter: u64,
    /// Offset of the payload in the packet, if present.
    payload: Option<usize>,
}

fn header(packet: &[u8]) -> Packet {
    let mut bits = Bits::new(packet);
    assert_eq!(bits.take(8), 0x47, "sync_byte");
    bits.skip(1);
    let begins = bits.flag();
    bits.skip(1);
    let pid = bits.take(13);
    bits.skip(2);
    let (has_field, has_payload) = (bits.flag(), bits.flag());
    let counter = bits.take(4);
    let field = if has_field { 1 + usize::from(packet[4]) } else { 0 };
    Packet { pid, begins, counter, payload: has_payload.then_some(4 + field) }
}

/// Returns the clock references of all packets.
fn references(file: &[u8]) -> Vec<Reference> {
    let mut references = Vec::new();
    for (number, packet) in file.chunks_exact(PACKET).enumerate() {
        // A reference requires an adaptation field with PCR_flag.
        let has_reference = packet[3] & 0x20 != 0 && packet[4] >= 7 && packet[5] & 0x10 != 0;
        if has_reference {
            let mut bits = Bits::new(&packet[6..]);
            let base = bits.take(33);
            bits.skip(6);
            let time = (300 * base + bits.take(9)) as f64 / CLOCK;
            references.push(Reference { at: number * PACKET + REFERENCE_BYTE, time });
        }
    }
    references
}

/// Returns the arrival time of a byte \[s\]: the rate is constant between two references (13818-1, 2.4.2.2).
fn time_of(references: &[Reference], at: usize) -> f64 {
    // Interpolate between the references around the byte, or extrapolate at the ends.
    let after = references.partition_point(|reference| reference.at < at).clamp(1, references.len().max(2) - 1);
    let Some([a, b]) = references.get(after - 1..after + 1) else { return references.first().map_or(0.0, |r| r.time) };
    a.time + (at as f64 - a.at as f64) * (b.time - a.time) / (b.at - a.at) as f64
}

fn reference_faults(references: &[Reference]) -> Vec<String> {
    let mut faults = Vec::new();
    for pair in references.windows(2) {
        let seconds = pair[1].time - pair[0].time;
        if seconds <= 0.0 || seconds > REFERENCE_INTERVAL + 1.0 / CLOCK {
            faults.push(format!("{seconds} s from one clock reference to that at byte {}", pair[1].at));
        }
    }
    faults.truncate(3);
    faults
}

/// Reports clock references that are too far from a constant rate.
fn accuracy_fault(references: &[Reference]) -> Option<String> {
    let worst = worst_reference(references);
    (worst > ACCURACY).then(|| format!("clock references are up to {worst} s off a constant rate"))
}

/// Returns the largest deviation of a reference from the line through the first and the last \[s\].
fn worst_reference(references: &[Reference]) -> f64 {
    let (Some(first), Some(last)) = (references.first(), references.last()) else { return 0.0 };
    let rate = (last.time - first.time) / (last.at - first.at).max(1) as f64;
    let off = |reference: &Reference| (reference.time - first.time - (reference.at - first.at) as f64 * rate).abs();
    references.iter().map(off).fold(0.0, f64::max)
}

/// Returns the largest deviation of a file's clock references from a constant rate \[s\].
#[must_use]
pub fn clock_accuracy(file: &[u8]) -> f64 {
    worst_reference(&references(file))
}

/// Returns the longest interval between two clock references of a file \[s\].
#[must_use]
pub fn clock_interval(file: &[u8]) -> f64 {
    references(file).windows(2).map(|pair| pair[1].time - pair[0].time).fold(0.0, f64::max)
}

/// Checks the CRC of a table section bit by bit (13818-1, Annex A).
fn table_faults(payload: &[u8]) -> Option<String> {
    let section = &payload[1 + usize::from(payload[0])..];
    let length = 3 + (usize::from(section[1] & 0xf) << 8 | usize::from(section[2]));
    let mut register = u32::MAX;
    for byte in &section[..length] {
        for bit in (0..8).rev() {
            let feedback = register >> 31 ^ u32::from(byte >> bit & 1);
            register = register << 1 ^ if feedback == 1 { 0x04c1_1db7 } else { 0 };
        }
    }
    (register != 0).then(|| "CRC_32 of a table".into())
}
