//! Matroska (RFC 9559), in EBML syntax (RFC 8794).
//!
//! Clause numbers in this file refer to RFC 9559.
//!
//! The file is written sequentially: a segment of unknown size, a cluster for each group of pictures, and finally the cues. All
//! times are display times, although pictures are in the order of coding.

use super::{
    clock::CLOCK,
    description::{Description, SeekPoint, reduced, sequence_header},
    pes::StreamPicture,
};
use crate::Standard;

/// Identifiers of elements that contain other elements (5.1).
const EBML: u32 = 0x1a45_dfa3;
const SEGMENT: u32 = 0x1853_8067;
const INFO: u32 = 0x1549_a966;
const TRACKS: u32 = 0x1654_ae6b;
const TRACK_ENTRY: u32 = 0xae;
const VIDEO: u32 = 0xe0;
const COLOR: u32 = 0x55b0;
const CLUSTER: u32 = 0x1f43_b675;
const SIMPLE_BLOCK: u32 = 0xa3;
const CUES: u32 = 0x1c53_bb6b;
const CUE_POINT: u32 = 0xbb;
const CUE_TRACK_POSITIONS: u32 = 0xb7;

/// Number of the only track.
const TRACK: u64 = 1;
/// Nanoseconds per time unit (TimestampScale, 5.1.2.9): the default, which all programs write.
const TIMESTAMP_SCALE: u64 = 1_000_000;
/// Units of the system clock per millisecond.
const MILLISECOND: u64 = CLOCK / 1000;
/// Flag of a SimpleBlock (10.2): decoding can begin at the picture.
const KEYFRAME: u8 = 0x80;
/// Flag of a SimpleBlock (10.2): no other picture depends on the picture.
const DISCARDABLE: u8 = 0x01;

/// Writes a Matroska file.
#[derive(Clone)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Writer {
    description: Description,
    /// Bytes written so far.
    length: u64,
    /// Offset of the segment's contents, from which positions are counted.
    segment: u64,
    /// Pictures of the group that is not yet complete.
    group: Vec<StreamPicture>,
    entries: Vec<SeekPoint>,
}

impl Writer {
    /// Makes a writer for the described video.
    pub fn new(description: Description) -> Self {
        Self { description, length: 0, segment: 0, group: Vec::new(), entries: Vec::new() }
    }

    /// Sets the number of pictures for the duration in the header.
    pub fn set_pictures(&mut self, count: u64) {
        self.description.pictures = Some(count);
    }

    /// Accepts a picture; if it begins a group, returns the cluster of the previous group.
    pub fn put(&mut self, picture: StreamPicture) -> Vec<u8> {
        let out = if picture.is_entry { self.flush() } else { Vec::new() };
        self.group.push(picture);
        out
    }

    /// Returns the last cluster and the cues (5.1.5).
    pub fn finish(mut self) -> Vec<u8> {
        let mut out = self.flush();
        out.extend(self.cues());
        out
    }

    /// Returns the cluster of the waiting pictures, preceded by the headers if it is the first.
    fn flush(&mut self) -> Vec<u8> {
        let Some(first) = self.group.first() else { return Vec::new() };
        let mut out = Vec::new();
        if self.length == 0 {
            out.extend(ebml_header());
            self.segment = out.len() as u64 + 12;
            out.extend(SEGMENT.to_be_bytes());
            out.extend([1, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff]); // unknown size (RFC 8794, 6.2)
            out.extend(self.info());
            out.extend(element(TRACKS, &[&self.track(sequence_header(first))]));
        }
        let place = (self.length + out.len() as u64).saturating_sub(self.segment);
        self.entries.push(SeekPoint { time: milliseconds(first.times.presentation), place });
        out.extend(self.cluster());
        self.group.clear();
        self.length += out.len() as u64;
        out
    }

    /// Returns the Info element (5.1.2). It omits the program's version, so files depend only on settings and pictures.
    fn info(&self) -> Vec<u8> {
        let duration = self.description.pictures.map_or(Vec::new(), |count| {
            let milliseconds = count as f64 * self.description.period() as f64 / MILLISECOND as f64;
            element(0x4489, &[&milliseconds.to_be_bytes()])
        });
        element(
            INFO,
            &[
                &number(0x2a_d7b1, TIMESTAMP_SCALE),
                &duration,
                &element(0x4d80, &[b"mpeg2enc"]), // MuxingApp
                &element(0x5741, &[b"mpeg2enc"]), // WritingApp
            ],
        )
    }

    /// Returns the TrackEntry element (5.1.4.1), which contains the stream headers for the decoder.
    fn track(&self, headers: &[u8]) -> Vec<u8> {
        let codec: &[u8] = match self.description.standard {
            Standard::Mpeg1 => b"V_MPEG1",
            Standard::Mpeg2 => b"V_MPEG2",
        };
        let (numerator, denominator) = self.description.frame_rate;
        // Round the frame period to whole nanoseconds.
        let period = (1_000_000_000 * denominator + numerator / 2) / numerator;
        element(
            TRACK_ENTRY,
            &[
                &number(0xd7, TRACK),           // TrackNumber
                &number(0x73c5, TRACK),         // TrackUID
                &number(0x83, 1),               // TrackType: video
                &number(0x9c, 0),               // FlagLacing
                &element(0x22_b59c, &[b"und"]), // Language
                &element(0x86, &[codec]),       // CodecID
                &element(0x63a2, &[headers]),   // CodecPrivate
                &number(0x23_e383, period),     // DefaultDuration, in nanoseconds
                &self.video(),
            ],
        )
    }

    /// Returns the Video element (5.1.4.1.28).
    fn video(&self) -> Vec<u8> {
        let Description { width, height, coded, color, .. } = &self.description;
        // MPEG-1 streams have no color description, so the element is omitted.
        let color = color.map_or(Vec::new(), |color| {
            element(
                COLOR,
                &[
                    &number(0x55b1, color.matrix.code().into()),    // MatrixCoefficients
                    &number(0x55b7, 1),                             // ChromaSitingHorz: left
                    &number(0x55b8, 2),                             // ChromaSitingVert: half
                    &number(0x55b9, 1),                             // Range: broadcast
                    &number(0x55ba, color.transfer.code().into()),  // TransferCharacteristics
                    &number(0x55bb, color.primaries.code().into()), // Primaries
                ],
            )
        });
        element(
            VIDEO,
            &[
                &number(0x9a, 2),                  // FlagInterlaced: progressive
                &number(0xb0, u64::from(coded.0)), // PixelWidth
                &number(0xba, u64::from(coded.1)), // PixelHeight
                &crop(0x54dd, coded.0 - width),    // PixelCropRight
                &crop(0x54aa, coded.1 - height),   // PixelCropBottom
                &self.shape(),
                &color,
            ],
        )
    }

    /// Returns DisplayUnit, DisplayWidth and DisplayHeight as a ratio; empty for square samples, the default.
    fn shape(&self) -> Vec<u8> {
        let Description { width, height, sample, .. } = self.description;
        if sample == (1, 1) {
            return Vec::new();
        }
        let ratio = reduced((u64::from(width) * u64::from(sample.0), u64::from(height) * u64::from(sample.1)));
        [number(0x54b2, 3), number(0x54b0, ratio.0), number(0x54ba, ratio.1)].concat()
    }

    /// Returns the Cluster element (5.1.3) of the group.
    fn cluster(&self) -> Vec<u8> {
        let times = self.group.iter().map(|picture| milliseconds(picture.times.presentation));
        let begin = times.min().unwrap_or(0);
        let mut blocks = number(0xe7, begin); // Timestamp
        for picture in &self.group {
            // SimpleBlock (10.2): track number, time relative to the cluster, flags. Groups are shorter than the limit of 32 s.
            let time = milliseconds(picture.times.presentation) - begin;
            let flags = match picture {
                StreamPicture { is_entry: true, .. } => KEYFRAME,
                StreamPicture { is_disposable: true, .. } => DISCARDABLE,
                StreamPicture { .. } => 0,
            };
            let head = [&size_of(TRACK)[..], &(time as i16).to_be_bytes(), &[flags]].concat();
            blocks.extend(element(SIMPLE_BLOCK, &[&head, &picture.data]));
        }
        element(CLUSTER, &[&blocks])
    }

    /// Returns the Cues element (5.1.5): positions of the clusters, each of which begins with an I picture.
    fn cues(&self) -> Vec<u8> {
        let mut points: Vec<u8> = Vec::new();
        for entry in &self.entries {
            let position = element(CUE_TRACK_POSITIONS, &[&number(0xf7, TRACK), &number(0xf1, entry.place)]);
            points.extend(element(CUE_POINT, &[&number(0xb3, entry.time), &position]));
        }
        if points.is_empty() { Vec::new() } else { element(CUES, &[&points]) }
    }
}

/// Returns the header of an EBML document (RFC 8794, 11.2).
fn ebml_header() -> Vec<u8> {
    element(
        EBML,
        &[
            &number(0x4286, 1),               // EBMLVersion
            &number(0x42f7, 1),               // EBMLReadVersion
            &number(0x42f2, 4),               // EBMLMaxIDLength
            &number(0x42f3, 8),               // EBMLMaxSizeLength
            &element(0x4282, &[b"matroska"]), // DocType
            &number(0x4287, 4),               // DocTypeVersion
            &number(0x4285, 2),               // DocTypeReadVersion
        ],
    )
}

/// Returns an element with these contents (RFC 8794, 5 and 6).
fn element(id: u32, contents: &[&[u8]]) -> Vec<u8> {
    let size: usize = contents.iter().map(|bytes| bytes.len()).sum();
    let mut out = without_zeros(id.into());
    out.extend(size_of(size as u64));
    contents.iter().for_each(|bytes| out.extend(*bytes));
    out
}

/// Returns an element that contains an unsigned integer.
fn number(id: u32, value: u64) -> Vec<u8> {
    element(id, &[&without_zeros(value)])
}

/// Returns an element with a number of coded but hidden samples; empty for 0.
fn crop(id: u32, samples: u32) -> Vec<u8> {
    if samples > 0 { number(id, samples.into()) } else { Vec::new() }
}

/// Returns the big-endian bytes of a number without leading zero bytes, but at least one byte.
fn without_zeros(value: u64) -> Vec<u8> {
    let zeros = value.leading_zeros() as usize / 8;
    value.to_be_bytes()[zeros.min(7)..].to_vec()
}

/// Returns a variable-length number with as few bytes as possible; its leading zero bits encode its length (RFC 8794, 4).
fn size_of(value: u64) -> Vec<u8> {
    // All ones are reserved for unknown sizes, so they need a longer code.
    let bytes = (1..8).find(|bytes| value < (1 << (7 * bytes)) - 1).unwrap_or(8);
    (value | 1 << (7 * bytes)).to_be_bytes()[8 - bytes..].to_vec()
}

/// Converts a time of the system clock to milliseconds, rounded.
fn milliseconds(time: u64) -> u64 {
    (time + MILLISECOND / 2) / MILLISECOND
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Checks lengths from RFC 8794, 4.4, and values around the maximum of each length.
    #[test]
    fn sizes_take_few_bytes() {
        assert_eq!(size_of(2), [0x82]);
        assert_eq!(size_of(126), [0xfe]);
        assert_eq!(size_of(127), [0x40, 0x7f]);
        assert_eq!(size_of((1 << 14) - 1), [0x20, 0x3f, 0xff]);
        assert_eq!(size_of(1 << 50), [1, 4, 0, 0, 0, 0, 0, 0]);
        assert_eq!(number(0xd7, 0), [0xd7, 0x81, 0]);
        assert_eq!(number(0x2a_d7b1, 1_000_000), [0x2a, 0xd7, 0xb1, 0x83, 0x0f, 0x42, 0x40]);
    }
}
