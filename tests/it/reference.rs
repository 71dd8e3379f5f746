//! `reference` and `compare` on the command line.

use glam::Vec3;
use render_core::image_file::{read_exr, read_layers};
use serde_json::Value;
use tests::{Moving, assert_fails, checkered_room, render, render2mpeg, sorted_names};

fn folder_with_room() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    checkered_room(Moving::Box).write(&folder.path().join("room.glb"));
    folder
}

fn succeed(folder: &std::path::Path, arguments: &str) -> String {
    let finished = render2mpeg(folder, &arguments.split_whitespace().collect::<Vec<&str>>());
    assert_eq!((finished.code, finished.stderr.as_str()), (Some(0), ""), "render2mpeg {arguments}");
    finished.stdout
}

/// A single frame with all lights is bit-identical to the frame of an all-lights film.
#[test]
fn all_lights_are_those_of_films() {
    let folder = folder_with_room();
    let lights = "--size 48x32 --vpls 100 --photons 5000";
    render(
        folder.path(),
        "film",
        &folder.path().join("room.glb"),
        &format!("{lights} --frames 3 --lighting all-lights --exr linear --exr-depth float"),
    );
    succeed(folder.path(), &format!("reference room.glb --method all-lights {lights} --frame 2 -o two.exr --quiet"));
    let film = read_exr(&folder.path().join("linear/frame_00002.exr")).unwrap();
    let single = read_exr(&folder.path().join("two.exr")).unwrap();
    assert!(film.samples().iter().any(|&rgb| rgb != Vec3::ZERO));
    let off = film.samples().iter().zip(single.samples()).map(|(a, b)| (*a - *b).abs().max_element());
    let (most, largest) = (off.fold(0.0, f32::max), film.samples().iter().map(|c| c.max_element()).fold(0.0, f32::max));
    assert!(most <= 1e-5 * largest, "off by {most} of {largest}");
}

#[test]
fn paths_come_with_their_noise_and_all_lights_are_near_them() {
    let folder = folder_with_room();
    let path = "reference room.glb --size 48x32 --quiet";
    succeed(folder.path(), &format!("{path} --spp 32 -o a.exr --threads 1"));
    succeed(folder.path(), &format!("{path} --spp 32 -o b.exr --threads 3"));
    let bytes = |name: &str| std::fs::read(folder.path().join(name)).unwrap();
    assert_eq!(bytes("a.exr"), bytes("b.exr"), "the same for any number of threads");
    succeed(folder.path(), &format!("{path} --spp 256 --seed 7 -o truth.exr --center"));
    succeed(folder.path(), &format!("{path} --method all-lights --center --vpls 2000 --photons 300000 -o lights.exr"));
    let names: Vec<String> =
        read_layers(&folder.path().join("a.exr")).unwrap().channels.into_iter().map(|(name, _)| name).collect();
    assert_eq!(names, ["B", "G", "R", "variance.B", "variance.G", "variance.R"]);

    let compare = |a: &str, b: &str| -> Value {
        serde_json::from_str(&succeed(folder.path(), &format!("compare {a} {b} --json"))).unwrap()
    };
    let same = compare("a.exr", "b.exr");
    assert_eq!((same["rmse"].as_f64(), same["relative_mse"].as_f64()), (Some(0.0), Some(0.0)));
    let lights = compare("lights.exr", "truth.exr");
    println!("all lights and paths: {lights}");
    assert!((lights["mean_ratio"].as_f64().unwrap() - 1.0).abs() < 0.03, "{lights}");
    assert!(lights["relative_mse_without_noise"].as_f64().unwrap() < 0.02, "{lights}");
    assert!(succeed(folder.path(), "compare lights.exr truth.exr").contains("relative MSE"));
}

#[test]
fn what_cannot_be_done_is_said() {
    let folder = folder_with_room();
    succeed(folder.path(), "reference room.glb --size 16x16 --spp 1 -o a.exr --quiet");
    succeed(folder.path(), "reference room.glb --size 8x16 --spp 1 -o b.exr --quiet");
    std::fs::write(folder.path().join("broken.exr"), b"no picture").unwrap();
    let before = sorted_names(folder.path());
    for (arguments, words) in [
        ("reference room.glb --size 16x16 -o nowhere/a.exr", &["nowhere/a.exr"][..]),
        ("reference gone.glb -o c.exr", &["gone.glb"]),
        ("reference room.glb -o c.exr --spp 0", &["0"]),
        ("reference room.glb -o c.exr --method photons", &["photons", "all-lights"]),
        ("compare a.exr b.exr", &["16x16", "8x16"]),
        ("compare a.exr gone.exr", &["gone.exr"]),
        ("compare broken.exr a.exr", &["broken.exr"]),
        ("compare a.exr room.glb", &["room.glb", ".exr"]),
    ] {
        assert_fails(folder.path(), &arguments.split_whitespace().collect::<Vec<&str>>(), words);
        assert_eq!(sorted_names(folder.path()), before, "{arguments} leaves something behind");
    }
}

/// A scene may have a sky from an image; an unreadable image is reported in one line.
#[test]
fn a_sky_may_be_an_image() {
    let folder = folder_with_room();
    let path = |name: &str| folder.path().join(name);
    let sky = plane::Plane::from_fn(32, 16, |_, _| Vec3::new(0.5, 1.0, 2.0));
    render_core::image_file::write_exr(&path("sky.exr"), &sky).unwrap();
    std::fs::write(path("room.toml"), "[sky]\nimage = \"sky.exr\"\nintensity = 2.0\nrotation = 45.0\n").unwrap();
    // An empty scene shows only the sky; with zero bounces, only emission is visible.
    std::fs::write(path("empty.glb"), tests::Glb::default().to_bytes()).unwrap();
    std::fs::copy(path("room.toml"), path("empty.toml")).unwrap();
    succeed(folder.path(), "reference empty.glb --size 16x16 --spp 16 -o sky-seen.exr --quiet");
    let seen = read_exr(&path("sky-seen.exr")).unwrap();
    assert!(seen.samples().iter().all(|&c| (c - Vec3::new(1.0, 2.0, 4.0)).abs().max_element() < 1e-5));
    for (toml, words) in [
        ("image = \"gone.hdr\"", &["room.toml", "gone.hdr"][..]),
        ("image = \"room.glb\"", &["room.toml", "room.glb", ".hdr"]),
        ("image = \"sky.exr\"\nintensity = -1.0", &["room.toml", "intensity"]),
    ] {
        std::fs::write(path("room.toml"), format!("[sky]\n{toml}\n")).unwrap();
        assert_fails(folder.path(), &["plan", "room.glb"], words);
    }
}
