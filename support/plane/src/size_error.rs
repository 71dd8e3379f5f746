//! Planes whose sizes do not belong together.

use crate::Plane;
use std::fmt;

/// A plane has another size than those that it stands with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct SizeError {
    /// Name of the plane.
    pub plane: &'static str,
    /// Samples in its rows.
    pub width: usize,
    /// Its rows.
    pub height: usize,
    /// Samples that its rows should have.
    pub expected_width: usize,
    /// Rows that it should have.
    pub expected_height: usize,
}

impl SizeError {
    /// Compares the size of the plane called `name` with the width and height `expected`.
    pub(crate) fn check<T: Copy>(name: &'static str, plane: &Plane<T>, expected: (usize, usize)) -> Result<(), Self> {
        let (width, height) = (plane.width(), plane.height());
        if (width, height) == expected {
            return Ok(());
        }
        Err(Self { plane: name, width, height, expected_width: expected.0, expected_height: expected.1 })
    }
}

impl fmt::Display for SizeError {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let Self { plane, width, height, expected_width, expected_height } = self;
        write!(f, "{plane} has {width}x{height} samples and needs {expected_width}x{expected_height}")
    }
}

impl std::error::Error for SizeError {}
