//! Random streams: headers, pictures and slices.

use super::{
    macroblock::{MacroblockWriter, Type},
    syntax::Writer,
};
use fastrand::Rng;

/// Columns of macroblocks.
pub const COLUMNS: usize = 5;
/// Rows of macroblocks of a frame.
pub const ROWS: usize = 4;
/// Frames of a stream.
pub const PICTURES: usize = 7;
/// f_code of all vectors.
pub const F_CODE: [u32; 2] = [2, 3];

/// Syntax that a stream uses.
#[derive(Clone, Copy)]
pub struct Features {
    pub mpeg1: bool,
    pub full_pel: bool,
    pub interlaced: bool,
    pub field_pictures: bool,
    pub bottom_first: bool,
    pub concealment: bool,
    /// Alternate scan, intra_vlc_format and q_scale_type.
    pub alternate: bool,
    /// intra_dc_precision.
    pub dc_precision: u32,
    /// chroma_format.
    pub chroma: u32,
    pub matrices: bool,
}

impl Default for Features {
    fn default() -> Self {
        Self {
            mpeg1: false,
            full_pel: false,
            interlaced: false,
            field_pictures: false,
            bottom_first: false,
            concealment: false,
            alternate: false,
            dc_precision: 0,
            chroma: 1,
            matrices: false,
        }
    }
}

/// A coded picture: a frame, or a field if it has a parity.
#[derive(Clone, Copy)]
pub struct CodedPicture {
    pub features: Features,
    pub kind: Type,
    pub parity: Option<usize>,
}

impl CodedPicture {
    pub fn rows(&self) -> usize {
        if self.parity.is_some() { ROWS / 2 } else { ROWS }
    }

    /// Returns f_code of both components; MPEG-1 has one for both.
    pub fn f_code(&self) -> [u32; 2] {
        if self.features.mpeg1 { [F_CODE[0]; 2] } else { F_CODE }
    }
}

/// Returns a random stream with these features.
pub fn random_stream(features: Features, seed: u64) -> Vec<u8> {
    let (mut writer, mut random) = (Writer::default(), Rng::with_seed(seed));
    sequence_header(&mut writer, features);
    writer.start_code(0xb8);
    writer.put(1 << 12, 25); // time_code with its marker bit
    writer.put(2, 2); // closed_gop
    let frames = [(0, Type::I), (2, Type::P), (1, Type::B), (3, Type::I), (6, Type::P), (4, Type::B), (5, Type::B)];
    for (reference, kind) in frames {
        let picture = CodedPicture { features, kind, parity: None };
        if features.field_pictures {
            let first = usize::from(features.bottom_first);
            coded_picture(&mut writer, &mut random, CodedPicture { parity: Some(first), ..picture }, reference);
            // The second field of an I frame may be predicted, also from the previous frame.
            let kind = if kind == Type::I && reference > 0 { Type::P } else { kind };
            let second = CodedPicture { parity: Some(1 - first), kind, ..picture };
            coded_picture(&mut writer, &mut random, second, reference);
        } else {
            coded_picture(&mut writer, &mut random, picture, reference);
        }
    }
    writer.start_code(0xb7);
    writer.bytes
}

pub fn sequence_header(writer: &mut Writer, features: Features) {
    writer.start_code(0xb3);
    writer.put(16 * COLUMNS as u32, 12);
    writer.put(16 * ROWS as u32, 12);
    writer.put(0x13, 8); // square samples, 25 Hz
    writer.put(0x3ffff, 18);
    writer.put(1, 1);
    writer.put(112 << 1, 11);
    let load = |writer: &mut Writer, weight: u32| {
        writer.put(1, 1);
        (0..64).for_each(|i| writer.put(if i == 0 { 8 } else { weight + i / 2 }, 8));
    };
    if features.matrices {
        load(writer, 12);
        load(writer, 14);
    } else {
        writer.put(0, 2);
    }
    if features.mpeg1 {
        return;
    }
    writer.start_code(0xb5);
    writer.put(1, 4);
    writer.put(if features.chroma == 1 { 0x44 } else { 0x82 }, 8); // Main, or 4:2:2 profile
    writer.put(u32::from(!features.interlaced), 1);
    writer.put(features.chroma, 2);
    writer.put(0, 2 + 2 + 12);
    writer.put(1, 1);
    writer.put(0, 8 + 1 + 2 + 5);
}

/// Writes the headers and slices of a picture.
fn coded_picture(writer: &mut Writer, random: &mut Rng, picture: CodedPicture, reference: u32) {
    let (features, kind) = (picture.features, picture.kind);
    writer.start_code(0);
    writer.put(reference, 10);
    writer.put(kind as u32 + 1, 3);
    writer.put(0xffff, 16);
    for _ in 0..kind as u32 {
        writer.put(if features.mpeg1 { u32::from(features.full_pel) << 3 | F_CODE[0] } else { 7 }, 4);
    }
    writer.put(0, 1);
    if !features.mpeg1 {
        writer.start_code(0xb5);
        writer.put(8, 4);
        for direction in 0..2 {
            let is_used = direction < kind as u32 || direction == 0 && features.concealment;
            F_CODE.iter().for_each(|&f_code| writer.put(if is_used { f_code } else { 15 }, 4));
        }
        writer.put(features.dc_precision, 2);
        writer.put(picture.parity.map_or(3, |parity| parity as u32 + 1), 2);
        let is_top_first = features.interlaced && picture.parity.is_none() && !features.bottom_first;
        let is_plain = !features.interlaced;
        let alternate = features.alternate;
        for flag in [is_top_first, is_plain, features.concealment, alternate, alternate, alternate, false] {
            writer.put(u32::from(flag), 1);
        }
        writer.put(u32::from(is_plain), 1); // chroma_420_type
        writer.put(u32::from(is_plain), 1); // progressive_frame
        writer.put(0, 1);
        if features.matrices {
            // Other matrices for chroma.
            writer.start_code(0xb5);
            writer.put(3, 4);
            writer.put(0, 2);
            for weight in [10, 20] {
                writer.put(1, 1);
                (0..64).for_each(|i| writer.put(if i == 0 { 8 } else { weight + i / 3 }, 8));
            }
        }
    }
    for row in 0..picture.rows() {
        // A row has one or two slices.
        let middle = if random.bool() { COLUMNS } else { random.usize(1..COLUMNS) };
        slice(writer, random, picture, [row, 0, middle]);
        if middle < COLUMNS {
            slice(writer, random, picture, [row, middle, COLUMNS]);
        }
    }
}

/// Writes the slice of a row from one column to another.
fn slice(writer: &mut Writer, random: &mut Rng, picture: CodedPicture, [row, first, end]: [usize; 3]) {
    writer.start_code(row as u8 + 1);
    writer.put(random.u32(1..5), 5);
    writer.put(0, 1);
    let mut macroblocks = MacroblockWriter::new(picture);
    let mut increment = first + 1;
    for column in first..end {
        let may_skip = column > first && column + 1 < end && random.u32(0..4) == 0;
        if may_skip && macroblocks.skip([column, row]) {
            increment += 1;
            continue;
        }
        writer.increment(increment);
        macroblocks.write(writer, random, [column, row]);
        increment = 1;
    }
}
