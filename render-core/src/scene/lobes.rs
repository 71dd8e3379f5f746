//! Lobes that material extensions add to base and coat: glass, clearcoat, sheen, thin films, and more.
//!
//! Each type contains the properties of one ratified extension, named as in the extension. The default of each type
//! disables the extension.

use super::encoding::Encoding;
use super::texture_slot::TextureSlot;
use glam::{Vec2, Vec3};

/// Index of refraction if a file does not set it (`KHR_materials_ior`): F0 = 4 %.
pub(super) const DEFAULT_IOR: f32 = 1.5;

/// Lobes of a material beyond base and coat. A lobe with a zero factor has no effect.
#[derive(Clone, Debug, PartialEq)]
pub struct MaterialLobes {
    /// Index of refraction, at least 1: `KHR_materials_ior`.
    pub ior: f32,
    /// Strength of the dielectric's reflection: `KHR_materials_specular`.
    pub specular: SpecularFactors,
    /// Direction of grooves: `KHR_materials_anisotropy`.
    pub anisotropy: Anisotropy,
    /// Layer of varnish: `KHR_materials_clearcoat`.
    pub clearcoat: Clearcoat,
    /// Fibers: `KHR_materials_sheen`.
    pub sheen: Sheen,
    /// Thin film: `KHR_materials_iridescence`.
    pub iridescence: Iridescence,
    /// Glass: `KHR_materials_transmission`, with `KHR_materials_volume` and `KHR_materials_dispersion`.
    pub transmission: Transmission,
    /// Leaves and paper: `KHR_materials_diffuse_transmission`.
    pub diffuse_transmission: DiffuseTransmission,
}

/// Factors on the reflectance of a dielectric. [`Material::dielectric_f0`](super::Material::dielectric_f0) contains the
/// untextured factors at normal incidence.
#[derive(Clone, Debug, PartialEq)]
pub struct SpecularFactors {
    /// Reflectance at grazing incidence, 0…1.
    pub factor: f32,
    /// Linear texture with a factor in alpha.
    pub texture: Option<TextureSlot>,
    /// sRGB texture of the reflectance at normal incidence.
    pub color_texture: Option<TextureSlot>,
}

/// Anisotropy of the coat's roughness.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Anisotropy {
    /// Strength, 0…1.
    pub strength: f32,
    /// Direction of the wider lobe, counter-clockwise from the tangent \[rad\].
    pub rotation: f32,
    /// Linear texture with the direction in red and green, −1…1, and a factor on the strength in blue.
    pub texture: Option<TextureSlot>,
}

/// Transparent layer over all other lobes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Clearcoat {
    /// Fraction of the surface with the layer, 0…1.
    pub factor: f32,
    /// Linear texture with a factor in red.
    pub texture: Option<TextureSlot>,
    /// Perceptual roughness, 0…1.
    pub roughness: f32,
    /// Linear texture with a factor on the roughness in green.
    pub roughness_texture: Option<TextureSlot>,
    /// Linear texture of normals in tangent space, and the factor on their x and y.
    pub normal_texture: Option<(TextureSlot, f32)>,
}

/// Fibers that reflect light at grazing angles.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sheen {
    /// Linear RGB reflectance, 0…1; zero for no fibers.
    pub color: Vec3,
    /// sRGB texture of the reflectance.
    pub color_texture: Option<TextureSlot>,
    /// Perceptual roughness, 0…1.
    pub roughness: f32,
    /// Linear texture with a factor on the roughness in alpha.
    pub roughness_texture: Option<TextureSlot>,
}

/// Thin film over base or glass.
#[derive(Clone, Debug, PartialEq)]
pub struct Iridescence {
    /// Fraction of the surface with the film, 0…1.
    pub factor: f32,
    /// Linear texture with a factor in red.
    pub texture: Option<TextureSlot>,
    /// Index of refraction of the film, at least 1.
    pub ior: f32,
    /// Minimum and maximum thickness \[nm\].
    pub thickness: [f32; 2],
    /// Linear texture with the place between both thicknesses in green.
    pub thickness_texture: Option<TextureSlot>,
}

/// Refraction of light through a surface.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Transmission {
    /// Fraction of the light that enters the surface and is refracted, 0…1. The rest enters the diffuse base.
    pub factor: f32,
    /// Linear texture with a factor in red.
    pub texture: Option<TextureSlot>,
    /// Interior of a closed surface; `None` for a thin wall, which does not deflect light.
    pub volume: Option<Volume>,
    /// Dispersion, 20 divided by the Abbe number.
    pub dispersion: f32,
}

/// Interior of a closed transparent surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Volume {
    /// Attenuation coefficient in linear RGB \[1/m\].
    pub attenuation: Vec3,
}

/// Diffuse transmission of light.
#[derive(Clone, Debug, PartialEq)]
pub struct DiffuseTransmission {
    /// Fraction of the base that transmits light, 0…1.
    pub factor: f32,
    /// Linear texture with a factor in alpha.
    pub texture: Option<TextureSlot>,
    /// Linear RGB color of the transmitted light, 0…1.
    pub color: Vec3,
    /// sRGB texture of the color.
    pub color_texture: Option<TextureSlot>,
}

impl Default for MaterialLobes {
    fn default() -> Self {
        Self {
            ior: DEFAULT_IOR,
            specular: SpecularFactors { factor: 1.0, texture: None, color_texture: None },
            anisotropy: Anisotropy::default(),
            clearcoat: Clearcoat::default(),
            sheen: Sheen::default(),
            iridescence: Iridescence::default(),
            transmission: Transmission::default(),
            diffuse_transmission: DiffuseTransmission::default(),
        }
    }
}

impl Default for Iridescence {
    /// Returns no film, with the extension's defaults.
    fn default() -> Self {
        Self { factor: 0.0, texture: None, ior: 1.3, thickness: [100.0, 400.0], thickness_texture: None }
    }
}

impl Default for DiffuseTransmission {
    /// Returns no transmission, with the extension's defaults.
    fn default() -> Self {
        Self { factor: 0.0, texture: None, color: Vec3::ONE, color_texture: None }
    }
}

impl MaterialLobes {
    /// Returns whether any lobe has an effect.
    #[must_use]
    pub fn has_effect(&self) -> bool {
        let SpecularFactors { factor, texture, color_texture } = &self.specular;
        let factors =
            [self.anisotropy.strength, self.clearcoat.factor, self.iridescence.factor, self.transmission.factor];
        factors.into_iter().any(|factor| factor > 0.0)
            || self.diffuse_transmission.factor > 0.0
            || self.sheen.color.max_element() > 0.0
            || *factor != 1.0
            || texture.is_some()
            || color_texture.is_some()
    }

    /// Returns whether light passes through the surface.
    #[must_use]
    pub fn transmits(&self) -> bool {
        self.transmission.factor > 0.0 || self.diffuse_transmission.factor > 0.0
    }

    /// Returns whether a lobe depends on tangents.
    pub(super) fn needs_tangents(&self) -> bool {
        self.anisotropy.strength > 0.0 || self.clearcoat.normal_texture.is_some()
    }

    /// Returns the texture slots, with the encoding of each texture.
    pub fn slots(&self) -> impl Iterator<Item = (&TextureSlot, Encoding)> {
        let colors =
            [&self.specular.color_texture, &self.sheen.color_texture, &self.diffuse_transmission.color_texture];
        let factors = [
            &self.specular.texture,
            &self.anisotropy.texture,
            &self.clearcoat.texture,
            &self.clearcoat.roughness_texture,
            &self.sheen.roughness_texture,
            &self.iridescence.texture,
            &self.iridescence.thickness_texture,
            &self.transmission.texture,
            &self.diffuse_transmission.texture,
        ];
        let normal = self.clearcoat.normal_texture.as_ref().map(|(slot, _)| slot);
        let colors = colors.into_iter().flatten().map(|slot| (slot, Encoding::Srgb));
        let factors = factors.into_iter().flatten().map(|slot| (slot, Encoding::Linear));
        colors.chain(factors).chain(normal.map(|slot| (slot, Encoding::Normal)))
    }

    pub(super) fn slots_mut(&mut self) -> impl Iterator<Item = (&mut TextureSlot, Encoding)> {
        let Self { specular, anisotropy, clearcoat, sheen, iridescence, transmission, diffuse_transmission, .. } = self;
        let colors = [&mut specular.color_texture, &mut sheen.color_texture, &mut diffuse_transmission.color_texture];
        let factors = [
            &mut specular.texture,
            &mut anisotropy.texture,
            &mut clearcoat.texture,
            &mut clearcoat.roughness_texture,
            &mut sheen.roughness_texture,
            &mut iridescence.texture,
            &mut iridescence.thickness_texture,
            &mut transmission.texture,
            &mut diffuse_transmission.texture,
        ];
        let normal = clearcoat.normal_texture.as_mut().map(|(slot, _)| slot);
        let colors = colors.into_iter().flatten().map(|slot| (slot, Encoding::Srgb));
        let factors = factors.into_iter().flatten().map(|slot| (slot, Encoding::Linear));
        colors.chain(factors).chain(normal.map(|slot| (slot, Encoding::Normal)))
    }
}

impl Volume {
    /// Returns the interior in which light of a `distance` \[m\] is attenuated to a linear RGB `color`
    /// (`KHR_materials_volume`: σ = −ln c / d).
    #[must_use]
    pub fn new(color: Vec3, distance: f32) -> Self {
        // A color of zero attenuates as much as the least color of 8 bits.
        let color = if color.is_finite() { color } else { Vec3::ONE };
        let log = color.clamp(Vec3::splat(1e-4), Vec3::ONE).map(f32::ln);
        Self { attenuation: if distance > 0.0 && distance.is_finite() { -log / distance } else { Vec3::ZERO } }
    }
}

impl Anisotropy {
    /// Returns the direction of the wider lobe in the tangent frame, as long as the strength, for a texel of the texture.
    #[must_use]
    pub fn at(&self, texel: Vec3) -> Vec2 {
        let direction = (texel.truncate() * 2.0 - 1.0).try_normalize().unwrap_or(Vec2::X);
        Vec2::from_angle(self.rotation).rotate(direction) * (self.strength * texel.z).clamp(0.0, 1.0)
    }
}
