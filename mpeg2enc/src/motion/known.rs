//! Motion that a caller knows.

use plane::Correspondence;

/// Motion of a frame that the caller knows; nothing by default.
///
/// ```
/// use mpeg2enc::KnownMotion;
/// let field = plane::Correspondence::from_motion(plane::Plane::filled(64, 48, [1.0, 0.0]));
/// assert!(KnownMotion::from(&field).to_previous.is_some());
/// ```
#[derive(Clone, Copy, Debug, Default)]
pub struct KnownMotion<'a> {
    /// Where each pixel was in the frame before.
    pub to_previous: Option<&'a Correspondence>,
    /// Where each pixel will be in the frame after.
    pub to_next: Option<&'a Correspondence>,
}

impl<'a> From<&'a Correspondence> for KnownMotion<'a> {
    /// Where each pixel was in the frame before.
    fn from(to_previous: &'a Correspondence) -> Self {
        Self { to_previous: Some(to_previous), to_next: None }
    }
}

impl<'a> From<Option<&'a Correspondence>> for KnownMotion<'a> {
    /// Where each pixel was in the frame before, if it is known.
    fn from(to_previous: Option<&'a Correspondence>) -> Self {
        Self { to_previous, to_next: None }
    }
}
