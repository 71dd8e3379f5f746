//! Surface points to be lit, and light from a disc at these points.

use glam::Vec3A;

/// Surface point to be lit.
#[derive(Clone, Copy, Debug)]
pub struct ShadingPoint {
    /// Position, slightly off the surface \[m\].
    pub position: Vec3A,
    /// Shading normal, a unit vector.
    pub normal: Vec3A,
    /// Normal of the triangle, on the same side as the shading normal, a unit vector.
    pub geometric_normal: Vec3A,
}

impl ShadingPoint {
    /// Builds the point `epsilon` meters off the surface at `place`, with its shading normal and its geometric normal.
    #[inline]
    #[must_use]
    pub fn off_surface(place: Vec3A, [normal, geometric_normal]: [Vec3A; 2], epsilon: f32) -> Self {
        Self { position: place + geometric_normal * epsilon, normal, geometric_normal }
    }

    /// Returns the cosine at the receiver and the squared distance to `point` \[m²\]. The cosine is 0 below the
    /// surface.
    #[inline]
    pub(super) fn cosine_to(&self, point: Vec3A) -> (f32, f32) {
        // cos θ = n · way / r. No light passes through the triangle, regardless of the shading normal.
        let way = point - self.position;
        let r2 = way.length_squared();
        if self.geometric_normal.dot(way) <= 0.0 {
            return (0.0, r2);
        }
        (self.normal.dot(way).max(0.0) / r2.sqrt().max(f32::MIN_POSITIVE), r2)
    }
}

/// Returns the irradiance from a uniformly emitting disc per unit of intensity, `cos θ_light · cos θ / (r² + bound)`
/// \[m⁻²\].
///
/// With bound = area / π, the result is exact on the disc's axis for a facing receiver. At contact, the result is finite,
/// unlike a point light's 1/r². It is 0 below the shading normal's horizon and below the triangle.
#[inline(always)]
pub(super) fn disc_term(position: [f32; 3], [normal, geometric_normal]: [[f32; 3]; 2], disc: &Disc) -> f32 {
    let dot = |a: [f32; 3], b: [f32; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let way = [disc.position[0] - position[0], disc.position[1] - position[1], disc.position[2] - position[2]];
    let (r2, cos_light, cos) = (dot(way, way), -dot(disc.normal, way), dot(normal, way));
    // Each cosine still contains the length of `way`, so divide by r² again.
    let term = cos_light * cos / (r2 * (r2 + disc.bound));
    // Avoid branches, so that the loop over receivers vectorizes.
    let shines = (cos_light > 0.0) & (cos > 0.0) & (dot(geometric_normal, way) > 0.0);
    if shines { term } else { 0.0 }
}

/// Position \[m\], normal and bound \[m²\] of an emitting disc.
pub(super) struct Disc {
    pub position: [f32; 3],
    pub normal: [f32; 3],
    pub bound: f32,
}

impl Disc {
    /// Returns the irradiance at `receiver` per unit of intensity \[m⁻²\].
    pub fn term(&self, receiver: &ShadingPoint) -> f32 {
        let normals = [receiver.normal.to_array(), receiver.geometric_normal.to_array()];
        disc_term(receiver.position.to_array(), normals, self)
    }
}
