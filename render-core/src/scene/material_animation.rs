//! Animated properties of materials.

use super::light::STRONGEST;
use super::lobes::DEFAULT_IOR;
use super::{Alpha, Channel, Material, Scene, TextureSlot};
use glam::{Vec2, Vec3};
use std::collections::HashMap;
use std::sync::Arc;

/// Texture slot of a material.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SlotName {
    /// Texture of the base color.
    BaseColor,
    /// Texture of metalness and roughness.
    MetallicRoughness,
    /// Texture of tangent-space normals.
    Normal,
    /// Texture of the emission.
    Emission,
}

/// Animated property of a material.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum MaterialProperty {
    /// Linear RGB reflectance, and opacity.
    BaseColor,
    /// Factor on the metalness.
    Metallic,
    /// Factor on the roughness.
    Roughness,
    /// Linear RGB factor on the emission.
    Emission,
    /// Factor on the emission \[W·m⁻²·sr⁻¹\].
    EmissionStrength,
    /// Factor on x and y of the normals in the texture.
    NormalScale,
    /// Opacity below which a texel is a hole \[0…1\].
    AlphaCutoff,
    /// Index of refraction of the dielectric.
    Ior,
    /// Factor on the reflectance at normal incidence.
    Specular,
    /// Linear RGB factor on the reflectance at normal incidence.
    SpecularColor,
    /// Offset of the coordinates in `KHR_texture_transform`.
    Offset(SlotName),
    /// Rotation of the coordinates in `KHR_texture_transform` \[rad\].
    Rotation(SlotName),
    /// Scale of the coordinates in `KHR_texture_transform`.
    Scale(SlotName),
}

impl MaterialProperty {
    /// Returns the number of components of a value, 1 to 4.
    #[must_use]
    pub fn width(self) -> usize {
        match self {
            Self::BaseColor => 4,
            Self::Emission | Self::SpecularColor => 3,
            Self::Offset(_) | Self::Scale(_) => 2,
            _ => 1,
        }
    }
}

/// Factors in the file that a [`Material`] contains only as products.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MaterialFactors {
    /// Linear RGB reflectance, before the texture's factor.
    pub base_color: Vec3,
    /// Linear RGB factor on the emission, and the emission's strength \[W·m⁻²·sr⁻¹\].
    pub emission: (Vec3, f32),
    /// Index of refraction. 0 means that all light is reflected.
    pub ior: f32,
    /// Reflectance at normal incidence: a scalar factor and a linear RGB factor.
    pub specular: (f32, Vec3),
    /// Whether the surface shows the sum of base color and emission, as points and lines do.
    pub shows_sum: bool,
}

/// Animation of a material.
#[derive(Clone, Debug)]
pub struct MaterialChannel {
    /// Index into the scene's materials.
    pub material: usize,
    /// Property of the material that the keys animate.
    pub property: MaterialProperty,
    /// Factors of the material in the file.
    pub rest: MaterialFactors,
    /// Keys, as weights: [`MaterialProperty::width`] weights per key.
    pub keys: Channel,
}

impl Scene {
    /// Returns the materials at `time` seconds, or an empty list if no material is animated. Values that are out of
    /// range are clamped.
    pub(super) fn materials_at(&self, time: f32) -> Arc<[Material]> {
        self.animated_materials(|channel, value| channel.keys.apply_weights(time, value))
    }

    /// Returns the materials with the given `value` of each channel, or an empty list if no material is animated.
    fn animated_materials(&self, value: impl Fn(&MaterialChannel, &mut [f32])) -> Arc<[Material]> {
        if self.material_channels.is_empty() {
            return Arc::default();
        }
        // Set the properties channel by channel. Channels of one material share factors.
        let mut materials = self.materials.clone();
        let mut factors: HashMap<usize, MaterialFactors> = HashMap::new();
        for channel in &self.material_channels {
            let mut numbers = [0.0; 4];
            value(channel, &mut numbers[..channel.property.width()]);
            let factors = factors.entry(channel.material).or_insert(channel.rest);
            materials[channel.material].set(channel.property, numbers, factors);
        }
        materials.into()
    }

    /// Returns, for each material, whether it changes over time.
    pub(crate) fn changing_materials(&self) -> Vec<bool> {
        let mut changing = vec![false; self.materials.len()];
        for channel in &self.material_channels {
            changing[channel.material] |= channel.keys.changes();
        }
        changing
    }

    /// Returns each material at its brightest and smoothest: with the largest key of each factor and the smallest
    /// roughness.
    #[must_use]
    pub fn extreme_materials(&self) -> Vec<Material> {
        if self.material_channels.is_empty() {
            return self.materials.clone();
        }
        // Reduce the keys of each component to the smallest or largest.
        let extreme = |channel: &MaterialChannel, value: &mut [f32]| {
            let keys = channel.keys.track.weights();
            let smallest = channel.property == MaterialProperty::Roughness;
            for (place, number) in value.iter_mut().enumerate() {
                let own = keys.iter().skip(place).step_by(channel.property.width()).copied();
                let found = if smallest { own.reduce(f32::min) } else { own.reduce(f32::max) };
                *number = found.unwrap_or(0.0);
            }
        };
        self.animated_materials(extreme).to_vec()
    }
}

impl Material {
    /// Sets a property to the first of these numbers, given the `factors` of the file for the other properties.
    fn set(&mut self, property: MaterialProperty, [x, y, z, w]: [f32; 4], factors: &mut MaterialFactors) {
        // Clamp factors to 0…1; animated numbers may be out of range.
        let unit = |x: f32| if x.is_finite() { x.clamp(0.0, 1.0) } else { 1.0 };
        let vector = Vec3::new(x, y, z);
        match property {
            MaterialProperty::BaseColor => (factors.base_color, self.opacity) = (vector, unit(w)),
            MaterialProperty::Metallic => self.metallic = unit(x),
            MaterialProperty::Roughness => self.roughness = unit(x),
            MaterialProperty::Emission => factors.emission.0 = vector,
            MaterialProperty::EmissionStrength => factors.emission.1 = x,
            MaterialProperty::NormalScale => {
                if let Some((_, scale)) = &mut self.normal_texture {
                    *scale = x;
                }
            }
            MaterialProperty::AlphaCutoff => {
                if let Alpha::Mask { cutoff } = &mut self.alpha {
                    *cutoff = x;
                }
            }
            MaterialProperty::Ior => factors.ior = x,
            MaterialProperty::Specular => factors.specular.0 = x,
            MaterialProperty::SpecularColor => factors.specular.1 = vector,
            MaterialProperty::Offset(name) => self.move_slot(name, |(offset, ..)| *offset = Vec2::new(x, y)),
            MaterialProperty::Rotation(name) => self.move_slot(name, |(_, rotation, _)| *rotation = x),
            MaterialProperty::Scale(name) => self.move_slot(name, |(.., scale)| *scale = Vec2::new(x, y)),
        }

        // Compute the properties that are products of factors.
        match property {
            MaterialProperty::Ior | MaterialProperty::Specular | MaterialProperty::SpecularColor => {
                self.dielectric_f0 = factors.dielectric_f0();
            }
            MaterialProperty::BaseColor | MaterialProperty::Emission | MaterialProperty::EmissionStrength => {
                let emission = factors.emission.0 * factors.emission.1;
                let emission = if emission.is_finite() { emission } else { Vec3::ZERO };
                let emission = emission.clamp(Vec3::ZERO, Vec3::splat(STRONGEST));
                let shown = if factors.shows_sum { factors.base_color + emission } else { factors.base_color };
                self.base_color = shown.clamp(Vec3::ZERO, Vec3::ONE);
                self.emission = if factors.shows_sum { Vec3::ZERO } else { emission };
            }
            _ => {}
        }
    }

    /// Changes the transform of a texture. If the file has no transform, changes the identity.
    fn move_slot(&mut self, name: SlotName, change: impl Fn(&mut (Vec2, f32, Vec2))) {
        let slot: Option<&mut TextureSlot> = match name {
            SlotName::BaseColor => self.base_color_texture.as_mut(),
            SlotName::MetallicRoughness => self.metallic_roughness_texture.as_mut(),
            SlotName::Normal => self.normal_texture.as_mut().map(|(slot, _)| slot),
            SlotName::Emission => self.emission_texture.as_mut(),
        };
        if let Some(slot) = slot {
            change(slot.transform.get_or_insert((Vec2::ZERO, 0.0, Vec2::ONE)));
        }
    }
}

impl MaterialFactors {
    /// Returns the reflectance at normal incidence, by `KHR_materials_ior` and `KHR_materials_specular`,
    /// "Implementation".
    #[must_use]
    pub fn dielectric_f0(&self) -> Vec3 {
        let ior = if self.ior.is_finite() && self.ior >= 1.0 { self.ior } else { DEFAULT_IOR };
        // An index of 0 means total reflection, for older material models.
        let f0 = if self.ior == 0.0 { 1.0 } else { ((ior - 1.0) / (ior + 1.0)).powi(2) };
        let (factor, color) = self.specular;
        let f0 = (color * f0).min(Vec3::ONE) * factor;
        if f0.is_finite() { f0.clamp(Vec3::ZERO, Vec3::ONE) } else { Vec3::splat(0.04) }
    }
}
