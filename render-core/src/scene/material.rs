//! Materials: a Lambert base below a GGX coat, emission, and textures.

use super::lobes::MaterialLobes;
use super::texture_slot::TextureSlot;
use glam::Vec3;

/// Meaning of the opacity of a base color.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Alpha {
    /// No meaning: the opacity is ignored.
    Opaque,
    /// Mask: texels with an opacity below the cutoff are holes.
    Mask {
        /// Opacity below which a texel is a hole \[0…1\].
        cutoff: f32,
    },
    /// Coverage: the opacity is the covered fraction of the surface. The remainder is holes too small to see.
    Blend,
}

/// Reflection and emission of a surface.
///
/// Contains glTF's complete metallic-roughness model except occlusion textures, since this crate computes occlusion
/// itself.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// Name in the file, or an empty string.
    pub name: String,
    /// Reflectance, or the factor on the texture; linear RGB.
    pub base_color: Vec3,
    /// sRGB texture of the reflectance.
    pub base_color_texture: Option<TextureSlot>,
    /// Metalness: 0 for a dielectric over a diffuse base, 1 for a metal. The texture's blue channel is a factor.
    pub metallic: f32,
    /// Perceptual roughness, 0…1: the square root of GGX's α. The texture's green channel is a factor.
    pub roughness: f32,
    /// Linear texture with roughness in green and metalness in blue.
    pub metallic_roughness_texture: Option<TextureSlot>,
    /// Linear texture of normals in tangent space, and the factor on their x and y.
    pub normal_texture: Option<(TextureSlot, f32)>,
    /// Linear RGB reflectance of the dielectric at normal incidence.
    pub dielectric_f0: Vec3,
    /// Opacity, 0…1. The opacities of the base-color texture and of the vertices are factors.
    pub opacity: f32,
    /// Meaning of the opacity.
    pub alpha: Alpha,
    /// Emitted radiance \[W·m⁻²·sr⁻¹\], or the factor on the texture; linear RGB.
    pub emission: Vec3,
    /// sRGB texture of the emission.
    pub emission_texture: Option<TextureSlot>,
    /// Whether both sides reflect and emit light.
    pub double_sided: bool,
    /// Whether the surface shows its color regardless of light. An unlit surface neither receives nor emits light.
    pub unlit: bool,
    /// Lobes of material extensions; `None` for the plain metallic-roughness model.
    pub lobes: Option<Box<MaterialLobes>>,
}

impl Default for Material {
    /// Returns a white Lambert surface without emission. (glTF's default material is a rough metal.)
    fn default() -> Self {
        Self {
            name: String::new(),
            base_color: Vec3::ONE,
            base_color_texture: None,
            metallic: 0.0,
            roughness: 1.0,
            metallic_roughness_texture: None,
            normal_texture: None,
            dielectric_f0: Vec3::splat(DIELECTRIC_F0),
            opacity: 1.0,
            alpha: Alpha::Opaque,
            emission: Vec3::ZERO,
            emission_texture: None,
            double_sided: false,
            unlit: false,
            lobes: None,
        }
    }
}

/// Reflectance of a dielectric at normal incidence: glTF 2.0, appendix B.2.
const DIELECTRIC_F0: f32 = 0.04;

impl Material {
    /// Returns the diffuse reflectance, and the specular reflectance at normal incidence, for a base color and
    /// metalness.
    ///
    /// A dielectric of roughness 1 counts as Lambert. Its coat of 4 % would reflect into the whole hemisphere. Without
    /// the coat, matte scenes need no computation of glossy reflections.
    #[must_use]
    pub fn split(&self, base_color: Vec3, metallic: f32, roughness: f32) -> (Vec3, Vec3) {
        if metallic <= 0.0 && roughness >= 1.0 {
            return (base_color, Vec3::ZERO);
        }
        (base_color * (1.0 - metallic), self.dielectric_f0.lerp(base_color, metallic))
    }

    /// Returns whether [`Material::split`] returns a coat anywhere on the surface.
    #[must_use]
    pub fn may_have_coat(&self) -> bool {
        let smoother = self.roughness < 1.0 || self.metallic_roughness_texture.is_some();
        !self.unlit && (self.metallic > 0.0 || smoother || self.lobes.is_some())
    }

    /// Returns whether the material uses the tangents of meshes.
    pub(super) fn needs_tangents(&self) -> bool {
        self.normal_texture.is_some() || self.lobes.as_ref().is_some_and(|lobes| lobes.needs_tangents())
    }

    /// Returns the texture slots of the material.
    pub fn slots(&self) -> impl Iterator<Item = &TextureSlot> {
        let normal = self.normal_texture.as_ref().map(|(slot, _)| slot);
        let others = [&self.base_color_texture, &self.metallic_roughness_texture, &self.emission_texture];
        let lobes = self.lobes.iter().flat_map(|lobes| lobes.slots()).map(|(slot, _)| slot);
        others.into_iter().flatten().chain(normal).chain(lobes)
    }

    pub(super) fn slots_mut(&mut self) -> impl Iterator<Item = &mut TextureSlot> {
        let normal = self.normal_texture.as_mut().map(|(slot, _)| slot);
        let Self { base_color_texture, metallic_roughness_texture, emission_texture, lobes, .. } = self;
        let lobes = lobes.iter_mut().flat_map(|lobes| lobes.slots_mut()).map(|(slot, _)| slot);
        let others = [base_color_texture, metallic_roughness_texture, emission_texture];
        others.into_iter().flatten().chain(normal).chain(lobes)
    }

    /// Returns whether the surface is meant to light other surfaces. A lamp emits without a texture, or the file sets
    /// an emission above 1, as `KHR_materials_emissive_strength` does for lamps and windows. A texture of at most 1,
    /// such as the instruments of a helmet, only belongs to the surface's appearance. A scene without any other light
    /// then needs a light from its viewer.
    #[must_use]
    pub fn is_lamp(&self) -> bool {
        self.emits() && (self.emission_texture.is_none() || self.emission.max_element() > 1.0)
    }

    /// Returns whether the surface emits light.
    #[must_use]
    pub fn emits(&self) -> bool {
        self.emission.max_element() > 0.0
    }
}
