//! An elementary stream extracted from a container: arrival times of its bytes, and time stamps of its pictures.

use super::elementary::Elementary;
use super::video::fps;

/// Longest time of a byte in the buffer \[s\] (13818-1, 2.4.2.6).
const LONGEST_WAIT: f64 = 1.0;
/// Longest interval between two time stamps \[s\] (13818-1, 2.7.4).
const STAMP_INTERVAL: f64 = 0.7;
/// Unit of time stamps \[s\].
const UNIT: f64 = 1.0 / 90_000.0;

/// Time stamps of a packet.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stamps {
    /// Offset in the elementary stream of the first byte after the stamps.
    pub at: usize,
    /// Time of display \[1/90 000 s\].
    pub presentation: u64,
    pub decoding: u64,
}

/// Consecutive bytes of the elementary stream.
#[derive(Clone, Copy, Debug)]
pub(super) struct Chunk {
    /// Offset of the byte after the last one.
    pub end: usize,
    /// Arrival times of the first and the last byte \[s\].
    pub arrival: (f64, f64),
}

/// Elementary stream of a container.
#[derive(Debug, Default)]
pub(super) struct Extracted {
    pub stream: Vec<u8>,
    pub chunks: Vec<Chunk>,
    pub stamps: Vec<Stamps>,
}

impl Extracted {
    /// Appends bytes with their arrival times.
    pub fn add(&mut self, bytes: &[u8], arrival: (f64, f64)) {
        self.stream.extend(bytes);
        self.chunks.push(Chunk { end: self.stream.len(), arrival });
    }

    /// Returns violated timing rules; `buffer` is the capacity of the decoder's buffer \[bytes\].
    pub fn faults(&self, video: &Elementary, buffer: f64) -> Vec<String> {
        let mut faults = Vec::new();
        let begins: Vec<usize> = video.pictures.iter().map(|picture| picture.begin).collect();
        if !self.stamps.iter().map(|stamps| stamps.at).eq(begins) {
            faults.push("not every picture has its time stamps".into());
            return faults;
        }
        faults.extend(self.stamp_faults(video));
        faults.extend(self.arrival_faults(video, buffer));
        faults.truncate(6);
        faults
    }

    /// Checks that pictures are due at the frame rate, in display order.
    fn stamp_faults(&self, video: &Elementary) -> Vec<String> {
        let mut faults = Vec::new();
        // Compute display times in fields, because some pictures last three fields.
        let field = 0.5 / fps(&video.sequences[0]);
        let fields = video.fields();
        let due = |index: u64| fields[..index as usize].iter().sum::<u64>() as f64 * field;
        let indices = video.display_indices();
        let shown_first = indices.iter().position(|&index| index == 0).expect("a first picture");
        let begin = self.stamps[shown_first].presentation as f64 * UNIT;
        // Check that display times follow the frame rate, and that decoding precedes display.
        for (at, (stamps, &index)) in self.stamps.iter().zip(&indices).enumerate() {
            let (presentation, expected) = (stamps.presentation as f64 * UNIT, begin + due(index));
            if (presentation - expected).abs() > 1.5 * UNIT {
                faults.push(format!("picture {at} is shown at {presentation} s, not {expected}"));
            }
            if stamps.decoding > stamps.presentation {
                faults.push(format!("picture {at} is decoded after it is shown"));
            }
        }
        // Check that a decoding interval equals the display time of the picture shown in it.
        let reorders =
            !video.sequences[0].low_delay && self.stamps.iter().any(|stamps| stamps.decoding != stamps.presentation);
        for (at, pair) in self.stamps.windows(2).enumerate() {
            let seconds = (pair[1].decoding as f64 - pair[0].decoding as f64) * UNIT;
            let held = if reorders { fields[at.saturating_sub(1)] } else { fields[at] };
            let is_first = reorders && at == 0;
            if !is_first && (seconds - held as f64 * field).abs() > 1.5 * UNIT
                || !(0.0..=STAMP_INTERVAL).contains(&seconds)
            {
                faults.push(format!("picture {} is decoded {seconds} s after the previous one", at + 1));
            }
        }
        faults
    }

    /// Checks that bytes arrive before their picture is decoded, at most one second early, and that the buffer never
    /// overflows.
    fn arrival_faults(&self, video: &Elementary, buffer: f64) -> Vec<String> {
        let mut faults = Vec::new();
        let decoding = |picture: usize| self.stamps[picture].decoding as f64 * UNIT;
        let (mut first, mut picture) = (0, 0);
        let mut begin = 0;
        for chunk in &self.chunks {
            // Find the picture that contains these bytes.
            while picture + 1 < video.pictures.len() && begin >= video.pictures[picture].end {
                picture += 1;
            }
            let due = decoding(picture);
            if chunk.arrival.1 > due + UNIT {
                faults.push(format!("byte {begin} of picture {picture} comes {} s late", chunk.arrival.1 - due));
            }
            if due - chunk.arrival.0 > LONGEST_WAIT + UNIT {
                faults.push(format!("byte {begin} of picture {picture} comes {} s early", due - chunk.arrival.0));
            }
            // Remove the pictures that were decoded before these bytes arrived.
            while first < picture && decoding(first) <= chunk.arrival.1 + UNIT {
                first += 1;
            }
            let held = chunk.end - video.pictures[first].begin;
            if held as f64 > buffer {
                faults.push(format!("{held} bytes wait in a buffer of {buffer} at byte {begin}"));
            }
            begin = chunk.end;
        }
        faults
    }
}
