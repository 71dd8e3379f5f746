//! Irradiance at a point, packed into 20 bytes.

use glam::{Vec2, Vec3, Vec3A};

/// Number of bits of each channel's mantissa.
const MANTISSA_BITS: u32 = 13;
/// Number of bits of the exponent (base 2) that the channels share.
const EXPONENT_BITS: u32 = 9;
/// Number of bits of each coordinate of the normal.
const NORMAL_BITS: u32 = 8;
const _: () = assert!(3 * MANTISSA_BITS + EXPONENT_BITS + 2 * NORMAL_BITS == 64);
/// Maximum mantissa.
const WHOLE: f32 = ((1 << MANTISSA_BITS) - 1) as f32;
/// First bit of the normal.
const NORMAL_BEGIN: u32 = 3 * MANTISSA_BITS + EXPONENT_BITS;
/// Stored value that represents the exponent 0.
const BIAS: i32 = 1 << (EXPONENT_BITS - 1);
/// Maximum coordinate of a stored normal.
const NORMAL_SCALE: f32 = 127.0;
/// Stored value that represents the coordinate 0 of a normal.
const NORMAL_ZERO: f32 = 128.0;

/// Irradiance \[W·m⁻²\] at a point \[m\] of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Sample {
    /// Position \[m\], or NaN without known light.
    pub position: [f32; 3],
    /// Mantissas of R, G and B, exponent and normal (octahedral), from the lowest bits up.
    packed: [u32; 2],
}

impl Sample {
    /// Sample without known light.
    pub const NONE: Self = Self { position: [f32::NAN; 3], packed: [0; 2] };

    pub fn new(position: [f32; 3], normal: Vec3, irradiance: Vec3) -> Self {
        // Use the exponent e of the brightest channel for all channels: E ≈ m 2^e / WHOLE. Store black and non-finite
        // values as 0.
        let most = irradiance.max_element();
        let mut packed = 0;
        if most.is_normal() && most > 0.0 {
            // Derive the least e with most < 2^e: the exponent field of an f32 is e + 126.
            let exponent = (most.to_bits() >> 23) as i32 - 126;
            let unit = exp2(-exponent) * WHOLE;
            for (k, channel) in (0..).zip(irradiance.to_array()) {
                packed |= ((channel * unit).round() as u64) << (k * MANTISSA_BITS);
            }
            packed |= ((exponent + BIAS) as u64) << (3 * MANTISSA_BITS);
        }

        packed |= u64::from(PackedNormal::new(normal).0) << NORMAL_BEGIN;
        Self { position, packed: [packed as u32, (packed >> 32) as u32] }
    }

    fn bits(&self, from: u32, count: u32) -> u32 {
        let [low, high] = self.packed;
        ((u64::from(high) << 32 | u64::from(low)) >> from) as u32 & ((1 << count) - 1)
    }

    /// Returns the normal, accurate to one degree.
    pub fn normal(&self) -> PackedNormal {
        PackedNormal(self.bits(NORMAL_BEGIN, 2 * NORMAL_BITS))
    }

    pub fn irradiance(&self) -> Vec3 {
        let unit = exp2(self.bits(3 * MANTISSA_BITS, EXPONENT_BITS) as i32 - BIAS) * (1.0 / WHOLE);
        Vec3::from_array([0, 1, 2].map(|k| self.bits(k * MANTISSA_BITS, MANTISSA_BITS) as f32 * unit))
    }
}

/// Unit normal as a position on the unfolded octahedron.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct PackedNormal(u32);

impl PackedNormal {
    pub fn new(normal: Vec3) -> Self {
        // Map −1…1 to 1…255, so that 0 is exact.
        let [x, y] = octahedral(normal).to_array().map(|x| (x * NORMAL_SCALE + NORMAL_ZERO).round() as u32);
        Self(x | y << NORMAL_BITS)
    }

    /// Returns a vector along the normal, of length 0.5 to 1.
    fn along(self) -> Vec3A {
        let coordinate = |k: u32| {
            let stored = self.0 >> (k * NORMAL_BITS) & ((1 << NORMAL_BITS) - 1);
            (stored as f32 - NORMAL_ZERO) * (1.0 / NORMAL_SCALE)
        };
        from_octahedral(Vec2::new(coordinate(0), coordinate(1))).into()
    }

    /// Returns whether the cosine of the angle to the unit vector `other` is at least `cosine` > 0.
    pub fn is_within(self, cosine: f32, other: Vec3A) -> bool {
        let along = self.along();
        let dot = along.dot(other);
        dot > 0.0 && dot * dot >= cosine * cosine * along.length_squared()
    }
}

impl Default for Sample {
    fn default() -> Self {
        Self::NONE
    }
}

/// Maps a unit vector to the square −1…1. The map unfolds the octahedron |x| + |y| + |z| = 1, with its lower half
/// folded outwards.
fn octahedral(v: Vec3) -> Vec2 {
    let v = v / v.abs().element_sum().max(f32::MIN_POSITIVE);
    if v.z >= 0.0 { v.truncate() } else { folded(v.truncate()) }
}

/// Inverts [`octahedral`], except for the length.
fn from_octahedral(p: Vec2) -> Vec3 {
    let z = 1.0 - p.x.abs() - p.y.abs();
    (if z >= 0.0 { p } else { folded(p) }).extend(z)
}

fn folded(p: Vec2) -> Vec2 {
    (Vec2::ONE - Vec2::new(p.y, p.x).abs()) * Vec2::ONE.copysign(p)
}

/// Returns 2 to the power of `exponent`, exactly for −126…127. Clamps other exponents.
fn exp2(exponent: i32) -> f32 {
    f32::from_bits(((exponent.clamp(-126, 127) + 127) as u32) << 23)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::{sobol_point, uniform_sphere};

    #[test]
    fn light_of_any_brightness_comes_back_within_a_part_in_ten_thousand() {
        for scale in [1e-30f32, 1e-3, 1.0, 0.99999994, 1.0000001, 7.3, 1e5, 1e30] {
            for color in [Vec3::new(1.0, 0.5, 0.25), Vec3::new(1e-3, 1.0, 0.0), Vec3::ONE] {
                let light = color * scale;
                let sample = Sample::new([1.0, -2.0, 3.0], Vec3::Z, light);
                let error = (sample.irradiance() - light).abs().max_element();
                assert!(error <= 1.3e-4 * light.max_element(), "{light} came back as {}", sample.irradiance());
                assert_eq!(sample.position, [1.0, -2.0, 3.0]);
            }
        }
        assert_eq!(Sample::new([0.0; 3], Vec3::X, Vec3::ZERO).irradiance(), Vec3::ZERO);
        assert!(Sample::NONE.position[0].is_nan());
        assert_eq!(size_of::<Sample>(), 20);
    }

    #[test]
    fn normals_come_back_within_a_degree() {
        let axes = [Vec3::X, Vec3::Y, Vec3::Z, -Vec3::X, -Vec3::Y, -Vec3::Z];
        for normal in (0..500).map(|k| uniform_sphere(sobol_point(k))).chain(axes) {
            let back = Sample::new([0.0; 3], normal, Vec3::ONE * 1e30).normal();
            let angle = Vec3::from(back.along()).angle_between(normal).to_degrees();
            assert!(angle < 1.0, "{normal} came back as {}", back.along());
            let within = |degrees: f32| back.is_within(degrees.to_radians().cos(), normal.into());
            assert!(within(1.1) && !PackedNormal::new(-normal).is_within(0.1, normal.into()));
        }
    }
}
