//! Headers of sequence, group and picture (6.2.2, 6.2.3).

use crate::PictureType;
use crate::{
    Config, Level, Rate, Standard,
    bits::{BitSink, BitWriter},
    config::coded_size,
    level::Limits,
    pulldown::{ShownFields, fields_before},
    quant::QuantiserParameters,
};
use mpeg2::scan::ZIGZAG;
use plane::matrices::{DEFAULT_INTRA_MATRIX, DEFAULT_NON_INTRA_MATRIX};

pub(crate) const PICTURE_START_CODE: u8 = 0x00;
pub(crate) const SEQUENCE_HEADER_CODE: u8 = 0xb3;
const USER_DATA_START_CODE: u8 = 0xb2;
const EXTENSION_START_CODE: u8 = 0xb5;
pub(crate) const SEQUENCE_END_CODE: u8 = 0xb7;
pub(crate) const GROUP_START_CODE: u8 = 0xb8;

const SEQUENCE_EXTENSION_ID: u32 = 1;
const SEQUENCE_DISPLAY_EXTENSION_ID: u32 = 2;
const PICTURE_CODING_EXTENSION_ID: u32 = 8;

/// vbv_delay of a stream with a variable bit rate (6.3.9).
pub(crate) const VBV_DELAY_VARIABLE: u32 = 0xffff;
/// bit_rate of an MPEG-1 stream with a variable bit rate (11172-2, 2.4.3.2).
const BIT_RATE_VARIABLE: u32 = 0x3_ffff;
/// f_code of an unused vector (6.3.10).
const F_CODE_UNUSED: u32 = 15;

/// Contents of the headers of one picture.
#[derive(Clone, Copy)]
pub(crate) struct PictureHeader {
    pub picture_type: PictureType,
    /// Position in the group of pictures, in display order.
    pub temporal_reference: u32,
    /// vbv_delay in units of 1/90000 s, or [`VBV_DELAY_VARIABLE`].
    pub vbv_delay: u32,
    /// f_code\[s\]\[t\]: forward and backward, horizontal and vertical reach of vectors.
    pub f_code: [[u32; 2]; 2],
    pub quantisers: QuantiserParameters,
    /// Displayed fields of a picture with pulldown.
    pub shown: Option<ShownFields>,
}

/// Writes sequence_header(), sequence_extension() and sequence_display_extension() (6.2.2.1, 6.2.2.3, 6.2.2.4). MPEG-1 has only
/// sequence_header() (11172-2, 2.4.2.3).
pub(crate) fn put_sequence_header(writer: &mut BitWriter, config: &Config) {
    let (horizontal_size, vertical_size) = config.coded_size();
    let limits = config.level().limits();
    let (bit_rate, vbv_buffer_size) = config.stated_rate();

    // MPEG-1 has a code for variable rates, and only 10 bits for the buffer size.
    let (bit_rate, vbv_buffer_size) = match (config.standard, config.rate) {
        (Standard::Mpeg2, _) => (bit_rate, vbv_buffer_size),
        (Standard::Mpeg1, Rate::Constant { .. }) => (bit_rate, vbv_buffer_size.min(0x3ff)),
        (Standard::Mpeg1, _) => (BIT_RATE_VARIABLE, vbv_buffer_size.min(0x3ff)),
    };
    writer.start_code(SEQUENCE_HEADER_CODE);
    writer.put(horizontal_size & 0xfff, 12); // horizontal_size_value
    writer.put(vertical_size & 0xfff, 12); // vertical_size_value
    // Validation has refused settings without a code.
    let aspect = config.aspect.code(config.standard, config.width, config.height).unwrap_or(1);
    writer.put(aspect, 4); // aspect_ratio_information; pel_aspect_ratio in MPEG-1
    writer.put(config.stated_frame_rate().code().into(), 4); // frame_rate_code
    writer.put(bit_rate & 0x3_ffff, 18); // bit_rate_value
    writer.put(1, 1); // marker_bit
    writer.put(vbv_buffer_size & 0x3ff, 10); // vbv_buffer_size_value
    writer.put(0, 1); // constrained_parameters_flag
    // The standard's default matrices are not written.
    for (matrix, default) in
        [(&config.intra_matrix, &DEFAULT_INTRA_MATRIX), (&config.non_intra_matrix, &DEFAULT_NON_INTRA_MATRIX)]
    {
        writer.put((matrix != default).into(), 1); // load_intra_quantiser_matrix, load_non_intra_quantiser_matrix
        if matrix != default {
            for raster in ZIGZAG {
                writer.put(matrix[raster].into(), 8); // in zig-zag order for both scans (6.3.11)
            }
        }
    }

    if config.standard == Standard::Mpeg1 {
        return;
    }
    // MPEG-2 stores the high bits of sizes and rates in the extension.
    writer.start_code(EXTENSION_START_CODE);
    writer.put(SEQUENCE_EXTENSION_ID, 4); // extension_start_code_identifier
    writer.put(profile_and_level(config.intra_dc_precision, limits), 8);
    writer.put((!config.pulldown).into(), 1); // progressive_sequence
    writer.put(1, 2); // chroma_format: 4:2:0
    writer.put(horizontal_size >> 12, 2); // horizontal_size_extension
    writer.put(vertical_size >> 12, 2); // vertical_size_extension
    writer.put(bit_rate >> 18, 12); // bit_rate_extension
    writer.put(1, 1); // marker_bit
    writer.put(vbv_buffer_size >> 10, 8); // vbv_buffer_size_extension
    writer.put((config.b_pictures == 0).into(), 1); // low_delay: no B pictures
    writer.put(0, 2); // frame_rate_extension_n
    writer.put(0, 5); // frame_rate_extension_d

    // Write the color description and the display size.
    writer.start_code(EXTENSION_START_CODE);
    writer.put(SEQUENCE_DISPLAY_EXTENSION_ID, 4); // extension_start_code_identifier
    writer.put(5, 3); // video_format: unspecified
    writer.put(1, 1); // colour_description
    writer.put(config.color.primaries.code().into(), 8); // colour_primaries
    writer.put(config.color.transfer.code().into(), 8); // transfer_characteristics
    writer.put(config.color.matrix.code().into(), 8); // matrix_coefficients
    writer.put(config.width as u32, 14); // display_horizontal_size
    writer.put(1, 1); // marker_bit
    writer.put(config.height as u32, 14); // display_vertical_size
}

/// Writes group_of_pictures_header() (6.2.2.6); `number` is the index of the group's first picture in display order.
///
/// A group that is not `closed` begins with B pictures that depend on the previous group.
pub(crate) fn put_group_header(writer: &mut BitWriter, config: &Config, number: u64, closed: bool) {
    let per_second = config.stated_frame_rate().fps().round() as u64;
    // With pulldown, time codes count displayed frames.
    let number = if config.pulldown { fields_before(number, config.reorder()) / 2 } else { number };
    let seconds = number / per_second;
    writer.start_code(GROUP_START_CODE);
    writer.put(0, 1); // time_code: drop_frame_flag
    writer.put((seconds / 3600 % 24) as u32, 5); // time_code_hours
    writer.put((seconds / 60 % 60) as u32, 6); // time_code_minutes
    writer.put(1, 1); // marker_bit
    writer.put((seconds % 60) as u32, 6); // time_code_seconds
    writer.put((number % per_second) as u32, 6); // time_code_pictures
    writer.put(closed.into(), 1); // closed_gop
    writer.put(0, 1); // broken_link
}

/// Writes picture_header() and picture_coding_extension() (6.2.3, 6.2.3.1). MPEG-1 has only picture_header() (11172-2, 2.4.2.5).
pub(crate) fn put_picture_header(writer: &mut BitWriter, picture: &PictureHeader) {
    writer.start_code(PICTURE_START_CODE);
    writer.put(picture.temporal_reference, 10); // temporal_reference
    writer.put(picture.picture_type as u32, 3); // picture_coding_type
    writer.put(picture.vbv_delay, 16); // vbv_delay
    let is_mpeg1 = picture.quantisers.standard == Standard::Mpeg1;
    // In MPEG-2 the extension contains f_code.
    let f_code = |s: usize| if is_mpeg1 { picture.f_code[s][0] } else { 7 };
    if picture.picture_type != PictureType::I {
        writer.put(0, 1); // full_pel_forward_vector
        writer.put(f_code(0), 3); // forward_f_code
    }
    if picture.picture_type == PictureType::B {
        writer.put(0, 1); // full_pel_backward_vector
        writer.put(f_code(1), 3); // backward_f_code
    }
    writer.put(0, 1); // extra_bit_picture
    if is_mpeg1 {
        return;
    }

    // The extension contains the coding tools and the displayed fields.
    writer.start_code(EXTENSION_START_CODE);
    writer.put(PICTURE_CODING_EXTENSION_ID, 4); // extension_start_code_identifier
    for (s, used) in
        [picture.picture_type != PictureType::I, picture.picture_type == PictureType::B].into_iter().enumerate()
    {
        for f_code in picture.f_code[s] {
            writer.put(if used { f_code } else { F_CODE_UNUSED }, 4); // f_code[s][t]
        }
    }
    writer.put(picture.quantisers.intra_dc_precision - 8, 2); // intra_dc_precision
    writer.put(3, 2); // picture_structure: frame picture
    let shown = picture.shown.unwrap_or_default();
    writer.put(shown.top_field_first.into(), 1); // top_field_first
    writer.put(1, 1); // frame_pred_frame_dct
    writer.put(0, 1); // concealment_motion_vectors
    writer.put(picture.quantisers.q_scale_type.into(), 1); // q_scale_type
    writer.put(picture.quantisers.intra_table as u32, 1); // intra_vlc_format
    writer.put(picture.quantisers.alternate_scan.into(), 1); // alternate_scan
    writer.put(shown.repeat_first_field.into(), 1); // repeat_first_field
    writer.put(1, 1); // chroma_420_type: the same as progressive_frame
    writer.put(1, 1); // progressive_frame
    writer.put(0, 1); // composite_display_flag
}

/// Returns user_data() (6.2.2.2.2) of `bytes` bytes including its start code, at least 4. It pads a picture that is too small.
pub(crate) fn filling(bytes: usize) -> Vec<u8> {
    let mut writer = BitWriter::default();
    writer.start_code(USER_DATA_START_CODE);
    let mut data = writer.into_bytes();
    data.resize(bytes.max(data.len()), 0xff); // without 23 consecutive zero bits
    data
}

/// Writes the beginning of slice() in macroblock row `row` (6.2.4).
pub(crate) fn put_slice_header(writer: &mut BitWriter, row: usize, height: usize, quantiser_scale_code: u8) {
    if coded_size(height) > 2800 {
        writer.start_code((row % 128 + 1) as u8); // slice_start_code: slice_vertical_position
        writer.put((row / 128) as u32, 3); // slice_vertical_position_extension
    } else {
        writer.start_code((row + 1) as u8);
    }
    writer.put(quantiser_scale_code.into(), 5); // quantiser_scale_code
    writer.put(0, 1); // extra_bit_slice
}

/// Writes sequence_end_code (6.2.2).
pub(crate) fn put_sequence_end(writer: &mut BitWriter) {
    writer.start_code(SEQUENCE_END_CODE);
}
/// Returns profile_and_level_indication (clause 8): Main Profile, or High Profile for an intra DC of 11 bits, which has no Low
/// Level.
fn profile_and_level(intra_dc_precision: u32, limits: &Limits) -> u32 {
    match intra_dc_precision {
        11 => 0b0001 << 4 | limits.level_indication.min(Level::Main.limits().level_indication),
        _ => 0b0100 << 4 | limits.level_indication,
    }
}
