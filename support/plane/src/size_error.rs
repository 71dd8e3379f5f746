//! Error for planes with mismatched sizes.

use crate::Plane;
use std::fmt;

/// Error for a plane with a size that does not match its related planes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct SizeError {
    /// Name of the plane.
    pub plane: &'static str,
    /// Actual number of samples per row.
    pub width: usize,
    /// Actual number of rows.
    pub height: usize,
    /// Expected number of samples per row.
    pub expected_width: usize,
    /// Expected number of rows.
    pub expected_height: usize,
}

impl SizeError {
    /// Checks that the plane called `name` has the `expected` width and height.
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
