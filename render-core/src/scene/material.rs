//! How a surface reflects and emits: a Lambert base below a GGX coat, and their textures.

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
    /// 0 for a dielectric over a diffuse base, 1 for a metal, times the texture's blue.
    pub metallic: f32,
    /// Perceptual roughness, 0…1, the square root of GGX's α; times the texture's green.
    pub roughness: f32,
    /// Linear texture: green is roughness, blue is metalness.
    pub metallic_roughness_texture: Option<TextureSlot>,
    /// Linear texture of normals in tangent space, and the factor on their x and y.
    pub normal_texture: Option<(TextureSlot, f32)>,
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
    /// A white Lambert surface without emission. (A glTF material that states nothing is a rough metal.)
    fn default() -> Self {
        Self {
            name: String::new(),
            base_color: Vec3::ONE,
            base_color_texture: None,
            metallic: 0.0,
            roughness: 1.0,
            metallic_roughness_texture: None,
            normal_texture: None,
            alpha_cutoff: None,
            emission: Vec3::ZERO,
            emission_texture: None,
            double_sided: false,
            unlit: false,
        }
    }
}

/// Reflectance of a dielectric at normal incidence: glTF 2.0, appendix B.2.
const DIELECTRIC_F0: f32 = 0.04;

impl Material {
    /// Diffuse reflectance, and specular reflectance at normal incidence, for a base colour and metalness.
    ///
    /// A dielectric of roughness 1 counts as Lambert: its coat of 4 % would be spread over the whole hemisphere, and
    /// leaving it out keeps matte scenes free of glossy work.
    pub fn split(base_color: Vec3, metallic: f32, roughness: f32) -> (Vec3, Vec3) {
        if metallic <= 0.0 && roughness >= 1.0 {
            return (base_color, Vec3::ZERO);
        }
        (base_color * (1.0 - metallic), Vec3::splat(DIELECTRIC_F0).lerp(base_color, metallic))
    }

    /// Whether the surface is a light.
    pub fn emits(&self) -> bool {
        self.emission.max_element() > 0.0
    }
}
