//! Writes codes of syntax elements.

use mpeg2::{
    Vlc,
    tables::{
        CODED_BLOCK_PATTERN, DCT_COEFFICIENTS, DCT_DC_SIZE_CHROMINANCE, DCT_DC_SIZE_LUMINANCE, END_OF_BLOCK, ESCAPE,
        LEVELS, MACROBLOCK_ADDRESS_INCREMENT, MACROBLOCK_ESCAPE, MOTION_CODE, RUNS,
    },
};

/// Bits of a stream.
#[derive(Default)]
pub struct Writer {
    pub bytes: Vec<u8>,
    pending: u32,
    count: u32,
}

impl Writer {
    pub fn put(&mut self, value: u32, length: u32) {
        for i in (0..length).rev() {
            self.pending = self.pending << 1 | (value >> i & 1);
            self.count += 1;
            if self.count == 8 {
                self.bytes.push(self.pending as u8);
                (self.pending, self.count) = (0, 0);
            }
        }
    }

    pub fn code(&mut self, vlc: Vlc) {
        assert!(vlc.length > 0, "a missing code");
        self.put(vlc.code, vlc.length);
    }

    pub fn start_code(&mut self, code: u8) {
        self.put(0, (8 - self.count) % 8);
        self.bytes.extend([0, 0, 1, code]);
    }

    pub fn increment(&mut self, mut increment: usize) {
        while increment > 33 {
            self.code(MACROBLOCK_ESCAPE);
            increment -= 33;
        }
        self.code(MACROBLOCK_ADDRESS_INCREMENT[increment - 1]);
    }

    /// Writes one vector component as its difference from the predicted one, modulo the range.
    pub fn motion(&mut self, difference: i32, f_code: u32) {
        let (r_size, half) = (f_code - 1, 16 << (f_code - 1));
        let delta = (difference + half).rem_euclid(2 * half) - half;
        if delta == 0 {
            return self.code(MOTION_CODE[0]);
        }
        let before = delta.unsigned_abs() - 1;
        self.code(MOTION_CODE[(before >> r_size) as usize + 1].signed(delta < 0));
        self.put(before & ((1 << r_size) - 1), r_size);
    }

    pub fn dual_difference(&mut self, difference: i32) {
        match difference {
            0 => self.put(0, 1),
            1 => self.put(2, 2),
            _ => self.put(3, 2),
        }
    }

    pub fn dc(&mut self, difference: i32, is_luma: bool) {
        let size = 32 - difference.unsigned_abs().leading_zeros();
        let table = if is_luma { &DCT_DC_SIZE_LUMINANCE } else { &DCT_DC_SIZE_CHROMINANCE };
        self.code(table[size as usize]);
        let value = if difference < 0 { difference + (1 << size) - 1 } else { difference };
        self.put(value as u32, size);
    }

    pub fn pattern(&mut self, pattern: u32, blocks: u32) {
        self.code(CODED_BLOCK_PATTERN[(pattern >> (blocks - 6)) as usize]);
        self.put(pattern & ((1 << (blocks - 6)) - 1), blocks - 6);
    }

    /// Writes a coefficient of table zero or one.
    pub fn coefficient(&mut self, table: usize, run: usize, level: i32, mpeg1: bool) {
        let magnitude = level.unsigned_abs() as usize;
        let code = if run < RUNS && magnitude < LEVELS { DCT_COEFFICIENTS[table][run][magnitude] } else { Vlc::NONE };
        if code.length > 0 {
            return self.code(code.signed(level < 0));
        }
        self.code(ESCAPE);
        self.put(run as u32, 6);
        match level {
            _ if !mpeg1 => self.put(level as u32 & 0xfff, 12),
            -127..=127 => self.put(level as u32 & 0xff, 8),
            128.. => self.put(level as u32, 16),
            _ => self.put(0x8000 | level as u32 & 0xff, 16),
        }
    }

    /// Writes the first coefficient of a non-intra block, which has a shorter code for run 0 and level 1.
    pub fn first_coefficient(&mut self, run: usize, level: i32, mpeg1: bool) {
        if run == 0 && level.abs() == 1 {
            self.put(2 | u32::from(level < 0), 2);
        } else {
            self.coefficient(0, run, level, mpeg1);
        }
    }

    pub fn end_of_block(&mut self, table: usize) {
        self.code(END_OF_BLOCK[table]);
    }
}
