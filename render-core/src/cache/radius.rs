//! Radius of a record from its light, before limits by the picture and by neighboring records.

use super::illumination::LocalIrradiance;
use super::tolerance::NORMAL_TOLERANCE;
use crate::luminance;
use glam::{Mat3A, Vec3A};

/// Ratio of the radius to the harmonic mean distance: Ward's a \[Ward88, eq. 2\]. It exceeds the usual 0.1…0.4 because
/// the weights decrease to zero at the radius.
pub(super) const BY_HARMONIC_MEAN: f32 = 0.6;
/// Ratio of the radius to the distance of the nearest surface. Records on either side of a thin wall end before it.
pub(super) const BY_NEAREST: f32 = 1.0;
/// Maximum change of irradiance over the radius by the gradient, as a fraction of the irradiance \[Krivanek08\].
const BY_GRADIENT: f32 = 0.7;
/// Maximum change of irradiance over the radius where the picture raises the radius, as a fraction of the irradiance.
/// Irradiance near such records changes more than a derivative predicts. In a simulation of `nave`, the value of
/// [`BY_GRADIENT`] would add a tenth to the relative MSE.
const KEPT_UP_BY_GRADIENT: f32 = 0.25;
/// Maximum length of a change of the normal: √(2 (1 − cos)).
const LARGEST_TURN: f32 = 0.632;
const _: () = assert!((LARGEST_TURN * LARGEST_TURN - 2.0 * NORMAL_TOLERANCE).abs() < 1e-3);

/// Returns the maximum radius that the surroundings allow \[m\].
pub(super) fn radius(estimate: &LocalIrradiance) -> f32 {
    // In the dark, the gradient term is 0/0 = NaN, which `min` ignores.
    (BY_HARMONIC_MEAN * estimate.harmonic_mean)
        .min(BY_NEAREST * estimate.nearest)
        .min(BY_GRADIENT * luminance(estimate.irradiance) / slope(&estimate.by_position))
}

/// Returns the factor, 0…1, on a record's derivatives if the picture changes the record's `own` radius to `radius`. The
/// factor limits the change of irradiance over the radius. The limit is stricter where the picture raises the radius,
/// because derivatives overshoot in this case.
pub(super) fn trust(estimate: &LocalIrradiance, own: f32, radius: f32) -> f32 {
    // Limit the larger change: over the radius, or over the largest rotation of the normal.
    let share = if radius > own { KEPT_UP_BY_GRADIENT } else { BY_GRADIENT };
    let most = share * luminance(estimate.irradiance);
    let change = (slope(&estimate.by_position) * radius).max(slope(&estimate.by_normal) * LARGEST_TURN);
    if change > most { most / change } else { 1.0 }
}

/// Returns the length of the luminance's gradient.
fn slope(gradient: &Mat3A) -> f32 {
    let Mat3A { x_axis, y_axis, z_axis } = *gradient;
    Vec3A::from_array([x_axis, y_axis, z_axis].map(|column| luminance(column.into()))).length()
}
