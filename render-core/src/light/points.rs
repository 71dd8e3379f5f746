//! Choice of the sample points of a light.

/// Sample points of a light that receive shadow rays.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LightPoints {
    /// The first points, and all points where these disagree on the light's visibility.
    #[default]
    All,
    /// One of four quarters of the points, for pixels with several samples. The number is taken modulo 4.
    Quarter(usize),
}

impl LightPoints {
    /// Returns the quarter of `points`; `None` for all points.
    pub(super) fn quarter<T>(self, points: &[T]) -> Option<&[T]> {
        let Self::Quarter(number) = self else { return None };
        let length = points.len().div_ceil(4).max(1);
        points.chunks(length).nth(number % points.len().div_ceil(length).max(1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quarters_are_the_whole() {
        for count in [1, 2, 3, 4, 5, 32, 63, 64] {
            let points: Vec<usize> = (0..count).collect();
            let quarters = |number| LightPoints::Quarter(number).quarter(&points).unwrap();
            // Lights with few points have fewer than four parts, which repeat.
            let parts = count.div_ceil(count.div_ceil(4));
            assert_eq!((0..parts).flat_map(quarters).copied().collect::<Vec<_>>(), points);
            assert_eq!(quarters(parts), quarters(0));
            assert_eq!(LightPoints::All.quarter(&points), None);
        }
    }
}
