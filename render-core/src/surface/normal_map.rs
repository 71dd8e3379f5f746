//! Normal maps: tangent frame, and the effect of detail below the resolution.

use super::site::TrianglePoint;
use crate::scene::{NORMAL_ROUNDING, TextureSlot};
use glam::{Affine3A, Vec3, Vec3A, Vec4, Vec4Swizzles};

/// Returns the unit directions of a normal map's x and y axes, from the file's tangent. The vertices' transform applies
/// to both, so that mirrored objects keep their bumps.
pub(super) fn given(world: &Affine3A, normal: Vec3, tangent: Vec4) -> Option<(Vec3A, Vec3A)> {
    let bitangent = normal.cross(tangent.xyz()) * tangent.w;
    let carry = |v: Vec3| world.transform_vector3a(v.into()).try_normalize();
    carry(tangent.xyz()).zip(carry(bitangent))
}

impl TrianglePoint<'_> {
    /// Returns the normal of the map instead of the unit `normal`, and the unevenness of the map within the footprint.
    /// The unevenness is 0 for a flat map, otherwise (1 − l) / l for a mean normal of length l.
    pub(super) fn mapped_normal(
        &self,
        slot: &TextureSlot,
        scale: f32,
        normal: Vec3A,
        given: Option<(Vec3A, Vec3A)>,
    ) -> (Vec3A, f32) {
        // Map 0…1 to −1…1. Without coordinates or axes, keep the normal.
        let texel = self.look_up(slot).map(|found| found.color * 2.0 - 1.0);
        let (Some(texel), Some((x, y))) = (texel, given.or_else(|| self.derived(slot, normal))) else {
            return (normal, 0.0);
        };
        // Filtering shortens the mean normal where the map is uneven.
        let mapped = x * (texel.x * scale) + y * (texel.y * scale) + normal * texel.z;
        let length = texel.length().clamp(1e-3, 1.0);
        (mapped.try_normalize().unwrap_or(normal), ((1.0 - length - NORMAL_ROUNDING) / length).max(0.0))
    }

    /// Returns the unit directions of a normal map's x and y axes, from the texture coordinates: x along increasing u,
    /// y along decreasing v. Images have their origin at the top, but in normal maps y points upward. Mirrored
    /// coordinates need no special case.
    pub(super) fn derived(&self, slot: &TextureSlot, normal: Vec3A) -> Option<(Vec3A, Vec3A)> {
        let [p, q, r] = self.coordinates(slot)?;
        let (d1, d2) = (q - p, r - p);
        let (e1, e2) = (self.corners[1] - self.corners[0], self.corners[2] - self.corners[0]);
        // Compute the gradients of position without the determinant's magnitude, which normalization removes.
        let sign = d1.perp_dot(d2).signum();
        let along_u = (e1 * d2.y - e2 * d1.y) * sign;
        let along_v = (e2 * d1.x - e1 * d2.x) * sign;
        // Project x onto the surface, and choose the sign of y by the direction of v.
        let x = (along_u - normal * normal.dot(along_u)).try_normalize()?;
        let y = normal.cross(x);
        (d1.perp_dot(d2) != 0.0).then_some((x, if y.dot(along_v) > 0.0 { -y } else { y }))
    }
}

/// Returns the perceptual roughness of a surface with an uneven normal map within the footprint.
///
/// \[Toksvig05\] shortens the Blinn–Phong exponent s to s' with 1/s' = 1/s + (1 − l)/l, for a mean normal of length l.
/// The exponent s = 2/α² − 2 matches GGX's α, the square of the roughness.
pub(super) fn roughened(roughness: f32, unevenness: f32) -> f32 {
    if unevenness <= 0.0 || roughness >= 1.0 {
        return roughness;
    }
    // Add the unevenness to 1/s, and convert the sum back to a roughness.
    let alpha2 = roughness.powi(4);
    let inverse_exponent = alpha2 / (2.0 - 2.0 * alpha2) + unevenness;
    (2.0 * inverse_exponent / (1.0 + 2.0 * inverse_exponent)).sqrt().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bumps_too_fine_to_see_are_roughness() {
        assert_eq!(roughened(0.3, 0.0), 0.3);
        assert_eq!(roughened(1.0, 5.0), 1.0);
        // Compare with Toksvig's own form: s' = ft·s, ft = l / (l + s (1 − l)).
        for (roughness, length) in [(0.3f32, 0.9f32), (0.7, 0.5), (0.1, 0.99)] {
            let s = 2.0 / roughness.powi(4) - 2.0;
            let short = length / (length + s * (1.0 - length)) * s;
            let expected = (2.0 / (short + 2.0)).sqrt().sqrt();
            let found = roughened(roughness, (1.0 - length) / length);
            assert!((found - expected).abs() < 1e-4, "{found} for {expected}");
        }
        // A mirror with normals spread over a half-space is almost matte, but never rougher than matte.
        assert!((0.9..1.0).contains(&roughened(0.0, 1.5)));
    }
}
