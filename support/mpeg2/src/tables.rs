//! Code tables of ISO/IEC 13818-2, Annex B, in the digits of the standard.
//!
//! The sign, a trailing `s` in the standard, is omitted; [`Vlc::signed`] adds it.

use crate::Vlc;

/// Parses a code from the digits of the standard; spaces are allowed.
///
/// # Panics
/// If another character occurs.
#[must_use]
pub const fn vlc(digits: &str) -> Vlc {
    let bytes = digits.as_bytes();
    let mut out = Vlc::NONE;
    let mut i = 0;
    while i < bytes.len() {
        if bytes[i] != b' ' {
            assert!(bytes[i] == b'0' || bytes[i] == b'1', "a code consists of the digits 0 and 1");
            out = out.signed(bytes[i] == b'1');
        }
        i += 1;
    }
    out
}

/// Table B.1: macroblock_address_increment, in order 1, 2, 3, …
#[rustfmt::skip]
pub const MACROBLOCK_ADDRESS_INCREMENT: [Vlc; 33] = [
    vlc("1"), vlc("011"), vlc("010"), vlc("0011"), vlc("0010"), vlc("0001 1"), vlc("0001 0"),
    vlc("0000 111"), vlc("0000 110"), vlc("0000 1011"), vlc("0000 1010"), vlc("0000 1001"), vlc("0000 1000"),
    vlc("0000 0111"), vlc("0000 0110"), vlc("0000 0101 11"), vlc("0000 0101 10"), vlc("0000 0101 01"),
    vlc("0000 0101 00"), vlc("0000 0100 11"), vlc("0000 0100 10"), vlc("0000 0100 011"), vlc("0000 0100 010"),
    vlc("0000 0100 001"), vlc("0000 0100 000"), vlc("0000 0011 111"), vlc("0000 0011 110"), vlc("0000 0011 101"),
    vlc("0000 0011 100"), vlc("0000 0011 011"), vlc("0000 0011 010"), vlc("0000 0011 001"), vlc("0000 0011 000"),
];

/// Table B.1: macroblock_escape, which represents 33 more macroblocks.
pub const MACROBLOCK_ESCAPE: Vlc = vlc("0000 0001 000");

/// Table B.2: macroblock_type of an intra macroblock in an I picture.
pub const I_INTRA: Vlc = vlc("1");
/// Table B.2: macroblock_type of an intra macroblock with quantiser_scale_code, in an I picture.
pub const I_INTRA_QUANT: Vlc = vlc("01");

/// Table B.3: macroblock_type with vector and coefficients, in a P picture.
pub const P_MOTION_CODED: Vlc = vlc("1");
/// Table B.3: macroblock_type with coefficients and a zero vector.
pub const P_CODED: Vlc = vlc("01");
/// Table B.3: macroblock_type with only a vector.
pub const P_MOTION: Vlc = vlc("001");
/// Table B.3: macroblock_type of an intra macroblock.
pub const P_INTRA: Vlc = vlc("0001 1");
/// Table B.3: macroblock_type with vector, coefficients and quantiser_scale_code.
pub const P_MOTION_CODED_QUANT: Vlc = vlc("0001 0");
/// Table B.3: macroblock_type with coefficients, a zero vector and quantiser_scale_code.
pub const P_CODED_QUANT: Vlc = vlc("0000 1");
/// Table B.3: macroblock_type of an intra macroblock with quantiser_scale_code.
pub const P_INTRA_QUANT: Vlc = vlc("0000 01");

/// Table B.4: macroblock_type without coefficients, in a B picture: forward, backward, both.
pub const B_MOTION: [Vlc; 3] = [vlc("0010"), vlc("010"), vlc("10")];
/// Table B.4: macroblock_type with coefficients: forward, backward, both.
pub const B_MOTION_CODED: [Vlc; 3] = [vlc("0011"), vlc("011"), vlc("11")];
/// Table B.4: macroblock_type with coefficients and quantiser_scale_code: forward, backward, both.
pub const B_MOTION_CODED_QUANT: [Vlc; 3] = [vlc("0000 11"), vlc("0000 10"), vlc("0001 0")];
/// Table B.4: macroblock_type of an intra macroblock.
pub const B_INTRA: Vlc = vlc("0001 1");
/// Table B.4: macroblock_type of an intra macroblock with quantiser_scale_code.
pub const B_INTRA_QUANT: Vlc = vlc("0000 01");

/// Table B.9: coded_block_pattern, as (pattern, code).
#[rustfmt::skip]
const CODED_BLOCK_PATTERN_PRINTED: [(u8, &str); 64] = [
    (60, "111"), (4, "1101"), (8, "1100"), (16, "1011"), (32, "1010"), (12, "1001 1"), (48, "1001 0"), (20, "1000 1"),
    (40, "1000 0"), (28, "0111 1"), (44, "0111 0"), (52, "0110 1"), (56, "0110 0"), (1, "0101 1"), (61, "0101 0"),
    (2, "0100 1"), (62, "0100 0"), (24, "0011 11"), (36, "0011 10"), (3, "0011 01"), (63, "0011 00"),
    (5, "0010 111"), (9, "0010 110"), (17, "0010 101"), (33, "0010 100"), (6, "0010 011"), (10, "0010 010"),
    (18, "0010 001"), (34, "0010 000"), (7, "0001 1111"), (11, "0001 1110"), (19, "0001 1101"), (35, "0001 1100"),
    (13, "0001 1011"), (49, "0001 1010"), (21, "0001 1001"), (41, "0001 1000"), (14, "0001 0111"), (50, "0001 0110"),
    (22, "0001 0101"), (42, "0001 0100"), (15, "0001 0011"), (51, "0001 0010"), (23, "0001 0001"), (43, "0001 0000"),
    (25, "0000 1111"), (37, "0000 1110"), (26, "0000 1101"), (38, "0000 1100"), (29, "0000 1011"), (45, "0000 1010"),
    (53, "0000 1001"), (57, "0000 1000"), (30, "0000 0111"), (46, "0000 0110"), (54, "0000 0101"), (58, "0000 0100"),
    (31, "0000 0011 1"), (47, "0000 0011 0"), (55, "0000 0010 1"), (59, "0000 0010 0"), (27, "0000 0001 1"),
    (39, "0000 0001 0"), (0, "0000 0000 1"),
];

/// Table B.9: coded_block_pattern, indexed by pattern.
pub const CODED_BLOCK_PATTERN: [Vlc; 64] = {
    let mut table = [Vlc::NONE; 64];
    let mut i = 0;
    while i < 64 {
        let (pattern, digits) = CODED_BLOCK_PATTERN_PRINTED[i];
        table[pattern as usize] = vlc(digits);
        i += 1;
    }
    table
};

/// Table B.10: motion_code, in order 0, 1, 2, …; a sign follows all but 0.
#[rustfmt::skip]
pub const MOTION_CODE: [Vlc; 17] = [
    vlc("1"), vlc("01"), vlc("001"), vlc("0001"), vlc("0000 11"), vlc("0000 101"), vlc("0000 100"), vlc("0000 011"),
    vlc("0000 0101 1"), vlc("0000 0101 0"), vlc("0000 0100 1"), vlc("0000 0100 01"), vlc("0000 0100 00"),
    vlc("0000 0011 11"), vlc("0000 0011 10"), vlc("0000 0011 01"), vlc("0000 0011 00"),
];

/// Table B.12: dct_dc_size_luminance, in order 0, 1, 2, …
#[rustfmt::skip]
pub const DCT_DC_SIZE_LUMINANCE: [Vlc; 12] = [
    vlc("100"), vlc("00"), vlc("01"), vlc("101"), vlc("110"), vlc("1110"), vlc("1111 0"), vlc("1111 10"),
    vlc("1111 110"), vlc("1111 1110"), vlc("1111 1111 0"), vlc("1111 1111 1"),
];

/// Table B.13: dct_dc_size_chrominance, in order 0, 1, 2, …
#[rustfmt::skip]
pub const DCT_DC_SIZE_CHROMINANCE: [Vlc; 12] = [
    vlc("00"), vlc("01"), vlc("10"), vlc("110"), vlc("1110"), vlc("1111 0"), vlc("1111 10"), vlc("1111 110"),
    vlc("1111 1110"), vlc("1111 1111 0"), vlc("1111 1111 10"), vlc("1111 1111 11"),
];

/// Code for the end of a block in Tables B.14 and B.15.
pub const END_OF_BLOCK: [Vlc; 2] = [vlc("10"), vlc("0110")];
/// Escape code of Tables B.14 and B.15, before run and level (7.2.2.3).
pub const ESCAPE: Vlc = vlc("0000 01");
/// Table B.14: run 0 and level 1 as the first coefficient of a non-intra block.
pub const FIRST_COEFFICIENT_ONE: Vlc = vlc("1");

/// Table B.14: DCT coefficients table zero, as (run, level, code).
#[rustfmt::skip]
pub const DCT_COEFFICIENTS_PRINTED: [(u8, u8, &str); 111] = [
    (0, 1, "11"), (1, 1, "011"), (0, 2, "0100"), (2, 1, "0101"), (0, 3, "0010 1"), (3, 1, "0011 1"), (4, 1, "0011 0"),
    (1, 2, "0001 10"), (5, 1, "0001 11"), (6, 1, "0001 01"), (7, 1, "0001 00"),
    (0, 4, "0000 110"), (2, 2, "0000 100"), (8, 1, "0000 111"), (9, 1, "0000 101"),
    (0, 5, "0010 0110"), (0, 6, "0010 0001"), (1, 3, "0010 0101"), (3, 2, "0010 0100"),
    (10, 1, "0010 0111"), (11, 1, "0010 0011"), (12, 1, "0010 0010"), (13, 1, "0010 0000"),
    (0, 7, "0000 0010 10"), (1, 4, "0000 0011 00"), (2, 3, "0000 0010 11"), (4, 2, "0000 0011 11"),
    (5, 2, "0000 0010 01"), (14, 1, "0000 0011 10"), (15, 1, "0000 0011 01"), (16, 1, "0000 0010 00"),
    (0, 8, "0000 0001 1101"), (0, 9, "0000 0001 1000"), (0, 10, "0000 0001 0011"), (0, 11, "0000 0001 0000"),
    (1, 5, "0000 0001 1011"), (2, 4, "0000 0001 0100"), (3, 3, "0000 0001 1100"), (4, 3, "0000 0001 0010"),
    (6, 2, "0000 0001 1110"), (7, 2, "0000 0001 0101"), (8, 2, "0000 0001 0001"),
    (17, 1, "0000 0001 1111"), (18, 1, "0000 0001 1010"), (19, 1, "0000 0001 1001"), (20, 1, "0000 0001 0111"),
    (21, 1, "0000 0001 0110"),
    (0, 12, "0000 0000 1101 0"), (0, 13, "0000 0000 1100 1"), (0, 14, "0000 0000 1100 0"), (0, 15, "0000 0000 1011 1"),
    (1, 6, "0000 0000 1011 0"), (1, 7, "0000 0000 1010 1"), (2, 5, "0000 0000 1010 0"), (3, 4, "0000 0000 1001 1"),
    (5, 3, "0000 0000 1001 0"), (9, 2, "0000 0000 1000 1"), (10, 2, "0000 0000 1000 0"), (22, 1, "0000 0000 1111 1"),
    (23, 1, "0000 0000 1111 0"), (24, 1, "0000 0000 1110 1"), (25, 1, "0000 0000 1110 0"), (26, 1, "0000 0000 1101 1"),
    (0, 16, "0000 0000 0111 11"), (0, 17, "0000 0000 0111 10"), (0, 18, "0000 0000 0111 01"),
    (0, 19, "0000 0000 0111 00"), (0, 20, "0000 0000 0110 11"), (0, 21, "0000 0000 0110 10"),
    (0, 22, "0000 0000 0110 01"), (0, 23, "0000 0000 0110 00"), (0, 24, "0000 0000 0101 11"),
    (0, 25, "0000 0000 0101 10"), (0, 26, "0000 0000 0101 01"), (0, 27, "0000 0000 0101 00"),
    (0, 28, "0000 0000 0100 11"), (0, 29, "0000 0000 0100 10"), (0, 30, "0000 0000 0100 01"),
    (0, 31, "0000 0000 0100 00"),
    (0, 32, "0000 0000 0011 000"), (0, 33, "0000 0000 0010 111"), (0, 34, "0000 0000 0010 110"),
    (0, 35, "0000 0000 0010 101"), (0, 36, "0000 0000 0010 100"), (0, 37, "0000 0000 0010 011"),
    (0, 38, "0000 0000 0010 010"), (0, 39, "0000 0000 0010 001"), (0, 40, "0000 0000 0010 000"),
    (1, 8, "0000 0000 0011 111"), (1, 9, "0000 0000 0011 110"), (1, 10, "0000 0000 0011 101"),
    (1, 11, "0000 0000 0011 100"), (1, 12, "0000 0000 0011 011"), (1, 13, "0000 0000 0011 010"),
    (1, 14, "0000 0000 0011 001"),
    (1, 15, "0000 0000 0001 0011"), (1, 16, "0000 0000 0001 0010"), (1, 17, "0000 0000 0001 0001"),
    (1, 18, "0000 0000 0001 0000"), (6, 3, "0000 0000 0001 0100"), (11, 2, "0000 0000 0001 1010"),
    (12, 2, "0000 0000 0001 1001"), (13, 2, "0000 0000 0001 1000"), (14, 2, "0000 0000 0001 0111"),
    (15, 2, "0000 0000 0001 0110"), (16, 2, "0000 0000 0001 0101"), (27, 1, "0000 0000 0001 1111"),
    (28, 1, "0000 0000 0001 1110"), (29, 1, "0000 0000 0001 1101"), (30, 1, "0000 0000 0001 1100"),
    (31, 1, "0000 0000 0001 1011"),
];

/// Table B.15: DCT coefficients table one, as (run, level, code), in order of length.
#[rustfmt::skip]
pub const DCT_COEFFICIENTS_ONE_PRINTED: [(u8, u8, &str); 111] = [
    (0, 1, "10"), (0, 2, "110"), (1, 1, "010"), (0, 3, "0111"), (0, 4, "1110 0"), (0, 5, "1110 1"), (1, 2, "0011 0"),
    (2, 1, "0010 1"), (3, 1, "0011 1"), (0, 6, "0001 01"), (0, 7, "0001 00"), (4, 1, "0001 10"), (5, 1, "0001 11"),
    (0, 8, "1111 011"), (0, 9, "1111 100"), (1, 3, "1111 001"), (2, 2, "0000 111"), (6, 1, "0000 110"),
    (7, 1, "0000 100"), (8, 1, "0000 101"), (9, 1, "1111 000"), (10, 1, "1111 010"), (0, 10, "0010 0011"),
    (0, 11, "0010 0010"), (0, 12, "1111 1010"), (0, 13, "1111 1011"), (0, 14, "1111 1110"), (0, 15, "1111 1111"),
    (1, 4, "0010 0111"), (1, 5, "0010 0000"), (2, 3, "1111 1100"), (3, 2, "0010 0110"), (4, 2, "1111 1101"),
    (11, 1, "0010 0001"), (12, 1, "0010 0101"), (13, 1, "0010 0100"), (5, 2, "0000 0010 0"), (14, 1, "0000 0010 1"),
    (15, 1, "0000 0011 1"), (2, 4, "0000 0011 00"), (16, 1, "0000 0011 01"), (3, 3, "0000 0001 1100"),
    (4, 3, "0000 0001 0010"), (6, 2, "0000 0001 1110"), (7, 2, "0000 0001 0101"), (8, 2, "0000 0001 0001"),
    (17, 1, "0000 0001 1111"), (18, 1, "0000 0001 1010"), (19, 1, "0000 0001 1001"), (20, 1, "0000 0001 0111"),
    (21, 1, "0000 0001 0110"), (1, 6, "0000 0000 1011 0"), (1, 7, "0000 0000 1010 1"), (2, 5, "0000 0000 1010 0"),
    (3, 4, "0000 0000 1001 1"), (5, 3, "0000 0000 1001 0"), (9, 2, "0000 0000 1000 1"), (10, 2, "0000 0000 1000 0"),
    (22, 1, "0000 0000 1111 1"), (23, 1, "0000 0000 1111 0"), (24, 1, "0000 0000 1110 1"), (25, 1, "0000 0000 1110 0"),
    (26, 1, "0000 0000 1101 1"), (0, 16, "0000 0000 0111 11"), (0, 17, "0000 0000 0111 10"),
    (0, 18, "0000 0000 0111 01"), (0, 19, "0000 0000 0111 00"), (0, 20, "0000 0000 0110 11"),
    (0, 21, "0000 0000 0110 10"), (0, 22, "0000 0000 0110 01"), (0, 23, "0000 0000 0110 00"),
    (0, 24, "0000 0000 0101 11"), (0, 25, "0000 0000 0101 10"), (0, 26, "0000 0000 0101 01"),
    (0, 27, "0000 0000 0101 00"), (0, 28, "0000 0000 0100 11"), (0, 29, "0000 0000 0100 10"),
    (0, 30, "0000 0000 0100 01"), (0, 31, "0000 0000 0100 00"), (0, 32, "0000 0000 0011 000"),
    (0, 33, "0000 0000 0010 111"), (0, 34, "0000 0000 0010 110"), (0, 35, "0000 0000 0010 101"),
    (0, 36, "0000 0000 0010 100"), (0, 37, "0000 0000 0010 011"), (0, 38, "0000 0000 0010 010"),
    (0, 39, "0000 0000 0010 001"), (0, 40, "0000 0000 0010 000"), (1, 8, "0000 0000 0011 111"),
    (1, 9, "0000 0000 0011 110"), (1, 10, "0000 0000 0011 101"), (1, 11, "0000 0000 0011 100"),
    (1, 12, "0000 0000 0011 011"), (1, 13, "0000 0000 0011 010"), (1, 14, "0000 0000 0011 001"),
    (1, 15, "0000 0000 0001 0011"), (1, 16, "0000 0000 0001 0010"), (1, 17, "0000 0000 0001 0001"),
    (1, 18, "0000 0000 0001 0000"), (6, 3, "0000 0000 0001 0100"), (11, 2, "0000 0000 0001 1010"),
    (12, 2, "0000 0000 0001 1001"), (13, 2, "0000 0000 0001 1000"), (14, 2, "0000 0000 0001 0111"),
    (15, 2, "0000 0000 0001 0110"), (16, 2, "0000 0000 0001 0101"), (27, 1, "0000 0000 0001 1111"),
    (28, 1, "0000 0000 0001 1110"), (29, 1, "0000 0000 0001 1101"), (30, 1, "0000 0000 0001 1100"),
    (31, 1, "0000 0000 0001 1011"),
];

/// Number of runs for which Tables B.14 and B.15 may contain codes.
pub const RUNS: usize = 32;
/// Maximum level for which Tables B.14 and B.15 contain codes, plus one.
pub const LEVELS: usize = 41;

/// Tables B.14 and B.15, indexed by run and level; [`Vlc::NONE`] where escape coding is used.
pub static DCT_COEFFICIENTS: [[[Vlc; LEVELS]; RUNS]; 2] =
    [by_run_and_level(&DCT_COEFFICIENTS_PRINTED), by_run_and_level(&DCT_COEFFICIENTS_ONE_PRINTED)];

const fn by_run_and_level(printed: &[(u8, u8, &str)]) -> [[Vlc; LEVELS]; RUNS] {
    let mut table = [[Vlc::NONE; LEVELS]; RUNS];
    let mut i = 0;
    while i < printed.len() {
        let (run, level, digits) = printed[i];
        table[run as usize][level as usize] = vlc(digits);
        i += 1;
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Checks that no code is a prefix of another, and that Kraft's sum is at most one.
    fn check(name: &str, codes: &[Vlc]) {
        let mut kraft = 0.0;
        for (i, a) in codes.iter().enumerate() {
            assert!(a.length > 0, "{name}: entry {i} has no code");
            kraft += 0.5f64.powi(a.length as i32);
            for (j, b) in codes.iter().enumerate() {
                let begins = i != j && a.length <= b.length && b.code >> (b.length - a.length) == a.code;
                assert!(!begins, "{name}: code {i} {a:?} is a prefix of code {j} {b:?}");
            }
        }
        assert!(kraft <= 1.0, "{name}: Kraft's sum is {kraft}");
    }

    fn both_signs(codes: &[Vlc]) -> impl Iterator<Item = Vlc> {
        codes.iter().flat_map(|code| [code.signed(false), code.signed(true)])
    }

    #[test]
    fn the_tables_are_prefix_codes() {
        let mut increments = MACROBLOCK_ADDRESS_INCREMENT.to_vec();
        increments.push(MACROBLOCK_ESCAPE);
        check("B.1", &increments);
        check("B.2", &[I_INTRA, I_INTRA_QUANT]);
        let plain = [P_MOTION_CODED, P_CODED, P_MOTION, P_INTRA];
        check("B.3", &[&plain[..], &[P_MOTION_CODED_QUANT, P_CODED_QUANT, P_INTRA_QUANT]].concat());
        let motion = [B_MOTION, B_MOTION_CODED, B_MOTION_CODED_QUANT].concat();
        check("B.4", &[&motion[..], &[B_INTRA, B_INTRA_QUANT]].concat());
        check("B.9", &CODED_BLOCK_PATTERN);
        let mut motion = vec![MOTION_CODE[0]];
        motion.extend(both_signs(&MOTION_CODE[1..]));
        check("B.10", &motion);
        check("B.12", &DCT_DC_SIZE_LUMINANCE);
        check("B.13", &DCT_DC_SIZE_CHROMINANCE);
        for (name, table, printed) in
            [("B.14", 0, &DCT_COEFFICIENTS_PRINTED), ("B.15", 1, &DCT_COEFFICIENTS_ONE_PRINTED)]
        {
            let printed: Vec<Vlc> = printed.iter().map(|&(_, _, digits)| vlc(digits)).collect();
            let mut coefficients = vec![END_OF_BLOCK[table], ESCAPE];
            coefficients.extend(both_signs(&printed));
            check(name, &coefficients);
        }
    }

    #[test]
    fn every_entry_of_the_coefficient_tables_is_found_again() {
        for (table, printed) in [&DCT_COEFFICIENTS_PRINTED, &DCT_COEFFICIENTS_ONE_PRINTED].into_iter().enumerate() {
            for &(run, level, digits) in printed {
                let found = DCT_COEFFICIENTS[table][run as usize][level as usize];
                let written: String =
                    (0..found.length).rev().map(|bit| char::from(b'0' + (found.code >> bit & 1) as u8)).collect();
                assert_eq!(written, digits.replace(' ', ""), "run {run}, level {level}");
            }
            let codes = DCT_COEFFICIENTS[table].iter().flatten().filter(|code| code.length > 0).count();
            assert_eq!(codes, printed.len(), "an entry occurs twice");
        }
    }
}
