//! Writes what the fuzz targets begin with: `cargo run --release -p tests --example fuzz_seeds -- fuzz/corpus`.

use glam::Vec3;
use serde_json::json;
use std::path::{Path, PathBuf};
use tests::{Glb, Moving, checkered_room, render};

/// A texel, as PNG and base64.
const PNG: &str = "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNk+M9QDwADhgGAWjR9awAAAABJRU5ErkJggg==";

/// A lit square with a texture, a point of light, a camera that moves: small enough that most changes hit something.
fn square() -> Glb {
    let mut glb = Glb::default();
    glb.add(&[[Vec3::ZERO, Vec3::X, Vec3::Y]], Vec3::splat(0.5), Vec3::ZERO);
    glb.add(&[[Vec3::new(0.0, 2.0, 1.0), Vec3::X, Vec3::Z]], Vec3::ONE, Vec3::splat(5.0));
    let camera = glb.add_camera(Vec3::new(0.5, 0.5, 2.0));
    glb.animate(camera, Vec3::ZERO, Vec3::Z);
    glb.json["images"] = json!([{ "uri": format!("data:image/png;base64,{PNG}") }]);
    glb.json["textures"] = json!([{ "source": 0 }]);
    glb.json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = json!({ "index": 0 });
    glb.json["materials"][0]["alphaMode"] = json!("MASK");
    glb.json["extensions"] =
        json!({ "KHR_lights_punctual": { "lights": [{ "type": "spot", "spot": {}, "intensity": 9 }] } });
    glb.json["nodes"][camera]["extensions"] = json!({ "KHR_lights_punctual": { "light": 0 } });
    glb.json["extensionsUsed"] = json!(["KHR_materials_emissive_strength", "KHR_lights_punctual"]);
    glb
}

/// A seed that begins with the byte by which a target tells its inputs apart.
fn seed(folder: &Path, target: &str, name: &str, kind: u8, bytes: &[u8]) {
    let folder = folder.join(target);
    std::fs::create_dir_all(&folder).expect("a folder");
    std::fs::write(folder.join(name), [&[kind], bytes].concat()).expect("a file");
}

fn main() {
    let folder = PathBuf::from(std::env::args().nth(1).unwrap_or_else(|| "fuzz/corpus".into()));
    for (name, glb) in [("square", square()), ("room", checkered_room(Moving::Box))] {
        seed(&folder, "scene", &format!("{name}.glb"), 1, &glb.to_bytes());
        seed(&folder, "scene", &format!("{name}.gltf"), 0, glb.json.to_string().as_bytes());
    }
    let sky = "[sky]\nzenith = [1, 2, 3]\nhorizon = [1, 1, 1]\nintensity = 2\n[sun]\nangular_diameter = 1.0\n";
    let rest = "[tone_mapping]\noperator = \"gamma\"\nexposure = 2.0\n[video]\nframes = 5\nfps = 25.0\n[camera]\nname = \"a\"\n";
    let config = folder.join("config");
    std::fs::create_dir_all(&config).expect("a folder");
    std::fs::write(config.join("scene.toml"), format!("{sky}{rest}")).expect("a file");

    let work = tempfile::tempdir().expect("a folder");
    let room = work.path().join("room.glb");
    checkered_room(Moving::Box).write(&room);
    let small = "--size 8x8 --vpls 20 --photons 200 --frames 2 --y4m film.y4m --exr frames --checkpoint off";
    render(work.path(), "film", &room, small);
    let read = |name: &str| std::fs::read(work.path().join(name)).expect("a file");
    seed(&folder, "pictures", "film.y4m", 0, &read("film.y4m"));
    seed(&folder, "pictures", "frame.exr", 2, &read("frames/frame_00000.exr"));
    seed(
        &folder,
        "pictures",
        "picture.hdr",
        3,
        b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n\x80\x80\x80\x81\x10\x20\x30\x80",
    );
    // What a stage left is made by the target itself.
    for kind in 0..28 {
        seed(&folder, "checkpoint", &format!("kind{kind}"), kind, &[0, 1, 250, 0, 1, 3, 251, 16, 0]);
    }
    seed(&folder, "encoder", "bytes", 0, &(0..=255).collect::<Vec<u8>>());
    println!("seeds are in {}", folder.display());
}
