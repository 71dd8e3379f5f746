//! Baked light of normal-mapped surfaces: the irradiance of any normal, for each of their texels.
//!
//! A normal map has more detail than texels, so a single irradiance per texel would average its light. Such texels
//! store spherical harmonics, which are evaluated at the normal of a pixel. Files store 27 coefficients of 16 bits.

use glam::{Vec3, Vec3A};
use half::f16;
use lightfield::Harmonics;
use pipeline::state::{decode, encode};
use serde::{Deserialize, Serialize};

/// Coefficient of the largest magnitude in units of a file. It leaves most of the range of 16 bits to small values.
const LARGEST: f32 = 16_384.0;

/// Light of the texels with normal maps.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct NormalTexels {
    /// Indices of the texels in the atlas, ascending.
    texels: Vec<u32>,
    light: Vec<Harmonics>,
}

/// The light as stored in files.
#[derive(Serialize, Deserialize)]
struct StoredTexels {
    texels: Vec<u32>,
    /// Value of a coefficient of 1 \[W·m⁻²·sr⁻¹\].
    unit: f32,
    /// Bits of the coefficients: 27 per texel.
    coefficients: Vec<u16>,
}

impl NormalTexels {
    /// Creates the light of `texels`, which are ascending, with one value each. Coefficients are rounded as in files.
    pub(crate) fn new(texels: Vec<u32>, light: &[Harmonics]) -> Self {
        let stored = StoredTexels::of(texels, light);
        stored.read().expect("there is one value for each texel")
    }

    /// Returns the number of texels.
    #[must_use]
    pub fn len(&self) -> usize {
        self.texels.len()
    }

    /// Returns whether no texel has a normal map.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.texels.is_empty()
    }

    /// Returns the indirect irradiance of a texel for a unit `normal` \[W·m⁻²\]; `None` for a texel
    /// without a normal map.
    #[must_use]
    pub fn irradiance(&self, texel: u32, normal: Vec3A) -> Option<Vec3> {
        if self.texels.is_empty() {
            return None;
        }
        let slot = self.texels.binary_search(&texel).ok()?;
        Some(self.light[slot].irradiance(normal.into()).max(Vec3::ZERO))
    }

    /// Returns whether both have light of the same texels.
    pub(crate) fn has_texels_of(&self, other: &Self) -> bool {
        self.texels == other.texels
    }

    /// Returns the mean of this light and the light `later` of the same texels, which has the `weight`.
    pub(crate) fn mixed(&self, later: &Self, weight: f32) -> Self {
        let mut light = self.light.clone();
        for (own, later) in light.iter_mut().zip(&later.light) {
            for (own, later) in own.coefficients.iter_mut().zip(later.coefficients) {
                *own = own.lerp(later, weight);
            }
        }
        Self { texels: self.texels.clone(), light }
    }

    /// Encodes the light as bytes.
    pub(crate) fn to_bytes(&self) -> Vec<u8> {
        encode(&StoredTexels::of(self.texels.clone(), &self.light))
    }

    /// Decodes the light of an atlas with `count` texels; the error text does not contain the file name.
    pub(crate) fn from_bytes(bytes: &[u8], count: usize) -> Result<Self, String> {
        let stored: StoredTexels = decode(bytes).map_err(|error| error.chain())?;
        let is_ascending = stored.texels.is_sorted_by(|a, b| a < b);
        let is_inside = stored.texels.last().is_none_or(|&last| (last as usize) < count);
        let read = stored.read().filter(|_| is_ascending && is_inside);
        read.ok_or_else(|| "its light by normal is invalid".into())
    }
}

impl StoredTexels {
    fn of(texels: Vec<u32>, light: &[Harmonics]) -> Self {
        // Choose the unit by the largest coefficient.
        let mut largest = f32::MIN_POSITIVE / f32::EPSILON;
        for harmonics in light {
            for coefficient in harmonics.coefficients {
                largest = largest.max(coefficient.abs().max_element());
            }
        }
        let unit = largest / LARGEST;
        let mut coefficients = Vec::with_capacity(27 * light.len());
        for harmonics in light {
            for coefficient in harmonics.coefficients {
                coefficients.extend((coefficient / unit).to_array().map(|value| f16::from_f32(value).to_bits()));
            }
        }
        Self { texels, unit, coefficients }
    }

    fn read(self) -> Option<NormalTexels> {
        let Self { texels, unit, coefficients } = self;
        let mut light = Vec::with_capacity(texels.len());
        for texel in coefficients.chunks_exact(27) {
            let mut harmonics = Harmonics::default();
            for (coefficient, bits) in harmonics.coefficients.iter_mut().zip(texel.chunks_exact(3)) {
                *coefficient = Vec3::from_array([0, 1, 2].map(|k| f16::from_bits(bits[k]).to_f32() * unit));
            }
            light.push(harmonics);
        }
        let is_complete = coefficients.len() == 27 * texels.len() && unit.is_finite();
        let is_finite = light.iter().flat_map(|one| one.coefficients).all(Vec3::is_finite);
        (is_complete && is_finite).then_some(NormalTexels { texels, light })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn light() -> NormalTexels {
        let mut light = [Harmonics::default(); 3];
        for (k, one) in light.iter_mut().enumerate() {
            one.add(Vec3::Z, Vec3::new(1e6, 2.0, 0.5) * (k + 1) as f32, 0.1);
        }
        NormalTexels::new(vec![2, 5, 9], &light)
    }

    #[test]
    fn files_keep_the_light() {
        let light = light();
        assert_eq!(NormalTexels::from_bytes(&light.to_bytes(), 10).as_ref(), Ok(&light));
        let exact = Vec3::new(1e6, 2.0, 0.5) * 2.0 * 0.1;
        let found = light.irradiance(5, Vec3A::Z).unwrap();
        // Light from one direction: the sum of (2 l + 1) A(l) / 4π over the degrees.
        let expected = exact * (0.25 + 0.5 + 5.0 / 16.0);
        assert!((found / expected - 1.0).abs().max_element() < 2e-3, "{found} instead of {expected}");
        assert_eq!(light.irradiance(4, Vec3A::Z), None);
    }

    #[test]
    fn invalid_bytes_are_refused() {
        let light = light();
        let with = |texels: Vec<u32>, count: usize| {
            let stored = StoredTexels { texels, ..StoredTexels::of(vec![2, 5, 9], &light.light) };
            NormalTexels::from_bytes(&encode(&stored), count)
        };
        assert!(with(vec![2, 5, 9], 10).is_ok());
        for (texels, count) in [(vec![2, 5, 10], 10), (vec![5, 2, 9], 10), (vec![2, 5], 10), (vec![2, 2, 9], 10)] {
            assert!(with(texels.clone(), count).is_err(), "{texels:?}");
        }
        let infinite = StoredTexels { unit: f32::INFINITY, ..StoredTexels::of(vec![1], &[Harmonics::default()]) };
        assert!(NormalTexels::from_bytes(&encode(&infinite), 10).is_err());
        assert!(NormalTexels::from_bytes(&[1, 2, 3], 10).is_err());
    }
}
