//! Code values of images: colors, numbers and normals in 8 bits.

use glam::Vec3;
use std::sync::LazyLock;

/// Meaning of an image's code values. Opacity is linear in both encodings.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Encoding {
    /// Colors in sRGB.
    Srgb,
    /// Linear numbers, such as roughness and metalness.
    Linear,
    /// Linear components of unit normals, from −1…1 in 0…255 (glTF 2.0, 3.9.3).
    Normal,
}

/// Deviation of a unit normal's length after rounding to 8 bits a component: at most √3 / 255, and slight interpolation.
pub(crate) const NORMAL_ROUNDING: f32 = 0.01;

/// Conversion of sRGB code values to linear (IEC 61966-2-1).
static SRGB_TO_LINEAR: LazyLock<[f32; 256]> = LazyLock::new(|| {
    std::array::from_fn(|code| {
        let c = code as f64 / 255.0;
        (if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }) as f32
    })
});

/// Conversion of linear code values to 0…1: division by 255.
static CODE_TO_LINEAR: LazyLock<[f32; 256]> = LazyLock::new(|| std::array::from_fn(|code| code as f32 / 255.0));

impl Encoding {
    /// Returns the numbers of all code values.
    pub(super) fn to_linear(self) -> &'static [f32; 256] {
        match self {
            Encoding::Srgb => &SRGB_TO_LINEAR,
            Encoding::Linear | Encoding::Normal => &CODE_TO_LINEAR,
        }
    }

    /// Returns the code value of a number in 0…1.
    pub(super) fn code(self, c: f32) -> u8 {
        let c = c.clamp(0.0, 1.0);
        let e = match self {
            Encoding::Linear | Encoding::Normal => c,
            Encoding::Srgb if c <= 0.003_130_8 => 12.92 * c,
            Encoding::Srgb => 1.055 * c.powf(1.0 / 2.4) - 0.055,
        };
        (e * 255.0 + 0.5) as u8
    }
}

/// Returns a texel of a normal map with unit length, up to rounding. Compressed files and painted maps contain others.
/// A texel without direction becomes the flat normal.
pub(super) fn unit_normal([x, y, z, alpha]: [u8; 4]) -> [u8; 4] {
    let stored = Vec3::from([x, y, z].map(f32::from)) * (2.0 / 255.0) - 1.0;
    let length = stored.length();
    // Code values around the middle, 127 and 128, encode zero.
    if length < 0.02 {
        return [128, 128, 255, alpha];
    }
    // Keep texels within the rounding error, to which another rounding would add.
    if (length - 1.0).abs() <= NORMAL_ROUNDING {
        return [x, y, z, alpha];
    }
    let [x, y, z] = (stored / length * 0.5 + 0.5).to_array().map(|c| Encoding::Normal.code(c));
    [x, y, z, alpha]
}
