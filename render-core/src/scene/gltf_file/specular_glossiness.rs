//! Conversion of textures of `KHR_materials_pbrSpecularGlossiness` to the metallic-roughness model.
//!
//! The conversion follows "convert-between-workflows" of Khronos' extension. F = 0.04 is the reflectance of a
//! dielectric. D and S are the perceived brightness √(0.299 r² + 0.587 g² + 0.114 b²) of the diffuse and specular
//! colors:
//!
//! ```text
//! F m² + (D s / (1 − F) + S − 2 F) m + F − S = 0        s  1 − max(specular);   m = 0 where S < F
//! base = (1 − m²) diffuse · s / (1 − F) / (1 − m) + m² (specular − F (1 − m)) / m
//! ```

use crate::scene::{Encoding, Texture, TextureSlot, Wrap};
use glam::{Vec2, Vec3};

/// Reflectance of a dielectric at normal incidence.
const DIELECTRIC: f32 = 0.04;
/// Minimum divisor of the conversion formulas.
const LEAST: f32 = 1e-6;

/// Factors of a specular-glossiness material with a specular-glossiness texture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct OlderFactors {
    /// Linear RGB diffuse color.
    pub diffuse: Vec3,
    /// Linear RGB reflectance at normal incidence.
    pub specular: Vec3,
    /// Glossiness: 1 minus the roughness.
    pub glossiness: f32,
}

/// Texel of the metallic-roughness model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Converted {
    /// Linear RGB base color.
    pub base: Vec3,
    /// Metalness of the texel, 0…1.
    pub metallic: f32,
}

/// Converts a diffuse and a specular color in linear RGB.
pub(super) fn converted(diffuse: Vec3, specular: Vec3) -> Converted {
    // Find the metalness that explains both colors.
    let brightness = |c: Vec3| (c * c).dot(Vec3::new(0.299, 0.587, 0.114)).sqrt();
    let strength = 1.0 - specular.max_element();
    let metallic = metalness(brightness(diffuse), brightness(specular), strength);
    // Derive the base color from both colors, and weight by the metalness.
    let from_diffuse = diffuse * (strength / (1.0 - DIELECTRIC) / (1.0 - metallic).max(LEAST));
    let from_specular = (specular - DIELECTRIC * (1.0 - metallic)) / metallic.max(LEAST);
    let base = from_diffuse.lerp(from_specular, metallic * metallic).clamp(Vec3::ZERO, Vec3::ONE);
    Converted { base, metallic }
}

/// Returns m, the root of the quadratic equation in the module's documentation.
fn metalness(diffuse: f32, specular: f32, strength: f32) -> f32 {
    if specular < DIELECTRIC {
        return 0.0;
    }
    // Solve the equation for its larger root.
    let b = diffuse * strength / (1.0 - DIELECTRIC) + specular - 2.0 * DIELECTRIC;
    let c = DIELECTRIC - specular;
    let root = (b * b - 4.0 * DIELECTRIC * c).max(0.0).sqrt();
    ((root - b) / (2.0 * DIELECTRIC)).clamp(0.0, 1.0)
}

/// Returns the base-color and the metallic-roughness texture. Width and height are the larger ones of the two images.
pub(super) fn textures(
    diffuse: Option<&Texture>,
    glossy: &Texture,
    factors: OlderFactors,
    wrap: [Wrap; 2],
) -> [Texture; 2] {
    // Use the larger size, so that neither image loses detail.
    let size = diffuse.map_or(glossy.size(), |texture| texture.size().max(glossy.size()));
    let (width, height) = (size.x as usize, size.y as usize);
    let (mut colors, mut data) = (Vec::with_capacity(width * height), Vec::with_capacity(width * height));
    for y in 0..height {
        for x in 0..width {
            // Sample the center of a texel, which in an image of this size is exactly one texel.
            let uv = (Vec2::new(x as f32, y as f32) + 0.5) / size;
            let (base, opacity) = diffuse.map_or((Vec3::ONE, 1.0), |texture| {
                let found = texture.sample(uv, 1.0);
                (found.color, found.opacity)
            });
            // Colors are sRGB. Glossiness, in the alpha channel, is linear.
            let found = glossy.sample(uv, 1.0);
            let Converted { base, metallic } = converted(base * factors.diffuse, found.color * factors.specular);
            let [r, g, b] = base.to_array().map(|x| Encoding::Srgb.code(x));
            let roughness = 1.0 - (found.opacity * factors.glossiness).clamp(0.0, 1.0);
            colors.push([r, g, b, Encoding::Linear.code(opacity)]);
            data.push([255, Encoding::Linear.code(roughness), Encoding::Linear.code(metallic), 255]);
        }
    }
    let texture = |texels, encoding| Texture::with_encoding(width, height, texels, wrap, encoding);
    [texture(colors, Encoding::Srgb), texture(data, Encoding::Linear)]
}

/// Returns whether two slots sample at the same coordinates.
pub(super) fn coincide(a: &TextureSlot, b: &TextureSlot) -> bool {
    (a.uv_set, a.transform) == (b.uv_set, b.transform)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Converted colors match reference values of Khronos' formula, computed separately in 64 bits.
    #[test]
    fn colors_are_those_of_the_conversion() {
        for (diffuse, specular, base, metallic) in CASES {
            let found = converted(diffuse.into(), specular.into());
            assert!((found.metallic - metallic).abs() < 2e-5, "{found:?}, not {metallic}");
            assert!((found.base - Vec3::from(base)).abs().max_element() < 2e-5, "{found:?}, not {base:?}");
        }
    }

    type Rgb = [f32; 3];
    /// Diffuse and specular color, with expected base color and metalness.
    const CASES: [(Rgb, Rgb, Rgb, f32); 5] = [
        ([0.5, 0.25, 0.75], [0.04, 0.04, 0.04], [0.5, 0.25, 0.75], 0.0),
        ([0.0, 0.0, 0.0], [0.9, 0.6, 0.2], [0.9, 0.6, 0.2], 1.0),
        ([0.3, 0.3, 0.3], [0.5, 0.5, 0.5], [0.646584, 0.646584, 0.646584], 0.758345),
        ([0.8, 0.1, 0.1], [0.0, 0.0, 0.0], [0.833333, 0.104167, 0.104167], 0.0),
        ([0.2, 0.4, 0.1], [0.1, 0.3, 0.2], [0.255208, 0.568963, 0.195442], 0.485558),
    ];
}
