//! Tests of `KHR_animation_pointer` for materials, and for the visibility of lights and skins.

use super::file::{File, notes};
use glam::{Vec2, Vec3, vec3};
use render_core::scene::{Alpha, Material, Scene};
use render_core::{Geometry, Hit, PathOptions, Still, Surfaces, path_traced};
use serde_json::{Value, json};

/// Returns the target of a channel that animates the property at `pointer`.
fn target(pointer: &str) -> Value {
    json!({ "path": "pointer", "extensions": { "KHR_animation_pointer": { "pointer": pointer } } })
}

/// Builds a square with this material.
fn square(material: Value) -> File {
    let mut file = File::square();
    file.json["materials"] = json!([material]);
    file.json["meshes"][0]["primitives"][0]["material"] = json!(0);
    file
}

/// Returns the material of instance 0 at `time` seconds.
fn material(scene: &Scene, time: f32) -> Material {
    Surfaces::new(scene, &scene.pose(time)).material(0).clone()
}

/// Halfway between two keys, a linear track has the mean of the keys (glTF 2.0, appendix C.3).
#[test]
fn factors_of_materials_are_animated() {
    let mut file = square(json!({
        "alphaMode": "MASK", "alphaCutoff": 0.25, "emissiveFactor": [1, 1, 1],
        "pbrMetallicRoughness": { "baseColorFactor": [1, 1, 1, 1] },
        "extensions": { "KHR_materials_emissive_strength": { "emissiveStrength": 3.0 } },
    }));
    let colors = file.accessor("VEC4", 2, &[1.0, 0.5, 0.0, 1.0, 0.0, 0.5, 1.0, 0.5]);
    let (numbers, glow) = (file.scalars(&[0.0, 0.5]), file.vectors(&[Vec3::ZERO, vec3(1.0, 0.5, 0.0)]));
    let (strengths, indices) = (file.scalars(&[2.0, 6.0]), file.scalars(&[1.0, 3.0]));
    let of = |path: &str| target(&format!("/materials/0/{path}"));
    file.clip(
        "a",
        &[
            (of("pbrMetallicRoughness/baseColorFactor"), colors),
            (of("pbrMetallicRoughness/metallicFactor"), numbers),
            (of("pbrMetallicRoughness/roughnessFactor"), numbers),
            (of("alphaCutoff"), numbers),
            (of("emissiveFactor"), glow),
            (of("extensions/KHR_materials_emissive_strength/emissiveStrength"), strengths),
            (of("extensions/KHR_materials_ior/ior"), indices),
        ],
    );
    let scene = file.load();
    assert_eq!(notes(&scene, "left out"), 0, "{:?}", scene.warnings);
    let found = material(&scene, 0.5);
    assert_eq!((found.base_color, found.opacity), (Vec3::splat(0.5), 0.75));
    assert_eq!((found.metallic, found.roughness, found.alpha), (0.25, 0.25, Alpha::Mask { cutoff: 0.25 }));
    // The emission is the product of factor and strength: (½, ¼, 0) · 4.
    assert_eq!(found.emission, vec3(2.0, 1.0, 0.0));
    // By KHR_materials_ior, ((n − 1) / (n + 1))² is 1/9 at n = 2.
    assert!((found.dielectric_f0 - 1.0 / 9.0).abs().max_element() < 1e-6);
    // The rest state has the file's values. The instance counts as dynamic, so it is neither baked nor reprojected.
    assert_eq!(scene.materials[0].emission, Vec3::splat(3.0));
    assert_eq!((scene.moving_instances(), scene.moving_nodes()), (vec![true], vec![false]));
    assert_eq!(scene.duration(), 1.0);
    // A lamp that is dark in the first frame may emit later.
    assert!(scene.extreme_materials()[0].is_lamp() && !material(&scene, 0.0).emits());
    assert_eq!(notes(&scene, "no lamp"), 0);
}

#[test]
fn values_that_no_material_has_are_clamped() {
    let mut file = square(json!({ "emissiveFactor": [1, 1, 1] }));
    let colors = file.accessor("VEC4", 2, &[2.0, -1.0, 0.5, 7.0, 2.0, -1.0, 0.5, 7.0]);
    let (glow, numbers) = (file.vectors(&[Vec3::splat(3e38); 2]), file.scalars(&[-4.0, 9.0]));
    let of = |path: &str| target(&format!("/materials/0/{path}"));
    file.clip(
        "a",
        &[
            (of("pbrMetallicRoughness/baseColorFactor"), colors),
            (of("pbrMetallicRoughness/roughnessFactor"), numbers),
            (of("emissiveFactor"), glow),
        ],
    );
    let found = material(&file.load(), 1.0);
    assert_eq!((found.base_color, found.opacity, found.roughness), (vec3(1.0, 0.0, 0.5), 1.0, 1.0));
    assert_eq!(found.emission, Vec3::splat(1e18));
}

/// Errors name keys with a wrong number of components. A channel with equal keys animates no property.
#[test]
fn keys_have_the_width_of_their_property() {
    let mut file = square(json!({}));
    let keys = file.scalars(&[0.0, 1.0]);
    file.clip("a", &[(target("/materials/0/emissiveFactor"), keys)]);
    let error = file.load_with(&[]).unwrap_err().to_string();
    assert!(error.contains("animation of material 0 needs keys of 3 numbers each"), "{error}");

    let mut file = square(json!({}));
    let keys = file.scalars(&[0.5, 0.5]);
    file.clip("a", &[(target("/materials/0/pbrMetallicRoughness/metallicFactor"), keys)]);
    let scene = file.load();
    assert_eq!((scene.moving_instances(), material(&scene, 0.3).metallic), (vec![false], 0.5));
}

/// With `KHR_texture_transform`, the texture and its holes slide by the offset.
#[test]
fn transforms_of_textures_are_animated() {
    // The left half is opaque, the right half is a hole. Each is one pixel wide.
    let mut file = square(json!({
        "alphaMode": "MASK",
        "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } },
    }));
    file.json["images"] = json!([{ "uri": HALF_OPAQUE }]);
    file.json["samplers"] = json!([{ "magFilter": 9728 }]);
    file.json["textures"] = json!([{ "source": 0, "sampler": 0 }]);
    let uvs = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 0.0], [1.0, 1.0], [0.0, 1.0]].concat();
    let uvs = file.accessor("VEC2", 6, &uvs);
    file.json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = json!(uvs);
    let offsets = file.accessor("VEC2", 2, &[0.0, 0.0, 0.5, 0.0]);
    let place = "/materials/0/pbrMetallicRoughness/baseColorTexture/extensions/KHR_texture_transform/offset";
    file.clip("a", &[(target(place), offsets)]);
    let scene = file.load();
    let slot = material(&scene, 0.5).base_color_texture.unwrap();
    assert_eq!(slot.map(Vec2::new(0.25, 0.5)), Vec2::new(0.5, 0.5));

    // Rays along −z hit only the opaque half: first on the left, then, after the texture rotated by 180°, on the right.
    let geometry = Geometry::new(&scene);
    for (time, shows) in [(0.0, [true, false]), (1.0, [false, true])] {
        let accelerator = geometry.place(&scene.pose(time));
        for (x, shown) in [0.25, 0.75].into_iter().zip(shows) {
            let hit: Option<Hit> = accelerator.closest(vec3(x, 0.4, 1.0).into(), -glam::Vec3A::Z);
            assert_eq!(hit.is_some(), shown, "x {x} at {time} s");
        }
    }
}

/// PNG of 2×1 pixels: white with opacity 1, and white with opacity 0.
const HALF_OPAQUE: &str = "data:image/png;base64,iVBORw0KGgoAAAANSUhEUgAAAAIAAAABCAYAAAD0In+KAAAAEUlEQVR4nGP8////fwYGBkYAGfkD/3ZDTbIAAAAASUVORK5CYII=";

/// The radiance of an emissive square matches the animated emission at the time of the picture.
#[test]
fn pictures_show_the_glow_of_their_time() {
    let mut file = square(json!({ "pbrMetallicRoughness": { "baseColorFactor": [0, 0, 0, 1] } }));
    file.json["cameras"] = json!([{ "type": "orthographic",
        "orthographic": { "xmag": 0.1, "ymag": 0.1, "znear": 0.1, "zfar": 9.0 } }]);
    file.node(json!({ "camera": 0, "translation": [0.5, 0.5, 1.0] }));
    let glow = file.vectors(&[Vec3::ZERO, vec3(1.0, 0.5, 0.25)]);
    file.clip("a", &[(target("/materials/0/emissiveFactor"), glow)]);
    let scene = file.load();
    for (time, expected) in [(0.0, 0.0), (0.5, 0.5), (1.0, 1.0)] {
        let options = PathOptions { samples: 4, max_bounces: Some(1), ..PathOptions::default() };
        let found = path_traced(&scene, Still { time, width: 8, height: 8 }, &options, |_, _| ()).mean.get(4, 4)[0];
        assert!((found - expected).abs() < 1e-6, "{found} at {time} s, not {expected}");
    }
}

/// "When a node is not visible, all its visual features including but not limited to meshes, light sources … are not rendered."
#[test]
fn visibility_of_lights_is_animated() {
    let mut file = File::square();
    file.json["extensions"] = json!({ "KHR_lights_punctual": { "lights": [{ "type": "point", "intensity": 5.0 }] } });
    let below = file.push("nodes", json!({ "extensions": { "KHR_lights_punctual": { "light": 0 } } }));
    let above =
        file.node(json!({ "children": [below], "extensions": { "KHR_node_visibility": { "visible": false } } }));
    let (on, intensities) = (file.scalars(&[0.0, 1.0]), file.scalars(&[2.0, 4.0]));
    file.clip(
        "a",
        &[
            (target(&format!("/nodes/{above}/extensions/KHR_node_visibility/visible")), on),
            (target("/extensions/KHR_lights_punctual/lights/0/intensity"), intensities),
        ],
    );
    let scene = file.load();
    for (time, intensity) in [(0.0, 0.0), (0.5, 0.0), (1.0, 4.0)] {
        let lights = scene.pose(time).punctual_lights(&scene).to_vec();
        assert_eq!(lights[0].color, Vec3::splat(intensity), "at {time} s");
    }
}

/// A mesh with a skin ignores its node's transform, but not its visibility.
#[test]
fn visibility_of_skins_is_animated() {
    for moves in [false, true] {
        let mut file = File::square();
        let joint = file.node(json!({ "translation": [0.0, 0.0, 3.0] }));
        let joints = file.accessor("VEC4", 6, &[0.0; 24]);
        let weights = file.accessor("VEC4", 6, &[[1.0, 0.0, 0.0, 0.0]; 6].concat());
        // Joints are numbers of one byte.
        let bytes = file.push("bufferViews", json!({ "buffer": 0, "byteOffset": 0, "byteLength": 24 }));
        file.json["accessors"][joints] =
            json!({ "bufferView": bytes, "byteOffset": 0, "componentType": 5121, "count": 6, "type": "VEC4" });
        file.bin[..24].fill(0);
        let corners = [Vec3::ZERO, Vec3::X, vec3(1.0, 1.0, 0.0), Vec3::ZERO, vec3(1.0, 1.0, 0.0), Vec3::Y];
        let positions = file.vectors(&corners);
        file.json["meshes"][0]["primitives"][0]["attributes"] =
            json!({ "POSITION": positions, "JOINTS_0": joints, "WEIGHTS_0": weights });
        file.json["skins"] = json!([{ "joints": [joint] }]);
        file.json["nodes"][0]["skin"] = json!(0);
        // Add a translation, which the skin ignores.
        file.json["nodes"][0]["translation"] = json!([9.0, 9.0, 9.0]);
        let visible = file.scalars(&[1.0, 0.0]);
        let mut channels = vec![(target("/nodes/0/extensions/KHR_node_visibility/visible"), visible)];
        if moves {
            let places = file.vectors(&[vec3(0.0, 0.0, 3.0), vec3(0.0, 0.0, 4.0)]);
            channels.push((target(&format!("/nodes/{joint}/translation")), places));
        }
        file.clip("a", &channels);
        let scene = file.load();
        assert_eq!(scene.moving_instances(), [true]);
        let geometry = Geometry::new(&scene);
        let hit = |time: f32| {
            let accelerator = geometry.place(&scene.pose(time));
            let hit: Option<Hit> = accelerator.closest(vec3(0.6, 0.4, 9.0).into(), -glam::Vec3A::Z);
            hit.map(|hit| hit.distance)
        };
        assert_eq!(hit(0.0), Some(6.0));
        assert!((hit(0.5).unwrap() - if moves { 5.5 } else { 6.0 }).abs() < 1e-5);
        assert_eq!(hit(1.0), None);
    }
}
