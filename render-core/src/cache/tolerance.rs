//! Constants of the error measure in `group.rs`: differences between a record and a pixel at which the weight becomes
//! zero.

/// 1 − cos of the maximum angle between the normals of a record and a pixel: 37°.
pub(super) const NORMAL_TOLERANCE: f32 = 0.2;
/// Maximum difference of openness between a record and a pixel. In a simulation of `nave`, 0.25 needs 2 % fewer records
/// and leaves 2 % more error. 0.3 needs 4 % fewer records and leaves 6 % more error.
pub(super) const OPENNESS_TOLERANCE: f32 = 0.22;
/// Factor on distances along the normal, so that a step counts as another surface.
pub(super) const ACROSS: f32 = 5.0;
