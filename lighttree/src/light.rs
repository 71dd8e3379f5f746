//! Point lights, which are the elements of clusters: geometry term and unshadowed contribution at a receiver.

use glam::{Vec3, Vec4};

use crate::lanes::{Real, Vector3};
use crate::receiver::Receiver;

/// Weights of linear RGB (Rec. 709 primaries) in luminance. Their sum is 1, so luminance has the unit of its
/// components.
pub const LUMINANCE_WEIGHTS: Vec3 = Vec3::from_array(plane::LUMINANCE_WEIGHTS);

/// Returns the luminance of a linear RGB quantity, in the unit of its components.
#[inline]
#[must_use]
pub fn luminance(rgb: Vec3) -> f32 {
    rgb.dot(LUMINANCE_WEIGHTS)
}

/// Largest coordinate of a light \[m\]. Beyond it, sums or squares may overflow `f32`.
const LARGEST_COORDINATE: f32 = 1e15;
/// Largest intensity of a light \[W·sr⁻¹\]. Beyond it, sums or squares may overflow `f32`.
const LARGEST_INTENSITY: f32 = 1e25;

/// Smallest squared distance \[m²\] with a defined direction to the light in `f32`.
pub(crate) const SMALLEST_DISTANCE2: f32 = 1e-30;

/// Directional distribution of a light's intensity.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum Emission {
    /// Equal intensity in all directions.
    Omni,
    /// Intensity times `max(0, cos θ)`, where θ is the angle to this unit axis: a virtual light on a surface.
    Cosine(Vec3),
    /// Parallel light that travels along this unit vector, like sunlight. It is uniform everywhere, and the light's
    /// position has no effect. `intensity` is the irradiance on a surface that faces the light \[W·m⁻²\].
    Directional(Vec3),
}

/// A point light, or a directional light at infinite distance.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Light {
    /// World-space position \[m\]. It is unused for [`Emission::Directional`] but must be finite.
    pub position: Vec3,
    /// Directional distribution of the intensity.
    pub emission: Emission,
    /// Radiant intensity, linear RGB \[W·sr⁻¹\], not negative. For [`Emission::Cosine`] it is the intensity along the
    /// axis, for [`Emission::Directional`] the irradiance \[W·m⁻²\].
    pub intensity: Vec3,
}

impl Light {
    /// Normalizes a light for a tree: makes its axis a unit vector, and its intensity zero if any field is unusable.
    pub(crate) fn accepted(mut self) -> (Self, Fitness) {
        // Move lights outside the valid range to the origin, where sums of squares stay finite.
        let mut placed = self.position.is_finite() && self.position.abs().max_element() <= LARGEST_COORDINATE;
        if !placed {
            self.position = Vec3::ZERO;
        }
        let mut unit = |axis: Vec3| {
            // Do not change the bits of an axis that already has unit length.
            let unit = if (axis.length_squared() - 1.0).abs() < 1e-6 { Some(axis) } else { axis.try_normalize() };
            placed &= unit.is_some();
            unit.unwrap_or(Vec3::Z)
        };
        self.emission = match self.emission {
            Emission::Omni => Emission::Omni,
            Emission::Cosine(axis) => Emission::Cosine(unit(axis)),
            Emission::Directional(travel) => Emission::Directional(unit(travel)),
        };
        // Keep a misplaced light with zero intensity, so that light indices do not change.
        let (intensity, lit) = accepted_intensity(self.intensity);
        self.intensity = if placed { intensity } else { Vec3::ZERO };
        let fitness = match (placed, lit) {
            (false, _) => Fitness::Misplaced,
            (true, false) => Fitness::Darkened,
            (true, true) => Fitness::Good,
        };
        (self, fitness)
    }
}

/// Usability of a light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Fitness {
    Good,
    /// The intensity was unusable and is replaced by zero.
    Darkened,
    /// The position or the axis is unusable. The intensity must stay zero.
    Misplaced,
}

/// Returns the intensity and `true`, or zero and `false` if it is not finite, negative or too large for sums.
pub(crate) fn accepted_intensity(intensity: Vec3) -> (Vec3, bool) {
    // Comparisons with NaN are false, so NaN is rejected too.
    let usable =
        intensity.min_element() >= 0.0 && intensity.max_element() <= LARGEST_INTENSITY && intensity.is_finite();
    (if usable { intensity } else { Vec3::ZERO }, usable)
}

/// Marker of directional lights in [`Node::cone_cosine`](crate::node::Node) and [`Site::kind`], less than any cosine.
pub(crate) const DIRECTIONAL: f32 = -2.0;

/// Position and axis of one light or of four lights. They are the input of an estimate.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Site<F> {
    /// Position \[m\], or the unit direction towards a directional light.
    pub position: Vector3<F>,
    pub axis: Vector3<F>,
    /// Cosine of the cone of axes, as in nodes: 1 for an axis, −1 for omni lights, [`DIRECTIONAL`] for directional
    /// lights.
    pub kind: F,
    /// Delay in the race between the halves of a cluster, see [`StoredSite::delay`].
    pub delay: F,
}

/// Memory layout of one light's site: half a cache line.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(32))]
pub(crate) struct StoredSite {
    pub position: Vec3,
    pub kind: f32,
    pub axis: Vec3,
    /// Delay of the light in the race between [halves](crate::cut) at unit radiance \[W·m⁻²·sr⁻¹\]. It is 0 without a
    /// light.
    pub delay: f32,
}

impl StoredSite {
    /// Site without a light.
    pub const NOWHERE: Self = Self { position: Vec3::ZERO, kind: -1.0, axis: Vec3::Z, delay: 0.0 };

    pub fn new(light: &Light) -> Self {
        let (position, axis, kind) = match light.emission {
            Emission::Omni => (light.position, Vec3::Z, -1.0),
            Emission::Cosine(axis) => (light.position, axis, 1.0),
            Emission::Directional(travel) => (-travel, Vec3::Z, DIRECTIONAL),
        };
        Self { position, kind, axis, delay: 0.0 }
    }

    #[inline(always)]
    pub fn one(&self) -> Site<f32> {
        Site { position: self.position.into(), axis: self.axis.into(), kind: self.kind, delay: self.delay }
    }

    /// Gathers four sites into lanes.
    #[inline(always)]
    pub fn four(sites: [&Self; 4]) -> Site<Vec4> {
        let [px, py, pz, kind] = transpose(sites.map(|s| Vec4::new(s.position.x, s.position.y, s.position.z, s.kind)));
        let [ax, ay, az, delay] = transpose(sites.map(|s| Vec4::new(s.axis.x, s.axis.y, s.axis.z, s.delay)));
        Site { position: Vector3 { x: px, y: py, z: pz }, axis: Vector3 { x: ax, y: ay, z: az }, kind, delay }
    }
}

/// Returns the transpose of four rows.
#[inline(always)]
pub(crate) fn transpose([a, b, c, d]: [Vec4; 4]) -> [Vec4; 4] {
    let m = glam::Mat4::from_cols(a, b, c, d).transpose();
    [m.x_axis, m.y_axis, m.z_axis, m.w_axis]
}

/// Returns M·G of a light: radiance at the receiver per unit of the light's intensity, without visibility. The unit is
/// m⁻², or 1 for directional lights.
///
/// ```text
/// L = M · G · V · I                        \[Walter05\], eq. 1
///   M  material term, includes the receiver's cosine
///   G  cos θ_light / (r² + s²)             Cosine
///      1 / (r² + s²)                       Omni
///      1                                   Directional
///   V  visibility, 0 or 1
///   I  intensity
/// ```
/// The paper has no s² (`geometry_term_bound`). It keeps G finite close to a light that represents a disc. A receiver
/// exactly at the light's position receives nothing, because the direction is undefined.
#[inline(always)]
pub(crate) fn unshadowed<F: Real, R: Receiver>(
    receiver: &R,
    position: Vector3<F>,
    site: &Site<F>,
    geometry_term_bound: F,
) -> Vector3<F> {
    unshadowed_of::<false, F, R>(receiver, position, site, geometry_term_bound)
}

/// Returns the same bits as [`unshadowed`]. With `COSINE`, all lights must be `Cosine`, and their `kind` is not read.
#[inline(always)]
pub(crate) fn unshadowed_of<const COSINE: bool, F: Real, R: Receiver>(
    receiver: &R,
    position: Vector3<F>,
    site: &Site<F>,
    geometry_term_bound: F,
) -> Vector3<F> {
    let (zero, one) = (F::splat(0.0), F::splat(1.0));
    // Measure directional light from the origin, because its site contains the direction.
    let far = site.kind.lt(F::splat(-1.5));
    let from = if COSINE { position } else { Vector3::select(far, Vector3::splat(Vec3::ZERO), position) };
    let to_light = site.position - from;
    let r2 = to_light.dot(to_light);
    // Avoid a division by zero. Lights too close are rejected at the end.
    let somewhere = r2.max(F::splat(SMALLEST_DISTANCE2));
    let direction = to_light * (one / somewhere.sqrt());
    let cosine = -site.axis.dot(direction);
    // Only cosine emitters depend on the axis, and directional light has no falloff.
    let emitted = if COSINE { cosine } else { F::select(site.kind.lt(zero), one, cosine) };
    let spread2 = if COSINE { r2 + geometry_term_bound } else { F::select(far, one, r2 + geometry_term_bound) };
    let g = emitted * (one / spread2);
    let lit = F::select(r2.lt(F::splat(SMALLEST_DISTANCE2)), zero, emitted);
    Vector3::select(zero.lt(lit), receiver.reflect(direction) * g, Vector3::splat(Vec3::ZERO))
}

/// Returns the result of [`unshadowed`] for one light.
#[inline]
pub(crate) fn unshadowed_by<R: Receiver>(receiver: &R, light: &Light, geometry_term_bound: f32) -> Vec3 {
    unshadowed(receiver, receiver.position().into(), &StoredSite::new(light).one(), geometry_term_bound).into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::receiver::Lambert;

    #[test]
    fn unusable_lights_are_darkened() {
        let good = Light { position: Vec3::ONE, emission: Emission::Cosine(Vec3::Y * 3.0), intensity: Vec3::ONE };
        assert_eq!(good.accepted(), (Light { emission: Emission::Cosine(Vec3::Y), ..good }, Fitness::Good));
        use Fitness::{Darkened, Misplaced};
        for (bad, expected) in [
            (Light { position: Vec3::new(f32::NAN, 0.0, 0.0), ..good }, Misplaced),
            (Light { position: Vec3::splat(1e20), ..good }, Misplaced),
            (Light { emission: Emission::Cosine(Vec3::ZERO), ..good }, Misplaced),
            (Light { emission: Emission::Cosine(Vec3::splat(f32::INFINITY)), ..good }, Misplaced),
            (Light { intensity: Vec3::new(1.0, f32::NAN, 1.0), ..good }, Darkened),
            (Light { intensity: Vec3::new(1.0, f32::INFINITY, 1.0), ..good }, Darkened),
            (Light { intensity: Vec3::new(1.0, -1.0, 1.0), ..good }, Darkened),
        ] {
            let (light, fitness) = bad.accepted();
            assert_eq!(fitness, expected, "{bad:?}");
            assert!(light.position.is_finite() && light.intensity == Vec3::ZERO, "{light:?}");
        }
    }

    /// The receivers include receivers at the light, behind it and in its plane. The lights include lights behind the
    /// receiver.
    #[test]
    fn known_kinds_change_no_bit() {
        let receiver = Lambert { position: Vec3::ZERO, normal: Vec3::Z, reflectance: Vec3::new(0.7, 0.5, 0.3) };
        let position = Vector3::splat(receiver.position);
        for k in 0..1000 {
            let number = |salt: u64| crate::race::uniform(salt, k) as f32 - 0.5;
            let position_of_light = Vec3::new(number(1), number(2), number(3)) * (k % 10) as f32;
            let axis = if k % 7 == 0 { Vec3::Z } else { Vec3::new(number(4), number(5), number(6)).normalize() };
            let light = Light { position: position_of_light, emission: Emission::Cosine(axis), intensity: Vec3::ONE };
            let site = StoredSite::new(&light).one();
            let of = [
                unshadowed_of::<true, f32, _>(&receiver, position, &site, 1e-4),
                unshadowed_of::<false, f32, _>(&receiver, position, &site, 1e-4),
            ];
            let bits = of.map(|unit| Vec3::from(unit).to_array().map(f32::to_bits));
            assert_eq!(bits[0], bits[1], "{light:?}");
        }
    }

    /// A lamp of 1 W/sr is two meters above a white diffuse floor: L = ρ/π · I/r² = 1/(4π). It emits down or sideways.
    #[test]
    fn closed_form_below_a_lamp() {
        let receiver = Lambert { position: Vec3::ZERO, normal: Vec3::Z, reflectance: Vec3::ONE };
        let position = Vec3::new(0.0, 0.0, 2.0);
        let value = |emission| unshadowed_by(&receiver, &Light { position, emission, intensity: Vec3::ONE }, 0.0).x;
        let expected = 0.25 / std::f32::consts::PI;
        assert!((value(Emission::Omni) - expected).abs() < 1e-7);
        assert!((value(Emission::Cosine(-Vec3::Z)) - expected).abs() < 1e-7);
        assert_eq!(value(Emission::Cosine(Vec3::X)), 0.0);
        assert_eq!(value(Emission::Cosine(Vec3::Z)), 0.0);
        // Sunlight of 1 W/m² arrives at 60° from the zenith: L = ρ/π · E cos 60°, for any position of the light.
        let sun = Emission::Directional(Vec3::new(0.75f32.sqrt(), 0.0, -0.5));
        assert!((value(sun) - 0.5 / std::f32::consts::PI).abs() < 1e-7);
        assert_eq!(value(Emission::Directional(Vec3::Z)), 0.0);
    }
}
