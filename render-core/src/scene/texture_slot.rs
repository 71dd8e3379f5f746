//! Reference to a texture, with the coordinates at which it is sampled.

use glam::Vec2;

/// Number of texture coordinate sets of a mesh.
pub const UV_SETS: usize = 4;

/// Texture and the coordinates at which it is sampled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TextureSlot {
    /// Index into the scene's textures.
    pub texture: usize,
    /// Coordinate set, below [`UV_SETS`].
    pub uv_set: usize,
    /// Offset, rotation in radians, and scale of `KHR_texture_transform`.
    pub transform: Option<(Vec2, f32, Vec2)>,
}

impl TextureSlot {
    /// Maps the mesh's `uv` to the texture's coordinates.
    #[inline]
    #[must_use]
    pub fn map(&self, uv: Vec2) -> Vec2 {
        match self.transform {
            None => uv,
            Some((offset, rotation, scale)) => {
                // Scale, rotate and translate, in the order of `KHR_texture_transform`.
                let (sin, cos) = rotation.sin_cos();
                let scaled = uv * scale;
                offset + Vec2::new(cos * scaled.x + sin * scaled.y, cos * scaled.y - sin * scaled.x)
            }
        }
    }
}
