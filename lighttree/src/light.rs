//! The point light, element of all clusters: its geometry term and its unshadowed share of the light reflected at a receiver.

use glam::{Vec3, Vec4};

use crate::lanes::{Real, Vector3};
use crate::receiver::Receiver;

/// Weights of linear RGB (Rec. 709 primaries) in luminance; they sum to one, so luminance keeps the unit of its argument.
pub const LUMINANCE_WEIGHTS: Vec3 = Vec3::from_array(plane::LUMINANCE_WEIGHTS);

/// Luminance of a linear RGB quantity, in the quantity's own unit.
#[inline]
#[must_use]
pub fn luminance(rgb: Vec3) -> f32 {
    rgb.dot(LUMINANCE_WEIGHTS)
}

/// Largest coordinate of a light \[m\] and largest intensity \[W·sr⁻¹\]; beyond, sums and squares may leave the range of `f32`.
const LARGEST_COORDINATE: f32 = 1e15;
const LARGEST_INTENSITY: f32 = 1e25;

/// Squared distance \[m²\] below which a direction to the light no longer exists in `f32`.
pub(crate) const SMALLEST_DISTANCE2: f32 = 1e-30;

/// How the intensity of a light depends on the direction it leaves in.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum Emission {
    /// The same in all directions.
    Omni,
    /// `max(0, cos θ)` of the axis' intensity, θ being the angle to this unit axis: a virtual light on a surface.
    Cosine(Vec3),
    /// Parallel light that travels along this unit vector, as from a sun: the same everywhere, whatever the light's
    /// position. Its `intensity` is the irradiance on a surface that faces it \[W·m⁻²\].
    Directional(Vec3),
}

/// A point light, or one so far away that only its direction is left.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Light {
    /// Where it is, in world space \[m\]; for [`Emission::Directional`] it does not matter, but has to be finite.
    pub position: Vec3,
    /// Where it shines.
    pub emission: Emission,
    /// Radiant intensity, linear RGB \[W·sr⁻¹\], not negative; along the axis for [`Emission::Cosine`];
    /// irradiance \[W·m⁻²\] for [`Emission::Directional`].
    pub intensity: Vec3,
}

impl Light {
    /// The light as it enters a tree: axis of unit length, and no intensity if any field is unusable.
    pub(crate) fn accepted(mut self) -> (Self, Fitness) {
        let mut placed = self.position.is_finite() && self.position.abs().max_element() <= LARGEST_COORDINATE;
        if !placed {
            self.position = Vec3::ZERO;
        }
        let mut unit = |axis: Vec3| {
            // What is of unit length already stays as it is, to the last bit.
            let unit = if (axis.length_squared() - 1.0).abs() < 1e-6 { Some(axis) } else { axis.try_normalize() };
            placed &= unit.is_some();
            unit.unwrap_or(Vec3::Z)
        };
        self.emission = match self.emission {
            Emission::Omni => Emission::Omni,
            Emission::Cosine(axis) => Emission::Cosine(unit(axis)),
            Emission::Directional(travel) => Emission::Directional(unit(travel)),
        };
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

/// Usability of a light that enters a tree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Fitness {
    Good,
    /// Its intensity was unusable and is now zero.
    Darkened,
    /// Its position or axis was unusable: the intensity has to stay zero.
    Misplaced,
}

/// The intensity itself, or zero where it is not finite, negative or too large for sums; and whether it was usable.
pub(crate) fn accepted_intensity(intensity: Vec3) -> (Vec3, bool) {
    // Comparisons with NaN are false, so this covers all of it.
    let usable =
        intensity.min_element() >= 0.0 && intensity.max_element() <= LARGEST_INTENSITY && intensity.is_finite();
    (if usable { intensity } else { Vec3::ZERO }, usable)
}

/// Value of [`Node::cone_cosine`](crate::node::Node) and of [`Site::kind`] that marks directional lights, below any cosine.
pub(crate) const DIRECTIONAL: f32 = -2.0;

/// Position and axis of a light, or of four: all that an estimate reads.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Site<F> {
    /// Position; the unit direction towards a directional light.
    pub position: Vector3<F>,
    pub axis: Vector3<F>,
    /// Cosine of the cone of axes, as nodes have it: 1 for an axis, −1 for omni lights, [`DIRECTIONAL`].
    pub kind: F,
    /// See [`StoredSite::delay`].
    pub delay: F,
}

/// Site of one light as it lies in memory: half a cache line.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(32))]
pub(crate) struct StoredSite {
    pub position: Vec3,
    pub kind: f32,
    pub axis: Vec3,
    /// Time until its shadow ray is traced, at unit light: the light's number in the race of
    /// [halves](crate::cut) \[W·m⁻²·sr⁻¹\]; 0 where there is none.
    pub delay: f32,
}

impl StoredSite {
    /// The site of no light.
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

    /// Four of them side by side.
    #[inline(always)]
    pub fn four(sites: [&Self; 4]) -> Site<Vec4> {
        let [px, py, pz, kind] = transpose(sites.map(|s| Vec4::new(s.position.x, s.position.y, s.position.z, s.kind)));
        let [ax, ay, az, delay] = transpose(sites.map(|s| Vec4::new(s.axis.x, s.axis.y, s.axis.z, s.delay)));
        Site { position: Vector3 { x: px, y: py, z: pz }, axis: Vector3 { x: ax, y: ay, z: az }, kind, delay }
    }
}

/// Rows to columns.
#[inline(always)]
pub(crate) fn transpose([a, b, c, d]: [Vec4; 4]) -> [Vec4; 4] {
    let m = glam::Mat4::from_cols(a, b, c, d).transpose();
    [m.x_axis, m.y_axis, m.z_axis, m.w_axis]
}

/// M·G of a light: radiance at the receiver per unit of the light's intensity, visibility left out
/// \[m⁻²; 1 for directional lights\].
///
/// ```text
/// L = M · G · V · I                        \[Walter05\], eq. 1
///   M  material term, the receiver's cosine included
///   G  cos θ_light / (r² + s²)             Cosine
///      1 / (r² + s²)                       Omni
///      1                                   Directional
///   V  visibility, 0 or 1
///   I  intensity
/// ```
/// `s²` (`geometry_term_bound`) is ours: it keeps G finite close to a light that stands for a disc.
/// A receiver exactly on the light gets nothing from it, as no direction exists.
#[inline(always)]
pub(crate) fn unshadowed<F: Real, R: Receiver>(
    receiver: &R,
    position: Vector3<F>,
    site: &Site<F>,
    geometry_term_bound: F,
) -> Vector3<F> {
    unshadowed_of::<false, F, R>(receiver, position, site, geometry_term_bound)
}

/// [`unshadowed`], to the same bits, of lights that are known to be `Cosine` if `COSINE`: their kind is not read.
#[inline(always)]
pub(crate) fn unshadowed_of<const COSINE: bool, F: Real, R: Receiver>(
    receiver: &R,
    position: Vector3<F>,
    site: &Site<F>,
    geometry_term_bound: F,
) -> Vector3<F> {
    let (zero, one) = (F::splat(0.0), F::splat(1.0));
    let far = site.kind.lt(F::splat(-1.5));
    let from = if COSINE { position } else { Vector3::select(far, Vector3::splat(Vec3::ZERO), position) };
    let to_light = site.position - from;
    let r2 = to_light.dot(to_light);
    let somewhere = r2.max(F::splat(SMALLEST_DISTANCE2));
    let direction = to_light * (one / somewhere.sqrt());
    let cosine = -site.axis.dot(direction);
    let emitted = if COSINE { cosine } else { F::select(site.kind.lt(zero), one, cosine) };
    let spread2 = if COSINE { r2 + geometry_term_bound } else { F::select(far, one, r2 + geometry_term_bound) };
    let g = emitted * (one / spread2);
    let lit = F::select(r2.lt(F::splat(SMALLEST_DISTANCE2)), zero, emitted);
    Vector3::select(zero.lt(lit), receiver.reflect(direction) * g, Vector3::splat(Vec3::ZERO))
}

/// [`unshadowed`] for one light.
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

    /// Also at the light itself, behind it, in its plane and behind the receiver's.
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

    /// A lamp of 1 W/sr two meters above a white diffuse floor: L = ρ/π · I/r² = 1/(4π); it shines down, or sideways.
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
        // A sun of 1 W/m² that stands 60° from the zenith: L = ρ/π · E cos 60°, wherever the "lamp" is.
        let sun = Emission::Directional(Vec3::new(0.75f32.sqrt(), 0.0, -0.5));
        assert!((value(sun) - 0.5 / std::f32::consts::PI).abs() < 1e-7);
        assert_eq!(value(Emission::Directional(Vec3::Z)), 0.0);
    }
}
