//! Tests of valid files that omit optional data or define it in extensions.

use super::file::{File, load_bytes, notes};
use glam::{Quat, Vec3, Vec3A, vec3};
use serde_json::{Value, json};

/// Channels may have no node: "When undefined, the animated object MAY be defined by an extension" (glTF 2.0, 5.6.1).
#[test]
fn channels_without_a_node_leave_the_others() {
    for target in [
        json!({ "path": "translation" }),
        json!({ "path": "pointer" }),
        json!({ "node": 0, "path": "ACME_color" }),
        json!({ "path": "pointer", "extensions": { "KHR_animation_pointer": { "pointer": "/acme/0/x" } } }),
    ] {
        let mut file = File::square();
        let moved = file.vectors(&[Vec3::ZERO, Vec3::Y]);
        file.clip("a", &[(target.clone(), moved), (json!({ "node": 0, "path": "translation" }), moved)]);
        let scene = file.load();
        assert_eq!(scene.channels.len(), 1, "{target}");
        assert_eq!(scene.pose(1.0).world[0].translation, Vec3A::Y, "{target}");
        let word =
            if target["extensions"].is_null() { "animations of unknown node properties" } else { "property /acme/0/x" };
        assert_eq!(notes(&scene, word), 1, "{target}: {:?}", scene.warnings);
    }
}

/// Textures may have no `source`: "When undefined, an extension or other mechanism SHOULD supply an alternate texture
/// source" (5.29.2).
#[test]
fn textures_without_a_source_leave_the_plain_color() {
    let slot = json!({ "index": 0 });
    for (texture, images) in [
        (json!({}), None),
        (json!({ "extensions": { "EXT_texture_avif": { "source": 0 } } }), Some(json!([{ "uri": "a.avif" }]))),
        (json!({ "source": 0 }), Some(json!([{ "name": "neither uri nor view" }]))),
    ] {
        let mut file = File::square();
        file.json["materials"] = json!([{
            "pbrMetallicRoughness": { "baseColorFactor": [0.2, 0.4, 0.6, 1.0], "baseColorTexture": slot },
            "normalTexture": slot, "emissiveTexture": slot, "occlusionTexture": slot,
            "extensions": { "KHR_materials_specular": { "specularTexture": slot } },
        }]);
        file.json["textures"] = json!([texture]);
        if let Some(images) = images {
            file.json["images"] = images;
        }
        file.json["meshes"][0]["primitives"][0]["material"] = json!(0);
        let scene = file.load();
        assert_eq!(scene.materials[0].slots().count(), 0);
        assert_eq!(scene.materials[0].base_color, vec3(0.2, 0.4, 0.6));
        assert_eq!(notes(&scene, "textures without a readable image"), 1, "{:?}", scene.warnings);
    }
}

/// Primitives may have no `POSITION`: "client implementations SHOULD skip primitive's rendering" (3.7.2.1).
#[test]
fn primitives_without_positions_are_skipped() {
    let mut file = File::square();
    let other = json!({ "attributes": { "NORMAL": 0 } });
    file.json["meshes"][0]["primitives"].as_array_mut().unwrap().insert(0, other);
    let scene = file.load();
    assert_eq!((scene.meshes.len(), scene.triangle_count()), (1, 2));
    assert_eq!(notes(&scene, "without readable positions"), 1);
    // Primitives are also skipped if their positions have a format that an extension adds, their mode is unknown, or
    // only an extension contains their data.
    for (pointer, value) in [
        ("/accessors/0/componentType", json!(5130)),
        ("/accessors/0/type", json!("VEC9")),
        ("/meshes/0/primitives/0/mode", json!(14)),
    ] {
        let mut file = File::square();
        if pointer.ends_with("mode") {
            file.json["meshes"][0]["primitives"][0]["mode"] = value;
        } else {
            *file.json.pointer_mut(pointer).unwrap() = value;
        }
        let scene = file.load();
        assert_eq!((scene.triangle_count(), notes(&scene, "without readable positions")), (0, 1), "{pointer}");
    }
    let mut file = File::square();
    file.json["buffers"].as_array_mut().unwrap().push(json!({ "byteLength": 72 }));
    file.json["bufferViews"][0]["buffer"] = json!(1);
    assert_eq!(file.load().triangle_count(), 0);
    // A build without the feature omits packed meshes.
    if !cfg!(feature = "draco") {
        let mut file = File::square();
        file.json["accessors"][0].as_object_mut().unwrap().remove("bufferView");
        file.json["meshes"][0]["primitives"][0]["extensions"] =
            json!({ "KHR_draco_mesh_compression": { "bufferView": 0, "attributes": { "POSITION": 0 } } });
        let scene = file.load();
        assert_eq!((scene.triangle_count(), notes(&scene, "only in KHR_draco_mesh_compression")), (0, 1));
    }
}

/// Unknown attributes, members and values of applications and extensions have no effect.
#[test]
fn unknown_parts_change_nothing() {
    let changes: [(&str, Value); 21] = [
        ("/asset/minVersion", json!("2.0")),
        ("/asset/version", json!("2.1")),
        ("/asset/extras", json!([1, { "a": null }])),
        ("/extras", json!("text")),
        ("/future", json!({ "x": 1 })),
        ("/nodes/0/extras", json!(3.5)),
        ("/nodes/0/extensions", json!({ "ACME_thing": { "extras": 1 }, "ACME_flag": true })),
        ("/scenes/0/extensions", json!({ "EXT_lights_image_based": { "light": 0 } })),
        ("/scenes/0/nodes", json!([0.0])),
        ("/meshes/0/name", Value::Null),
        ("/meshes/0/weights", json!([])),
        ("/meshes/0/primitives/0/attributes/_TEMPERATURE", json!(0)),
        ("/meshes/0/primitives/0/attributes/FEATURE_ID", json!(0)),
        ("/meshes/0/primitives/0/attributes/COLOR_x", json!(0)),
        ("/meshes/0/primitives/0/mode", json!(4.0)),
        ("/bufferViews/0/target", json!(99)),
        ("/materials", json!([{ "alphaMode": "ACME_DITHER" }])),
        ("/samplers", json!([{ "magFilter": 1, "minFilter": 2, "wrapS": 3, "wrapT": 10497 }])),
        ("/cameras", json!([{ "type": "ACME_fisheye", "extensions": { "ACME_fisheye": {} } }])),
        ("/extensions", json!({ "KHR_lights_punctual": { "lights": [{ "type": "area" }] } })),
        ("/images", json!([{ "bufferView": 0 }])),
    ];
    for (pointer, value) in changes {
        let mut file = File::square();
        let (parent, name) = pointer.rsplit_once('/').unwrap();
        file.json.pointer_mut(parent).unwrap()[name] = value;
        if pointer == "/cameras" {
            file.json["nodes"][0]["camera"] = json!(0);
        }
        if pointer == "/extensions" {
            file.json["nodes"][0]["extensions"] = json!({ "KHR_lights_punctual": { "light": 0 } });
        }
        let scene = file.load();
        assert_eq!((scene.triangle_count(), scene.cameras.len(), scene.punctual_lights.len()), (2, 0, 0), "{pointer}");
    }
}

/// By `KHR_lights_punctual`, a spot light without angles has "innerConeAngle 0" and "outerConeAngle PI / 4.0".
#[test]
fn spots_without_angles_have_the_default_cone() {
    let mut file = File::square();
    file.json["extensions"] = json!({ "KHR_lights_punctual": { "lights": [{ "type": "spot" }] } });
    file.node(json!({ "extensions": { "KHR_lights_punctual": { "light": 0 } } }));
    file.node(json!({ "extensions": { "KHR_lights_punctual": {} } }));
    let lights = file.load().punctual_lights;
    let quarter = std::f32::consts::FRAC_PI_4;
    assert_eq!(lights.len(), 1);
    assert_eq!(lights[0].kind, render_core::scene::PunctualKind::Spot { inner: 0.0, outer: quarter });
}

/// For a painted sky of unlit triangles around the scene, a note names the surface that blocks the sun.
#[test]
fn unlit_backdrops_are_named() {
    let backdrop = |size: f32, depth: f32, unlit: bool| {
        let mut file = File::square();
        let corners = [vec3(-1.0, -1.0, -1.0), vec3(1.0, 1.0, -1.0), vec3(-1.0, 1.0, 1.0)];
        let around = file.vectors(&corners.map(|corner| corner * vec3(size, size, depth)));
        let mesh = json!({ "primitives": [{ "attributes": { "POSITION": around }, "material": 0 }] });
        let mesh = file.push("meshes", mesh);
        file.node(json!({ "mesh": mesh, "name": "dome" }));
        let extensions = if unlit { json!({ "KHR_materials_unlit": {} }) } else { json!({}) };
        file.json["materials"] = json!([{ "extensions": extensions }]);
        file.json["extensions"] = json!({ "KHR_lights_punctual": { "lights": [{ "type": "directional" }] } });
        file.node(json!({ "extensions": { "KHR_lights_punctual": { "light": 0 } } }));
        notes(&file.load(), "\"dome\" encloses the scene and blocks the sun wherever it is closed")
    };
    assert_eq!(backdrop(9.0, 9.0, true), 1);
    // Lit, smaller and flat surfaces are not backdrops.
    assert_eq!((backdrop(9.0, 9.0, false), backdrop(0.5, 9.0, true), backdrop(9.0, 0.0, true)), (0, 0, 0));
}

/// Lists may be absent or empty: in a scene without nodes (5.25), a file without `scene` (5.17), or an animation
/// without channels.
#[test]
fn absent_and_empty_lists_are_read() {
    for (pointer, value) in [
        ("/scene", None),
        ("/animations", Some(json!([{ "channels": [], "samplers": [] }]))),
        ("/materials", Some(json!([]))),
        ("/cameras", Some(json!([]))),
        ("/extensionsUsed", Some(json!([]))),
        ("/skins", Some(json!([]))),
    ] {
        let mut file = File::square();
        let name = pointer.trim_start_matches('/');
        match value {
            Some(value) => file.json[name] = value,
            None => {
                file.json.as_object_mut().unwrap().remove(name);
            }
        }
        assert_eq!(file.load().triangle_count(), 2, "{pointer}");
    }
    for scenes in [json!([{}]), json!([{ "nodes": [] }]), json!([{ "name": "empty" }])] {
        let mut file = File::square();
        file.json["scenes"] = scenes;
        let scene = file.load();
        assert_eq!(scene.triangle_count(), 0);
        assert!(scene.sky.is_some());
        assert_eq!(notes(&scene, "only the sky is visible"), 1, "{:?}", scene.warnings);
    }
}

/// A file without scenes is "a library of individual entities such as materials or meshes" (3.5.1): all nodes are shown.
#[test]
fn files_without_scenes_show_all_nodes() {
    let mut file = File::square();
    let below = file.push("nodes", json!({ "mesh": 0, "translation": [2.0, 0.0, 0.0] }));
    file.json["nodes"][0]["children"] = json!([below]);
    let root = file.json.as_object_mut().unwrap();
    root.remove("scene");
    root.remove("scenes");
    let scene = file.load();
    assert_eq!((scene.instances.len(), notes(&scene, "no scene: all its nodes are shown")), (2, 1));
    // Without nodes, no mesh is visible.
    file.json.as_object_mut().unwrap().remove("nodes");
    assert_eq!(notes(&file.load(), "only the sky is visible"), 1);
    // The index of a missing scene is invalid.
    file.json["scene"] = json!(0);
    assert!(file.load_with(&[]).unwrap_err().contains("scene"));
}

/// "When bufferView is undefined, the accessor MUST be initialized with zeros" (5.1.1), even in files without any view.
/// Extensions may define buffers without `uri` (3.6.1). Content in these buffers is omitted.
#[test]
fn accessors_and_buffers_without_data_are_read() {
    let mut file = File::square();
    let root = file.json.as_object_mut().unwrap();
    root.remove("bufferViews");
    root.remove("buffers");
    root["accessors"][0].as_object_mut().unwrap().remove("bufferView");
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.gltf");
    std::fs::write(&path, file.json.to_string()).unwrap();
    assert_eq!(render_core::scene::load(&path).unwrap().meshes[0].positions, [Vec3::ZERO; 6]);
    let mut json = File::square().json;
    json["buffers"] = json!([{ "byteLength": 72 }]);
    json["images"] = json!([{ "bufferView": 0, "mimeType": "image/png" }]);
    json["textures"] = json!([{ "source": 0 }]);
    json["materials"] = json!([{ "emissiveTexture": { "index": 0 } }]);
    std::fs::write(&path, json.to_string()).unwrap();
    let scene = render_core::scene::load(&path).unwrap();
    assert_eq!((scene.triangle_count(), notes(&scene, "without readable positions")), (0, 1), "{:?}", scene.warnings);
    assert_eq!(notes(&scene, "textures without a readable image"), 1);
}

/// Unused buffers need no data.
#[test]
fn buffers_without_use_may_be_absent() {
    let mut file = File::square();
    for buffer in [json!({ "byteLength": 8, "uri": "absent.bin" }), json!({ "byteLength": 8 })] {
        let buffer = file.push("buffers", buffer);
        file.push("bufferViews", json!({ "buffer": buffer, "byteLength": 8 }));
    }
    assert_eq!(file.load().triangle_count(), 2);
    file.json["accessors"][0]["bufferView"] = json!(1);
    assert!(file.load_with(&[]).unwrap_err().contains("absent.bin"));
}

/// A matrix may flatten its node along one axis or all axes, since columns of zero are as valid as a scale of zero.
#[test]
fn flat_matrices_are_kept() {
    let turn = Quat::from_axis_angle(vec3(1.0, 2.0, 3.0).normalize(), 0.7);
    for scale in [
        vec3(2.0, 3.0, 0.0),
        vec3(0.0, 3.0, 1.0),
        vec3(2.0, 0.0, 1.0),
        vec3(0.0, 0.0, 4.0),
        Vec3::ZERO,
        vec3(2.0, -3.0, 0.0),
    ] {
        let matrix = glam::Mat4::from_scale_rotation_translation(scale, turn, vec3(5.0, 6.0, 7.0));
        let mut file = File::square();
        file.json["nodes"][0]["matrix"] = json!(matrix.to_cols_array().to_vec());
        let scene = file.load();
        let world = scene.pose(0.0).world[0];
        for point in [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z] {
            let (found, expected) = (world.transform_point3(point), matrix.transform_point3(point));
            assert!((found - expected).length() < 1e-5, "{scale}: {point} is at {found}, not {expected}");
        }
    }
}

/// A normal of zero has no direction, so the triangle's normal replaces it.
#[test]
fn normals_of_zero_become_those_of_the_triangle() {
    let mut file = File::square();
    let some = [Vec3::X, Vec3::ZERO, Vec3::ZERO, Vec3::X, Vec3::ZERO, Vec3::ZERO];
    let normals = file.vectors(&some);
    file.json["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = json!(normals);
    let found = file.load().meshes[0].normals.clone();
    assert_eq!(found, some.map(|n| if n == Vec3::ZERO { Vec3::Z } else { n }));
    let none = file.vectors(&[Vec3::ZERO; 6]);
    file.json["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = json!(none);
    assert!(file.load().meshes[0].normals.is_empty(), "flat, as without normals");
}

/// Chunks of unknown types are ignored (4.4.3), regardless of their position. Zeros may pad the text.
#[test]
fn binary_files_may_have_chunks_of_other_types() {
    let bytes = File::square().bytes();
    let json_end = 20 + u32::from_le_bytes([bytes[12], bytes[13], bytes[14], bytes[15]]) as usize;
    for place in [json_end, bytes.len()] {
        let mut longer = bytes.clone();
        longer.splice(place..place, *b"\x04\0\0\0ACMEdata");
        let length = longer.len() as u32;
        longer[8..12].copy_from_slice(&length.to_le_bytes());
        assert_eq!(load_bytes(&longer, &[]).unwrap().triangle_count(), 2);
    }
    let mut zeros = bytes.clone();
    for byte in zeros[20..json_end].iter_mut().rev().take_while(|byte| **byte == b' ') {
        *byte = 0;
    }
    assert_eq!(load_bytes(&zeros, &[]).unwrap().triangle_count(), 2);
    assert!(load_bytes(&bytes[..bytes.len() - 8], &[]).unwrap_err().contains("not a complete glTF file"));
}

/// For invalid files, loading returns an accurate error.
#[test]
fn other_versions_and_wrong_types_are_named() {
    for (pointer, value, words) in [
        ("/asset/version", json!("1.0"), "glTF 1.0"),
        ("/asset/version", json!("1.0.2"), "glTF 1.0.2"),
        ("/asset/version", json!(1), "glTF 1,"),
        ("/asset/version", json!("3.0"), "glTF 3.0"),
        ("/asset/minVersion", json!("2.1"), "glTF 2.1"),
        ("/nodes/0/mesh", json!("box"), "does not follow glTF 2.0"),
        ("/meshes", json!({}), "does not follow glTF 2.0"),
    ] {
        let mut file = File::square();
        let (parent, name) = pointer.rsplit_once('/').unwrap();
        file.json.pointer_mut(parent).unwrap()[name] = value;
        let line = file.load_with(&[]).unwrap_err();
        assert!(line.contains(words) && line.lines().count() == 1 && !line.contains("not a complete"), "{line}");
    }
}

/// Windows separators in addresses (invalid in URIs) and percent-encoding (RFC 3986, 2.1) are accepted.
#[test]
fn addresses_of_other_systems_lead_to_their_files() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("my data")).unwrap();
    let file = File::square();
    std::fs::write(folder.path().join("my data/über.bin"), &file.bin).unwrap();
    let path = folder.path().join("scene.gltf");
    for uri in ["my data\\über.bin", "my%20data/%C3%BCber.bin", "my%20data%5C%C3%BCber.bin", ".\\my data\\über.bin"] {
        let mut json = file.json.clone();
        json["buffers"][0] = json!({ "byteLength": file.bin.len(), "uri": uri });
        std::fs::write(&path, json.to_string()).unwrap();
        let scene = render_core::scene::load(&path).unwrap_or_else(|error| panic!("{uri}: {error}"));
        assert_eq!(scene.triangle_count(), 2, "{uri}");
    }
    let mut json = file.json.clone();
    json["buffers"][0] = json!({ "byteLength": file.bin.len(), "uri": "..\\secret.bin" });
    std::fs::write(&path, json.to_string()).unwrap();
    assert!(render_core::scene::load(&path).unwrap_err().to_string().contains("outside"));
}
