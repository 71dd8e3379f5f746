//! Rectangular planes of samples.

/// Rectangle of `width × height` samples in raster order.
///
/// Invariant: `data.len() == width * height`, without padding.
#[derive(Clone, Debug, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(try_from = "StoredPlane<T>"))]
pub struct Plane<T> {
    data: Vec<T>,
    width: usize,
    height: usize,
}

/// Serialized form of a plane, before the size is checked.
#[cfg(feature = "serde")]
#[derive(serde::Deserialize)]
struct StoredPlane<T> {
    data: Vec<T>,
    width: usize,
    height: usize,
}

#[cfg(feature = "serde")]
impl<T> TryFrom<StoredPlane<T>> for Plane<T> {
    type Error = String;

    fn try_from(StoredPlane { data, width, height }: StoredPlane<T>) -> Result<Self, String> {
        match width.checked_mul(height) {
            Some(count) if count == data.len() => Ok(Self { data, width, height }),
            _ => Err(format!("{} samples are no plane of {width}x{height}", data.len())),
        }
    }
}

impl<T: Copy> Plane<T> {
    /// Returns a plane with every sample equal to `value`.
    #[must_use]
    pub fn filled(width: usize, height: usize, value: T) -> Self {
        Self { data: vec![value; width * height], width, height }
    }

    /// Returns a plane with the value `f(x, y)` in column `x` and row `y`.
    #[must_use]
    pub fn from_fn(width: usize, height: usize, mut f: impl FnMut(usize, usize) -> T) -> Self {
        let mut data = Vec::with_capacity(width * height);
        for y in 0..height {
            data.extend((0..width).map(|x| f(x, y)));
        }
        Self { data, width, height }
    }

    /// Wraps samples in raster order.
    ///
    /// # Panics
    /// If `data.len() != width * height`.
    #[must_use]
    pub fn from_vec(width: usize, height: usize, data: Vec<T>) -> Self {
        assert_eq!(data.len(), width * height, "a {width}x{height} plane needs exactly that many samples");
        Self { data, width, height }
    }

    /// Number of samples per row.
    #[must_use]
    pub fn width(&self) -> usize {
        self.width
    }

    /// Number of rows.
    #[must_use]
    pub fn height(&self) -> usize {
        self.height
    }

    /// Sample in column `x`, row `y`.
    ///
    /// # Panics
    /// If the position is outside the plane.
    #[inline]
    #[must_use]
    pub fn get(&self, x: usize, y: usize) -> T {
        self.row(y)[x]
    }

    /// Sample nearest to column `x`, row `y`. Positions outside the plane are clamped to its border.
    #[inline]
    #[must_use]
    pub fn get_clamped(&self, x: isize, y: isize) -> T {
        let x = x.clamp(0, self.width as isize - 1) as usize;
        let y = y.clamp(0, self.height as isize - 1) as usize;
        self.data[y * self.width + x]
    }

    /// Replaces the sample in column `x`, row `y`.
    ///
    /// # Panics
    /// If the position is outside the plane.
    #[inline]
    pub fn set(&mut self, x: usize, y: usize, value: T) {
        self.row_mut(y)[x] = value;
    }

    /// Samples of row `y`: a slice of length `width`.
    ///
    /// # Panics
    /// If the plane has no row `y`.
    #[inline]
    #[must_use]
    pub fn row(&self, y: usize) -> &[T] {
        &self.data[y * self.width..][..self.width]
    }

    /// Mutable samples of row `y`.
    ///
    /// # Panics
    /// If the plane has no row `y`.
    #[inline]
    #[must_use]
    pub fn row_mut(&mut self, y: usize) -> &mut [T] {
        &mut self.data[y * self.width..][..self.width]
    }

    /// Rows from top to bottom.
    pub fn rows(&self) -> impl Iterator<Item = &[T]> {
        // An empty plane has no rows. A chunk size of 0 would panic.
        self.data.chunks_exact(self.width.max(1))
    }

    /// Samples of the whole plane in raster order.
    #[must_use]
    pub fn samples(&self) -> &[T] {
        &self.data
    }

    /// Mutable samples of the whole plane in raster order. `chunks_mut(width * rows)` divides them among threads.
    #[must_use]
    pub fn samples_mut(&mut self) -> &mut [T] {
        &mut self.data
    }

    /// Returns a plane of the same size with `f` applied to every sample.
    #[must_use]
    pub fn map<U: Copy>(&self, f: impl FnMut(T) -> U) -> Plane<U> {
        Plane { data: self.data.iter().copied().map(f).collect(), width: self.width, height: self.height }
    }

    /// Returns the 8×8 block with its upper left sample at `(8 * column, 8 * row)`. Samples outside the plane repeat
    /// the last row and column.
    #[must_use]
    pub fn block(&self, column: usize, row: usize) -> [T; 64] {
        let (left, top) = (8 * column, 8 * row);
        if left + 8 <= self.width && top + 8 <= self.height {
            // Copy the rows of a block inside the plane.
            let mut out = [self.data[top * self.width + left]; 64];
            for y in 0..8 {
                out[8 * y..][..8].copy_from_slice(&self.row(top + y)[left..left + 8]);
            }
            out
        } else {
            std::array::from_fn(|i| self.get_clamped((left + i % 8) as isize, (top + i / 8) as isize))
        }
    }

    /// Replaces the samples of the 8×8 block with its upper left sample at `(8 * column, 8 * row)`. Samples of `block`
    /// outside the plane are ignored.
    ///
    /// ```
    /// use plane::Plane;
    ///
    /// let mut plane = Plane::filled(10, 9, 0);
    /// plane.set_block(1, 0, &[7; 64]);
    /// assert_eq!(plane.row(7), [0, 0, 0, 0, 0, 0, 0, 0, 7, 7]);
    /// assert_eq!(plane.row(8), [0; 10]);
    /// ```
    pub fn set_block(&mut self, column: usize, row: usize, block: &[T; 64]) {
        let (left, top) = (8 * column, 8 * row);
        let inside = self.width.saturating_sub(left).min(8);
        if inside == 0 {
            return;
        }
        for (line, samples) in self.data.chunks_exact_mut(self.width).skip(top).zip(block.chunks_exact(8)) {
            line[left..][..inside].copy_from_slice(&samples[..inside]);
        }
    }

    /// Number of columns and number of rows of 8×8 blocks that cover the plane.
    #[must_use]
    pub fn block_counts(&self) -> (usize, usize) {
        (self.width.div_ceil(8), self.height.div_ceil(8))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_repeat_the_border() {
        let plane = Plane::from_fn(10, 9, |x, y| (x + 100 * y) as i32);
        let corner = plane.block(1, 1);
        assert_eq!(corner[0], 808);
        assert_eq!(corner[7], 809, "columns beyond the last repeat it");
        assert_eq!(corner[63], 809, "rows too");
        assert_eq!(plane.block(0, 0)[9], 101);
        assert_eq!(plane.block_counts(), (2, 2));
    }

    #[test]
    fn blocks_written_back_give_the_same_plane() {
        for (width, height) in [(0, 0), (1, 1), (8, 8), (7, 17), (10, 9), (16, 3), (23, 24)] {
            let plane = Plane::from_fn(width, height, |x, y| (x + 100 * y) as i32);
            let mut copy = Plane::filled(width, height, -1);
            let (columns, rows) = plane.block_counts();
            for (column, row) in (0..rows).flat_map(|row| (0..columns).map(move |column| (column, row))) {
                let before = copy.clone();
                copy.set_block(column, row, &plane.block(column, row));
                let is_inside = |x, y| (x / 8, y / 8) == (column, row);
                let expected = |x, y| if is_inside(x, y) { plane.get(x, y) } else { before.get(x, y) };
                assert_eq!(copy, Plane::from_fn(width, height, expected), "only the block changes");
            }
            assert_eq!(copy, plane);
            copy.set_block(columns, 0, &[-1; 64]);
            copy.set_block(0, rows, &[-1; 64]);
            assert_eq!(copy, plane, "a block outside the plane has no effect");
        }
    }
}
