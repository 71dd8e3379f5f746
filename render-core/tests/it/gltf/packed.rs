//! Tests that compare packed meshes, views and images with data unpacked by reference decoders. `tests/data/packed.mjs`
//! wrote both.

use super::file::{File, load_bytes, notes};
use glam::Vec3;
use render_core::scene::{Mesh, Scene};
use serde_json::{Value, json};

/// Opens a file of `tests/data`.
fn open(name: &str) -> File {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(name);
    let bytes = std::fs::read(path).unwrap();
    let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    let json = serde_json::from_slice(&bytes[20..20 + length]).unwrap();
    File { json, bin: bytes[28 + length..].to_vec() }
}

/// Returns pairs of meshes with names that differ only in their ends.
fn twins(scene: &Scene) -> Vec<[&Mesh; 2]> {
    let named = |name: String| scene.meshes.iter().find(|mesh| mesh.name == name);
    let names = scene.meshes.iter().filter_map(|mesh| mesh.name.strip_suffix(" packed"));
    names.map(|name| [" packed", " plain"].map(|end| named(format!("{name}{end}")).unwrap())).collect()
}

/// Returns the largest difference between two lists of vectors.
fn difference(a: &[Vec3], b: &[Vec3]) -> f32 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| (*a - *b).abs().max_element()).fold(0.0, f32::max)
}

#[test]
fn views_packed_by_meshopt_have_the_reference_numbers() {
    let scene = open("meshopt.glb").load();
    let twins = twins(&scene);
    assert_eq!(twins.len(), 6);
    for [packed, plain] in twins {
        assert_eq!(packed.positions, plain.positions, "{}", packed.name);
        assert_eq!(packed.triangles, plain.triangles, "{}", packed.name);
        // The specification allows a filter's result to be off by one unit in the last place, so decoders differ by two.
        let unit = if packed.name.starts_with("shorts") { 1.0 / 127.0 } else { 1.0 / 32767.0 };
        assert!(difference(&packed.normals, &plain.normals) <= 2.0 * unit, "{}", packed.name);
        let colors = packed.colors.iter().zip(&plain.colors).map(|(a, b)| (*a - *b).abs().max_element());
        assert!(colors.fold(0.0, f32::max) <= 1.001 / 255.0, "{}", packed.name);
        assert_eq!(packed.colors.len(), if packed.name.starts_with("floats") { 35 } else { 0 });
    }
    let pose = scene.pose(1.25);
    let node = |name: String| pose.world[scene.nodes.iter().position(|node| node.name == name).unwrap()];
    for version in [0, 1] {
        let [packed, plain] = ["packed", "plain"].map(|twin| node(format!("turn {version} {twin}")));
        assert!(packed.abs_diff_eq(plain, 4.0 / 32767.0) && plain.matrix3.x_axis.x < 0.9, "{packed} is not {plain}");
    }
}

#[test]
fn meshes_packed_by_draco_have_the_reference_numbers() {
    let scene = open("draco.glb").load();
    let twins = twins(&scene);
    assert_eq!(twins.len(), 4);
    for [packed, plain] in twins {
        assert!(!packed.triangles.is_empty() && !packed.colors.is_empty());
        assert_eq!(packed.positions, plain.positions, "{}", packed.name);
        assert_eq!(packed.normals, plain.normals, "{}", packed.name);
        assert_eq!(packed.colors, plain.colors, "{}", packed.name);
        assert_eq!(packed.triangles, plain.triangles, "{}", packed.name);
        let bends = [packed, plain].map(|mesh| {
            let skinning = mesh.skinning.as_ref().unwrap();
            skinning.influences.iter().map(|influence| (influence.joint, influence.weight)).collect::<Vec<_>>()
        });
        assert_eq!(bends[0], bends[1], "{}", packed.name);
    }
}

#[test]
fn packed_images_have_the_reference_texels() {
    let scene = open("images.glb").load();
    let texels = |mesh: &Mesh| {
        let slot = scene.materials[mesh.material].base_color_texture.as_ref().unwrap();
        let mut bytes = Vec::new();
        scene.textures[slot.texture].visit_bytes(&mut |part| bytes.extend_from_slice(part));
        bytes
    };
    let twins = twins(&scene);
    assert_eq!(twins.len(), 5);
    for [packed, plain] in twins {
        assert!(texels(packed).len() > 4 * 20 * 12);
        assert_eq!(texels(packed), texels(plain), "{}", packed.name);
    }
}

/// "mimeType" may be wrong, since the data determines the format.
#[test]
fn images_are_read_whatever_their_declared_type() {
    let mut file = open("images.glb");
    for (place, image) in file.json["images"].as_array_mut().unwrap().iter_mut().enumerate() {
        image["mimeType"] = json!(["image/jpeg", "image/png", "image/webp", "text/plain"][place % 4]);
    }
    assert_eq!(file.load().textures.len(), 10);
    // Without the extension, the texture uses its own image.
    let mut file = open("images.glb");
    for texture in file.json["textures"].as_array_mut().unwrap() {
        let own = texture.pointer("/extensions/KHR_texture_basisu/source").cloned();
        if let Some(source) = own {
            *texture = json!({ "source": source });
        }
    }
    assert_eq!(file.load().textures.len(), 10);
}

/// For files with truncated or wrong packed data, an error names the location, or a note is added if there is a plain
/// copy.
#[test]
fn damaged_packed_views_are_refused_or_replaced() {
    let pointer = |file: &File, view: usize| {
        let extensions = file.json["bufferViews"][view]["extensions"].as_object().cloned();
        extensions.and_then(|e| e.keys().next().cloned()).map(|name| format!("/bufferViews/{view}/extensions/{name}"))
    };
    let whole = open("meshopt.glb");
    let packed: Vec<String> =
        (0..whole.json["bufferViews"].as_array().unwrap().len()).filter_map(|view| pointer(&whole, view)).collect();
    assert_eq!(packed.len(), 18);
    for place in &packed {
        for (key, value) in [
            ("byteLength", json!(3)),
            ("byteLength", json!(1u64 << 40)),
            ("byteOffset", json!(u64::MAX)),
            ("buffer", json!(7)),
            ("buffer", json!(1)),
            ("count", json!(1u64 << 60)),
            ("count", json!(1 << 27)),
            ("byteStride", json!(6)),
            ("mode", json!("STRIPS")),
            ("filter", json!("BLUR")),
        ] {
            let mut file = open("meshopt.glb");
            file.json.pointer_mut(place).unwrap()[key] = value.clone();
            let line = file.load_with(&[]).unwrap_err();
            assert!(line.contains("buffer view") && !line.contains('\n'), "{place} {key} {value}: {line}");
        }
    }
    // Test views with a plain copy.
    for (extension, note) in [(json!({}), "lacks a count"), (json!({ "count": 6, "byteStride": 12 }), "unknown mode")] {
        let mut file = File::square();
        file.json["extensionsUsed"] = json!(["EXT_meshopt_compression"]);
        file.json["bufferViews"][0]["extensions"] = json!({ "EXT_meshopt_compression": extension });
        let scene = file.load();
        assert_eq!((scene.triangle_count(), notes(&scene, note), notes(&scene, "plain copy")), (2, 1, 1));
    }
}

/// The packed data of optional compression suffices if the plain copy is in a missing file.
#[test]
fn plain_copies_are_not_needed() {
    let mut file = open("meshopt.glb");
    file.json.as_object_mut().unwrap().remove("extensionsRequired");
    file.json["buffers"][1]["uri"] = json!("missing.bin");
    assert_eq!(file.load().meshes.len(), 12);
    let mut file = open("draco.glb");
    file.json.as_object_mut().unwrap().remove("extensionsRequired");
    let buffer = file.push("buffers", json!({ "uri": "missing.bin", "byteLength": 9000 }));
    let view = file.push("bufferViews", json!({ "buffer": buffer, "byteLength": 9000 }));
    for accessor in file.json["accessors"].as_array_mut().unwrap() {
        if accessor.get("bufferView").is_none() {
            accessor["bufferView"] = json!(view);
        }
    }
    assert_eq!(file.load().meshes.len(), 8);
}

#[test]
fn damaged_packed_meshes_are_refused_or_replaced() {
    let name = "KHR_draco_mesh_compression";
    let extension = |file: &File| file.json["meshes"][0]["primitives"][0]["extensions"][name].clone();
    for change in 0..7 {
        let mut file = open("draco.glb");
        let mut members = extension(&file);
        let view = members["bufferView"].as_u64().unwrap() as usize;
        let start = file.json["bufferViews"][view]["byteOffset"].as_u64().unwrap() as usize;
        match change {
            0 => file.json["bufferViews"][view]["byteLength"] = json!(20),
            1 => file.bin[start..start + 5].copy_from_slice(b"dRACO"),
            2 => members["bufferView"] = json!(99),
            3 => members["attributes"]["POSITION"] = json!(77),
            4 => members["attributes"]["POSITION"] = json!("first"),
            // The data contains more triangles than the indices specify.
            5 => {
                let indices = file.json["meshes"][0]["primitives"][0]["indices"].as_u64().unwrap() as usize;
                file.json["accessors"][indices]["count"] = json!(3);
            }
            _ => file.bin[start + 11..start + 19].fill(0xff),
        }
        file.json["meshes"][0]["primitives"][0]["extensions"][name] = members;
        let line = file.load_with(&[]).unwrap_err();
        let is_named = line.contains("mesh 0 primitive 0") && line.contains("buffer view");
        assert!(is_named && !line.contains('\n'), "{change}: {line}");
    }
    // Test primitives with a plain copy.
    let mut file = File::square();
    file.json["extensionsUsed"] = json!([name]);
    file.json["meshes"][0]["primitives"][0]["extensions"] =
        json!({ name: { "bufferView": 0, "attributes": { "POSITION": 0 } } });
    let scene = file.load();
    assert_eq!((scene.triangle_count(), notes(&scene, "plain copy")), (2, 1));
    file.json["extensionsRequired"] = json!([name]);
    file.json["accessors"][0].as_object_mut().unwrap().remove("bufferView");
    assert!(file.load_with(&[]).unwrap_err().contains("export it again"));
}

#[test]
fn damaged_packed_images_are_refused_or_replaced() {
    let file = open("images.glb");
    let textures = file.json["textures"].as_array().unwrap().clone();
    let packed = textures.iter().enumerate().filter_map(|(place, texture)| {
        let extensions = texture.get("extensions")?.as_object()?;
        let (name, extension) = extensions.iter().next()?;
        Some((place, name.clone(), extension["source"].as_u64()? as usize))
    });
    for (texture, name, image) in packed.collect::<Vec<_>>() {
        let mut file = open("images.glb");
        let view = file.json["images"][image]["bufferView"].as_u64().unwrap() as usize;
        let start = file.json["bufferViews"][view]["byteOffset"].as_u64().unwrap() as usize;
        // Set false sizes: the width in KTX2, the chunk header in WebP.
        file.bin[start + 22..start + 34].fill(0xff);
        let line = file.load_with(&[]).unwrap_err();
        assert!(line.contains(&format!("image {image}")) && !line.contains('\n'), "{name}: {line}");
        file.json["bufferViews"][view]["byteLength"] = json!(50);
        assert!(file.load_with(&[]).unwrap_err().contains(&format!("image {image}")), "{name}");
        // Use the twin as the plain copy.
        file.json["textures"][texture]["source"] = json!(image + 1);
        let scene = file.load();
        assert_eq!(notes(&scene, &format!("image {} is shown", image + 1)), 1, "{:?}", scene.warnings);
    }
}

/// For truncated files, and files with wrong bytes anywhere, loading returns a one-line error or a scene.
#[test]
fn no_damage_panics() {
    for name in ["meshopt.glb", "draco.glb", "images.glb"] {
        let file = open(name);
        let mut random = fastrand::Rng::with_seed(1);
        for _ in 0..60 {
            let mut bin = file.bin.clone();
            for _ in 0..20 {
                let place = random.usize(..bin.len());
                bin[place] = random.u8(..);
            }
            let damaged = File { json: file.json.clone(), bin };
            match load_bytes(&damaged.bytes(), &[]) {
                Ok(scene) => assert!(scene.meshes.iter().all(|mesh| mesh.positions.iter().all(|p| p.is_finite()))),
                Err(line) => assert!(!line.contains('\n') && !line.contains("damaged glTF"), "{name}: {line}"),
            }
        }
    }
}

/// Files with packed data have no notes in a build with all features.
#[test]
fn packed_files_have_no_notes() {
    for name in ["meshopt.glb", "draco.glb", "images.glb"] {
        let file = open(name);
        assert!(file.json["extensionsRequired"].as_array().is_some_and(|list| list.iter().all(Value::is_string)));
        assert_eq!(notes(&file.load(), "extension"), 0, "{name}");
    }
}
