//! Tests of material extensions: glass, clearcoat, sheen, and more.

use super::file::{File, notes};
use glam::{Vec2, Vec3, vec3};
use render_core::scene::{Encoding, Material, Scene, Volume};
use serde_json::{Value, json};

/// Loads a square with a material of these extensions.
fn load(extensions: Value) -> Scene {
    let mut file = File::square();
    file.json["materials"] = json!([{ "extensions": extensions }]);
    file.json["meshes"][0]["primitives"][0]["material"] = json!(0);
    file.load()
}

fn material(extensions: Value) -> Material {
    load(extensions).materials[0].clone()
}

/// Every factor of the extensions has its place, and none has a note.
#[test]
fn materials_have_their_lobes() {
    let scene = load(json!({
        "KHR_materials_anisotropy": { "anisotropyStrength": 0.6, "anisotropyRotation": -1.5 },
        "KHR_materials_clearcoat": { "clearcoatFactor": 0.5, "clearcoatRoughnessFactor": 0.25 },
        "KHR_materials_diffuse_transmission": {
            "diffuseTransmissionFactor": 0.3, "diffuseTransmissionColorFactor": [0.1, 0.2, 0.3]
        },
        "KHR_materials_dispersion": { "dispersion": 0.4 },
        "KHR_materials_ior": { "ior": 1.7 },
        "KHR_materials_iridescence": {
            "iridescenceFactor": 0.9, "iridescenceIor": 1.8,
            "iridescenceThicknessMinimum": 50, "iridescenceThicknessMaximum": 700
        },
        "KHR_materials_sheen": { "sheenColorFactor": [0.4, 0.5, 0.6], "sheenRoughnessFactor": 0.7 },
        "KHR_materials_specular": { "specularFactor": 0.8 },
        "KHR_materials_transmission": { "transmissionFactor": 0.35 },
        "KHR_materials_volume": {
            "thicknessFactor": 0.1, "attenuationDistance": 2.0, "attenuationColor": [1.0, 0.5, 0.25]
        },
    }));
    assert_eq!(notes(&scene, "left out"), 0, "{:?}", scene.warnings);
    let material = &scene.materials[0];
    let lobes = material.lobes.as_ref().unwrap();
    assert_eq!((lobes.ior, lobes.specular.factor), (1.7, 0.8));
    assert_eq!((lobes.anisotropy.strength, lobes.anisotropy.rotation), (0.6, -1.5));
    assert_eq!((lobes.clearcoat.factor, lobes.clearcoat.roughness), (0.5, 0.25));
    assert_eq!((lobes.sheen.color, lobes.sheen.roughness), (vec3(0.4, 0.5, 0.6), 0.7));
    let film = &lobes.iridescence;
    assert_eq!((film.factor, film.ior, film.thickness), (0.9, 1.8, [50.0, 700.0]));
    let leaf = &lobes.diffuse_transmission;
    assert_eq!((leaf.factor, leaf.color), (0.3, vec3(0.1, 0.2, 0.3)));
    assert_eq!((lobes.transmission.factor, lobes.transmission.dispersion), (0.35, 0.4));
    // The color is reached at the attenuation distance: exp(−σ · 2).
    let attenuation = lobes.transmission.volume.unwrap().attenuation;
    assert!(((attenuation * -2.0).exp() - vec3(1.0, 0.5, 0.25)).abs().max_element() < 1e-4);
    // Light passes glass from both sides.
    assert!(material.double_sided);
}

/// Exporters write extensions with all factors at zero, or the default. Such materials stay plain.
#[test]
fn extensions_without_effect_add_no_lobes() {
    for extensions in [
        json!({ "KHR_materials_clearcoat": {}, "KHR_materials_sheen": { "sheenColorFactor": [0, 0, 0] } }),
        json!({ "KHR_materials_specular": { "specularFactor": 1.0 }, "KHR_materials_ior": { "ior": 1.3 } }),
        json!({ "KHR_materials_transmission": { "transmissionFactor": 0 }, "KHR_materials_volume": { "thicknessFactor": 1 } }),
        json!({ "KHR_materials_transmission": { "transmissionFactor": 1 }, "KHR_materials_unlit": {} }),
    ] {
        let material = material(extensions.clone());
        assert!(material.lobes.is_none() && !material.double_sided, "{extensions}");
    }
}

/// Numbers outside their range are clamped, and other values have the default.
#[test]
fn factors_out_of_range_are_clamped() {
    let lobes = material(json!({
        "KHR_materials_clearcoat": { "clearcoatFactor": 7, "clearcoatRoughnessFactor": -1 },
        "KHR_materials_sheen": { "sheenColorFactor": [2, "red", 0] },
        "KHR_materials_iridescence": { "iridescenceIor": 0.2, "iridescenceFactor": 1e99 },
        "KHR_materials_transmission": { "transmissionFactor": -3 },
    }))
    .lobes
    .unwrap();
    assert_eq!((lobes.clearcoat.factor, lobes.clearcoat.roughness, lobes.sheen.color), (1.0, 0.0, Vec3::ZERO));
    assert_eq!((lobes.iridescence.ior, lobes.transmission.factor), (1.0, 0.0));
    assert!(lobes.iridescence.factor <= 1.0);
    // A volume without a distance does not attenuate.
    assert_eq!(Volume::new(Vec3::ZERO, f32::INFINITY).attenuation, Vec3::ZERO);
}

/// Textures are decoded as colors or as data, and have their own transforms.
#[test]
fn textures_of_lobes_are_read() {
    let mut file = File::square();
    let slot = |set: u32| json!({ "index": 0, "texCoord": set });
    let moved = json!({ "index": 0, "extensions": { "KHR_texture_transform": { "offset": [0.5, 0.25] } } });
    file.json["images"] = json!([{ "uri": PIXEL }]);
    file.json["textures"] = json!([{ "source": 0 }]);
    file.json["materials"] = json!([{ "extensions": {
        "KHR_materials_sheen": { "sheenColorFactor": [1, 1, 1], "sheenColorTexture": moved, "sheenRoughnessTexture": slot(1) },
        "KHR_materials_transmission": { "transmissionFactor": 1, "transmissionTexture": slot(2) },
    } }]);
    file.json["meshes"][0]["primitives"][0]["material"] = json!(0);
    let scene = file.load();
    // One image is stored twice: as color and as data.
    assert_eq!(scene.textures.len(), 2);
    let lobes = scene.materials[0].lobes.as_ref().unwrap();
    let color = lobes.sheen.color_texture.unwrap();
    assert_eq!(color.map(Vec2::ZERO), Vec2::new(0.5, 0.25));
    let (roughness, factor) = (lobes.sheen.roughness_texture.unwrap(), lobes.transmission.texture.unwrap());
    assert_eq!((roughness.texture, roughness.uv_set, factor.uv_set), (factor.texture, 1, 2));
    assert_ne!(color.texture, factor.texture);
    let encodings: Vec<Encoding> = lobes.slots().map(|(_, encoding)| encoding).collect();
    assert_eq!(encodings.iter().filter(|&&encoding| encoding == Encoding::Srgb).count(), 1);
}

/// PNG of a single texel.
const PIXEL: &str = "data:image/png;base64,iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNk+M9QDwADhgGAWjR9awAAAABJRU5ErkJggg==";
