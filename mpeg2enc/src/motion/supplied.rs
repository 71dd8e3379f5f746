//! Motion supplied by the caller.

use plane::Correspondence;

/// Motion of a frame supplied by the caller; empty by default.
///
/// ```
/// use mpeg2enc::SuppliedMotion;
/// let field = plane::Correspondence::from_motion(plane::Plane::filled(64, 48, [1.0, 0.0]));
/// assert!(SuppliedMotion::from(&field).to_previous.is_some());
/// ```
#[derive(Clone, Copy, Debug, Default)]
pub struct SuppliedMotion<'a> {
    /// Position of each pixel in the previous frame.
    pub to_previous: Option<&'a Correspondence>,
    /// Position of each pixel in the next frame.
    pub to_next: Option<&'a Correspondence>,
}

impl<'a> From<&'a Correspondence> for SuppliedMotion<'a> {
    /// Uses a field of positions in the previous frame.
    fn from(to_previous: &'a Correspondence) -> Self {
        Self { to_previous: Some(to_previous), to_next: None }
    }
}

impl<'a> From<Option<&'a Correspondence>> for SuppliedMotion<'a> {
    /// Uses an optional field of positions in the previous frame.
    fn from(to_previous: Option<&'a Correspondence>) -> Self {
        Self { to_previous, to_next: None }
    }
}
