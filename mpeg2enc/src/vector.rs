//! Motion vectors and their allowed ranges.

use plane::Plane;

/// A vector in half luma samples, as coded (7.6.3): from a macroblock to its position in the reference picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct HalfSample {
    pub x: i32,
    pub y: i32,
}

impl HalfSample {
    pub const ZERO: Self = Self { x: 0, y: 0 };

    pub fn offset(self, x: i32, y: i32) -> Self {
        Self { x: self.x + x, y: self.y + y }
    }

    /// Returns whether the vector may be a sum of a few vectors over the largest picture.
    pub fn is_plausible(&self) -> bool {
        self.x.unsigned_abs().max(self.y.unsigned_abs()) <= 1 << 24
    }
}

/// Range of vectors that a macroblock may have.
#[derive(Clone, Copy)]
pub(crate) struct Range {
    x: (i32, i32),
    y: (i32, i32),
}

impl Range {
    /// Returns the range of vectors of the macroblock at `(column, row)`.
    pub fn new(reference: &Plane<u8>, column: usize, row: usize, f_code_max: [u32; 2]) -> Self {
        Self::of_block(reference, 16, column, row, f_code_max)
    }

    /// Returns the range of vectors of a block of `block`² samples: inside the reference picture (7.6.3.8) and within the
    /// largest f_code of the level.
    pub fn of_block(reference: &Plane<u8>, block: usize, column: usize, row: usize, f_code_max: [u32; 2]) -> Self {
        let range = |size: usize, position: usize, f_code: u32| {
            let reach = 16 << (f_code - 1);
            let (first, last) = (-2 * position as i32, 2 * (size - block - position) as i32);
            (first.max(-reach), last.min(reach - 1))
        };
        Self {
            x: range(reference.width(), block * column, f_code_max[0]),
            y: range(reference.height(), block * row, f_code_max[1]),
        }
    }

    pub fn contains(&self, vector: HalfSample) -> bool {
        (self.x.0..=self.x.1).contains(&vector.x) && (self.y.0..=self.y.1).contains(&vector.y)
    }

    /// Returns whether the range contains all vectors that differ from `vector` by at most `distance` in each component.
    pub fn contains_around(&self, vector: HalfSample, distance: i32) -> bool {
        self.contains(vector.offset(-distance, -distance)) && self.contains(vector.offset(distance, distance))
    }

    pub fn clamp(&self, vector: HalfSample) -> HalfSample {
        HalfSample { x: vector.x.clamp(self.x.0, self.x.1), y: vector.y.clamp(self.y.0, self.y.1) }
    }
}

/// Returns the smallest f_code with a reach that covers all vector components (Table 7-8).
pub(crate) fn f_code(components: impl Iterator<Item = i32>) -> u32 {
    let (low, high) = components.fold((0, 0), |(low, high), c| (low.min(c), high.max(c)));
    (1..).find(|f_code| -low <= 16 << (f_code - 1) && high < 16 << (f_code - 1)).expect("some reach suffices")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn f_codes_at_the_borders_of_their_reach() {
        assert_eq!(f_code([].into_iter()), 1);
        assert_eq!(f_code([-16, 15].into_iter()), 1);
        assert_eq!(f_code([16].into_iter()), 2);
        assert_eq!(f_code([-17].into_iter()), 2);
        assert_eq!(f_code([-4096, 4095].into_iter()), 9);
    }
}
