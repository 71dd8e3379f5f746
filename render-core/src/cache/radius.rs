//! Radius of a record by the light found there, before the picture and its neighbors have a say.

use super::illumination::LocalIrradiance;
use super::tolerance::NORMAL_TOLERANCE;
use crate::luminance;
use glam::{Mat3A, Vec3A};

/// Radius by harmonic mean distance: Ward's a \[Ward88, eq. 2\]. Ours is larger than the usual 0.1…0.4, since the weights
/// fall off towards the border and reach zero there.
pub(super) const BY_HARMONIC_MEAN: f32 = 0.6;
/// Radius by distance of the nearest surface: to either side of a thin wall its records end before it.
pub(super) const BY_NEAREST: f32 = 1.0;
/// Change of irradiance over the radius that its gradient may predict, as a share of the irradiance \[Krivanek08\].
const BY_GRADIENT: f32 = 0.7;
/// The same where the picture keeps the radius up: what is near there changes more than a derivative tells. In a simulation
/// of `nave`, following it as far as elsewhere adds a tenth to the relative MSE.
const KEPT_UP_BY_GRADIENT: f32 = 0.25;
/// Length of the change of a normal that is tolerated: √(2 (1 − cos)).
const LARGEST_TURN: f32 = 0.632;
const _: () = assert!((LARGEST_TURN * LARGEST_TURN - 2.0 * NORMAL_TOLERANCE).abs() < 1e-3);

/// Radius that the surroundings allow \[m\].
pub(super) fn radius(estimate: &LocalIrradiance) -> f32 {
    // NaN from 0/0 in the dark gives way to the other two.
    (BY_HARMONIC_MEAN * estimate.harmonic_mean)
        .min(BY_NEAREST * estimate.nearest)
        .min(BY_GRADIENT * luminance(estimate.irradiance) / slope(&estimate.by_position))
}

/// How far the derivatives of a record are followed, 0…1, when the picture makes its `own` radius `radius`: so far that they
/// change the irradiance by no more than they may. Where the picture keeps the radius up, they would promise light that is not
/// there.
pub(super) fn trust(estimate: &LocalIrradiance, own: f32, radius: f32) -> f32 {
    // Changes of the irradiance over the radius, and over the largest turn of the normal: the larger one counts.
    let share = if radius > own { KEPT_UP_BY_GRADIENT } else { BY_GRADIENT };
    let most = share * luminance(estimate.irradiance);
    let change = (slope(&estimate.by_position) * radius).max(slope(&estimate.by_normal) * LARGEST_TURN);
    if change > most { most / change } else { 1.0 }
}

/// Length of the luminance's derivative.
fn slope(gradient: &Mat3A) -> f32 {
    let Mat3A { x_axis, y_axis, z_axis } = *gradient;
    Vec3A::from_array([x_axis, y_axis, z_axis].map(|column| luminance(column.into()))).length()
}
