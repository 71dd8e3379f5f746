//! Maximum values of settings.

/// Maximum distance between I pictures. A macroblock is predicted at most 131 times before it is intra coded again. This bounds
/// the accumulated mismatch of inverse transforms that the standard allows.
pub(crate) const GROUP_MAX: u32 = 132;
/// Maximum width and height that horizontal_size and vertical_size can represent (6.3.3, 14 bits).
pub(crate) const SIZE_MAX: usize = 16383;
/// Maximum number of consecutive B pictures; with more, vectors would become too long.
pub(crate) const B_PICTURES_MAX: u32 = 7;
/// Maximum look-ahead in frames; inheritance beyond a few dozen frames has no effect.
pub(crate) const LOOKAHEAD_MAX: u32 = 30;
