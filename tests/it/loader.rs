//! Third-party files and malicious files.

use glam::{Vec3, Vec3A, vec2, vec3};
use pipeline::Run;
use render_core::scene::{self, Alpha, Scene};
use render2mpeg::{Options, Settings};
use renderer::plan::Plan;
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;
use tests::{Glb, Hostile, Moving, Random, checkered_room, cornell, damaged, hostile_scenes, program, shared_scenes};

fn scene_files(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            scene_files(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "glb" || extension == "gltf") {
            found.push(path);
        }
    }
}

/// Unreadable files, and the required text of the message.
const REFUSED: [(&str, &str); 3] = [
    ("khronos-odd/broken-MissingBin/BoxTextured.gltf", "BoxTextured0.bin"),
    ("khronos-odd/broken-NoScene/NoScene.gltf", "scene"),
    ("khronos-odd/broken-sceneWrongType/sceneWrongType.gltf", "scene"),
];

#[test]
fn scenes_from_elsewhere_load_or_are_refused_in_a_line() {
    let Some(folder) = shared_scenes() else { return };
    let mut files = Vec::new();
    scene_files(&folder, &mut files);
    files.sort();
    assert!(files.len() > 40, "{} files", files.len());
    let mut wrong = Vec::new();
    for path in files {
        let name = path.strip_prefix(&folder).unwrap().to_str().unwrap();
        let word = REFUSED.iter().find(|(refused, _)| *refused == name).map(|(_, word)| *word);
        match (scene::load(&path), word) {
            (Ok(scene), None) => println!("{name}: {} triangles, {:?}", scene.triangle_count(), scene.warnings),
            (Ok(_), Some(_)) => wrong.push(format!("{name} loads")),
            (Err(error), word) => {
                let message = error.to_string();
                println!("{message}");
                if message.lines().count() != 1 || !word.is_some_and(|word| message.contains(word)) {
                    wrong.push(message);
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

/// Builds a square of side 1 with a material given as JSON.
fn square(material: Value) -> Glb {
    let mut glb = Glb::default();
    glb.add(&[[Vec3::ZERO, Vec3::X, Vec3::Y]], Vec3::ONE, Vec3::ZERO);
    glb.json["materials"][0] = material;
    glb
}

fn load(glb: &Glb, settings: &str) -> Result<Scene, String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.glb");
    glb.write(&path);
    std::fs::write(path.with_extension("toml"), settings).unwrap();
    scene::load(&path).map_err(|error| error.to_string())
}

#[test]
fn materials_mean_what_the_specification_says() {
    let material = |json: Value| load(&square(json), "").unwrap().materials[0].clone();
    let near = |found: Vec3, expected: Vec3| assert!((found - expected).length() < 1e-5, "{found} for {expected}");
    // Missing properties have defaults: a rough metal, with 4 % reflectance if not metallic.
    let plain = material(json!({}));
    assert_eq!((plain.metallic, plain.roughness, plain.opacity, plain.alpha), (1.0, 1.0, 1.0, Alpha::Opaque));
    near(plain.dielectric_f0, Vec3::splat(0.04));
    let mut without = square(json!({}));
    without.json["meshes"][0]["primitives"][0].as_object_mut().unwrap().remove("material");
    let scene = load(&without, "").unwrap();
    let default = &scene.materials[scene.meshes[0].material];
    assert_eq!((default.metallic, default.roughness, default.base_color), (1.0, 1.0, Vec3::ONE));

    assert_eq!(material(json!({ "alphaMode": "MASK" })).alpha, Alpha::Mask { cutoff: 0.5 });
    assert_eq!(material(json!({ "alphaMode": "MASK", "alphaCutoff": 0.3 })).alpha, Alpha::Mask { cutoff: 0.3 });
    let blended = material(json!({
        "alphaMode": "BLEND", "doubleSided": true, "pbrMetallicRoughness": { "baseColorFactor": [0.1, 0.2, 0.3, 0.4] }
    }));
    assert_eq!((blended.alpha, blended.opacity, blended.double_sided), (Alpha::Blend, 0.4, true));
    near(blended.base_color, vec3(0.1, 0.2, 0.3));

    // ((n − 1) / (n + 1))² times the color, at most 1, times the factor.
    let coated = |ior: f32, factor: f32, color: [f32; 3]| {
        let specular = json!({ "specularFactor": factor, "specularColorFactor": color });
        material(json!({ "extensions": { "KHR_materials_ior": { "ior": ior }, "KHR_materials_specular": specular } }))
    };
    near(coated(2.0, 1.0, [1.0; 3]).dielectric_f0, Vec3::splat(1.0 / 9.0));
    near(coated(2.0, 0.5, [1.0, 0.5, 100.0]).dielectric_f0, vec3(1.0 / 18.0, 1.0 / 36.0, 0.5));
    near(coated(1.5, 0.0, [1.0; 3]).dielectric_f0, Vec3::ZERO);
}

/// An image in four slots is stored once as colors, once as numbers and once as normals. Each slot has its own
/// coordinates and transform.
#[test]
fn textures_are_held_for_what_they_are_used_as() {
    let transform = |set: u32| {
        json!({ "KHR_texture_transform": {
        "offset": [0.5, 0.25], "rotation": 1.5, "scale": [2.0, 3.0], "texCoord": set
    } })
    };
    let mut glb = square(json!({
        "pbrMetallicRoughness": {
            "baseColorTexture": { "index": 0, "texCoord": 1 },
            "metallicRoughnessTexture": { "index": 0, "extensions": transform(2) },
        },
        "normalTexture": { "index": 1, "scale": 0.5, "texCoord": 1, "extensions": transform(3) },
        "emissiveTexture": { "index": 1, "texCoord": 7 },
        "occlusionTexture": { "index": 0 },
    }));
    // A single texel.
    let png = "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNk+M9QDwADhgGAWjR9awAAAABJRU5ErkJggg==";
    glb.json["images"] = json!([{ "uri": format!("data:image/png;base64,{png}") }]);
    glb.json["textures"] = json!([{ "source": 0 }, { "source": 0 }]);
    let scene = load(&glb, "").unwrap();
    assert_eq!(scene.textures.len(), 3);
    let material = &scene.materials[0];
    let (base, emission) = (material.base_color_texture.unwrap(), material.emission_texture.unwrap());
    let (numbers, (normal, scale)) = (material.metallic_roughness_texture.unwrap(), material.normal_texture.unwrap());
    assert_eq!(base.texture, emission.texture);
    assert_eq!(BTreeSet::from([base.texture, numbers.texture, normal.texture]).len(), 3);
    let moved = Some((vec2(0.5, 0.25), 1.5, vec2(2.0, 3.0)));
    assert_eq!((base.uv_set, base.transform), (1, None));
    assert_eq!((numbers.uv_set, numbers.transform), (2, moved));
    assert_eq!((normal.uv_set, normal.transform, scale), (3, moved, 0.5));
    // A set beyond the supported ones gives a warning and is replaced by the last.
    assert_eq!(emission.uv_set, 3);
    assert!(scene.warnings.iter().any(|warning| warning.contains("sets 0 to 3")), "{:?}", scene.warnings);
}

/// Only scenes without any intended light source get a plain sky.
#[test]
fn a_sky_is_added_where_nothing_was_made_to_shine() {
    let png = "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNk+M9QDwADhgGAWjR9awAAAABJRU5ErkJggg==";
    let glowing = |strength: f32| {
        let mut glb = square(json!({
            "emissiveFactor": [1.0, 1.0, 1.0], "emissiveTexture": { "index": 0 },
            "extensions": { "KHR_materials_emissive_strength": { "emissiveStrength": strength } },
        }));
        glb.json["extensionsUsed"] = json!(["KHR_materials_emissive_strength"]);
        glb.json["images"] = json!([{ "uri": format!("data:image/png;base64,{png}") }]);
        glb.json["textures"] = json!([{ "source": 0 }]);
        glb
    };
    let lit_by_sky = |glb: &Glb, settings: &str| {
        let scene = load(glb, settings).unwrap();
        assert_eq!(scene.sky.is_some(), scene.warnings.iter().any(|warning| warning.contains("plain white sky")));
        scene.sky.is_some()
    };
    // No emission, weak emission, strong emission, and a sky in the settings.
    assert!(lit_by_sky(&square(json!({})), ""));
    assert!(lit_by_sky(&glowing(1.0), ""), "instruments of a helmet");
    assert!(!lit_by_sky(&glowing(6.5), ""), "a stained glass window");
    let black = "[sky]\nzenith = [0, 0, 0]\nhorizon = [0, 0, 0]\n";
    assert!(!lit_by_sky(&square(json!({})), black), "an explicit black sky");

    let nave = scene::load(&cornell().with_file_name("../nave/nave.glb")).unwrap();
    assert!(nave.sky.is_none() && nave.warnings.is_empty(), "{:?}", nave.warnings);
}

/// A square with normalized 16-bit corners, interleaved at eight bytes, and 8-bit normals.
#[test]
fn quantised_meshes_have_the_numbers_they_stand_for() {
    let mut glb = square(json!({}));
    for name in ["extensionsUsed", "extensionsRequired"] {
        glb.json[name] = json!(["KHR_mesh_quantization"]);
    }
    // Normalized shorts replace the corners.
    let corners: [[i16; 3]; 4] = [[0, 0, 0], [32767, 0, 0], [32767, 16384, 0], [0, 16384, -32768]];
    for (vertex, corner) in corners.iter().enumerate() {
        for (axis, value) in corner.iter().enumerate() {
            glb.bin[8 * vertex + 2 * axis..][..2].copy_from_slice(&value.to_le_bytes());
        }
    }
    glb.json["bufferViews"][0]["byteStride"] = json!(8);
    glb.json["accessors"][0]["componentType"] = json!(5122);
    glb.json["accessors"][0]["normalized"] = json!(true);

    // Normals are bytes.
    let start = glb.bin.len();
    glb.bin.extend((0..4).flat_map(|_| [0u8, 0x81, 0, 0]));
    let views = glb.json["bufferViews"].as_array_mut().unwrap();
    views.push(json!({ "buffer": 0, "byteOffset": start, "byteLength": 16, "byteStride": 4 }));
    let view = views.len() - 1;
    let accessors = glb.json["accessors"].as_array_mut().unwrap();
    accessors.push(json!({
        "bufferView": view, "componentType": 5120, "normalized": true, "count": 4, "type": "VEC3"
    }));
    let accessor = accessors.len() - 1;
    glb.json["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = json!(accessor);

    // Both are decoded exactly.
    let scene = load(&glb, "").unwrap();
    let mesh = &scene.meshes[0];
    let half = 16384.0 / 32767.0;
    let expected = [Vec3::ZERO, Vec3::X, vec3(1.0, half, 0.0), vec3(0.0, half, -1.0)];
    assert_eq!(mesh.positions, expected);
    assert_eq!(mesh.normals, [-Vec3::Y; 4]);
}

#[test]
fn a_quantised_cube_morphs_like_its_original() {
    let Some(folder) = shared_scenes() else { return };
    let cube = |name: &str| scene::load(&folder.join(name)).unwrap();
    let whole = cube("khronos-animated/AnimatedMorphCube/AnimatedMorphCube.glb");
    let quantised = cube("khronos-odd/AnimatedMorphCubeQuantized/AnimatedMorphCube.gltf");
    let mut sizes = Vec::new();
    for step in 0..20 {
        let time = whole.duration() * step as f32 / 19.0;
        let box_of = |scene: &Scene| scene.bounds(&scene.pose(time)).unwrap();
        let ((low, high), (q_low, q_high)) = (box_of(&whole), box_of(&quantised));
        assert!((low - q_low).length() + (high - q_high).length() < 0.01 * (high - low).length(), "at {time} s");
        sizes.push((high - low).length());
    }
    let (least, most) = sizes.iter().fold((f32::MAX, 0.0f32), |(least, most), &s| (least.min(s), most.max(s)));
    assert!(most > 1.2 * least, "the cube keeps its size, {least} to {most} m");
}

#[test]
fn the_settings_choose_the_animation() {
    let mut room = checkered_room(Moving::Camera);
    let camera = room.json["animations"][0]["channels"][0]["target"]["node"].clone();
    let mut second = room.json["animations"][0].clone();
    second["name"] = json!("second");
    second["channels"][0]["target"]["node"] = json!(0);
    room.json["animations"][0]["name"] = json!("first");
    room.json["animations"].as_array_mut().unwrap().push(second);
    let moving = |settings: &str| -> Vec<usize> {
        let scene = load(&room, settings).unwrap();
        scene.channels.iter().map(|channel| channel.node).collect()
    };
    // The loader numbers nodes in hierarchy order; the camera is the room's last node in both cases.
    assert_ne!(camera, json!(0));
    assert_eq!(moving("[animation]\nname = \"second\""), [0]);
    assert_eq!(moving(""), moving("[animation]\nname = \"first\""));
    assert_ne!(moving(""), [0]);
    let message = load(&room, "[animation]\nname = \"third\"").unwrap_err();
    assert!(message.contains("third") && message.contains("first") && message.contains("second"), "{message}");
}

/// A skin from a file: 8-bit joints and weights, one animated joint, an accessor without data.
#[test]
fn skins_come_out_of_files() {
    let mut glb = square(json!({}));
    let joint = {
        let nodes = glb.json["nodes"].as_array_mut().unwrap();
        nodes.push(json!({ "translation": [0.0, 0.0, 0.0] }));
        nodes.len() - 1
    };
    glb.json["scenes"][0]["nodes"].as_array_mut().unwrap().push(json!(joint));
    let start = glb.bin.len();
    glb.bin.extend([255u8, 0, 0, 0].repeat(4));
    let views = glb.json["bufferViews"].as_array_mut().unwrap();
    views.push(json!({ "buffer": 0, "byteOffset": start, "byteLength": 16 }));
    let view = views.len() - 1;
    let accessors = glb.json["accessors"].as_array_mut().unwrap();
    // An accessor without data is all zeros: every vertex has joint 0.
    accessors.push(json!({ "componentType": 5121, "count": 4, "type": "VEC4" }));
    accessors
        .push(json!({ "bufferView": view, "componentType": 5121, "normalized": true, "count": 4, "type": "VEC4" }));
    let weights = accessors.len() - 1;
    glb.json["meshes"][0]["primitives"][0]["attributes"]["JOINTS_0"] = json!(weights - 1);
    glb.json["meshes"][0]["primitives"][0]["attributes"]["WEIGHTS_0"] = json!(weights);
    glb.json["skins"] = json!([{ "joints": [joint] }]);
    glb.json["nodes"][0]["skin"] = json!(0);
    glb.json["nodes"][0]["translation"] = json!([7.0, 7.0, 7.0]);
    glb.animate(joint, Vec3::ZERO, Vec3::X * 2.0);
    let scene = load(&glb, "").unwrap();
    assert_eq!(scene.moving_instances(), [true]);
    for time in [0.0, 0.5, 1.0] {
        let (low, high) = scene.bounds(&scene.pose(time)).unwrap();
        let left = 2.0 * time;
        assert!((low - Vec3A::new(left, 0.0, 0.0)).length() < 1e-5, "{low} at {time}");
        assert!((high - Vec3A::new(left + 1.0, 1.0, 0.0)).length() < 1e-5, "{high} at {time}");
    }
    for (pointer, value) in [("/skins/0/joints/0", json!(99)), ("/accessors/2/count", json!(2))] {
        let mut broken = glb.clone();
        *broken.json.pointer_mut(pointer).unwrap() = value;
        let message = load(&broken, "").unwrap_err();
        assert_eq!(message.lines().count(), 1, "{message}");
    }
}

#[test]
fn hostile_files_get_an_error_and_little_memory() {
    let folder = tempfile::tempdir().unwrap();
    let cases = hostile_scenes();
    let mut wrong = Vec::new();
    for Hostile { name, bytes } in &cases {
        let file = format!("{name}.glb");
        std::fs::write(folder.path().join(&file), bytes).unwrap();
        // 4 GB of address space: enough for threads, too little for an allocation by a false size.
        let script = "ulimit -v 4000000; exec \"$0\" plan \"$1\"";
        let mut shell = Command::new("sh");
        shell.args(["-c", script]).arg(program()).arg(&file).current_dir(folder.path()).stdin(Stdio::null());
        let output = shell.output().unwrap();
        let message = String::from_utf8_lossy(&output.stderr);
        println!("{} {message}", output.status);
        let one_line = message.lines().count() == 1 && message.starts_with("render2mpeg: ") && message.contains(&file);
        if output.status.code() != Some(1) || !one_line || message.contains("root:") {
            wrong.push(format!("{name}: {} {message}", output.status));
        }
    }
    assert!(wrong.is_empty(), "{} of {}: {wrong:#?}", wrong.len(), cases.len());
}

/// Returns the header of a PNG file of this size without image data (PNG, 11.2.1 and 5.3).
fn png_that_claims(width: u32, height: u32) -> Vec<u8> {
    let chunk = |kind: &[u8; 4], data: &[u8]| {
        let body = [&kind[..], data].concat();
        let mut sum = u32::MAX;
        for &byte in &body {
            sum ^= u32::from(byte);
            (0..8).for_each(|_| sum = if sum & 1 == 1 { sum >> 1 ^ 0xedb8_8320 } else { sum >> 1 });
        }
        [&(data.len() as u32).to_be_bytes()[..], &body[..], &(!sum).to_be_bytes()[..]].concat()
    };
    let header = [&width.to_be_bytes()[..], &height.to_be_bytes()[..], &[8, 6, 0, 0, 0]].concat();
    [&b"\x89PNG\r\n\x1a\n"[..], &chunk(b"IHDR", &header), &chunk(b"IDAT", &[0x78, 0x9c]), &chunk(b"IEND", &[])].concat()
}

/// Small files with large content are refused: an oversized image, meshes that share data, and one mesh in many nodes.
#[test]
fn small_files_that_claim_much_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("large.png"), png_that_claims(16384, 16384)).unwrap();
    let mut image = square(json!({ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } }));
    image.json["images"] = json!([{ "uri": "large.png" }]);
    image.json["textures"] = json!([{ "source": 0 }]);
    // Each mesh takes 12 bytes for each of 16 million vertices without data.
    let mut zeros = square(json!({}));
    zeros.json["accessors"]
        .as_array_mut()
        .unwrap()
        .push(json!({ "componentType": 5126, "count": 1 << 24, "type": "VEC3", "min": [0, 0, 0], "max": [0, 0, 0] }));
    let of_zeros = json!({ "primitives": [{ "attributes": { "POSITION": 2 }, "indices": 1 }] });
    for mesh in 0..50 {
        zeros.json["meshes"].as_array_mut().unwrap().push(of_zeros.clone());
        zeros.json["nodes"].as_array_mut().unwrap().push(json!({ "mesh": mesh + 1 }));
        zeros.json["scenes"][0]["nodes"].as_array_mut().unwrap().push(json!(mesh + 1));
    }
    // 20 000 squares in 20 000 nodes.
    let mut often = Glb::default();
    often.add(&vec![[Vec3::ZERO, Vec3::X, Vec3::Y]; 20_000], Vec3::ONE, Vec3::ZERO);
    for node in 1..20_000 {
        often.json["nodes"].as_array_mut().unwrap().push(json!({ "mesh": 0 }));
        often.json["scenes"][0]["nodes"].as_array_mut().unwrap().push(json!(node));
    }

    // Each is refused within 2 GB of address space.
    for (name, glb, words) in [
        ("image", &image, &["16384x16384", "image 0"][..]),
        ("zeros", &zeros, &["numbers"]),
        ("often", &often, &["800000000 triangles"]),
    ] {
        let file = format!("{name}.glb");
        glb.write(&folder.path().join(&file));
        let script = "ulimit -v 2000000; exec \"$0\" plan \"$1\"";
        let mut shell = Command::new("sh");
        shell.args(["-c", script]).arg(program()).arg(&file).current_dir(folder.path()).stdin(Stdio::null());
        let output = shell.output().unwrap();
        let message = String::from_utf8_lossy(&output.stderr);
        println!("{message}");
        assert_eq!((output.status.code(), message.lines().count()), (Some(1), 1), "{name}: {message}");
        assert!(words.iter().all(|word| message.contains(word)), "{name}: {message}");
    }
}

/// Neither a large size in a header nor a size that overflows leads to an allocation.
#[test]
fn videos_that_claim_much_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    for (width, height) in [("16384", "16384"), ("4294967296", "4294967296"), ("9223372036854775808", "2"), ("0", "0")]
    {
        let header = format!("YUV4MPEG2 W{width} H{height} F25:1 Ip A1:1 C420mpeg2\nFRAME\n0000");
        std::fs::write(folder.path().join("a.y4m"), header).unwrap();
        tests::assert_fails(folder.path(), &["compare", "a.y4m", "a.y4m"], &["a.y4m"]);
    }
}

/// A skinned mesh with lines as its first primitive: lines and triangles have separate joints.
#[test]
fn lines_and_triangles_have_their_own_joints() {
    let mut glb = square(json!({}));
    let start = glb.bin.len();
    // Joint 0 for the two vertices of the line, joint 1 for the four of the square, then full weights for both.
    glb.bin.extend([[0u8, 0, 0, 0].repeat(2), [1, 0, 0, 0].repeat(4), [255, 0, 0, 0].repeat(4)].concat());
    let mut push = |list: &str, value: Value| {
        let list = glb.json[list].as_array_mut().unwrap();
        list.push(value);
        list.len() - 1
    };
    let view = push("bufferViews", json!({ "buffer": 0, "byteOffset": start, "byteLength": 40 }));
    let mut of = |offset: usize, count: usize, normalized: bool| {
        let accessor = json!({
            "bufferView": view, "byteOffset": offset, "componentType": 5121, "normalized": normalized, "count": count, "type": "VEC4"
        });
        push("accessors", accessor)
    };
    let [line_joints, line_weights] = [of(0, 2, false), of(24, 2, true)];
    let [joints, weights] = [of(8, 4, false), of(24, 4, true)];
    let ends = glb.json["accessors"][0].clone();
    let line = {
        let list = glb.json["accessors"].as_array_mut().unwrap();
        list.push(ends);
        let place = list.len() - 1;
        list[place]["count"] = json!(2);
        json!({ "mode": 1, "attributes": { "POSITION": place, "JOINTS_0": line_joints, "WEIGHTS_0": line_weights } })
    };
    let attributes = &mut glb.json["meshes"][0]["primitives"][0]["attributes"];
    (attributes["JOINTS_0"], attributes["WEIGHTS_0"]) = (json!(joints), json!(weights));
    glb.json["meshes"][0]["primitives"].as_array_mut().unwrap().insert(0, line);
    for x in [5.0, 9.0] {
        glb.json["nodes"].as_array_mut().unwrap().push(json!({ "translation": [x, 0.0, 0.0] }));
    }
    glb.json["scenes"][0]["nodes"] = json!([0, 1, 2]);
    glb.json["skins"] = json!([{ "joints": [1, 2] }]);
    glb.json["nodes"][0]["skin"] = json!(0);
    let scene = load(&glb, "").unwrap();
    let pose = scene.pose(0.0);
    let left = |instance: usize| {
        let shape = pose.deformed(instance).unwrap();
        shape.positions.iter().fold(f32::MAX, |least, position| least.min(position.x))
    };
    assert!((left(0) - 5.0).abs() < 0.01, "the line hangs from joint 0: {}", left(0));
    assert!((left(1) - 9.0).abs() < 1e-5, "the square hangs from joint 1: {}", left(1));
}

/// Loads a damaged scene and renders a frame if it loads. Returns whether it was rendered.
fn survives(path: &Path, video: &Path) -> bool {
    let Ok(scene) = scene::load(path) else { return false };
    let options = Options {
        frames: Some(1),
        size: "16x16".parse().ok(),
        vpls: Some(20),
        photons: Some(200),
        ..Options::default()
    };
    let options = Options { output: Some(video.into()), ..options };
    let Ok(settings) = Settings::new(path.into(), &scene, &options) else { return false };
    let plan = Plan::new(&scene, &settings.render);
    let report = render2mpeg::render(&scene, &settings, &plan, Run::default());
    report.unwrap_or_else(|error| panic!("{}", error.chain()));
    true
}

#[test]
fn flipped_bytes_never_panic() {
    let (done, progress) = std::sync::mpsc::channel();
    let worker = std::thread::spawn(move || {
        let folder = tempfile::tempdir().unwrap();
        let (path, video) = (folder.path().join("scene.glb"), folder.path().join("film.m2v"));
        let whole = std::fs::read(cornell()).unwrap();
        let mut random = Random::new(0x2545_f491_4f6c_dd1d);
        let mut loaded = 0;
        for case in 0..300 {
            let (damaged, places) = damaged(&whole, &mut random);
            std::fs::write(&path, &damaged).unwrap();
            // The last printed case is the one that panics or hangs.
            println!("case {case}: {places:?}");
            loaded += usize::from(survives(&path, &video));
            done.send(loaded).unwrap();
        }
    });
    let mut loaded = 0;
    for case in 0..300 {
        match progress.recv_timeout(Duration::from_secs(60)) {
            Ok(count) => loaded = count,
            Err(std::sync::mpsc::RecvTimeoutError::Timeout) => panic!("case {case} does not end"),
            Err(_) => break,
        }
    }
    worker.join().expect("no panic");
    println!("{loaded} of 300 damaged scenes could be rendered");
    assert!(
        (30..285).contains(&loaded),
        "{loaded} of 300 loaded: the damage is too large or too small for a useful test"
    );
}
