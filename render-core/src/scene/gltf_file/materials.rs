//! Conversion of glTF materials.
//!
//! Occlusion textures are omitted on purpose: they approximate occlusion that a rasterizer cannot compute, but this
//! renderer can.

use super::lobes::with_lobes;
use super::slots::{normal_slot, slot, slot_of};
use super::specular_glossiness::{OlderFactors, coincide};
use crate::scene::{Alpha, Material, MaterialFactors, TextureSlot, UV_SETS};
use glam::Vec3;
use serde_json::Value;
use std::collections::BTreeMap;

/// Extension with the older of two material models. It takes precedence if a material has both.
pub(super) const SPECULAR_GLOSSINESS: &str = "KHR_materials_pbrSpecularGlossiness";

/// Converts all materials in the file's order, followed by the default material for primitives without a material.
///
/// Also returns the factors of specular-glossiness materials with textures, and a note for each type of omitted
/// property. The texture slots of these materials refer to the file's images until the textures are converted.
pub(super) fn materials(document: &gltf::Document) -> (Vec<Material>, Older, Vec<String>) {
    let mut left_out = [false; 2];
    let mut materials: Vec<Material> = Vec::new();
    let mut older = Older::new();
    for source in document.materials() {
        let mut material = material(&source);
        // Convert specular-glossiness materials with textures if both textures coincide.
        if let Some((glossy, factors)) = source.extension_value(SPECULAR_GLOSSINESS).and_then(glossy) {
            if material.base_color_texture.as_ref().is_none_or(|diffuse| coincide(diffuse, &glossy)) {
                // The texels will contain the factors.
                material = Material {
                    metallic_roughness_texture: Some(glossy),
                    base_color: Vec3::ONE,
                    metallic: 1.0,
                    roughness: 1.0,
                    dielectric_f0: Vec3::splat(0.04),
                    ..material
                };
                older.insert(materials.len(), factors);
            } else {
                left_out[1] = true;
            }
        }
        // Clamp coordinate sets that are not read.
        for slot in material.slots_mut() {
            left_out[0] |= slot.uv_set >= UV_SETS;
            slot.uv_set = slot.uv_set.min(UV_SETS - 1);
        }
        materials.push(material);
    }
    // glTF 2.0, 3.9.2 and 3.7.2.1: omitted properties have default values; metalness and roughness default to 1.
    materials.push(Material { metallic: 1.0, roughness: 1.0, ..Material::default() });
    let notes = [
        "only texture coordinate sets 0 to 3 are read",
        "specular-glossiness textures with other coordinates than the diffuse texture are left out",
    ];
    let mut warnings = Vec::new();
    for (note, is_left_out) in notes.into_iter().zip(left_out) {
        if is_left_out {
            warnings.push(note.to_owned());
        }
    }
    (materials, older, warnings)
}

/// Maximum roughness that keeps the coat in [`Material::split`]: a coat that reflects more than 4 % is never omitted.
const ROUGHEST: f32 = 0.999;

/// Factors of specular-glossiness materials with textures to convert, by index of the material.
pub(super) type Older = BTreeMap<usize, OlderFactors>;

fn material(source: &gltf::Material) -> Material {
    let material = metallic_roughness(source);
    let material = match source.extension_value(SPECULAR_GLOSSINESS) {
        Some(extension) => specular_glossiness(material, extension),
        None => material,
    };
    with_lobes(material, source)
}

/// Returns the material of `KHR_materials_pbrSpecularGlossiness`, a diffuse base below a coat. It takes precedence over
/// the metallic-roughness model.
fn specular_glossiness(material: Material, extension: &Value) -> Material {
    let OlderFactors { diffuse, specular, glossiness } = older_factors(extension);
    let reflects = specular.max_element() > 0.04;
    Material {
        // "c_diff = diffuse.rgb * (1 - max(specular.r, specular.g, specular.b))"
        base_color: diffuse * (1.0 - specular.max_element()),
        base_color_texture: extension.get("diffuseTexture").and_then(slot_of),
        metallic: 0.0,
        roughness: if reflects { (1.0 - glossiness).min(ROUGHEST) } else { 1.0 - glossiness },
        metallic_roughness_texture: None,
        dielectric_f0: specular,
        opacity: factor(extension, "diffuseFactor", 3),
        ..material
    }
}

/// Returns the specular-glossiness texture and its factors.
fn glossy(extension: &Value) -> Option<(TextureSlot, OlderFactors)> {
    Some((extension.get("specularGlossinessTexture").and_then(slot_of)?, older_factors(extension)))
}

fn older_factors(extension: &Value) -> OlderFactors {
    let color = |name: &str| Vec3::from([0, 1, 2].map(|place| factor(extension, name, place)));
    let glossiness = extension.get("glossinessFactor").and_then(Value::as_f64).map_or(1.0, |x| x as f32);
    OlderFactors {
        diffuse: color("diffuseFactor"),
        specular: color("specularFactor"),
        glossiness: glossiness.clamp(0.0, 1.0),
    }
}

/// Returns a number in a list, clamped to 0…1, or 1 if it is absent.
fn factor(extension: &Value, name: &str, place: usize) -> f32 {
    let number = || extension.get(name)?.get(place)?.as_f64();
    number().map_or(1.0, |x| x as f32).clamp(0.0, 1.0)
}

fn metallic_roughness(source: &gltf::Material) -> Material {
    let pbr = source.pbr_metallic_roughness();
    let [r, g, b, opacity] = pbr.base_color_factor();
    // Infinite strength becomes the largest float, which is refused because it exceeds the limit.
    let strength = source.emissive_strength().unwrap_or(1.0).min(f32::MAX);
    let emission = Vec3::from(source.emissive_factor()) * strength;
    // Replace numbers that are not finite.
    let unit = |factor: f32| if factor.is_finite() { factor.clamp(0.0, 1.0) } else { 1.0 };
    let sane = |color: Vec3| if color.is_finite() { color.max(Vec3::ZERO) } else { Vec3::ZERO };
    Material {
        name: source.name().unwrap_or_default().to_owned(),
        // A surface never reflects more light than arrives.
        base_color: sane(Vec3::new(r, g, b)).min(Vec3::ONE),
        base_color_texture: pbr.base_color_texture().map(slot),
        metallic: unit(pbr.metallic_factor()),
        roughness: unit(pbr.roughness_factor()),
        metallic_roughness_texture: pbr.metallic_roughness_texture().map(slot),
        normal_texture: source.normal_texture().map(normal_slot),
        dielectric_f0: factors(source).dielectric_f0(),
        opacity: unit(opacity),
        alpha: match source.alpha_mode() {
            gltf::material::AlphaMode::Opaque => Alpha::Opaque,
            gltf::material::AlphaMode::Mask => Alpha::Mask { cutoff: source.alpha_cutoff().unwrap_or(0.5) },
            gltf::material::AlphaMode::Blend => Alpha::Blend,
        },
        emission: sane(emission),
        emission_texture: source.emissive_texture().map(slot),
        double_sided: source.double_sided(),
        unlit: source.unlit(),
        lobes: None,
    }
}

/// Returns the factors that a material contains only as products.
pub(super) fn factors(source: &gltf::Material) -> MaterialFactors {
    let [r, g, b, _] = source.pbr_metallic_roughness().base_color_factor();
    let specular = source.specular();
    MaterialFactors {
        base_color: Vec3::new(r, g, b),
        emission: (source.emissive_factor().into(), source.emissive_strength().unwrap_or(1.0)),
        // NaN selects the default index.
        ior: source.ior().unwrap_or(f32::NAN),
        specular: specular.map_or((1.0, Vec3::ONE), |s| (s.specular_factor(), Vec3::from(s.specular_color_factor()))),
        shows_sum: false,
    }
}
