//! Tests of extensions that select content, of Blender's lamps, and of several simultaneous clips.

use super::file::{File, notes};
use glam::{Quat, Vec3, Vec3A, vec3};
use render_core::scene::{PunctualKind, Scene, TextureSlot};
use serde_json::{Value, json};

/// With `KHR_node_visibility`, "When visible is false, the node and all its children" are hidden: meshes and lights,
/// but not cameras.
#[test]
fn hidden_nodes_and_all_below_them_are_not_shown() {
    for (visible, shown) in [(json!({ "visible": false }), 0), (json!({ "visible": true }), 1), (json!({}), 1)] {
        let mut file = File::square();
        file.json["extensions"] = json!({ "KHR_lights_punctual": { "lights": [{ "type": "point" }] } });
        file.json["cameras"] = json!([{ "type": "perspective", "perspective": { "yfov": 1, "znear": 0.1 } }]);
        let below = file
            .push("nodes", json!({ "mesh": 0, "camera": 0, "extensions": { "KHR_lights_punctual": { "light": 0 } } }));
        file.node(json!({ "mesh": 0, "children": [below], "extensions": { "KHR_node_visibility": visible } }));
        let scene = file.load();
        let found = (scene.instances.len(), scene.punctual_lights.len(), scene.cameras.len());
        assert_eq!(found, (1 + 2 * shown, shown, 1), "{visible}");
    }
}

/// With `MSFT_lod`, "the highest level of detail is the node itself", and its `ids` list the others.
#[test]
fn the_finest_level_of_detail_is_shown() {
    let mut file = File::square();
    let coarse = file.node(json!({ "mesh": 0, "name": "coarse" }));
    let inside = file.push("nodes", json!({ "mesh": 0 }));
    file.json["nodes"][coarse]["children"] = json!([inside]);
    file.json["nodes"][0]["extensions"] = json!({ "MSFT_lod": { "ids": [coarse, 99] } });
    assert_eq!(file.load().instances.len(), 1);
}

/// With `EXT_mesh_gpu_instancing`, the world transform of a copy is the node's transform times T · R · S of its
/// attributes.
#[test]
fn copies_of_a_mesh_have_their_own_places() {
    let mut file = File::square();
    let turn = Quat::from_rotation_z(std::f32::consts::FRAC_PI_2);
    let translation = file.vectors(&[Vec3::X, Vec3::Y * 2.0, Vec3::ZERO]);
    let rotation: Vec<f32> = [Quat::IDENTITY, turn, turn].iter().flat_map(|q| q.to_array()).collect();
    let rotation = file.accessor("VEC4", 3, &rotation);
    let scale = file.vectors(&[Vec3::ONE, Vec3::splat(2.0), Vec3::splat(0.5)]);
    file.json["nodes"][0]["translation"] = json!([0.0, 0.0, 5.0]);
    let extension = |attributes: Value| json!({ "EXT_mesh_gpu_instancing": { "attributes": attributes } });
    file.json["nodes"][0]["extensions"] =
        extension(json!({ "TRANSLATION": translation, "ROTATION": rotation, "SCALE": scale, "_ID": scale }));
    let scene = file.load();
    assert_eq!((scene.instances.len(), scene.triangle_count()), (3, 6));
    let pose = scene.pose(0.0);
    let corner = |copy: usize| scene.instance_world(&pose, copy).transform_point3(Vec3::X);
    for (copy, expected) in [vec3(2.0, 0.0, 5.0), vec3(0.0, 4.0, 5.0), vec3(0.0, 0.5, 5.0)].into_iter().enumerate() {
        assert!((corner(copy) - expected).length() < 1e-5, "copy {copy} is at {}", corner(copy));
    }
    // Missing attributes have defaults. Attributes of different lengths are refused.
    file.json["nodes"][0]["extensions"] = extension(json!({ "TRANSLATION": translation }));
    assert_eq!(file.load().instances.len(), 3);
    let two = file.vectors(&[Vec3::ONE; 2]);
    file.json["nodes"][0]["extensions"] = extension(json!({ "TRANSLATION": translation, "SCALE": two }));
    assert!(file.load_with(&[]).unwrap_err().contains("different numbers of elements"));
}

/// With `KHR_materials_variants`, a mapping's material applies to its listed variants. Other variants use the
/// primitive's own material.
#[test]
fn variants_replace_materials() {
    let mut file = File::square();
    let colors = [0.1, 0.2, 0.3];
    let materials = colors.map(|c| json!({ "pbrMetallicRoughness": { "baseColorFactor": [c, c, c, 1.0] } }));
    file.json["materials"] = json!(materials);
    let names = ["day", "night", "fog"].map(|name| json!({ "name": name }));
    file.json["extensions"] = json!({ "KHR_materials_variants": { "variants": names } });
    let primitive = &mut file.json["meshes"][0]["primitives"][0];
    primitive["material"] = json!(0);
    let mappings = json!([{ "material": 1, "variants": [0] }, { "material": 2, "variants": [1, 7] }]);
    primitive["extensions"] = json!({ "KHR_materials_variants": { "mappings": mappings } });
    let color = |scene: &Scene| scene.materials[scene.meshes[0].material].base_color.x;
    for (name, expected) in [("day", 0.2), ("night", 0.3), ("fog", 0.1)] {
        let scene = file.load_with(&[&format!("variant.name={name}")]).unwrap();
        assert_eq!((color(&scene), notes(&scene, "--variant")), (expected, 0), "{name}");
    }
    let scene = file.load();
    assert_eq!((color(&scene), notes(&scene, "\"day\", \"night\", \"fog\": --variant NAME")), (0.1, 1));
    let line = file.load_with(&["variant.name=noon"]).unwrap_err();
    assert!(line.contains("no variant \"noon\"; there are \"day\", \"night\", \"fog\""), "{line}");
    assert!(File::square().load_with(&["variant.name=noon"]).unwrap_err().contains("have none"));
}

/// Materials follow `KHR_materials_pbrSpecularGlossiness`: "c_diff = diffuse.rgb * (1 - max(specular))", "F0 = specular",
/// "α = (1 - glossiness)²".
#[test]
fn the_older_material_model_is_converted() {
    let mut file = File::square();
    let transform = json!({ "KHR_texture_transform": { "scale": [2.0, 3.0] } });
    file.json["images"] = json!([{ "uri": concat!("data:image/png;base64,",
        "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNk+M9QDwADhgGAWjR9awAAAABJRU5ErkJggg==") }]);
    file.json["textures"] = json!([{ "source": 0 }]);
    let older = json!({ "diffuseFactor": [0.5, 0.25, 1.0, 0.75], "specularFactor": [0.2, 0.4, 0.1],
        "glossinessFactor": 0.75, "diffuseTexture": { "index": 0, "texCoord": 1, "extensions": transform } });
    file.json["materials"] = json!([
        { "alphaMode": "BLEND", "pbrMetallicRoughness": { "baseColorFactor": [1, 0, 0, 1] },
            "extensions": { "KHR_materials_pbrSpecularGlossiness": older } },
        { "extensions": { "KHR_materials_pbrSpecularGlossiness": {} } },
        { "extensions": { "KHR_materials_pbrSpecularGlossiness": { "glossinessFactor": 0 } } },
    ]);
    file.json["meshes"][0]["primitives"][0]["material"] = json!(0);
    let scene = file.load();
    let material = &scene.materials[0];
    assert!((material.base_color - vec3(0.3, 0.15, 0.6)).length() < 1e-6, "{}", material.base_color);
    assert_eq!((material.dielectric_f0, material.roughness, material.opacity), (vec3(0.2, 0.4, 0.1), 0.25, 0.75));
    assert_eq!(material.metallic, 0.0);
    let slot = material.base_color_texture.unwrap();
    assert_eq!((slot.uv_set, slot.transform.unwrap().2), (1, glam::vec2(2.0, 3.0)));
    // Without gloss, a coat of 100 % is a rough metal, not a black body.
    let rough = &scene.materials[2];
    let (albedo, coat) = rough.split(rough.base_color, rough.metallic, rough.roughness);
    assert_eq!((albedo, coat), (Vec3::ZERO, Vec3::ONE));
    // By default all factors are 1, which is a mirror without a diffuse base.
    let mirror = &scene.materials[1];
    assert_eq!((mirror.base_color, mirror.dielectric_f0, mirror.roughness), (Vec3::ZERO, Vec3::ONE, 0.0));
}

/// Textures are compared with Khronos' conversion of specular and glossiness, texel by texel. Expected base color,
/// metalness and roughness are computed separately by Khronos' formula.
#[test]
fn textures_of_the_older_model_are_converted() {
    let mut file = File::square();
    // Use one diffuse texel, sRGB 188, 137, 225 with opacity ½. Use a black specular texel of glossiness 64 / 255 next
    // to a gold one of glossiness 1.
    file.json["images"] = json!([
        { "uri": "data:image/png;base64,iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR4nGPY0/mwAQAG0gKnuUAV2QAAAABJRU5ErkJggg==" },
        { "uri": "data:image/png;base64,iVBORw0KGgoAAAANSUhEUgAAAAIAAAABCAYAAAD0In+KAAAAEUlEQVR4nGNgYGBw+Hy65j8ACW0Deohp1wQAAAAASUVORK5CYII=" },
    ]);
    file.json["textures"] = json!([{ "source": 0 }, { "source": 1 }]);
    let older = |diffuse: Value| {
        json!({ "extensions": { "KHR_materials_pbrSpecularGlossiness": {
            "glossinessFactor": 0.5, "diffuseTexture": diffuse, "specularGlossinessTexture": { "index": 1 } } } })
    };
    file.json["materials"] = json!([older(json!({ "index": 0 })), older(json!({ "index": 0, "texCoord": 1 }))]);
    file.json["meshes"][0]["primitives"][0]["material"] = json!(0);
    let scene = file.load();
    let material = &scene.materials[0];
    assert_eq!((material.base_color, material.metallic, material.roughness), (Vec3::ONE, 1.0, 1.0));
    assert_eq!(material.dielectric_f0, Vec3::splat(0.04));
    let look = |slot: TextureSlot, u: f32| scene.textures[slot.texture].sample(glam::vec2(u, 0.5), 1.0);
    for (u, base, metallic, roughness) in [
        (0.25, vec3(0.5238, 0.2606, 0.7843), 0.0, 1.0 - 0.5 * 64.0 / 255.0),
        (0.75, vec3(0.9423, 0.6093, 0.344), 0.9366, 0.5),
    ] {
        let found = look(material.base_color_texture.unwrap(), u);
        assert!((found.color - base).abs().max_element() < 0.005, "{} at {u}", found.color);
        assert!((found.opacity - 128.0 / 255.0).abs() < 1e-3);
        let data = look(material.metallic_roughness_texture.unwrap(), u).color;
        // The tolerance is half a code value.
        assert!((data.z - metallic).abs() < 0.0021 && (data.y - roughness).abs() < 0.0021, "{data} at {u}");
    }
    // With different coordinates, the two textures have no texels in common.
    assert_eq!(notes(&scene, "other coordinates than the diffuse texture"), 1, "{:?}", scene.warnings);
}

/// Candela and lux of Blender's exporter are 683 times the watts: `PBR_WATTS_TO_LUMENS` in the exporter's source.
#[test]
fn lamps_of_blender_fit_its_emission() {
    let mut file = File::square();
    let lights = json!([{ "type": "point", "intensity": 683.0 }, { "type": "directional", "intensity": 68.3 }]);
    file.json["extensions"] = json!({ "KHR_lights_punctual": { "lights": lights } });
    for light in 0..2 {
        file.node(json!({ "extensions": { "KHR_lights_punctual": { "light": light } } }));
    }
    let colors = |file: &File, settings: &[&str]| {
        let scene = file.load_with(settings).unwrap();
        let colors: Vec<f32> = scene.punctual_lights.iter().map(|light| light.color.y).collect();
        (colors, notes(&scene, "--set lamps=1"))
    };
    assert_eq!(colors(&file, &[]), (vec![683.0, 68.3], 0));
    file.json["asset"]["generator"] = json!("Khronos glTF Blender I/O v5.0.21");
    let (found, notes) = colors(&file, &[]);
    assert!((found[0] - 1.0).abs() < 1e-6 && (found[1] - 0.1).abs() < 1e-6 && notes == 1, "{found:?}, {notes}");
    assert_eq!(colors(&file, &["lamps=1"]), (vec![683.0, 68.3], 0));
    assert_eq!(colors(&file, &["light.lamps=2"]).0, [1366.0, 136.6]);
    file.json["asset"]["generator"] = json!("THREE.GLTFExporter");
    assert_eq!(colors(&file, &[]).1, 0);
}

/// A sphere of radiance L and surface area A has the mean intensity L · A / 4 (Cauchy).
#[test]
fn points_may_have_a_radius() {
    let mut file = File::square();
    let lights = json!([{ "type": "point", "intensity": 7.0 }, { "type": "spot", "spot": {} }]);
    file.json["extensions"] = json!({ "KHR_lights_punctual": { "lights": lights } });
    for light in 0..2 {
        file.node(json!({ "translation": [0, 0, 3], "extensions": { "KHR_lights_punctual": { "light": light } } }));
    }
    let scene = file.load_with(&["lamp_radius=0.1"]).unwrap();
    assert!(matches!(scene.punctual_lights[..], [light] if matches!(light.kind, PunctualKind::Spot { .. })));
    let lamp = scene.meshes.last().unwrap();
    let mut area = 0.0;
    for triangle in &lamp.triangles {
        let [a, b, c] = triangle.map(|vertex| lamp.positions[vertex as usize]);
        area += (b - a).cross(c - a).length() / 2.0;
    }
    let intensity = scene.materials[lamp.material].emission.x * area / 4.0;
    assert!((intensity - 7.0).abs() < 1e-4, "{intensity}");
    assert!(lamp.positions.iter().all(|p| p.length() <= 0.1001));
    assert_eq!(notes(&scene, "spots"), 1);
}

/// Clips of different properties play together; of two clips with the same property, the first plays.
#[test]
fn all_clips_play_together_on_request() {
    let mut file = File::square();
    let other = file.node(json!({ "mesh": 0 }));
    let (up, right) = (file.vectors(&[Vec3::ZERO, Vec3::Y]), file.vectors(&[Vec3::ZERO, Vec3::X]));
    file.push("animations", json!({ "name": "nothing", "channels": [], "samplers": [] }));
    file.clip("rise", &[(json!({ "node": 0, "path": "translation" }), up)]);
    file.clip("slide", &[(json!({ "node": other, "path": "translation" }), right)]);
    file.clip("grow", &[(json!({ "node": 0, "path": "scale" }), right)]);
    file.clip("fall", &[(json!({ "node": 0, "path": "translation" }), right)]);
    let ends = |scene: &Scene| scene.pose(1.0).world.iter().map(|world| world.translation).collect::<Vec<_>>();
    let first = file.load();
    assert_eq!(ends(&first), [Vec3A::Y, Vec3A::ZERO]);
    assert_eq!(notes(&first, "only the first of 4 animations plays"), 1, "{:?}", first.warnings);
    assert_eq!(notes(&first, "--animation all"), 1);
    let all = file.load_with(&["animation.name=all"]).unwrap();
    assert_eq!((ends(&all), all.channels.len()), (vec![Vec3A::Y, Vec3A::X], 3));
    assert_eq!(notes(&all, "left out: \"fall\""), 1, "{:?}", all.warnings);
    // A clip called "all" takes precedence.
    file.json["animations"][2]["name"] = json!("all");
    let named = file.load_with(&["animation.name=all"]).unwrap();
    assert_eq!(ends(&named), [Vec3A::ZERO, Vec3A::X]);
}
