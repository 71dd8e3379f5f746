//! glTF materials into ours.
//!
//! Occlusion textures are left out on purpose: they stand for light that a rasteriser cannot compute, and we do.

use crate::scene::{Alpha, Material, TextureSlot, UV_SETS};
use glam::{Vec2, Vec3};
use serde_json::Value;

/// Index of refraction where a file gives none (`KHR_materials_ior`): F0 = 4 %.
const DEFAULT_IOR: f32 = 1.5;

/// The older of two material models.
const SPECULAR_GLOSSINESS: &str = "KHR_materials_pbrSpecularGlossiness";

/// All materials in the file's order, and after them the default one for primitives without; what is left out of them, as
/// a line each.
pub(super) fn materials(document: &gltf::Document) -> (Vec<Material>, Vec<String>) {
    let mut left_out = [false; 3];
    let mut materials: Vec<Material> = Vec::new();
    for source in document.materials() {
        let specular = source.specular();
        left_out[0] |= specular.is_some_and(|s| s.specular_texture().or(s.specular_color_texture()).is_some());
        let older = source.extension_value(SPECULAR_GLOSSINESS);
        left_out[2] |= older.is_some_and(|older| older.get("specularGlossinessTexture").is_some());
        let mut material = material(&source);
        for slot in material.slots_mut() {
            left_out[1] |= slot.uv_set >= UV_SETS;
            slot.uv_set = slot.uv_set.min(UV_SETS - 1);
        }
        materials.push(material);
    }
    // glTF 2.0, 3.9.2 and 3.7.2.1: what is not given has its default, which for metalness and roughness is 1.
    materials.push(Material { metallic: 1.0, roughness: 1.0, ..Material::default() });
    let notes = [
        "specular textures are left out, their factors are not",
        "of texture coordinates the sets 0 to 3 are read",
        "textures of specular and glossiness are left out, their factors are not",
    ];
    let warnings = notes.iter().zip(left_out).filter(|(_, met)| *met).map(|(note, _)| note.to_string()).collect();
    (materials, warnings)
}

fn material(source: &gltf::Material) -> Material {
    let material = metallic_roughness(source);
    match source.extension_value(SPECULAR_GLOSSINESS) {
        Some(extension) => specular_glossiness(material, extension),
        None => material,
    }
}

/// The material by `KHR_materials_pbrSpecularGlossiness`, which comes before the other model: a diffuse base below a coat.
fn specular_glossiness(material: Material, extension: &Value) -> Material {
    let number = |name: &str, place: usize| extension.get(name)?.get(place)?.as_f64();
    let factor = |name: &str, place: usize| number(name, place).map_or(1.0, |x| x as f32).clamp(0.0, 1.0);
    let color = |name: &str| Vec3::from([0, 1, 2].map(|place| factor(name, place)));
    let glossiness = extension.get("glossinessFactor").and_then(Value::as_f64).map_or(1.0, |x| x as f32);
    let specular = color("specularFactor");
    Material {
        // "c_diff = diffuse.rgb * (1 - max(specular.r, specular.g, specular.b))"
        base_color: color("diffuseFactor") * (1.0 - specular.max_element()),
        base_color_texture: extension.get("diffuseTexture").and_then(slot_of),
        metallic: 0.0,
        roughness: 1.0 - glossiness.clamp(0.0, 1.0),
        metallic_roughness_texture: None,
        dielectric_f0: specular,
        opacity: factor("diffuseFactor", 3),
        ..material
    }
}

fn metallic_roughness(source: &gltf::Material) -> Material {
    let pbr = source.pbr_metallic_roughness();
    let [r, g, b, opacity] = pbr.base_color_factor();
    // What is beyond all numbers stays beyond what is allowed, and is refused as that.
    let strength = source.emissive_strength().unwrap_or(1.0).min(f32::MAX);
    let emission = Vec3::from(source.emissive_factor()) * strength;
    let unit = |factor: f32| if factor.is_finite() { factor.clamp(0.0, 1.0) } else { 1.0 };
    let sane = |color: Vec3| if color.is_finite() { color.max(Vec3::ZERO) } else { Vec3::ZERO };
    Material {
        name: source.name().unwrap_or_default().to_owned(),
        // A surface reflects no more than what arrives.
        base_color: sane(Vec3::new(r, g, b)).min(Vec3::ONE),
        base_color_texture: pbr.base_color_texture().map(slot),
        metallic: unit(pbr.metallic_factor()),
        roughness: unit(pbr.roughness_factor()),
        metallic_roughness_texture: pbr.metallic_roughness_texture().map(slot),
        normal_texture: source.normal_texture().map(normal_slot),
        dielectric_f0: dielectric_f0(source),
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
    }
}

/// Reflectance at normal incidence: `KHR_materials_ior` and `KHR_materials_specular`, "Implementation".
fn dielectric_f0(source: &gltf::Material) -> Vec3 {
    let ior = source.ior().filter(|ior| ior.is_finite() && *ior >= 1.0);
    // An index of 0 stands for "reflects all", for the sake of older material models.
    let f0 = match source.ior() {
        Some(0.0) => 1.0,
        _ => ((ior.unwrap_or(DEFAULT_IOR) - 1.0) / (ior.unwrap_or(DEFAULT_IOR) + 1.0)).powi(2),
    };
    let (factor, color) =
        source.specular().map_or((1.0, Vec3::ONE), |s| (s.specular_factor(), Vec3::from(s.specular_color_factor())));
    let f0 = (color * f0).min(Vec3::ONE) * factor;
    if f0.is_finite() { f0.clamp(Vec3::ZERO, Vec3::ONE) } else { Vec3::splat(0.04) }
}

fn slot(info: gltf::texture::Info) -> TextureSlot {
    let transform = info.texture_transform();
    let own_set = transform.as_ref().and_then(|t| t.tex_coord());
    TextureSlot {
        texture: info.texture().index(),
        uv_set: own_set.unwrap_or(info.tex_coord()) as usize,
        transform: transform.map(|t| (Vec2::from(t.offset()), t.rotation(), Vec2::from(t.scale()))),
    }
}

/// As [`slot`], of the JSON of a texture's reference.
fn slot_of(info: &Value) -> Option<TextureSlot> {
    let texture = usize::try_from(info.get("index")?.as_u64()?).ok()?;
    let uv_set = info.get("texCoord").and_then(Value::as_u64).unwrap_or(0);
    Some(moved_slot(texture, uv_set as usize, info.pointer("/extensions/KHR_texture_transform")))
}

/// As [`slot`]; the crate leaves the transform of a normal texture to be read by hand.
fn normal_slot(source: gltf::material::NormalTexture) -> (TextureSlot, f32) {
    let transform = source.extension_value("KHR_texture_transform");
    let slot = moved_slot(source.texture().index(), source.tex_coord() as usize, transform);
    let scale = source.scale();
    (slot, if scale.is_finite() { scale } else { 1.0 })
}

/// A slot with the JSON of its transform.
fn moved_slot(texture: usize, uv_set: usize, transform: Option<&Value>) -> TextureSlot {
    let number = |name: &str| transform.and_then(|t| t.get(name)?.as_f64());
    let pair = |name: &str, default: f32| {
        let at = |i: usize| transform.and_then(|t| t.get(name)?.get(i)?.as_f64()).map_or(default, |x| x as f32);
        Vec2::new(at(0), at(1))
    };
    TextureSlot {
        texture,
        uv_set: number("texCoord").map_or(uv_set, |set| set as usize),
        transform: transform
            .map(|_| (pair("offset", 0.0), number("rotation").unwrap_or(0.0) as f32, pair("scale", 1.0))),
    }
}
