//! Conversion of material extensions to [`MaterialLobes`].

use super::slots::{slot, slot_of};
use crate::scene::{
    Anisotropy, Clearcoat, DiffuseTransmission, Iridescence, Material, MaterialLobes, Sheen, SpecularFactors,
    TextureSlot, Transmission, Volume,
};
use glam::Vec3;
use serde_json::Value;

/// Properties of one extension of a material. All are absent if the material lacks the extension.
#[derive(Clone, Copy)]
struct Properties<'a>(Option<&'a Value>);

impl Properties<'_> {
    /// Returns a number that is not negative, or the default.
    fn number(self, name: &str, default: f32) -> f32 {
        let found = self.0.and_then(|value| value.get(name)?.as_f64()).map(|x| x as f32);
        found.filter(|x| x.is_finite()).unwrap_or(default).max(0.0)
    }

    /// Returns a number in 0…1, or zero.
    fn factor(self, name: &str) -> f32 {
        self.number(name, 0.0).min(1.0)
    }

    /// Returns a linear RGB color in 0…1, or the default.
    fn color(self, name: &str, default: Vec3) -> Vec3 {
        let at = |i: usize| Some(self.0?.get(name)?.get(i)?.as_f64()? as f32);
        let color = at(0).zip(at(1)).zip(at(2)).map(|((r, g), b)| Vec3::new(r, g, b));
        color.filter(|color| color.is_finite()).unwrap_or(default).clamp(Vec3::ZERO, Vec3::ONE)
    }

    fn slot(self, name: &str) -> Option<TextureSlot> {
        self.0?.get(name).and_then(slot_of)
    }

    /// Returns the slot of a normal texture, and its scale.
    fn normal_slot(self, name: &str) -> Option<(TextureSlot, f32)> {
        let scale = self.0?.get(name)?.get("scale").and_then(Value::as_f64).map_or(1.0, |x| x as f32);
        Some((self.slot(name)?, if scale.is_finite() { scale } else { 1.0 }))
    }
}

/// Returns the lobes of a material, or `None` if no lobe has an effect.
pub(super) fn lobes(source: &gltf::Material) -> Option<Box<MaterialLobes>> {
    let of = |name: &str| Properties(source.extension_value(name));
    // The gltf crate parses some of the extensions.
    let specular = source.specular();
    let ior = source.ior().filter(|ior| ior.is_finite() && *ior >= 1.0);
    let (anisotropy, clearcoat) = (of("KHR_materials_anisotropy"), of("KHR_materials_clearcoat"));
    let (sheen, film) = (of("KHR_materials_sheen"), of("KHR_materials_iridescence"));
    let (glass, volume) = (source.transmission(), source.volume());
    let leaf = of("KHR_materials_diffuse_transmission");

    let factor = |factor: f32| if factor.is_finite() { factor.clamp(0.0, 1.0) } else { 1.0 };
    let lobes = MaterialLobes {
        ior: ior.unwrap_or(MaterialLobes::default().ior),
        specular: SpecularFactors {
            factor: specular.as_ref().map_or(1.0, |specular| factor(specular.specular_factor())),
            texture: specular.as_ref().and_then(|s| s.specular_texture()).map(slot),
            color_texture: specular.as_ref().and_then(|s| s.specular_color_texture()).map(slot),
        },
        anisotropy: Anisotropy {
            strength: anisotropy.factor("anisotropyStrength"),
            rotation: rotation(anisotropy),
            texture: anisotropy.slot("anisotropyTexture"),
        },
        clearcoat: Clearcoat {
            factor: clearcoat.factor("clearcoatFactor"),
            texture: clearcoat.slot("clearcoatTexture"),
            roughness: clearcoat.factor("clearcoatRoughnessFactor"),
            roughness_texture: clearcoat.slot("clearcoatRoughnessTexture"),
            normal_texture: clearcoat.normal_slot("clearcoatNormalTexture"),
        },
        sheen: Sheen {
            color: sheen.color("sheenColorFactor", Vec3::ZERO),
            color_texture: sheen.slot("sheenColorTexture"),
            roughness: sheen.factor("sheenRoughnessFactor"),
            roughness_texture: sheen.slot("sheenRoughnessTexture"),
        },
        iridescence: Iridescence {
            factor: film.factor("iridescenceFactor"),
            texture: film.slot("iridescenceTexture"),
            ior: film.number("iridescenceIor", 1.3).max(1.0),
            thickness: [
                film.number("iridescenceThicknessMinimum", 100.0),
                film.number("iridescenceThicknessMaximum", 400.0),
            ],
            thickness_texture: film.slot("iridescenceThicknessTexture"),
        },
        transmission: Transmission {
            factor: glass.as_ref().map_or(0.0, |glass| factor(glass.transmission_factor())),
            texture: glass.as_ref().and_then(|glass| glass.transmission_texture()).map(slot),
            // A thickness of zero is a thin wall. Its texture approximates shapes that rays measure exactly.
            volume: volume
                .filter(|volume| volume.thickness_factor() > 0.0)
                .map(|volume| Volume::new(Vec3::from(volume.attenuation_color()), volume.attenuation_distance())),
            dispersion: of("KHR_materials_dispersion").number("dispersion", 0.0),
        },
        diffuse_transmission: DiffuseTransmission {
            factor: leaf.factor("diffuseTransmissionFactor"),
            texture: leaf.slot("diffuseTransmissionTexture"),
            color: leaf.color("diffuseTransmissionColorFactor", Vec3::ONE),
            color_texture: leaf.slot("diffuseTransmissionColorTexture"),
        },
    };
    lobes.has_effect().then(|| Box::new(lobes))
}

/// Returns the material with its lobes. Light passes transparent surfaces in both directions, so both sides are
/// visible.
pub(super) fn with_lobes(material: Material, source: &gltf::Material) -> Material {
    let lobes = if material.unlit { None } else { lobes(source) };
    let transmits = lobes.as_ref().is_some_and(|lobes| lobes.transmits());
    Material { double_sided: material.double_sided || transmits, lobes, ..material }
}

/// Returns the angle of the wider lobe, which may be negative \[rad\].
fn rotation(anisotropy: Properties) -> f32 {
    let found = anisotropy.0.and_then(|value| value.get("anisotropyRotation")?.as_f64()).map(|x| x as f32);
    found.filter(|angle| angle.is_finite()).unwrap_or(0.0)
}
