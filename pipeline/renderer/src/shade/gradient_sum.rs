//! Irradiance with its derivatives, as a sum over lights or rays.

use glam::{Mat3A, Vec3, Vec3A};
use lighttree::IrradianceTerm;
use serde::{Deserialize, Serialize};

/// Maximum cosine of lights near the horizon, from which the light behind the horizon is estimated.
const HORIZON_COSINE: f32 = 0.4;

/// Irradiance E = Σ I t over lights of intensity I and geometry term t, with its derivatives.
///
/// ∂t/∂n is taken for a fixed horizon. Under uniform radiance L, rotating the normal n by α would then reduce E to
/// π L cos α. Light that rises over the horizon compensates for this loss. Its radiance is assumed to be Lₕ, the mean
/// radiance just above the horizon:
///
/// ```text
/// ∂E/∂n = Σ I ∂t/∂n − min(π Lₕ, E) nᵀ
/// Lₕ = Σ I t / cos θ / (2π h)          over the lights with cos θ < h
/// θ  angle between the normal and the direction to the light
/// h  HORIZON_COSINE
/// ```
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(crate) struct GradientSum {
    /// E \[W·m⁻²\].
    pub irradiance: Vec3,
    pub by_normal: Mat3A,
    pub by_position: Mat3A,
    /// Estimate of π Lₕ, from lights near the horizon \[W·m⁻²\].
    horizon: Vec3,
}

impl GradientSum {
    /// Sum without any light. (The default matrix would be the identity.)
    pub const ZERO: Self =
        Self { irradiance: Vec3::ZERO, by_normal: Mat3A::ZERO, by_position: Mat3A::ZERO, horizon: Vec3::ZERO };

    /// Adds a light of this `intensity`.
    pub fn add(&mut self, intensity: Vec3, term: &IrradianceTerm) {
        self.irradiance += intensity * term.value;
        self.by_normal += outer(intensity, term.by_normal);
        self.by_position += outer(intensity, term.by_position);
        // The length of ∂t/∂n is t / cos θ.
        let facing = term.by_normal.length();
        if term.value < HORIZON_COSINE * facing {
            self.horizon += intensity * (facing / (2.0 * HORIZON_COSINE));
        }
    }

    /// Adds the lights of another sum.
    pub fn add_all(&mut self, other: &Self) {
        self.irradiance += other.irradiance;
        self.by_normal += other.by_normal;
        self.by_position += other.by_position;
        self.horizon += other.horizon;
    }

    /// Returns ∂E/∂n with the light that rises over the horizon of `normal`.
    pub fn by_normal_and_horizon(&self, normal: Vec3) -> Mat3A {
        self.by_normal - outer(self.horizon.min(self.irradiance), normal)
    }
}

/// Returns the outer product `a · bᵀ`.
fn outer(a: Vec3, b: Vec3) -> Mat3A {
    let a = Vec3A::from(a);
    Mat3A::from_cols(a * b.x, a * b.y, a * b.z)
}
