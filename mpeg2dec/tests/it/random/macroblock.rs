//! Random macroblocks with valid vectors.

use super::{
    stream::{COLUMNS, CodedPicture, ROWS},
    syntax::Writer,
};
use fastrand::Rng;
use mpeg2::tables::{
    B_INTRA, B_INTRA_QUANT, B_MOTION, B_MOTION_CODED, B_MOTION_CODED_QUANT, I_INTRA, I_INTRA_QUANT, P_CODED,
    P_CODED_QUANT, P_INTRA, P_INTRA_QUANT, P_MOTION, P_MOTION_CODED, P_MOTION_CODED_QUANT,
};

/// Picture type.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Type {
    I = 0,
    P = 1,
    B = 2,
}

/// Motion compensation: the code of frame_motion_type or field_motion_type.
#[derive(Clone, Copy, PartialEq, Eq)]
struct Motion {
    code: u32,
    in_frame: bool,
}

impl Motion {
    fn is_dual(self) -> bool {
        self.code == 3
    }

    /// Returns whether there are two vectors: one per field of a frame, or one per half of a field.
    fn has_two(self) -> bool {
        self.code == if self.in_frame { 1 } else { 2 }
    }

    /// Returns whether vectors refer to lines of a field.
    fn is_field(self) -> bool {
        !self.in_frame || self.code != 2
    }
}

/// Vectors of one direction.
#[derive(Clone, Copy)]
struct Values {
    vectors: [[i32; 2]; 2],
    /// dmvector.
    dual: [i32; 2],
    /// motion_vertical_field_select of each vector.
    fields: [u32; 2],
}

/// Writer of the macroblocks of a slice.
pub struct MacroblockWriter {
    picture: CodedPicture,
    dc: [i32; 3],
    predictors: [[[i32; 2]; 2]; 2],
    /// Directions of the previous macroblock in a B picture; `None` after an intra macroblock.
    directions: Option<[bool; 2]>,
}

impl MacroblockWriter {
    pub fn new(picture: CodedPicture) -> Self {
        let mut new = Self { picture, dc: [0; 3], predictors: Default::default(), directions: None };
        new.reset_dc();
        new
    }

    fn reset_dc(&mut self) {
        self.dc = [128 << self.picture.features.dc_precision; 3];
    }

    /// Returns whether a block of `height` luma lines at `at` may have a vector, in lines of the whole picture or of a field.
    fn is_valid(&self, vector: [i32; 2], at: [usize; 2], height: usize, in_field: bool) -> bool {
        let lines = if in_field { 8 * ROWS } else { 16 * ROWS };
        let is_inside = |v: i32, position: usize, size: usize, limit: usize| {
            let start = 2 * position as i32 + v;
            start >= 0 && start + 2 * size as i32 <= 2 * limit as i32
        };
        is_inside(vector[0], at[0], 16, 16 * COLUMNS) && is_inside(vector[1], at[1], height, lines)
    }

    /// Skips a macroblock if its prediction is valid.
    pub fn skip(&mut self, [column, row]: [usize; 2]) -> bool {
        match (self.picture.kind, self.directions) {
            (Type::P, _) => self.predictors = Default::default(),
            // libavcodec does not double the vectors of skipped macroblocks.
            (Type::B, Some(_)) if self.picture.features.full_pel => return false,
            (Type::B, Some(directions)) => {
                let at = [16 * column, 16 * row];
                for s in (0..2).filter(|&s| directions[s]) {
                    if !self.is_valid(self.predictors[0][s], at, 16, self.picture.parity.is_some()) {
                        return false;
                    }
                }
            }
            _ => return false,
        }
        self.reset_dc();
        true
    }

    /// Writes a random macroblock after its address.
    pub fn write(&mut self, writer: &mut Writer, random: &mut Rng, at: [usize; 2]) {
        let kind = self.picture.kind;
        if kind == Type::I || random.u32(0..5) == 0 {
            return self.intra(writer, random, at);
        }
        let (has_motion, coded, quant) = (kind == Type::B || random.u32(0..5) > 0, random.bool(), random.bool());
        let coded = coded || !has_motion;
        let direction = random.usize(0..3);
        let directions = if kind == Type::P { [has_motion, false] } else { [direction != 1, direction != 0] };
        writer.code(match (kind, has_motion, coded, quant) {
            (Type::P, true, false, _) => P_MOTION,
            (Type::P, true, true, false) => P_MOTION_CODED,
            (Type::P, true, true, true) => P_MOTION_CODED_QUANT,
            (Type::P, false, _, false) => P_CODED,
            (Type::P, false, _, true) => P_CODED_QUANT,
            (_, _, false, _) => B_MOTION[direction],
            (_, _, true, false) => B_MOTION_CODED[direction],
            (_, _, true, true) => B_MOTION_CODED_QUANT[direction],
        });
        let in_frame = self.picture.parity.is_none();
        let plain = Motion { code: if in_frame { 2 } else { 1 }, in_frame };
        let has_types = self.picture.features.interlaced && !self.picture.features.mpeg1;
        let (mut motion, mut vectors) = (plain, [[[0; 2]; 2]; 2]);
        if has_types && has_motion {
            motion.code = random.u32(1..if kind == Type::P { 4 } else { 3 });
        }
        let mut dual = [random.i32(-1..=1), random.i32(-1..=1)];
        if motion.is_dual() {
            match self.dual_vector(random, at, dual, in_frame) {
                Some(vector) => vectors[0][0] = vector,
                None => motion = plain,
            }
        }
        for s in (0..2).filter(|&s| directions[s] && !motion.is_dual()) {
            for (r, vector) in vectors.iter_mut().enumerate().take(1 + usize::from(motion.has_two())) {
                vector[s] = self.random_vector(random, at, motion, r);
            }
        }
        if has_types && has_motion && (in_frame || self.picture.parity.is_some()) {
            writer.put(motion.code, 2);
        }
        if has_types && in_frame && coded {
            writer.put(random.u32(0..2), 1); // dct_type
        }
        if coded && quant {
            writer.put(random.u32(1..6), 5);
        }
        if !motion.is_dual() {
            dual = [0; 2];
        }
        for s in (0..2).filter(|&s| directions[s]) {
            let fields = [random.u32(0..2), random.u32(0..2)];
            self.vectors(writer, s, motion, Values { vectors: [vectors[0][s], vectors[1][s]], dual, fields });
        }
        if !has_motion {
            self.predictors = Default::default();
        }
        self.directions = (kind == Type::B).then_some(directions);
        self.reset_dc();
        if coded {
            self.inter_blocks(writer, random);
        }
    }

    /// Returns a vector that predicts from inside the picture.
    fn random_vector(&self, random: &mut Rng, [column, row]: [usize; 2], motion: Motion, r: usize) -> [i32; 2] {
        let (height, top) = match (motion.in_frame, motion.has_two()) {
            (true, true) => (8, 8 * row),
            (false, true) => (8, 16 * row + 8 * r),
            _ => (16, 16 * row),
        };
        let reach = self.picture.f_code().map(|f_code| (16 << (f_code - 1)) - 1);
        let scale = if self.picture.features.full_pel { 2 } else { 1 };
        loop {
            let vector = reach.map(|reach| random.i32(-reach..=reach) / random.i32(1..6));
            if self.is_valid(vector.map(|v| scale * v), [16 * column, top], height, motion.is_field()) {
                return vector;
            }
        }
    }

    /// Returns a vector for dual-prime prediction, if one is found.
    fn dual_vector(&self, random: &mut Rng, at: [usize; 2], dual: [i32; 2], in_frame: bool) -> Option<[i32; 2]> {
        let (height, top) = if in_frame { (8, 8 * at[1]) } else { (16, 16 * at[1]) };
        for _ in 0..30 {
            let vector = [random.i32(-8..9), random.i32(-8..9)];
            let mut is_valid = self.is_valid(vector, [16 * at[0], top], height, true);
            for (distance, shift) in [(1, -1), (1, 1), (3, -1), (3, 1)] {
                // The nearest half sample; ties are rounded away from zero.
                let scaled = |v: i32| (v * distance + v.signum()) / 2;
                let opposite = [scaled(vector[0]) + dual[0], scaled(vector[1]) + shift + dual[1]];
                is_valid &= self.is_valid(opposite, [16 * at[0], top], height, true);
            }
            if is_valid {
                return Some(vector);
            }
        }
        None
    }

    /// Writes one or two vectors, and the difference of dual-prime prediction.
    fn vectors(&mut self, writer: &mut Writer, s: usize, motion: Motion, values: Values) {
        let f_code = self.picture.f_code();
        for r in 0..=usize::from(motion.has_two()) {
            if motion.has_two() || !motion.in_frame && !motion.is_dual() {
                writer.put(values.fields[r], 1); // motion_vertical_field_select
            }
            let halved = motion.in_frame && motion.is_field();
            let predicted = self.predictors[r][s];
            let predicted = if halved { [predicted[0], predicted[1] >> 1] } else { predicted };
            for t in 0..2 {
                writer.motion(values.vectors[r][t] - predicted[t], f_code[t]);
                if motion.is_dual() {
                    writer.dual_difference(values.dual[t]);
                }
            }
            let [x, y] = values.vectors[r];
            self.predictors[r][s] = if halved { [x, 2 * y] } else { [x, y] };
        }
        if !motion.has_two() {
            self.predictors[1][s] = self.predictors[0][s];
        }
    }

    fn intra(&mut self, writer: &mut Writer, random: &mut Rng, at: [usize; 2]) {
        let features = self.picture.features;
        let quant = random.bool();
        let [plain, with_quant] = match self.picture.kind {
            Type::I => [I_INTRA, I_INTRA_QUANT],
            Type::P => [P_INTRA, P_INTRA_QUANT],
            Type::B => [B_INTRA, B_INTRA_QUANT],
        };
        writer.code(if quant { with_quant } else { plain });
        let in_frame = self.picture.parity.is_none();
        if features.interlaced && in_frame {
            writer.put(random.u32(0..2), 1); // dct_type
        }
        if quant {
            writer.put(random.u32(1..6), 5);
        }
        if features.concealment {
            let motion = Motion { code: if in_frame { 2 } else { 1 }, in_frame };
            let vector = self.random_vector(random, at, motion, 0);
            let fields = [random.u32(0..2); 2];
            self.vectors(writer, 0, motion, Values { vectors: [vector; 2], dual: [0; 2], fields });
            writer.put(1, 1);
        } else {
            self.predictors = Default::default();
        }
        self.directions = None;
        // Restored coefficients stay below 2048, because libavcodec does not saturate them.
        let most = 35;
        let table = usize::from(features.alternate);
        for i in 0..self.blocks() as usize {
            let component = if i < 4 { 0 } else { 1 + i % 2 };
            let range = 256 << features.dc_precision;
            let dc =
                (self.dc[component] + random.i32(-range..range) / random.i32(4..40)).clamp(range / 8, range * 7 / 8);
            writer.dc(dc - self.dc[component], component == 0);
            self.dc[component] = dc;
            let mut place = 1;
            while random.u32(0..3) > 0 {
                let (run, level) = run_level(random, most);
                place += run + 1;
                if place > 64 {
                    break;
                }
                writer.coefficient(table, run, level, features.mpeg1);
            }
            writer.end_of_block(table);
        }
    }

    fn blocks(&self) -> u32 {
        [0, 6, 8, 12][self.picture.features.chroma as usize]
    }

    fn inter_blocks(&self, writer: &mut Writer, random: &mut Rng) {
        let blocks = self.blocks();
        // Pattern 0 of the first six blocks is reserved in 4:2:0.
        let pattern = random.u32(1..1 << blocks).max(if blocks == 6 { 1 } else { 1 << (blocks - 6) });
        writer.pattern(pattern, blocks);
        // Restored coefficients stay below 2048, because libavcodec does not saturate them.
        let most = if self.picture.features.matrices { 35 } else { 140 };
        for i in 0..blocks {
            if pattern >> (blocks - 1 - i) & 1 == 0 {
                continue;
            }
            let (run, level) = run_level(random, most);
            writer.first_coefficient(run, level, self.picture.features.mpeg1);
            let mut place = run + 1;
            while random.u32(0..3) > 0 {
                let (run, level) = run_level(random, most);
                place += run + 1;
                if place > 64 {
                    break;
                }
                writer.coefficient(0, run, level, self.picture.features.mpeg1);
            }
            writer.end_of_block(0);
        }
    }
}

/// Returns a random run and a level up to `most`. Most are small.
fn run_level(random: &mut Rng, most: i32) -> (usize, i32) {
    let run = if random.u32(0..8) == 0 { random.usize(0..60) } else { random.usize(0..6) };
    let magnitude = if random.u32(0..10) == 0 { random.i32(1..=most) } else { random.i32(1..5) };
    (run, if random.bool() { magnitude } else { -magnitude })
}
