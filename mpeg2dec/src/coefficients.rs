//! Coefficients of a block: codes, inverse quantisation and mismatch control (7.2 to 7.4).

use crate::{bits::BitReader, lookup::Invalid};
use mpeg2::tables::{
    DCT_COEFFICIENTS_ONE_PRINTED, DCT_COEFFICIENTS_PRINTED, END_OF_BLOCK, ESCAPE, FIRST_COEFFICIENT_ONE, vlc,
};

/// Run in a table entry for the end of a block.
const END_RUN: u32 = 64;
/// Run in a table entry for an escape code.
const ESCAPE_RUN: u32 = 65;
/// Run in a table entry without a code.
const INVALID_RUN: u32 = 66;

/// Run, level and length without sign of the codes that begin with the bits of an index.
#[derive(Clone, Copy)]
struct RunLevel {
    run: u32,
    level: i32,
    length: u32,
}

/// [`RunLevel`] in 7, 6 and 3 bits. The length is stored as the excess over the shortest length of the table.
#[derive(Clone, Copy)]
struct PackedRunLevel(u16);

impl PackedRunLevel {
    const INVALID: Self = Self(INVALID_RUN as u16);

    const fn new(run: u32, level: u8, excess: u32) -> Self {
        Self(run as u16 | (level as u16) << 7 | (excess as u16) << 13)
    }

    #[inline(always)]
    fn unpacked(self, shortest: u32) -> RunLevel {
        let bits = u32::from(self.0);
        RunLevel { run: bits & 127, level: (bits >> 7 & 63) as i32, length: shortest + (bits >> 13) }
    }
}

/// Decoding table of coefficients. Codes of more than 8 bits begin with six zeros.
pub(crate) struct CoefficientCodes {
    /// Entries by the first 8 bits.
    short: [PackedRunLevel; 256],
    /// Entries by 16 bits of which the first six are zero.
    long: [PackedRunLevel; 1024],
}

/// Tables B.14 and B.15.
pub(crate) static CODES: [CoefficientCodes; 2] =
    [codes(&DCT_COEFFICIENTS_PRINTED, 0), codes(&DCT_COEFFICIENTS_ONE_PRINTED, 1)];

const fn codes(printed: &[(u8, u8, &str)], table: usize) -> CoefficientCodes {
    let none = PackedRunLevel::INVALID;
    let mut codes = CoefficientCodes { short: [none; 256], long: [none; 1024] };
    let mut i = 0;
    while i < printed.len() + 2 {
        // End of block and escape follow the printed codes.
        let (run, level, code) = if i < printed.len() {
            let (run, level, digits) = printed[i];
            (run as u32, level, vlc(digits))
        } else if i == printed.len() {
            (END_RUN, 0, END_OF_BLOCK[table])
        } else {
            (ESCAPE_RUN, 0, ESCAPE)
        };
        let is_short = code.length <= 8;
        let entry = PackedRunLevel::new(run, level, code.length - if is_short { 1 } else { 9 });
        let free = if is_short { 8 } else { 16 } - code.length;
        let mut index = (code.code as usize) << free;
        let end = (code.code as usize + 1) << free;
        while index < end {
            if is_short {
                codes.short[index] = entry;
            } else {
                codes.long[index] = entry;
            }
            index += 1;
        }
        i += 1;
    }
    codes
}

impl CoefficientCodes {
    #[inline(always)]
    fn find(&self, window: u64) -> RunLevel {
        if window >> 58 == 0 {
            self.long[(window >> 48) as usize % 1024].unpacked(9)
        } else {
            self.short[(window >> 56) as usize].unpacked(1)
        }
    }
}

/// Parameters of the inverse quantisation of one block.
pub(crate) struct BlockQuantiser<'a> {
    pub codes: &'a CoefficientCodes,
    /// Weights in transmission order.
    pub weights: &'a [i32; 64],
    /// Index of each coefficient in a block stored by column, in transmission order.
    pub scan: &'a [u8; 64],
    pub scale: i32,
    /// Restored DC coefficient of an intra block.
    pub dc: Option<i32>,
}

/// Coefficients of a block, stored by column.
pub(crate) struct Coefficients {
    pub values: [i32; 64],
    /// False if all coefficients except the DC and the last one are zero.
    pub has_ac: bool,
}

impl Coefficients {
    pub const ZERO: Self = Self { values: [0; 64], has_ac: false };

    /// Sets the only coefficient of a block.
    pub fn set_dc(&mut self, dc: i32) {
        (self.values[0], self.has_ac) = (dc, false);
    }

    /// Reads a block into zeroed values. `MPEG1` selects the escape codes and the mismatch control.
    #[inline(always)]
    pub fn read<const MPEG1: bool>(&mut self, reader: &mut BitReader, block: &BlockQuantiser) -> Result<(), Invalid> {
        // A copy stays in registers.
        let mut copy = *reader;
        let bits = &mut copy;
        let mut place = 0;
        let mut parity = 0;
        // k of 7.4.2.3 is 0 in intra blocks.
        let k = i32::from(block.dc.is_none());
        self.has_ac = false;
        bits.refill();
        let mut entry = if let Some(dc) = block.dc {
            let dc = dc.clamp(-2048, 2047);
            (self.values[0], parity, place) = (dc, dc, 1);
            block.codes.find(bits.window())
        } else if bits.peek(1) == FIRST_COEFFICIENT_ONE.code {
            RunLevel { run: 0, level: 1, length: 1 }
        } else {
            block.codes.find(bits.window())
        };
        loop {
            bits.skip(entry.length);
            let (run, magnitude, negative) = if entry.run < END_RUN {
                (entry.run as usize, entry.level, bits.take(1) == 1)
            } else if entry.run == END_RUN {
                break;
            } else if entry.run == INVALID_RUN {
                return Err(Invalid);
            } else {
                let run = bits.take(6) as usize;
                let level = if MPEG1 { short_level(bits) } else { (bits.take(12) as i32) << 20 >> 20 };
                (run, level.abs(), level < 0)
            };
            place += run;
            let (Some(&index), Some(&weight)) = (block.scan.get(place), block.weights.get(place)) else {
                return Err(Invalid);
            };
            let mut value = ((2 * magnitude + k) * (weight * block.scale)) >> 5;
            if MPEG1 && value > 0 {
                value = (value - 1) | 1; // even values become odd, toward zero (11172-2, 2.4.4.1)
            }
            // Signs are random, so a branch would be slow.
            let sign = -i32::from(negative);
            let value = ((value ^ sign) - sign).clamp(-2048, 2047);
            self.values[usize::from(index) % 64] = value;
            parity ^= value;
            self.has_ac |= place > 0;
            place += 1;
            bits.refill();
            entry = block.codes.find(bits.window());
        }
        // Mismatch control (7.4.4).
        if !MPEG1 && parity & 1 == 0 {
            self.values[63] ^= 1;
        }
        *reader = copy;
        Ok(())
    }

    /// Resets all coefficients to zero.
    #[inline(always)]
    pub fn clear(&mut self) {
        self.values = [0; 64];
    }
}

/// Reads the level of an escape code of MPEG-1 (11172-2, Annex B): 8 bits, or 16 bits for levels beyond ±127.
#[cold]
fn short_level(bits: &mut BitReader) -> i32 {
    match bits.take(8) as u8 as i8 {
        0 => bits.take(8) as i32,
        -128 => bits.take(8) as i32 - 256,
        level => level.into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(bytes: &[u8], dc: Option<i32>) -> Result<[i32; 64], Invalid> {
        let scan = std::array::from_fn(|i| i as u8);
        let block = BlockQuantiser { codes: &CODES[0], weights: &[16; 64], scan: &scan, scale: 2, dc };
        let mut coefficients = Coefficients::ZERO;
        coefficients.read::<false>(&mut BitReader::new(bytes), &block)?;
        Ok(coefficients.values)
    }

    #[test]
    fn levels_follow_the_formula() {
        // Run 0 and level 1, then run 1 and level −1, then the end: 1 0, 011 1, 10.
        let values = read(&[0b1001_1110], None).unwrap();
        assert_eq!((values[0], values[1], values[2], values[63]), (3, 0, -3, 1));
        // An escape with run 2 and level −2 after a DC of 80.
        let values = read(&[0b0000_0100, 0b0010_1111, 0b1111_1110, 0b1000_0000], Some(80)).unwrap();
        assert_eq!((values[0], values[3], values[63]), (80, -4, 1));
        assert_eq!(read(&[0; 4], None), Err(Invalid));
        // Escapes with a run of 63 leave the block.
        assert_eq!(
            read(&[0b0000_0111, 0b1111_0000, 0b0000_0001, 0b0000_0111, 0b1111_0000, 0, 0xff], None),
            Err(Invalid)
        );
    }
}
