//! Decoding tables, built from the code tables of the standard.

use crate::bits::BitReader;
use mpeg2::{
    Vlc,
    tables::{
        B_INTRA, B_INTRA_QUANT, B_MOTION, B_MOTION_CODED, B_MOTION_CODED_QUANT, CODED_BLOCK_PATTERN,
        DCT_DC_SIZE_CHROMINANCE, DCT_DC_SIZE_LUMINANCE, I_INTRA, I_INTRA_QUANT, MACROBLOCK_ADDRESS_INCREMENT,
        MACROBLOCK_ESCAPE, MOTION_CODE, P_CODED, P_CODED_QUANT, P_INTRA, P_INTRA_QUANT, P_MOTION, P_MOTION_CODED,
        P_MOTION_CODED_QUANT, vlc,
    },
};

/// Error of data that no valid stream contains.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Invalid;

/// Symbol of the codes that begin with the bits of its index. The length is 0 where no code exists.
#[derive(Clone, Copy)]
struct Symbol {
    value: u8,
    length: u8,
}

/// Decoding table with an entry for each value of the first bits; N is a power of two.
pub(crate) struct Lookup<const N: usize>([Symbol; N]);

impl<const N: usize> Lookup<N> {
    const EMPTY: Self = Self([Symbol { value: 0, length: 0 }; N]);

    /// Returns the table with one more code.
    const fn with(mut self, vlc: Vlc, value: u8) -> Self {
        let free = N.ilog2() - vlc.length;
        let (mut i, end) = ((vlc.code as usize) << free, (vlc.code as usize + 1) << free);
        while i < end {
            self.0[i] = Symbol { value, length: vlc.length as u8 };
            i += 1;
        }
        self
    }

    /// Returns the table with the codes of a list, with values from `first` on.
    const fn with_list(mut self, list: &[Vlc], first: u8) -> Self {
        let mut i = 0;
        while i < list.len() {
            self = self.with(list[i], first + i as u8);
            i += 1;
        }
        self
    }

    /// Consumes a code of loaded bits and returns its value.
    #[inline(always)]
    pub fn take(&self, bits: &mut BitReader) -> Result<u8, Invalid> {
        let symbol = self.0[(bits.window() >> (64 - N.ilog2())) as usize % N];
        bits.skip(symbol.length.into());
        if symbol.length == 0 { Err(Invalid) } else { Ok(symbol.value) }
    }
}

/// Value of macroblock_escape in [`INCREMENT`].
pub(crate) const ESCAPE_VALUE: u8 = 0;
/// Value of macroblock_stuffing of MPEG-1 in [`INCREMENT`] (11172-2, Annex B).
pub(crate) const STUFFING_VALUE: u8 = 34;
/// Table B.1: macroblock_address_increment.
pub(crate) static INCREMENT: Lookup<2048> = Lookup::EMPTY
    .with_list(&MACROBLOCK_ADDRESS_INCREMENT, 1)
    .with(MACROBLOCK_ESCAPE, ESCAPE_VALUE)
    .with(vlc("0000 0001 111"), STUFFING_VALUE);

/// Flag of macroblock types with quantiser_scale_code.
pub(crate) const QUANT: u8 = 1;
/// Flag of macroblock types with forward vectors.
pub(crate) const FORWARD: u8 = 2;
/// Flag of macroblock types with backward vectors.
pub(crate) const BACKWARD: u8 = 4;
/// Flag of macroblock types with coded_block_pattern.
pub(crate) const PATTERN: u8 = 8;
/// Flag of intra macroblock types.
pub(crate) const INTRA: u8 = 16;

/// Tables B.2 to B.4: macroblock_type in I, P and B pictures, as flags.
pub(crate) static MACROBLOCK_TYPES: [Lookup<64>; 3] = [
    Lookup::EMPTY.with(I_INTRA, INTRA).with(I_INTRA_QUANT, INTRA | QUANT),
    Lookup::EMPTY
        .with(P_MOTION_CODED, FORWARD | PATTERN)
        .with(P_CODED, PATTERN)
        .with(P_MOTION, FORWARD)
        .with(P_INTRA, INTRA)
        .with(P_MOTION_CODED_QUANT, FORWARD | PATTERN | QUANT)
        .with(P_CODED_QUANT, PATTERN | QUANT)
        .with(P_INTRA_QUANT, INTRA | QUANT),
    b_types(),
];

const fn b_types() -> Lookup<64> {
    let mut table = Lookup::EMPTY.with(B_INTRA, INTRA).with(B_INTRA_QUANT, INTRA | QUANT);
    let directions = [FORWARD, BACKWARD, FORWARD | BACKWARD];
    let mut i = 0;
    while i < 3 {
        table = table
            .with(B_MOTION[i], directions[i])
            .with(B_MOTION_CODED[i], directions[i] | PATTERN)
            .with(B_MOTION_CODED_QUANT[i], directions[i] | PATTERN | QUANT);
        i += 1;
    }
    table
}

/// Table B.9: coded_block_pattern.
pub(crate) static PATTERNS: Lookup<512> = Lookup::EMPTY.with_list(&CODED_BLOCK_PATTERN, 0);
/// Table B.10: motion_code without its sign.
pub(crate) static MOTION: Lookup<1024> = Lookup::EMPTY.with_list(&MOTION_CODE, 0);
/// Table B.12: dct_dc_size of luma.
pub(crate) static LUMA_DC_SIZE: Lookup<512> = Lookup::EMPTY.with_list(&DCT_DC_SIZE_LUMINANCE, 0);
/// Table B.13: dct_dc_size of chroma.
pub(crate) static CHROMA_DC_SIZE: Lookup<1024> = Lookup::EMPTY.with_list(&DCT_DC_SIZE_CHROMINANCE, 0);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_are_found_again() {
        for (value, code) in MOTION_CODE.iter().enumerate() {
            let bytes = (code.code << (32 - code.length)).to_be_bytes();
            assert_eq!(MOTION.take(&mut BitReader::new(&bytes)), Ok(value as u8));
        }
        assert_eq!(MOTION.take(&mut BitReader::new(&[0; 8])), Err(Invalid));
        assert_eq!(MACROBLOCK_TYPES[2].take(&mut BitReader::new(&[0xc0])), Ok(FORWARD | BACKWARD | PATTERN));
    }
}
