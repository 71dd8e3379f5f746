//! Program streams (13818-1, 2.5.3): packs, system headers and packets.

use super::bits::Bits;
use super::elementary::Elementary;
use super::extracted::{Extracted, Stamps};

/// Frequency of the system clock \[Hz\].
const CLOCK: f64 = 27_000_000.0;
/// Longest interval between two system clock references \[s\] (13818-1, 2.7.1).
const REFERENCE_INTERVAL: f64 = 0.7;

/// Demultiplexes a program stream; returns the video and all faults.
pub(super) fn read(file: &[u8]) -> (Extracted, Elementary, Vec<String>) {
    let (mut extracted, mut faults) = (Extracted::default(), Vec::new());
    let (mut at, mut buffer, mut bound) = (0, None, None);
    let mut before = None;
    let mut pack = (0, 0.0, 1.0);
    while at + 4 <= file.len() {
        let mut bits = Bits::new(&file[at + 4..]);
        match file[at + 3] {
            0xb9 => break,
            // A pack's clock reference must not precede the arrival of the previous pack.
            0xba => {
                bits.skip(2);
                let reference = (300 * bits.stamp() + bits.take(9)) as f64 / CLOCK;
                bits.skip(1);
                let rate = 50.0 * bits.take(22) as f64;
                let clear = pack.1 + (at - pack.0) as f64 / pack.2;
                let passed = if at == 0 { 0.0 } else { clear };
                if reference < passed - 1.0 / CLOCK {
                    faults.push(format!("the pack at {at} comes at {reference} s, before {passed}"));
                }
                if before.is_some_and(|before| reference - before > REFERENCE_INTERVAL) {
                    faults.push(format!("no system clock reference for {} s at {at}", reference - pack.1));
                }
                before = Some(reference);
                pack = (at, reference, rate);
                if bound.is_some_and(|bound| rate > bound) {
                    faults.push(format!("program_mux_rate {rate} above rate_bound at {at}"));
                }
                at += 14 + usize::from(file[at + 13] & 7);
            }
            // The system header contains rate_bound.
            0xbb => {
                let length = bits.take(16) as usize;
                bits.skip(1);
                bound = Some(50.0 * bits.take(22) as f64);
                at += 6 + length;
            }
            // Bytes of video packets arrive at the rate of the pack.
            0xe0 => {
                let length = bits.take(16) as usize;
                let fields = read_header(&mut bits, &mut buffer, &mut extracted);
                let begin = at + 9 + fields;
                let when = |at: usize| pack.1 + (at - pack.0) as f64 / pack.2;
                let end = at + 6 + length;
                extracted.add(&file[begin..end], (when(begin), when(end)));
                at = end;
            }
            // Skip private, padding and other streams.
            0xbd..=0xbf => at += 6 + bits.take(16) as usize,
            other => {
                faults.push(format!("start code {other:#x} at {at}"));
                break;
            }
        }
    }

    // Check the elementary stream with the buffer size in the packets.
    let video = Elementary::read(&extracted.stream);
    match buffer {
        Some(buffer) => faults.extend(extracted.faults(&video, buffer as f64)),
        None => faults.push("no P-STD_buffer_size".into()),
    }
    (extracted, video, faults)
}

/// Parses a packet's header after its length, and returns PES_header_data_length.
fn read_header(bits: &mut Bits, buffer: &mut Option<u64>, extracted: &mut Extracted) -> usize {
    bits.skip(8);
    let (has, _) = (bits.take(2), bits.take(5));
    let extension = bits.flag();
    let fields = bits.take(8) as usize;
    read_stamps(bits, has, extracted);
    // The extension contains P-STD_buffer_size.
    if extension {
        bits.skip(8 + 2);
        let scale = if bits.flag() { 1024 } else { 128 };
        *buffer = Some(scale * bits.take(13));
    }
    fields
}

/// Reads PTS and DTS after the PTS_DTS_flags `has`.
pub(super) fn read_stamps(bits: &mut Bits, has: u64, extracted: &mut Extracted) {
    let at = extracted.stream.len();
    if has & 2 != 0 {
        bits.skip(4);
        let presentation = bits.stamp();
        let mut decoding = presentation;
        if has == 3 {
            bits.skip(4);
            decoding = bits.stamp();
        }
        extracted.stamps.push(Stamps { at, presentation, decoding });
    }
}
