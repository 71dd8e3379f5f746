//! Fragmented MP4: ISO/IEC 14496-12:2015, with the descriptors of ISO/IEC 14496-1 stored as in ISO/IEC 14496-14.
//!
//! Clause numbers in this file refer to 14496-12, unless another standard is named.
//!
//! An unfragmented file cannot be played without one table with the sizes of all pictures. A fragmented file is written
//! sequentially: each group of pictures is a `moof` with sizes and times, and a `mdat`. The final table, `mfra`, only contains
//! the positions of the groups.

use super::{
    clock::CLOCK,
    description::{Description, SeekPoint},
    pes::StreamPicture,
};
use crate::Standard;

/// Number of the only track (8.3.2).
const TRACK: u32 = 1;
/// Minimum timescale in Hz; many players expect a finer one than 24.
const TIMESCALE_LEAST: u64 = 1000;
/// Unit matrix of video headers (8.2.2), in 16.16 format; the last column has 2.30 format.
const MATRIX: [u32; 9] = [0x1_0000, 0, 0, 0, 0x1_0000, 0, 0, 0, 0x4000_0000];
/// Flags of default-base-is-moof and default-sample-duration-present (8.8.7).
const FRAGMENT_HEADER_FLAGS: u32 = 0x02_0008;
/// Flags of data-offset, sample-size, sample-flags and sample-composition-time-offsets (8.8.8).
const RUN_FLAGS: u32 = 0x00_0e01;
/// sample_flags of a picture that depends on no other picture (sample_depends_on; 8.6.4.3, 8.8.3.1).
const FLAGS_ENTRY: u32 = 2 << 24;
/// sample_flags of a picture that depends on other pictures (sample_depends_on, sample_is_non_sync_sample).
const FLAGS_PREDICTED: u32 = 1 << 24 | 1 << 16;
/// sample_flags of a picture on which no other picture depends (sample_is_depended_on).
const FLAGS_DISPOSABLE: u32 = 2 << 22;
/// sample_flags of a picture that depends on the previous group and is displayed before its own group's I picture (is_leading).
const FLAGS_LEADING: u32 = 1 << 26;

/// Writes a fragmented MP4 file.
#[derive(Clone)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Writer {
    description: Description,
    /// Display time of the first picture, in units of 1/27 000 000 s; the edit list skips the time before it.
    begin: u64,
    /// Bytes written so far.
    length: u64,
    /// Pictures of the group that is not yet complete.
    group: Vec<StreamPicture>,
    entries: Vec<SeekPoint>,
}

impl Writer {
    /// Makes a writer; `begin` is the display time of the first picture, in units of 1/27 000 000 s.
    pub fn new(description: Description, begin: u64) -> Self {
        Self { description, begin, length: 0, group: Vec::new(), entries: Vec::new() }
    }

    /// Sets the number of pictures for the duration in the header.
    pub fn set_pictures(&mut self, count: u64) {
        self.description.pictures = Some(count);
    }

    /// Sets the size of the decoder's buffer for the header, in units of 16 384 bits.
    pub fn restate(&mut self, buffer_size: u32) {
        self.description.buffer = buffer_size.saturating_mul(2048);
    }

    /// Accepts a picture; if it begins a group, returns the fragment of the previous group.
    pub fn put(&mut self, picture: StreamPicture) -> Vec<u8> {
        let out = if picture.is_entry { self.flush() } else { Vec::new() };
        self.group.push(picture);
        out
    }

    /// Returns the last fragment and the table of all fragments (8.8.9).
    pub fn finish(mut self) -> Vec<u8> {
        let mut out = self.flush();
        out.extend(self.random_access());
        out
    }

    /// Returns the fragment of the waiting pictures, preceded by the headers if it is the first.
    fn flush(&mut self) -> Vec<u8> {
        let Some(first) = self.group.first() else { return Vec::new() };
        let mut out = if self.length == 0 { self.headers() } else { Vec::new() };
        let place = self.length + out.len() as u64;
        self.entries.push(SeekPoint { time: self.ticks(first.times.presentation), place });
        out.extend(self.fragment());
        self.group.clear();
        self.length += out.len() as u64;
        out
    }

    /// Returns `ftyp` and `moov` (4.3, 8.2.1).
    fn headers(&self) -> Vec<u8> {
        let mut out = atom(b"ftyp", &[b"iso6", &[0, 0, 2, 0], b"iso6iso5mp41"]);
        out.extend(atom(b"moov", &[&self.movie_header(), &self.track(), &self.extends()]));
        out
    }

    /// Returns `mvhd` (8.2.2).
    fn movie_header(&self) -> Vec<u8> {
        let mut body = words(&[0, 0, self.timescale() as u32, 0]); // times of creation and modification, timescale, duration
        body.extend(words(&[0x1_0000])); // rate
        body.extend([1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]); // volume, reserved
        body.extend(words(&MATRIX));
        body.extend([0; 24]); // pre_defined
        body.extend(words(&[TRACK + 1])); // next_track_ID
        full_atom(b"mvhd", 0, 0, &[&body])
    }

    /// Returns `trak` (8.3.1).
    fn track(&self) -> Vec<u8> {
        let Description { height, .. } = self.description;
        let mut header = words(&[0, 0, TRACK, 0, 0]); // times of creation and modification, track_ID, reserved, duration
        header.extend([0; 16]); // reserved, layer, alternate_group, volume, reserved
        header.extend(words(&MATRIX));
        header.extend(words(&[self.description.display_width() << 16, height << 16]));
        let header = full_atom(b"tkhd", 0, 3, &[&header]); // enabled, in the movie
        atom(b"trak", &[&header, &self.edits(), &self.media()])
    }

    /// Returns `edts` (8.6.5), which plays from the first displayed picture to the end. It is empty without B pictures, because
    /// the display then starts at 0.
    fn edits(&self) -> Vec<u8> {
        if self.begin == 0 {
            return Vec::new();
        }
        // entry_count, segment_duration of all fragments, media_time, media_rate
        let list = words(&[1, 0, self.ticks(self.begin) as u32, 0x1_0000]);
        atom(b"edts", &[&full_atom(b"elst", 0, 0, &[&list])])
    }

    /// Returns `mdia` (8.4.1).
    fn media(&self) -> Vec<u8> {
        let header = words(&[0, 0, self.timescale() as u32, 0, 0x55c4_0000]); // times, timescale, duration, language: und
        // Use this name, because programs display any other name as a title.
        let handler: [&[u8]; 4] = [&[0; 4], b"vide", &[0; 12], b"VideoHandler\0"];
        let reference = full_atom(b"dref", 0, 0, &[&words(&[1]), &full_atom(b"url ", 0, 1, &[])]); // the data are in this file
        let none = words(&[0]);
        let samples = atom(
            b"stbl",
            &[
                &full_atom(b"stsd", 0, 0, &[&words(&[1]), &self.sample_entry()]),
                &full_atom(b"stts", 0, 0, &[&none]),
                &full_atom(b"stsc", 0, 0, &[&none]),
                &full_atom(b"stsz", 0, 0, &[&none, &none]),
                &full_atom(b"stco", 0, 0, &[&none]),
            ],
        );
        let information =
            atom(b"minf", &[&full_atom(b"vmhd", 0, 1, &[&[0; 8]]), &atom(b"dinf", &[&reference]), &samples]);
        let header = full_atom(b"mdhd", 0, 0, &[&header]);
        atom(b"mdia", &[&header, &full_atom(b"hdlr", 0, 0, &handler), &information])
    }

    /// Returns `mp4v` (12.1.3; 14496-14, 5.6), with sample aspect ratio and color.
    fn sample_entry(&self) -> Vec<u8> {
        let Description { width, height, sample, color, .. } = &self.description;
        let size = [*width as u16, *height as u16].map(u16::to_be_bytes).concat();
        let shape = atom(b"pasp", &[&words(&[sample.0, sample.1])]);
        let color = color.map_or(Vec::new(), |color| {
            let codes = [color.primaries.code(), color.transfer.code(), color.matrix.code()];
            // The box contains 16-bit codes.
            let codes = codes.map(|code| [0, code]).concat();
            atom(b"colr", &[b"nclx", &codes, &[0]]) // last bit: not full range
        });
        let fields: [&[u8]; 8] = [
            &[0, 0, 0, 0, 0, 0, 0, 1], // reserved, data_reference_index
            &[0; 16],                  // pre_defined, reserved
            &size,
            &words(&[0x48_0000, 0x48_0000, 0]), // horizresolution, vertresolution: 72 dpi; reserved
            &[0, 1],                            // frame_count
            &[0; 32],                           // compressorname
            &[0, 0x18, 0xff, 0xff],             // depth, pre_defined
            &self.stream_descriptor(),
        ];
        atom(b"mp4v", &[&fields.concat(), &shape, &color])
    }

    /// Returns `esds`, which contains an ES_Descriptor (14496-1, 7.2.6.5).
    fn stream_descriptor(&self) -> Vec<u8> {
        let Description { standard, is_high, buffer, bit_rate, .. } = self.description;
        // objectTypeIndication (14496-1, Table 5).
        let object_type = match standard {
            Standard::Mpeg1 => 0x6a,
            Standard::Mpeg2 if is_high => 0x64,
            Standard::Mpeg2 => 0x61,
        };
        let mut decoder = vec![object_type, 4 << 2 | 1]; // streamType: visual; upStream, reserved
        decoder.extend(&buffer.min(0xff_ffff).to_be_bytes()[1..]); // bufferSizeDB
        decoder.extend(words(&[bit_rate, 0])); // maxBitrate, avgBitrate: variable
        let mut stream = vec![0, 0, 0]; // ES_ID, flags and streamPriority
        stream.extend(descriptor(4, &decoder)); // DecoderConfigDescriptor (7.2.6.6)
        stream.extend(descriptor(6, &[2])); // SLConfigDescriptor, with the value that 14496-14 requires
        full_atom(b"esds", 0, 0, &[&descriptor(3, &stream)])
    }

    /// Returns `mvex` (8.8.1), which announces fragments and their total duration.
    fn extends(&self) -> Vec<u8> {
        let length = self.description.pictures.map_or(Vec::new(), |count| {
            let duration = self.ticks(count.saturating_mul(self.description.period()));
            full_atom(b"mehd", 1, 0, &[&duration.to_be_bytes()])
        });
        let defaults = words(&[TRACK, 1, 0, 0, 0]); // sample description 1; fragments contain duration, size and flags
        atom(b"mvex", &[&length, &full_atom(b"trex", 0, 0, &[&defaults])])
    }

    /// Returns `moof` and `mdat` of the group (8.8.4, 8.1.1).
    fn fragment(&self) -> Vec<u8> {
        let size: u64 = self.group.iter().map(|picture| picture.data.len() as u64).sum();
        // A size beyond 32 bits needs the long form of the header.
        let data_header = match u32::try_from(size + 8) {
            Ok(size) => [&words(&[size])[..], b"mdat"].concat(),
            Err(_) => [&words(&[1])[..], b"mdat", &(size + 16).to_be_bytes()].concat(),
        };
        // The data offset does not change the size of the header, so compute the size first.
        let length = self.fragment_header(0).len() + data_header.len();
        let mut out = self.fragment_header(length as u32);
        out.extend(data_header);
        self.group.iter().for_each(|picture| out.extend(&picture.data));
        out
    }

    /// Returns `moof`; `offset` is the distance from its first byte to the data.
    fn fragment_header(&self, offset: u32) -> Vec<u8> {
        let number = full_atom(b"mfhd", 0, 0, &[&words(&[self.entries.len() as u32])]);
        let duration = self.ticks(self.description.period()) as u32;
        let header = full_atom(b"tfhd", 0, FRAGMENT_HEADER_FLAGS, &[&words(&[TRACK, duration])]);
        let decoding = self.group.first().map_or(0, |picture| self.ticks(picture.times.decoding));
        let time = full_atom(b"tfdt", 1, 0, &[&decoding.to_be_bytes()]);

        let mut run = words(&[self.group.len() as u32, offset]); // sample_count, data_offset
        for picture in &self.group {
            let wait = picture.times.presentation.saturating_sub(picture.times.decoding);
            // sample_size, sample_flags, sample_composition_time_offset
            run.extend(words(&[picture.data.len() as u32, self.flags(picture), self.ticks(wait) as u32]));
        }
        let run = full_atom(b"trun", 0, RUN_FLAGS, &[&run]);
        atom(b"moof", &[&number, &atom(b"traf", &[&header, &time, &run])])
    }

    /// Returns sample_flags of a picture of the group, which contain its dependencies in both directions (8.8.3.1).
    fn flags(&self, picture: &StreamPicture) -> u32 {
        let entry = self.group.first().map_or(0, |first| first.times.presentation);
        match picture {
            StreamPicture { is_entry: true, .. } => FLAGS_ENTRY,
            StreamPicture { is_disposable: false, .. } => FLAGS_PREDICTED,
            StreamPicture { times, .. } if times.presentation < entry => {
                FLAGS_PREDICTED | FLAGS_DISPOSABLE | FLAGS_LEADING
            }
            StreamPicture { .. } => FLAGS_PREDICTED | FLAGS_DISPOSABLE,
        }
    }

    /// Returns `mfra` (8.8.9 to 8.8.11).
    fn random_access(&self) -> Vec<u8> {
        let mut table = words(&[TRACK, 0, self.entries.len() as u32]); // traf, trun and sample numbers take a byte each
        for SeekPoint { time, place } in &self.entries {
            table.extend(time.to_be_bytes());
            table.extend(place.to_be_bytes()); // moof_offset
            table.extend([1, 1, 1]); // traf_number, trun_number, sample_number
        }
        let table = full_atom(b"tfra", 1, 0, &[&table]);
        // Total size of the box: header, table, and the final box that contains this size.
        let size = 8 + table.len() as u32 + 16;
        atom(b"mfra", &[&table, &full_atom(b"mfro", 0, 0, &[&words(&[size])])])
    }

    /// Returns the timescale in Hz: the frame rate's numerator, or a thousand times this numerator.
    fn timescale(&self) -> u64 {
        match self.description.frame_rate.0 {
            numerator if numerator < TIMESCALE_LEAST => numerator * TIMESCALE_LEAST,
            numerator => numerator,
        }
    }

    /// Converts a time of the system clock to the file's units; exact for whole frame periods.
    fn ticks(&self, time: u64) -> u64 {
        (u128::from(time) * u128::from(self.timescale()) / u128::from(CLOCK)) as u64
    }
}

/// Returns a box with these contents (4.2).
fn atom(kind: &[u8; 4], contents: &[&[u8]]) -> Vec<u8> {
    let contents = contents.concat();
    [&words(&[contents.len() as u32 + 8])[..], kind, &contents].concat()
}

/// Returns a box with version and flags (4.2).
fn full_atom(kind: &[u8; 4], version: u8, flags: u32, contents: &[&[u8]]) -> Vec<u8> {
    let head = words(&[u32::from(version) << 24 | flags]);
    atom(kind, &[&head, &contents.concat()])
}

/// Returns a descriptor of fewer than 128 bytes (14496-1, 8.3.3).
fn descriptor(tag: u8, contents: &[u8]) -> Vec<u8> {
    [&[tag, contents.len() as u8], contents].concat()
}

/// Returns the big-endian bytes of 32-bit numbers.
fn words(numbers: &[u32]) -> Vec<u8> {
    numbers.iter().flat_map(|number| number.to_be_bytes()).collect()
}
