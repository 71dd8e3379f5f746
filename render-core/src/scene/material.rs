//! How a surface reflects and emits: a Lambert base and its textures.

use glam::{Vec2, Vec3};

/// Which texture, through which coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TextureSlot {
    /// Index into the scene's textures.
    pub texture: usize,
    /// Coordinate set, 0 or 1.
    pub uv_set: usize,
    /// `KHR_texture_transform`: offset, rotation in radians, scale.
    pub transform: Option<(Vec2, f32, Vec2)>,
}

impl TextureSlot {
    /// The coordinates to look up for the mesh's own `uv`.
    #[inline]
    pub fn map(&self, uv: Vec2) -> Vec2 {
        match self.transform {
            None => uv,
            Some((offset, rotation, scale)) => {
                let (sin, cos) = rotation.sin_cos();
                let scaled = uv * scale;
                offset + Vec2::new(cos * scaled.x + sin * scaled.y, cos * scaled.y - sin * scaled.x)
            }
        }
    }
}

/// A surface.
#[derive(Clone, Debug)]
pub struct Material {
    /// Name in the file, or empty.
    pub name: String,
    /// Linear RGB reflectance, times the texture's.
    pub base_color: Vec3,
    /// sRGB texture of the reflectance.
    pub base_color_texture: Option<TextureSlot>,
    /// `MASK` mode: texels with less opacity than this are meant to be holes. Rays do not know them yet: loading says so.
    pub alpha_cutoff: Option<f32>,
    /// Emitted radiance \[W·m⁻²·sr⁻¹\], times the texture's.
    pub emission: Vec3,
    /// sRGB texture of the emission.
    pub emission_texture: Option<TextureSlot>,
    /// Light leaves and arrives on both sides.
    pub double_sided: bool,
    /// Shows its colour whatever the light; neither lit nor a light.
    pub unlit: bool,
}

impl Default for Material {
    /// glTF's default material: white, without emission.
    fn default() -> Self {
        Self {
            name: String::new(),
            base_color: Vec3::ONE,
            base_color_texture: None,
            alpha_cutoff: None,
            emission: Vec3::ZERO,
            emission_texture: None,
            double_sided: false,
            unlit: false,
        }
    }
}

impl Material {
    /// Whether the surface is a light.
    pub fn emits(&self) -> bool {
        self.emission.max_element() > 0.0
    }
}
