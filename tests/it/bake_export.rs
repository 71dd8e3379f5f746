//! Scenes exported with baked light in textures: their pictures and their files.

use super::bake::assert_bake_fails;
use glam::{Vec3, vec3};
use perceptual::psnr;
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use tests::{Glb, Moving, checkered_room, read_y4m, render, render2mpeg};

const SIDE: usize = 96;

/// Runs `bake SCENE --gltf lit.glb` with `extra` arguments, which must succeed.
fn export(folder: &Path, scene: &Path, extra: &str) -> Vec<u8> {
    let mut arguments =
        vec!["bake", scene.to_str().expect("a path in UTF-8"), "--gltf", "lit.glb", "--quiet", "--overwrite"];
    arguments.extend(extra.split_whitespace());
    let finished = render2mpeg(folder, &arguments);
    assert_eq!((finished.code, finished.stderr.as_str()), (Some(0), ""), "render2mpeg {arguments:?}");
    std::fs::read(folder.join("lit.glb")).expect("the export is there")
}

/// Returns the luma PSNR between the first frames of a scene and of its export, before coding.
fn difference(folder: &Path, scene: &Path, vpls: usize) -> f64 {
    let lit = folder.join("lit.glb");
    let frames = [("film", scene), ("lit", &lit)].map(|(name, scene)| {
        let arguments = format!("--size {SIDE}x{SIDE} --frames 1 --vpls {vpls} --y4m {name}.y4m");
        render(folder, name, scene, &arguments);
        read_y4m(&folder.join(format!("{name}.y4m")), (SIDE, SIDE)).remove(0)
    });
    psnr(frames[1].luma(), frames[0].luma())
}

/// Returns the document of a .glb file.
fn document(file: &[u8]) -> Value {
    let length = u32::from_le_bytes(file[12..16].try_into().expect("four bytes")) as usize;
    serde_json::from_slice(&file[20..20 + length]).expect("JSON")
}

/// Returns the elements of an export's accessor as bytes; accessors read here are not interleaved.
fn bytes(file: &[u8], accessor: &Value) -> Vec<u8> {
    let document = document(file);
    let length = u32::from_le_bytes(file[12..16].try_into().expect("four bytes")) as usize;
    let number = |value: &Value| value.as_u64().expect("a number") as usize;
    let accessor = &document["accessors"][number(accessor)];
    let view = &document["bufferViews"][number(&accessor["bufferView"])];
    file[28 + length + number(&view["byteOffset"])..][..number(&view["byteLength"])].to_vec()
}

/// Films of the export and of the scene agree. Neither the number of threads nor a file of baked light changes the export.
/// light.
#[test]
fn an_export_looks_like_the_film() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let scene = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../scenes/cornell-box/cornell-box.glb"));
    let one = export(folder, &scene, "--texels 20000 --vpls 1000 --threads 1 -o box.slf");
    let two = export(folder, &scene, "--baked box.slf --threads 2");
    assert!(one == two, "the same bytes with any number of threads, and from a file");
    let psnr = difference(folder, &scene, 1000);
    println!("{psnr} dB");
    assert!(psnr > 35.0, "{psnr} dB");

    let settings = std::fs::read_to_string(folder.join("lit.toml")).expect("its settings file");
    for words in ["operator = \"srgb\"", "exposure = 1.0", "name = \"camera\"", "frames = 1\n"] {
        assert!(settings.contains(words), "{words} is not in {settings}");
    }
    let document = document(&one);
    assert_eq!(document["extensionsUsed"], json!(["KHR_materials_unlit"]), "no glow, no lamp");
    assert_eq!(document["images"].as_array().map(Vec::len), Some(1));
    assert_eq!(document["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["texCoord"], 1);
}

/// If a scene has no exposure, the export determines it as a film does.
#[test]
fn exposure_is_found_as_for_films() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    checkered_room(Moving::Camera).write(&folder.join("room.glb"));
    let file = export(folder, &folder.join("room.glb"), "--texels 40000 --vpls 300 --photons 30000");
    assert_eq!(document(&file)["animations"].as_array().map(Vec::len), Some(1), "the camera moves");
    let psnr = difference(folder, &folder.join("room.glb"), 300);
    println!("{psnr} dB");
    assert!(psnr > 35.0, "{psnr} dB");
}

/// Builds a floor, a mesh in two nodes, a double-sided sheet, and a moving block.
fn odd_room() -> Glb {
    let mut glb = Glb::default();
    glb.add(&[[vec3(-2.0, 0.0, -2.0), 4.0 * Vec3::Z, 4.0 * Vec3::X]], Vec3::splat(0.7), Vec3::ZERO);
    glb.add(&[[vec3(-0.5, 2.9, -0.5), Vec3::X, Vec3::Z]], Vec3::ZERO, Vec3::splat(10.0));
    let (x, y, z) = (0.5 * Vec3::X, 0.5 * Vec3::Y, 0.5 * Vec3::Z);
    let twice = glb.add(&[[Vec3::ZERO, x, y], [Vec3::ZERO, y, z]], Vec3::splat(0.5), Vec3::ZERO);
    let mut again = glb.json["nodes"][twice].clone();
    again["translation"] = json!([1.0, 0.5, 0.0]);
    let sheet = glb.add(&[[vec3(-1.5, 0.5, 0.0), x, y]], vec3(0.8, 0.2, 0.1), Vec3::ZERO);
    // Indices of nodes, meshes and materials are equal up to this point.
    glb.json["materials"][sheet]["doubleSided"] = json!(true);
    let block = glb.add(&[[vec3(0.0, 1.0, 0.0), x, y]], vec3(0.2, 0.8, 0.1), Vec3::ZERO);
    glb.add_camera(vec3(0.0, 1.5, 4.5));
    glb.animate(block, Vec3::ZERO, Vec3::X);
    let last = glb.json["nodes"].as_array().expect("a list").len();
    glb.json["nodes"].as_array_mut().expect("a list").push(again);
    glb.json["scenes"][0]["nodes"].as_array_mut().expect("a list").push(json!(last));
    glb
}

#[test]
fn each_node_and_each_side_has_coordinates_of_its_own() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    odd_room().write(&folder.join("odd.glb"));
    let file = export(folder, &folder.join("odd.glb"), "--texels 3000 --vpls 50 --photons 2000 --texture 600");
    let document = document(&file);
    let primitives = |node: usize| {
        let mesh = document["nodes"][node]["mesh"].as_u64().expect("a mesh") as usize;
        document["meshes"][mesh]["primitives"].as_array().expect("a list").clone()
    };
    let [first, again, sheet] = [2, 6, 3].map(primitives);

    // The two nodes of one mesh differ only in texture coordinates.
    assert_eq!((first.len(), again.len(), sheet.len()), (1, 1, 2));
    assert_eq!(first[0]["attributes"]["POSITION"], again[0]["attributes"]["POSITION"]);
    assert_eq!(first[0]["indices"], again[0]["indices"]);

    // The back of the sheet is just behind its front, with reversed winding.
    let positions = [0, 1].map(|side| bytes(&file, &sheet[side]["attributes"]["POSITION"]));
    let number = |bytes: &[u8]| f32::from_le_bytes(bytes.try_into().expect("four bytes"));
    for (k, (front, back)) in positions[0].chunks_exact(4).zip(positions[1].chunks_exact(4)).enumerate() {
        let behind = number(front) - number(back);
        assert!(if k % 3 == 2 { behind > 1e-6 && behind < 1e-3 } else { behind == 0.0 }, "{behind} at {k}");
    }
    let [front, back] = [0, 1].map(|side| bytes(&file, &sheet[side]["indices"]));
    let turned: Vec<u8> = front.chunks_exact(6).flat_map(|t| [t[0], t[1], t[4], t[5], t[2], t[3]]).collect();
    assert_eq!(turned, back);

    // All texture coordinates are distinct and inside the texture.
    let mut places = BTreeSet::new();
    for primitive in [&first[0], &again[0], &sheet[0], &sheet[1]] {
        let coordinates = bytes(&file, &primitive["attributes"]["TEXCOORD_1"]);
        for pair in coordinates.chunks_exact(8) {
            assert!(places.insert(pair.to_vec()), "two vertices in one place");
            assert!(pair.chunks_exact(4).all(|bytes| (0.0..=1.0).contains(&number(bytes))), "{pair:?}");
        }
        let material = &document["materials"][primitive["material"].as_u64().expect("a material") as usize];
        assert!(material["extensions"]["KHR_materials_unlit"].is_object() && material["doubleSided"].is_null());
    }

    // The moving block has its original material.
    let block = &document["materials"][primitives(4)[0]["material"].as_u64().expect("a material") as usize];
    assert!(block["extensions"]["KHR_materials_unlit"].is_null(), "{block}");
    assert_eq!(document["animations"].as_array().map(Vec::len), Some(1));
}

#[test]
fn wrong_requests_are_told_before_the_work() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    checkered_room(Moving::Nothing).write(&folder.join("room.glb"));
    let fails = |extra: &str, words: &[&str]| assert_bake_fails(folder, extra, words);
    fails("--gltf lit.gltf", &["lit.gltf", ".glb"]);
    fails("--gltf room.glb", &["room.glb", "another name"]);
    fails("--gltf ./room.glb", &["room.glb", "another name"]);
    fails("--gltf none/lit.glb", &["none/lit.glb", "cannot be written", "--gltf"]);
    fails("--texture 2048", &["--gltf"]);
    fails("--baked room.slf", &["--gltf"]);
    fails("--gltf lit.glb --baked room.slf", &["room.slf", "cannot be read"]);
    fails("--gltf lit.glb --texture 16", &["--texture", "16384"]);
    assert_eq!(tests::sorted_names(folder), ["room.glb"], "nothing is written");
}
