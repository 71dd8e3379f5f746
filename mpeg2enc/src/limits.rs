//! The largest values of settings.

/// The largest distance of I pictures: no macroblock is predicted more than 131 times before it is coded intra again,
/// so that the differences of inverse transforms, which the standard allows, do not add up without end.
pub(crate) const GROUP_MAX: u32 = 132;
/// The largest width and height that horizontal_size and vertical_size can say (6.3.3, 14 bits).
pub(crate) const SIZE_MAX: usize = 16383;
/// The most B pictures in a row: vectors would reach too far.
pub(crate) const B_PICTURES_MAX: u32 = 7;
/// The longest look-ahead: beyond a few dozen frames, what is inherited no longer changes.
pub(crate) const LOOKAHEAD_MAX: u32 = 30;
