//! Elementary streams: headers of sequence, group and picture (13818-2, 6.2; 11172-2, 2.4.2).

use super::bits::{Bits, start_codes};

/// frame_rate_code 1 to 8 (13818-2, Table 6-4).
const FRAME_RATES: [(u64, u64); 8] =
    [(24_000, 1001), (24, 1), (25, 1), (30_000, 1001), (30, 1), (50, 1), (60_000, 1001), (60, 1)];

/// Values of the sequence headers.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Sequence {
    /// horizontal_size and vertical_size, with their extensions.
    pub size: (u64, u64),
    /// display_horizontal_size and display_vertical_size, if present.
    pub display: Option<(u64, u64)>,
    /// aspect_ratio_information, pel_aspect_ratio in MPEG-1.
    pub aspect: u64,
    /// Frames per second, numerator and denominator.
    pub frame_rate: (u64, u64),
    /// bit_rate \[bit/s\]; none for a variable rate in MPEG-1.
    pub bit_rate: Option<u64>,
    /// vbv_buffer_size \[bits\].
    pub buffer: u64,
    /// constrained_parameters_flag: whether the stream obeys MPEG-1's constrained parameters.
    pub constrained: bool,
    /// Whether the sequence has a sequence_extension(), as only MPEG-2 does.
    pub is_mpeg2: bool,
    /// profile_and_level_indication: profile in the upper, level in the lower four bits.
    pub profile_and_level: u64,
    /// progressive_sequence: whether all pictures are progressive frames.
    pub progressive: bool,
    /// low_delay: whether the sequence has no B pictures.
    pub low_delay: bool,
    /// matrix_coefficients, if present.
    pub matrix: Option<u64>,
}

/// Group of pictures.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Group {
    /// Hours, minutes, seconds and pictures of its time code.
    pub time_code: [u64; 4],
    /// closed_gop: whether the first B pictures need no earlier group.
    pub closed: bool,
}

/// Picture in coding order, with preceding headers.
#[derive(Clone, Debug, Default)]
pub struct Picture {
    /// Offset in the stream of the first byte of its headers.
    pub begin: usize,
    /// Offset of the byte after the last one.
    pub end: usize,
    /// Offset of the byte after picture_start_code.
    pub header: usize,
    /// picture_coding_type: 1 for I, 2 for P, 3 for B.
    pub kind: u64,
    /// temporal_reference: display index within the group, modulo 1024.
    pub temporal_reference: u64,
    /// vbv_delay \[1/90 000 s\].
    pub vbv_delay: u64,
    /// Group that starts with this picture, if any.
    pub group: Option<Group>,
    /// f_code\[s\]\[t\]; 15 without vectors.
    pub f_code: [[u64; 2]; 2],
    /// top_field_first: whether the top field is displayed first.
    pub top_field_first: bool,
    /// repeat_first_field: whether the first field is displayed again.
    pub repeat_first_field: bool,
    /// progressive_frame: whether both fields show the same time.
    pub progressive_frame: bool,
    /// Macroblock row of each slice.
    pub rows: Vec<u64>,
}

impl Picture {
    /// Size of the picture with the headers in front of it \[bits\].
    #[must_use]
    pub fn bits(&self) -> u64 {
        8 * (self.end - self.begin) as u64
    }
}

/// Headers of a whole stream.
#[derive(Clone, Debug, Default)]
pub struct Elementary {
    /// All sequence headers, including repetitions.
    pub sequences: Vec<Sequence>,
    /// Pictures in coding order.
    pub pictures: Vec<Picture>,
    /// Whether the stream ends with sequence_end_code.
    pub is_ended: bool,
}

impl Elementary {
    /// Parses a stream.
    ///
    /// # Panics
    /// If the stream does not start with a sequence header.
    #[must_use]
    pub fn read(bytes: &[u8]) -> Self {
        let mut stream = Self::default();
        let (mut begin, mut in_picture) = (0, false);
        let mut group = None;
        // Assign each header to the sequence, group or picture that it belongs to.
        for (at, code) in start_codes(bytes) {
            let mut bits = Bits::new(&bytes[at + 4..]);
            // A header after slices ends the picture.
            if in_picture && matches!(code, 0x00 | 0xb3 | 0xb7 | 0xb8) {
                stream.last().end = at;
                (begin, in_picture) = (at, false);
            }
            match code {
                0xb3 => stream.sequences.push(sequence_header(&mut bits)),
                0xb5 => stream.extension(&mut bits, in_picture),
                0xb7 => stream.is_ended = true,
                0xb8 => group = Some(group_header(&mut bits)),
                0x00 => {
                    let picture = Picture {
                        begin,
                        end: bytes.len(),
                        header: at + 4,
                        group: group.take(),
                        ..picture_header(&mut bits)
                    };
                    stream.pictures.push(picture);
                    in_picture = true;
                }
                0x01..=0xaf => {
                    // Above 2800 lines, slices have an extension of their row (6.2.4).
                    let vertical_size = stream.sequences.last().expect("a sequence header in front").size.1;
                    let above = if vertical_size > 2800 { 128 * bits.take(3) } else { 0 };
                    stream.last().rows.push(above + u64::from(code) - 1);
                }
                _ => {}
            }
        }
        stream
    }

    fn last(&mut self) -> &mut Picture {
        self.pictures.last_mut().expect("a picture header in front")
    }

    fn extension(&mut self, bits: &mut Bits, in_picture: bool) {
        let id = bits.take(4);
        // Read only one of a picture's extensions, the picture coding extension.
        if in_picture {
            if id == 8 {
                picture_coding_extension(bits, self.last());
            }
            return;
        }
        let sequence = self.sequences.last_mut().expect("a sequence header in front");
        match id {
            1 => sequence_extension(bits, sequence),
            2 => {
                // Read matrix_coefficients and the display size from the sequence_display_extension.
                bits.skip(3);
                if bits.flag() {
                    bits.skip(16);
                    sequence.matrix = Some(bits.take(8));
                }
                let width = bits.take(14);
                bits.skip(1);
                sequence.display = Some((width, bits.take(14)));
            }
            _ => {}
        }
    }

    /// Returns the display index of each picture; groups follow each other.
    #[must_use]
    pub fn display_indices(&self) -> Vec<u64> {
        let (mut first, mut in_group) = (0, 0);
        let mut indices = Vec::new();
        for picture in &self.pictures {
            if picture.group.is_some() {
                first += in_group;
                in_group = 0;
            }
            in_group += 1;
            indices.push(first + picture.temporal_reference);
        }
        indices
    }

    /// Returns the display time of each picture in fields, by display index: two fields, or three with repeat_first_field.
    #[must_use]
    pub fn fields(&self) -> Vec<u64> {
        let mut fields = vec![2; self.pictures.len()];
        for (index, picture) in self.display_indices().into_iter().zip(&self.pictures) {
            if picture.repeat_first_field
                && let Some(fields) = fields.get_mut(index as usize)
            {
                *fields = 3;
            }
        }
        fields
    }
}

fn sequence_header(bits: &mut Bits) -> Sequence {
    let size = (bits.take(12), bits.take(12));
    let (aspect, rate) = (bits.take(4), bits.take(4));
    let bit_rate = bits.take(18);
    bits.skip(1);
    let buffer = bits.take(10);
    Sequence {
        size,
        aspect,
        frame_rate: FRAME_RATES.get((rate as usize).wrapping_sub(1)).copied().unwrap_or((0, 1)),
        bit_rate: (bit_rate != 0x3_ffff).then_some(400 * bit_rate),
        buffer: 16_384 * buffer,
        constrained: bits.flag(),
        progressive: true,
        ..Sequence::default()
    }
}

fn sequence_extension(bits: &mut Bits, sequence: &mut Sequence) {
    sequence.is_mpeg2 = true;
    sequence.profile_and_level = bits.take(8);
    sequence.progressive = bits.flag();
    assert_eq!(bits.take(2), 1, "chroma_format: 4:2:0");
    sequence.size.0 += bits.take(2) << 12;
    sequence.size.1 += bits.take(2) << 12;
    // Add the upper bits of bit_rate, which start at bit 18.
    let low = sequence.bit_rate.unwrap_or(400 * 0x3_ffff) / 400;
    sequence.bit_rate = Some(400 * (low | bits.take(12) << 18));
    bits.skip(1);
    sequence.buffer += 16_384 * (bits.take(8) << 10);
    sequence.low_delay = bits.flag();
    let (n, d) = (bits.take(2), bits.take(5));
    sequence.frame_rate = (sequence.frame_rate.0 * (n + 1), sequence.frame_rate.1 * (d + 1));
}

fn group_header(bits: &mut Bits) -> Group {
    bits.skip(1);
    let (hours, minutes) = (bits.take(5), bits.take(6));
    bits.skip(1);
    Group { time_code: [hours, minutes, bits.take(6), bits.take(6)], closed: bits.flag() }
}

fn picture_header(bits: &mut Bits) -> Picture {
    let (temporal_reference, kind, vbv_delay) = (bits.take(10), bits.take(3), bits.take(16));
    let mut f_code = [[15; 2]; 2];
    for f_code in f_code.iter_mut().take(kind as usize - 1) {
        bits.skip(1); // full_pel_forward_vector, full_pel_backward_vector
        *f_code = [bits.take(3); 2];
    }
    Picture { temporal_reference, kind, vbv_delay, f_code, progressive_frame: true, ..Picture::default() }
}

fn picture_coding_extension(bits: &mut Bits, picture: &mut Picture) {
    for f_code in picture.f_code.iter_mut().flatten() {
        *f_code = bits.take(4);
    }
    bits.skip(2); // intra_dc_precision
    assert_eq!(bits.take(2), 3, "picture_structure: a frame");
    picture.top_field_first = bits.flag();
    bits.skip(5);
    picture.repeat_first_field = bits.flag();
    bits.skip(1);
    picture.progressive_frame = bits.flag();
}
