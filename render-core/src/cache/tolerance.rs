//! Differences between a record and a pixel at which the record is no use: constants of the error measure in `group.rs`.

/// 1 − cos of the largest angle between the normals of a record and of a pixel that uses it: 37°.
pub(super) const NORMAL_TOLERANCE: f32 = 0.2;
/// Difference of openness at which a record is no use. In a simulation of `nave` 0.25 needs 2 % fewer records and leaves 2 % more
/// error, 0.3 needs 4 % fewer and leaves 6 % more.
pub(super) const OPENNESS_TOLERANCE: f32 = 0.22;
/// Factor of distances along the normal: a step is another surface.
pub(super) const ACROSS: f32 = 5.0;
