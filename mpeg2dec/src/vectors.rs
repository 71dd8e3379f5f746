//! Motion vectors and their predictors (7.6.3).

use crate::{
    bits::BitReader,
    lookup::{Invalid, MOTION},
};

/// Kind of motion compensation (Tables 6-17 and 6-18).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum MotionKind {
    /// One vector for the whole macroblock of a frame picture.
    Frame,
    /// One vector for each field of a macroblock of a frame picture.
    FrameFields,
    /// One vector for the whole macroblock of a field picture.
    Field,
    /// One vector for each half of a macroblock of a field picture.
    Halves,
    /// One vector and a small difference, for predictions from both parities.
    Dual,
}

/// Vectors of a macroblock.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MotionVectors {
    pub kind: MotionKind,
    /// Vectors by order and direction, in half samples over the lines that they refer to.
    pub vectors: [[[i32; 2]; 2]; 2],
    /// Parity of the reference field, by order and direction.
    pub field: [[usize; 2]; 2],
    /// dmvector of dual-prime prediction.
    pub dual: [i32; 2],
}

impl MotionVectors {
    /// Returns zero vectors. `parity` is the parity of a field picture.
    pub fn zero(kind: MotionKind, parity: usize) -> Self {
        Self { kind, vectors: [[[0; 2]; 2]; 2], field: [[parity; 2]; 2], dual: [0; 2] }
    }
}

/// Vector predictors: PMV by order, direction and component.
pub(crate) type VectorPredictors = [[[i32; 2]; 2]; 2];

/// Parameters of the vectors of a picture and direction.
#[derive(Clone, Copy)]
pub(crate) struct VectorCoding {
    pub direction: usize,
    pub f_code: [u32; 2],
    /// Whether the picture is a frame picture.
    pub in_frame: bool,
    /// Whether vectors are in whole samples (MPEG-1).
    pub full_pel: bool,
}

impl VectorCoding {
    /// Reads the vectors of one direction (6.2.5.2) and updates the predictors.
    pub fn read(
        self,
        bits: &mut BitReader,
        motion: &mut MotionVectors,
        predictors: &mut VectorPredictors,
    ) -> Result<(), Invalid> {
        let s = self.direction;
        let two = matches!(motion.kind, MotionKind::FrameFields | MotionKind::Halves);
        let has_field_select = two || motion.kind == MotionKind::Field;
        // Vectors of fields in a frame picture have predictors in frame lines.
        let halved = self.in_frame && motion.kind != MotionKind::Frame;
        for (r, predictor) in predictors.iter_mut().enumerate().take(1 + usize::from(two)) {
            if has_field_select {
                motion.field[r][s] = bits.read(1) as usize;
            }
            let [x, y] = predictor[s];
            let mut vector = [x, if halved { y >> 1 } else { y }];
            for (t, (value, f_code)) in vector.iter_mut().zip(self.f_code).enumerate() {
                *value = component(bits, *value, f_code)?;
                if motion.kind == MotionKind::Dual {
                    motion.dual[t] = dual_difference(bits);
                }
            }
            predictor[s] = if halved { [vector[0], 2 * vector[1]] } else { vector };
            motion.vectors[r][s] = if self.full_pel { vector.map(|v| 2 * v) } else { vector };
        }
        if !two {
            predictors[1][s] = predictors[0][s]; // Tables 7-9 and 7-10
        }
        Ok(())
    }
}

/// Reads one component and adds its prediction, modulo the range of `f_code` (7.6.3.1).
#[inline]
fn component(bits: &mut BitReader, predicted: i32, f_code: u32) -> Result<i32, Invalid> {
    bits.refill();
    let code = MOTION.take(bits)?;
    if code == 0 {
        return Ok(predicted);
    }
    let negative = bits.take(1) == 1;
    let r_size = f_code - 1;
    let mut delta = (i32::from(code) - 1) << r_size;
    if r_size > 0 {
        delta += bits.take(r_size) as i32;
    }
    delta += 1;
    // The sum wraps to 5 + r_size bits.
    let unused = 32 - (5 + r_size);
    Ok((predicted + if negative { -delta } else { delta }) << unused >> unused)
}

/// Reads dmvector (Table B.11).
fn dual_difference(bits: &mut BitReader) -> i32 {
    if !bits.flag() {
        0
    } else if bits.flag() {
        -1
    } else {
        1
    }
}

/// Returns the vector of dual-prime prediction to the opposite parity (7.6.3.6). `distance` is the number of fields, 1 or 3,
/// and `parity` the parity of the predicted field.
pub(crate) fn opposite_parity(motion: &MotionVectors, distance: i32, parity: usize) -> [i32; 2] {
    let scaled = |v: i32| (v * distance + i32::from(v > 0)) >> 1;
    let [x, y] = motion.vectors[0][0];
    let shift = if parity == 0 { -1 } else { 1 };
    [scaled(x) + motion.dual[0], scaled(y) + shift + motion.dual[1]]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn components_wrap_to_their_range() {
        // motion_code 2 (001) and a positive sign.
        assert_eq!(component(&mut BitReader::new(&[0b0010_0000]), 15, 1), Ok(-15));
        // motion_code −1 (01, sign 1) with residual 1 of f_code 2: a difference of −2.
        assert_eq!(component(&mut BitReader::new(&[0b0111_0000]), 3, 2), Ok(1));
    }

    #[test]
    fn dual_prime_rounds_away_from_zero() {
        let mut motion = MotionVectors::zero(MotionKind::Dual, 0);
        motion.vectors[0][0] = [3, -3];
        assert_eq!(opposite_parity(&motion, 1, 1), [2, -1]);
        assert_eq!(opposite_parity(&motion, 3, 0), [5, -6]);
    }
}
