//! Writes the seeds of the fuzz targets: `cargo run --release -p tests --example fuzz_seeds -- tests/fuzz/corpus`.

use std::path::{Path, PathBuf};
use tests::{Moving, checkered_room, render, textured_square};

/// Writes a seed with a leading byte that selects the kind of input.
fn seed(folder: &Path, target: &str, name: &str, kind: u8, bytes: &[u8]) {
    let folder = folder.join(target);
    std::fs::create_dir_all(&folder).expect("a folder");
    std::fs::write(folder.join(name), [&[kind], bytes].concat()).expect("a file");
}

fn main() {
    let folder = PathBuf::from(std::env::args().nth(1).unwrap_or_else(|| "tests/fuzz/corpus".into()));
    // Scenes.
    for (name, glb) in [("square", textured_square()), ("room", checkered_room(Moving::Box))] {
        seed(&folder, "scene", &format!("{name}.glb"), 1, &glb.to_bytes());
        seed(&folder, "scene", &format!("{name}.gltf"), 0, glb.json.to_string().as_bytes());
    }
    for name in ["meshopt", "draco", "images"] {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../render-core/tests/data");
        let bytes = std::fs::read(Path::new(path).join(name).with_extension("glb")).expect("a file");
        seed(&folder, "scene", &format!("{name}.glb"), 1, &bytes);
    }
    // Settings.
    let sky = "[sky]\nzenith = [1, 2, 3]\nhorizon = [1, 1, 1]\nintensity = 2\n[sun]\nangular_diameter = 1.0\n";
    let rest = "[tone_mapping]\noperator = \"gamma\"\nexposure = 2.0\n[video]\nframes = 5\nfps = 25.0\n[camera]\nname = \"a\"\n";
    let config = folder.join("config");
    std::fs::create_dir_all(&config).expect("a folder");
    std::fs::write(config.join("scene.toml"), format!("{sky}{rest}")).expect("a file");

    // Pictures and videos, most of them from a small film.
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
    // The target itself creates the states of stages.
    for kind in 0..28 {
        seed(&folder, "checkpoint", &format!("kind{kind}"), kind, &[0, 1, 250, 0, 1, 3, 251, 16, 0]);
    }
    seed(&folder, "encoder", "bytes", 0, &(0..=255).collect::<Vec<u8>>());
    // Streams; tests of `mpeg2dec` use the same one.
    let stream = include_bytes!("../../mpeg2dec/tests/data/small.m2v");
    seed(&folder, "decoder", "small.m2v", 255, stream);
    println!("seeds are in {}", folder.display());
}
