//! Variable-length codes of the syntax elements (clause 7.2, Annex B).

use crate::{
    Standard,
    bits::BitSink,
    block::{Block, places},
};
use mpeg2::Vlc;
pub(crate) use mpeg2::tables::{
    B_INTRA, B_INTRA_QUANT, B_MOTION, B_MOTION_CODED, B_MOTION_CODED_QUANT, CODED_BLOCK_PATTERN, I_INTRA,
    I_INTRA_QUANT, P_CODED, P_CODED_QUANT, P_INTRA, P_INTRA_QUANT, P_MOTION, P_MOTION_CODED, P_MOTION_CODED_QUANT,
};
use mpeg2::tables::{
    DCT_COEFFICIENTS, DCT_DC_SIZE_CHROMINANCE, DCT_DC_SIZE_LUMINANCE, END_OF_BLOCK, ESCAPE, FIRST_COEFFICIENT_ONE,
    LEVELS, MACROBLOCK_ADDRESS_INCREMENT, MACROBLOCK_ESCAPE, MOTION_CODE, RUNS,
};

/// Code table of a block's coefficients (Table 7-3).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum CoefficientTable {
    /// Table B.14.
    Zero = 0,
    /// Table B.15: shorter codes for the larger levels of intra blocks.
    One = 1,
}

/// Codes of the coefficients of a block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Codes {
    pub table: CoefficientTable,
    /// Standard that determines the escape coding of levels.
    pub standard: Standard,
}

/// Returns the bits of an escape-coded coefficient. They are the escape code, a run of 6 bits, and the level. The level has 12
/// bits (7.2.2.3), or 8 or 16 bits in MPEG-1 (11172-2, Annex B).
const fn escape_bits(standard: Standard, level: u32) -> u32 {
    ESCAPE.length
        + 6
        + match standard {
            Standard::Mpeg2 => 12,
            Standard::Mpeg1 if level < 128 => 8,
            Standard::Mpeg1 => 16,
        }
}

/// Writes one macroblock_escape per 33 excess macroblocks, then macroblock_address_increment (6.2.5, 6.3.17).
pub(crate) fn put_macroblock_address_increment(sink: &mut impl BitSink, mut increment: usize) {
    while increment > 33 {
        sink.put_code(MACROBLOCK_ESCAPE);
        increment -= 33;
    }
    sink.put_code(MACROBLOCK_ADDRESS_INCREMENT[increment - 1]);
}

/// Writes motion_code and motion_residual of one vector component (6.2.5.2.1, 7.6.3.1).
///
/// `delta` is the vector minus its prediction in half samples; this function wraps it to the range of `f_code`.
pub(crate) fn put_motion_component(sink: &mut impl BitSink, delta: i32, f_code: u32) {
    let r_size = f_code - 1;
    let f = 1 << r_size;
    let (low, high, range) = (-16 * f, 16 * f - 1, 32 * f);
    // Wrap the difference, because decoders add it modulo the range.
    let delta = if delta < low {
        delta + range
    } else if delta > high {
        delta - range
    } else {
        delta
    };
    debug_assert!((low..=high).contains(&delta), "vector difference {delta} does not fit f_code {f_code}");
    if delta == 0 {
        return sink.put_code(MOTION_CODE[0]);
    }
    // motion_code contains the sign and the high bits; motion_residual contains the low bits.
    let before = delta.unsigned_abs() - 1;
    sink.put_code(MOTION_CODE[(before >> r_size) as usize + 1].signed(delta < 0));
    if r_size > 0 {
        sink.put(before & (f as u32 - 1), r_size); // motion_residual
    }
}

/// Writes dct_dc_size and dct_dc_differential (6.2.6, 7.2.1).
fn put_dc(sink: &mut impl BitSink, differential: i32, luminance: bool) {
    let size = 32 - differential.unsigned_abs().leading_zeros();
    let table = if luminance { &DCT_DC_SIZE_LUMINANCE } else { &DCT_DC_SIZE_CHROMINANCE };
    sink.put_code(table[size as usize]);
    if size > 0 {
        // Negative differences are coded as their ones' complement (7.2.1).
        let value = if differential > 0 { differential } else { differential + (1 << size) - 1 };
        sink.put(value as u32, size);
    }
}

/// Returns the code of a coefficient without its sign; [`Vlc::NONE`] if it needs an escape.
#[inline]
fn coefficient_code(table: CoefficientTable, run: usize, level: u32) -> Vlc {
    if run < RUNS && (level as usize) < LEVELS {
        DCT_COEFFICIENTS[table as usize][run][level as usize]
    } else {
        Vlc::NONE
    }
}

/// Number of bits by standard, table, run and level, including the sign.
static COEFFICIENT_BITS: [[[[u8; LEVELS]; 64]; 2]; 2] =
    [all_coefficient_bits(Standard::Mpeg1), all_coefficient_bits(Standard::Mpeg2)];

const fn all_coefficient_bits(standard: Standard) -> [[[u8; LEVELS]; 64]; 2] {
    const { assert!(LEVELS < 128, "levels in the table have escapes of equal length") };
    // Begin with escapes, and replace the entries that have a code.
    let mut bits = [[[escape_bits(standard, 1) as u8; LEVELS]; 64]; 2];
    let mut table = 0;
    while table < 2 {
        let mut run = 0;
        while run < RUNS {
            let mut level = 0;
            while level < LEVELS {
                if DCT_COEFFICIENTS[table][run][level].length > 0 {
                    bits[table][run][level] = DCT_COEFFICIENTS[table][run][level].length as u8 + 1;
                }
                level += 1;
            }
            run += 1;
        }
        table += 1;
    }
    bits
}

/// Returns the number of bits of a coefficient, except the first one of a non-intra block.
#[inline]
pub(crate) fn coefficient_bits(codes: Codes, run: usize, level: u32) -> u32 {
    if (level as usize) < LEVELS {
        COEFFICIENT_BITS[codes.standard as usize][codes.table as usize][run % 64][level as usize].into()
    } else {
        escape_bits(codes.standard, level)
    }
}

/// Returns the number of bits of the first coefficient of a non-intra block.
#[inline]
pub(crate) fn first_coefficient_bits(codes: Codes, run: usize, level: u32) -> u32 {
    if run == 0 && level == 1 { FIRST_COEFFICIENT_ONE.length + 1 } else { coefficient_bits(codes, run, level) }
}

/// Returns the number of bits of End of block.
#[inline]
pub(crate) fn end_of_block_bits(codes: Codes) -> u32 {
    END_OF_BLOCK[codes.table as usize].length
}

/// Writes one run and level (7.2.2.1), as an escape if the table has no code (7.2.2.3).
#[inline]
fn put_coefficient(sink: &mut impl BitSink, codes: Codes, run: usize, level: i16) {
    let code = coefficient_code(codes.table, run, level.unsigned_abs().into());
    if code.length > 0 {
        return sink.put_code(code.signed(level < 0));
    }
    sink.put_code(ESCAPE);
    sink.put(run as u32, 6);
    let low_byte = u32::from(level as u8);
    match codes.standard {
        Standard::Mpeg2 => sink.put(level as u32 & 0xfff, 12),
        Standard::Mpeg1 if level.unsigned_abs() < 128 => sink.put(low_byte, 8),
        // A first byte of 0x00 or 0x80 announces a level beyond ±127.
        Standard::Mpeg1 => sink.put(if level < 0 { 0x8000 } else { 0 } | low_byte, 16),
    }
}

/// Writes an intra block: the difference of the DC from `dc_prediction`, coefficients, End of block (6.2.6).
pub(crate) fn put_intra_block(
    sink: &mut impl BitSink,
    codes: Codes,
    block: &Block,
    dc_prediction: i32,
    luminance: bool,
) {
    put_dc(sink, i32::from(block.levels[0]) - dc_prediction, luminance);
    if sink.only_counts() {
        sink.count(block.bits);
    } else {
        put_coefficients(sink, codes, block, 1);
    }
}

/// Writes a coded non-intra block (6.2.6).
pub(crate) fn put_inter_block(sink: &mut impl BitSink, codes: Codes, block: &Block) {
    debug_assert!(block.is_coded(), "a coded block has a coefficient");
    if sink.only_counts() {
        return sink.count(block.bits);
    }
    let first = block.levels[0];
    if first.unsigned_abs() == 1 {
        sink.put_code(FIRST_COEFFICIENT_ONE.signed(first < 0));
        put_coefficients(sink, codes, block, 1);
    } else {
        put_coefficients(sink, codes, block, 0);
    }
}

fn put_coefficients(sink: &mut impl BitSink, codes: Codes, block: &Block, start: usize) {
    let mut next = start;
    for place in places(block.places >> start << start) {
        put_coefficient(sink, codes, place - next, block.levels[place]);
        next = place + 1;
    }
    sink.put_code(END_OF_BLOCK[codes.table as usize]);
}

/// Returns the number of bits of a block's coefficients and its End of block, without the intra DC.
pub(crate) fn block_bits(codes: Codes, block: &Block, intra: bool) -> u32 {
    let start = usize::from(intra);
    let (mut bits, mut next) = (0, start);
    for place in places(block.places >> start << start) {
        let (run, level) = (place - next, u32::from(block.levels[place].unsigned_abs()));
        let first = !intra && next == 0;
        bits += if first { first_coefficient_bits(codes, run, level) } else { coefficient_bits(codes, run, level) };
        next = place + 1;
    }
    if block.is_coded() || intra { bits + end_of_block_bits(codes) } else { 0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bits::{BitCounter, BitWriter};

    #[test]
    fn bit_counts_agree_with_the_writer() {
        for table in [CoefficientTable::Zero, CoefficientTable::One] {
            for standard in [Standard::Mpeg1, Standard::Mpeg2] {
                let codes = Codes { table, standard };
                for run in 0..63 {
                    for level in 1..=standard.level_max() as i16 {
                        let mut counter = BitCounter::default();
                        put_coefficient(&mut counter, codes, run, -level);
                        assert_eq!(counter.0 as u32, coefficient_bits(codes, run, level as u32));
                    }
                }
            }
        }
    }

    #[test]
    fn escapes_of_mpeg_1_are_the_printed_ones() {
        // From ISO/IEC 11172-2, Annex B: levels, and the digits after escape code and run.
        for (level, digits) in [
            (-255, "1000 0000 0000 0001"),
            (-128, "1000 0000 1000 0000"),
            (-127, "1000 0001"),
            (-100, "1001 1100"),
            (100, "0110 0100"),
            (127, "0111 1111"),
            (128, "0000 0000 1000 0000"),
            (255, "0000 0000 1111 1111"),
        ] {
            let mut writer = BitWriter::default();
            put_coefficient(&mut writer, Codes { table: CoefficientTable::Zero, standard: Standard::Mpeg1 }, 20, level);
            let printed = mpeg2::tables::vlc(digits);
            let mut expected = BitWriter::default();
            expected.put_code(ESCAPE);
            expected.put(20, 6);
            expected.put_code(printed);
            assert_eq!(writer.into_bytes(), expected.into_bytes(), "{level}");
        }
    }

    #[test]
    fn motion_residual_restores_the_difference() {
        // Check the written codes by the decoding process of 7.6.3.1.
        struct Words(Vec<(u32, u32)>);
        impl BitSink for Words {
            fn put(&mut self, value: u32, length: u32) {
                self.0.push((value, length));
            }
            fn bits(&self) -> u64 {
                self.0.iter().map(|word| u64::from(word.1)).sum()
            }
        }
        for f_code in 1..=9u32 {
            let f = 1i32 << (f_code - 1);
            for delta in -32 * f + 1..32 * f {
                let mut words = Words(Vec::new());
                put_motion_component(&mut words, delta, f_code);
                let (value, length) = words.0[0];
                let decoded = if (value, length) == (1, 1) {
                    0
                } else {
                    let negative = value & 1 == 1;
                    let code =
                        MOTION_CODE.iter().position(|c| c.signed(negative) == Vlc { code: value, length }).unwrap();
                    let residual = words.0.get(1).map_or(0, |word| word.0 as i32);
                    let magnitude = (code as i32 - 1) * f + residual + 1;
                    if negative { -magnitude } else { magnitude }
                };
                assert_eq!((decoded - delta).rem_euclid(32 * f), 0, "f_code {f_code}");
            }
        }
    }
}
