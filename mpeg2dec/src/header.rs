//! Picture headers and picture coding extensions (6.2.3).

use crate::bits::BitReader;
use plane::PictureType;

/// Part of a frame that a coded picture contains (Table 6-14).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum PictureStructure {
    /// A field: the even lines if the parity is 0, the odd lines if it is 1.
    Field {
        parity: usize,
    },
    Frame,
}

/// Parameters of a coded picture.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CodedHeader {
    pub temporal_reference: u16,
    /// Picture type. D pictures are I pictures whose blocks have only DC coefficients.
    pub kind: PictureType,
    /// Whether the picture is a D picture of MPEG-1 (11172-2, 2.4.3.4).
    pub is_dc_only: bool,
    /// Whether forward and backward vectors are in whole samples (MPEG-1).
    pub full_pel: [bool; 2],
    /// f_code by direction and component.
    pub f_code: [[u32; 2]; 2],
    /// Binary logarithm of intra_dc_mult.
    pub dc_shift: u32,
    pub structure: PictureStructure,
    pub top_field_first: bool,
    pub frame_pred_frame_dct: bool,
    pub concealment_motion_vectors: bool,
    pub q_scale_type: bool,
    pub intra_vlc_format: bool,
    pub alternate_scan: bool,
    pub repeat_first_field: bool,
    pub progressive_frame: bool,
}

impl CodedHeader {
    /// Reads a picture header. `None` if the picture type is not I, P, B or D.
    pub fn read(bits: &mut BitReader) -> Option<Self> {
        let temporal_reference = bits.read(10) as u16;
        let code = bits.read(3);
        let kind = match code {
            1 | 4 => PictureType::I,
            2 => PictureType::P,
            3 => PictureType::B,
            _ => return None,
        };
        bits.read(16); // vbv_delay
        let (mut full_pel, mut f_code) = ([false; 2], [[1; 2]; 2]);
        let directions = kind as usize - 1;
        for direction in 0..directions {
            full_pel[direction] = bits.flag();
            f_code[direction] = [bits.read(3).max(1); 2];
        }
        Some(Self {
            temporal_reference,
            kind,
            is_dc_only: code == 4,
            full_pel,
            f_code,
            dc_shift: 3,
            structure: PictureStructure::Frame,
            top_field_first: false,
            frame_pred_frame_dct: true,
            concealment_motion_vectors: false,
            q_scale_type: false,
            intra_vlc_format: false,
            alternate_scan: false,
            repeat_first_field: false,
            progressive_frame: true,
        })
    }

    /// Reads a picture coding extension, after its identifier (6.2.3.1).
    pub fn extend(&mut self, bits: &mut BitReader) {
        self.full_pel = [false; 2];
        for direction in &mut self.f_code {
            // f_code 15 marks unused vectors; 0 is forbidden.
            *direction = std::array::from_fn(|_| bits.read(4).clamp(1, 15));
        }
        self.dc_shift = 3 - bits.read(2);
        self.structure = match bits.read(2) {
            1 => PictureStructure::Field { parity: 0 },
            2 => PictureStructure::Field { parity: 1 },
            _ => PictureStructure::Frame,
        };
        for flag in [
            &mut self.top_field_first,
            &mut self.frame_pred_frame_dct,
            &mut self.concealment_motion_vectors,
            &mut self.q_scale_type,
            &mut self.intra_vlc_format,
            &mut self.alternate_scan,
            &mut self.repeat_first_field,
        ] {
            *flag = bits.flag();
        }
        bits.read(1); // chroma_420_type
        self.progressive_frame = bits.flag();
    }
}
