//! Slices: macroblock headers, vectors and blocks (6.2.4 to 6.2.6).

use crate::{
    bits::BitReader,
    coding::{PictureCoding, References},
    coefficients::{BlockQuantiser, Coefficients},
    compensate::{Compensation, compensate},
    frame::FrameMemory,
    lookup::{
        BACKWARD, CHROMA_DC_SIZE, ESCAPE_VALUE, FORWARD, INCREMENT, INTRA, Invalid, LUMA_DC_SIZE, MACROBLOCK_TYPES,
        PATTERN, PATTERNS, QUANT, STUFFING_VALUE,
    },
    predict::MacroblockBuffer,
    progress::MacroblockRecord,
    residual::BlockSlot,
    vectors::{MotionKind, MotionVectors, VectorCoding, VectorPredictors},
};
use mpeg2::Standard;
use plane::PictureType;

/// Decoder of one slice.
pub(crate) struct SliceDecoder<'a> {
    coding: &'a PictureCoding,
    references: References<'a>,
    frame: &'a mut FrameMemory,
    record: &'a mut MacroblockRecord,
    bits: BitReader<'a>,
    quantiser_scale: i32,
    /// DC predictors of luma and chroma.
    dc: [i32; 3],
    predictors: VectorPredictors,
    /// Directions of the previous macroblock, which skipped macroblocks of B pictures repeat.
    directions: u8,
    buffer: MacroblockBuffer,
    coefficients: Coefficients,
}

impl<'a> SliceDecoder<'a> {
    pub fn new(
        coding: &'a PictureCoding,
        references: References<'a>,
        frame: &'a mut FrameMemory,
        record: &'a mut MacroblockRecord,
        data: &'a [u8],
    ) -> Self {
        Self {
            coding,
            references,
            frame,
            record,
            bits: BitReader::new(data),
            quantiser_scale: 2,
            dc: [0; 3],
            predictors: VectorPredictors::default(),
            directions: FORWARD,
            buffer: MacroblockBuffer::new(coding.shape.shifts),
            coefficients: Coefficients::ZERO,
        }
    }

    /// Decodes the slice with vertical position `position`, the last byte of its start code.
    pub fn decode(mut self, position: u8) -> Result<(), Invalid> {
        let extension = if self.coding.is_tall { self.bits.read(3) as usize } else { 0 };
        let row = (extension << 7) + usize::from(position) - 1;
        let code = self.bits.read(5);
        self.quantiser_scale = self.coding.scale(code);
        // Skip intra_slice and extra_information_slice.
        while self.bits.flag() {
            self.bits.read(8);
            if self.bits.is_past_end() {
                return Err(Invalid);
            }
        }
        if row >= self.coding.rows {
            return Err(Invalid);
        }
        self.reset_dc();
        // Slices of MPEG-1 may continue in the next rows.
        let columns = self.coding.shape.macroblocks[0];
        let last_row = if self.coding.standard == Standard::Mpeg1 { self.coding.rows } else { row + 1 };
        let mut address = row * columns + self.increment()? - 1;
        loop {
            if address >= last_row * columns {
                return Err(Invalid);
            }
            self.macroblock(address)?;
            self.bits.refill();
            if self.bits.peek(23) == 0 {
                // Zero bits past the end of truncated data are not an end.
                return if self.bits.is_past_end() { Err(Invalid) } else { Ok(()) };
            }
            let skipped = self.increment()? - 1;
            if address + skipped >= last_row * columns {
                return Err(Invalid);
            }
            for _ in 0..skipped {
                address += 1;
                self.skipped_macroblock(address);
            }
            address += 1;
        }
    }

    fn reset_dc(&mut self) {
        self.dc = [128 << (3 - self.coding.header.dc_shift); 3];
    }

    /// Reads macroblock_address_increment with its escapes.
    #[inline]
    fn increment(&mut self) -> Result<usize, Invalid> {
        let mut sum = 0;
        loop {
            self.bits.refill();
            match INCREMENT.take(&mut self.bits)? {
                ESCAPE_VALUE => sum += 33,
                STUFFING_VALUE if self.coding.standard == Standard::Mpeg1 => {}
                STUFFING_VALUE => return Err(Invalid),
                increment => return Ok(sum + usize::from(increment)),
            }
        }
    }

    fn place(&self, address: usize) -> [usize; 2] {
        let columns = self.coding.shape.macroblocks[0];
        [address % columns, address / columns]
    }

    /// Predicts a skipped macroblock (7.6.6).
    fn skipped_macroblock(&mut self, address: usize) {
        self.reset_dc();
        let kind = if self.coding.is_frame() { MotionKind::Frame } else { MotionKind::Field };
        let mut motion = MotionVectors::zero(kind, self.coding.parity());
        if self.coding.is_b() {
            motion.vectors[0] = self.predictors[0];
            self.scale_full_pel(&mut motion);
        } else {
            self.predictors = VectorPredictors::default();
            self.directions = FORWARD;
        }
        self.predict(address, &motion);
        self.store(address);
    }

    /// Converts vectors in whole samples.
    fn scale_full_pel(&self, motion: &mut MotionVectors) {
        for s in 0..2 {
            if self.coding.header.full_pel[s] {
                motion.vectors[0][s] = motion.vectors[0][s].map(|v| 2 * v);
            }
        }
    }

    /// Predicts a macroblock in the current directions and registers its vector.
    fn predict(&mut self, address: usize, motion: &MotionVectors) {
        let at = self.place(address);
        let compensation =
            Compensation { coding: self.coding, references: self.references, current: self.frame, motion };
        for (direction, flag) in [FORWARD, BACKWARD].into_iter().enumerate() {
            if self.directions & flag != 0 {
                let average = direction == 1 && self.directions & FORWARD != 0;
                compensate(&compensation, direction, at, average, &mut self.buffer);
            }
        }
        let has_vector = self.directions & FORWARD != 0 && motion.kind != MotionKind::FrameFields;
        self.record.set(address, if has_vector { motion.vectors[0][0] } else { [0; 2] });
    }

    fn store(&mut self, address: usize) {
        let at = self.place(address);
        self.buffer.store(self.frame, self.coding.lines(), at);
    }

    /// Decodes a macroblock after its address (6.2.5).
    fn macroblock(&mut self, address: usize) -> Result<(), Invalid> {
        let coding = self.coding;
        let header = &coding.header;
        self.bits.refill();
        let flags = MACROBLOCK_TYPES[header.kind as usize - 1].take(&mut self.bits)?;
        // The only type of macroblocks in D pictures has no quantiser_scale.
        if header.is_dc_only && flags != INTRA {
            return Err(Invalid);
        }
        let is_intra = flags & INTRA != 0;
        let kind = self.motion_kind(flags)?;
        let asks_dct_type = coding.is_frame() && !header.frame_pred_frame_dct && flags & (INTRA | PATTERN) != 0;
        let by_field = asks_dct_type && self.bits.take(1) == 1;
        if flags & QUANT != 0 {
            let code = self.bits.take(5);
            self.quantiser_scale = coding.scale(code);
        }
        let mut motion = MotionVectors::zero(kind, coding.parity());
        for (direction, flag) in [FORWARD, BACKWARD].into_iter().enumerate() {
            let conceals = direction == 0 && is_intra && header.concealment_motion_vectors;
            if flags & flag != 0 || conceals {
                let vectors = VectorCoding {
                    direction,
                    f_code: header.f_code[direction],
                    in_frame: coding.is_frame(),
                    full_pel: header.full_pel[direction],
                };
                vectors.read(&mut self.bits, &mut motion, &mut self.predictors)?;
            }
        }
        if is_intra {
            return self.intra_macroblock(address, by_field, &motion);
        }
        if flags & (FORWARD | BACKWARD) == 0 {
            self.predictors = VectorPredictors::default();
        }
        // P macroblocks without vector have a zero vector.
        self.directions = if header.kind == PictureType::P { FORWARD } else { flags & (FORWARD | BACKWARD) };
        self.reset_dc();
        self.predict(address, &motion);
        if flags & PATTERN != 0 {
            self.inter_blocks(by_field)?;
        }
        self.store(address);
        Ok(())
    }

    /// Reads frame_motion_type or field_motion_type (Tables 6-17 and 6-18).
    #[inline]
    fn motion_kind(&mut self, flags: u8) -> Result<MotionKind, Invalid> {
        let in_frame = self.coding.is_frame();
        let plain = if in_frame { MotionKind::Frame } else { MotionKind::Field };
        if flags & (FORWARD | BACKWARD) == 0 || in_frame && self.coding.header.frame_pred_frame_dct {
            return Ok(plain);
        }
        match (self.bits.take(2), in_frame) {
            (1, true) => Ok(MotionKind::FrameFields),
            (2, true) => Ok(MotionKind::Frame),
            (1, false) => Ok(MotionKind::Field),
            (2, false) => Ok(MotionKind::Halves),
            (3, _) if self.coding.header.kind == PictureType::P => Ok(MotionKind::Dual),
            _ => Err(Invalid),
        }
    }

    /// Decodes the blocks of an intra macroblock.
    fn intra_macroblock(&mut self, address: usize, by_field: bool, motion: &MotionVectors) -> Result<(), Invalid> {
        if self.coding.header.concealment_motion_vectors {
            self.bits.read(1); // marker_bit
        } else {
            self.predictors = VectorPredictors::default();
        }
        self.directions = FORWARD;
        for i in 0..self.coding.blocks {
            let component = if i < 4 { 0 } else { 1 + (i & 1) };
            let dc = self.dc(component)?;
            self.block(i, by_field, Some(dc << self.coding.header.dc_shift))?;
        }
        if self.coding.header.is_dc_only && self.bits.read(1) == 0 {
            return Err(Invalid); // end_of_macroblock
        }
        self.record.set(address, motion.vectors[0][0]);
        self.store(address);
        Ok(())
    }

    /// Reads a DC coefficient and updates its predictor (7.2.1).
    #[inline]
    fn dc(&mut self, component: usize) -> Result<i32, Invalid> {
        self.bits.refill();
        let bits = &mut self.bits;
        let size = if component == 0 { LUMA_DC_SIZE.take(bits) } else { CHROMA_DC_SIZE.take(bits) };
        let size = u32::from(size?);
        if size > 0 {
            let value = self.bits.take(size) as i32;
            // Negative differences are coded as their ones' complement.
            let difference = if value >> (size - 1) == 0 { value + 1 - (1 << size) } else { value };
            self.dc[component] = (self.dc[component] + difference).clamp(0, 2047);
        }
        Ok(self.dc[component])
    }

    /// Decodes the coded blocks of a predicted macroblock.
    fn inter_blocks(&mut self, by_field: bool) -> Result<(), Invalid> {
        let blocks = self.coding.blocks;
        self.bits.refill();
        let mut pattern = u32::from(PATTERNS.take(&mut self.bits)?);
        if blocks > 6 {
            let more = blocks as u32 - 6;
            pattern = pattern << more | self.bits.take(more);
        } else if pattern == 0 {
            return Err(Invalid);
        }
        for i in 0..blocks {
            if pattern >> (blocks - 1 - i) & 1 == 1 {
                self.block(i, by_field, None)?;
            }
        }
        Ok(())
    }

    /// Decodes a block and adds it to the prediction. `dc` is the DC coefficient of an intra block.
    #[inline]
    fn block(&mut self, i: usize, by_field: bool, dc: Option<i32>) -> Result<(), Invalid> {
        let is_intra = dc.is_some();
        if let Some(dc) = dc.filter(|_| self.coding.header.is_dc_only) {
            self.coefficients.set_dc(dc);
            BlockSlot::new(&self.buffer, i, by_field).add(&self.coefficients, is_intra, &mut self.buffer);
            return Ok(());
        }
        // Chroma of 4:2:0 has the matrices of luma (7.4.2.1).
        let is_chroma = i >= 4 && self.coding.blocks > 6;
        let block = BlockQuantiser {
            codes: self.coding.codes(is_intra),
            weights: &self.coding.weights.0[2 * usize::from(is_chroma) + usize::from(!is_intra)],
            scan: self.coding.scan(),
            scale: self.quantiser_scale,
            dc,
        };
        let read = match self.coding.standard {
            Standard::Mpeg1 => self.coefficients.read::<true>(&mut self.bits, &block),
            Standard::Mpeg2 => self.coefficients.read::<false>(&mut self.bits, &block),
        };
        if read.is_ok() {
            BlockSlot::new(&self.buffer, i, by_field).add(&self.coefficients, is_intra, &mut self.buffer);
        }
        self.coefficients.clear();
        read
    }
}
