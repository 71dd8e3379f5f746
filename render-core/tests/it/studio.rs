//! Tests of studios and of cameras around a scene.

use crate::common::{add, material, quad, rest};
use glam::{Quat, Vec2, Vec3, Vec3A, vec3};
use render_core::scene::{Camera, Node, Orbit, Projection, Reach, Scene, Setting, load_with};
use render_core::{PathOptions, Still, path_traced};
use std::f32::consts::FRAC_PI_2;
use std::path::PathBuf;

/// Writes a glTF file of a triangle per corner list, without lamps and camera.
fn written(folder: &tempfile::TempDir, triangles: &[[Vec3; 3]]) -> PathBuf {
    let corners: Vec<Vec3> = triangles.iter().flatten().copied().collect();
    let bytes: Vec<u8> = corners.iter().flat_map(|c| c.to_array()).flat_map(f32::to_le_bytes).collect();
    std::fs::write(folder.path().join("corners.bin"), &bytes).unwrap();
    let (low, high) = corners.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(a, b), &c| (a.min(c), b.max(c)));
    let json = serde_json::json!({
        "asset": { "version": "2.0" },
        "scene": 0,
        "scenes": [{ "nodes": [0] }],
        "nodes": [{ "mesh": 0 }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 } }] }],
        "buffers": [{ "uri": "corners.bin", "byteLength": bytes.len() }],
        "bufferViews": [{ "buffer": 0, "byteLength": bytes.len() }],
        "accessors": [{
            "bufferView": 0, "componentType": 5126, "count": corners.len(), "type": "VEC3",
            "min": low.to_array(), "max": high.to_array(),
        }],
    });
    let path = folder.path().join("scene.gltf");
    std::fs::write(&path, json.to_string()).unwrap();
    path
}

/// Triangles with corners in a box, from a fixed sequence of numbers.
fn triangles(seed: u32, size: Vec3, middle: Vec3) -> Vec<[Vec3; 3]> {
    let mut state = seed;
    let mut next = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / (1 << 24) as f32 - 0.5
    };
    let mut corner = || vec3(next(), next(), next()) * size + middle;
    (0..40).map(|_| [corner(), corner(), corner()]).collect()
}

fn loaded(path: &std::path::Path, set: &[&str]) -> Scene {
    let set: Vec<Setting> = set.iter().map(|text| text.parse().unwrap()).collect();
    let mut scene = load_with(path, Reach::Folder, &set).unwrap();
    scene.furnish();
    scene
}

/// Returns the box around the projected corners, in pictures of this size, as fractions of the picture.
fn seen(scene: &Scene, corners: &[Vec3], time: f32, size: (usize, usize)) -> (Vec2, Vec2) {
    let view = scene.view(&scene.pose(time), size.0, size.1);
    let all = Vec2::new(size.0 as f32, size.1 as f32);
    let places = corners.iter().map(|&corner| view.project(corner.into()).unwrap().pixel / all);
    places.fold((Vec2::INFINITY, Vec2::NEG_INFINITY), |(low, high), place| (low.min(place), high.max(place)))
}

/// Scenes of any shape and place fill 78 % of the picture's height or width, in the middle.
#[test]
fn a_scene_without_a_camera_fills_the_picture() {
    let sizes = [Vec3::ONE, vec3(10.0, 1.0, 1.0), vec3(0.1, 5.0, 0.1), vec3(1.0, 0.0, 1.0), Vec3::splat(1e-3)];
    for (seed, size) in sizes.into_iter().enumerate() {
        for middle in [Vec3::ZERO, vec3(5.0, -3.0, 2.0) * size.max_element()] {
            let folder = tempfile::tempdir().unwrap();
            let triangles = triangles(seed as u32, size, middle);
            let path = written(&folder, &triangles);
            for orbit in [None, Some("camera.orbit=\"120,40\""), Some("camera.orbit=\"0,90\""), Some("camera.fov=60")] {
                let scene = loaded(&path, orbit.as_slice());
                let (low, high) = seen(&scene, triangles.as_flattened(), 0.0, (512, 512));
                let extent = (high - low).max_element();
                assert!((extent - 0.78).abs() < 0.005, "{size} {orbit:?}: {extent} of the picture");
                assert!(((low + high) / 2.0 - 0.5).abs().max_element() < 0.01, "{size} {orbit:?}: {low} to {high}");
                // Wide and high pictures show at least as much.
                for size in [(800, 300), (300, 800)] {
                    let (low, high) = seen(&scene, triangles.as_flattened(), 0.0, size);
                    assert!(low.min_element() > 0.1 && high.max_element() < 0.9, "{size:?}: {low} to {high}");
                }
            }
        }
    }
}

/// A camera at a given distance, target and direction is exactly there.
#[test]
fn an_orbit_is_where_it_says() {
    let folder = tempfile::tempdir().unwrap();
    let path = written(&folder, &triangles(1, Vec3::ONE, Vec3::ZERO));
    for (orbit, expected) in [
        ("0,90,3", vec3(0.0, 0.0, 3.0)),
        ("90,90,2", vec3(2.0, 0.0, 0.0)),
        ("180,90,2", vec3(0.0, 0.0, -2.0)),
        ("0,45,2", vec3(0.0, 2f32.sqrt(), 2f32.sqrt())),
    ] {
        let target = vec3(0.1, 0.2, 0.3);
        let scene = loaded(&path, &[&format!("camera.orbit=\"{orbit}\""), "camera.target=[0.1, 0.2, 0.3]"]);
        let view = scene.view(&scene.pose(0.0), 100, 100);
        assert!((Vec3::from(view.position()) - target - expected).length() < 1e-5, "{orbit}: {}", view.position());
        let middle = view.project(target.into()).unwrap().pixel;
        assert!((middle - 50.0).length() < 1e-3, "{orbit}: {middle}");
    }
    // With z up, an angle of 90° from the up axis is at equal z.
    let scene = loaded(&path, &["camera.orbit=\"0,90,3\"", "camera.up=[0,0,1]", "camera.target=[0,0,0]"]);
    let position = scene.view(&scene.pose(0.0), 10, 10).position();
    assert!(position.z.abs() < 1e-5 && (position.length() - 3.0).abs() < 1e-5, "{position}");
    for text in ["", "1", "1,2,3,4", "a,b", "0,181", "0,-1", "0,90,0", "0,90,-5%", "nan,3", "0,90,x%"] {
        assert!(text.parse::<Orbit>().is_err(), "{text}");
    }
}

/// A turning camera shows the whole scene at all times, comes back to its start, and moves at a constant rate.
#[test]
fn a_turntable_has_no_seam() {
    let folder = tempfile::tempdir().unwrap();
    let triangles = triangles(3, vec3(1.0, 2.0, 0.3), Vec3::ZERO);
    let scene = loaded(&written(&folder, &triangles), &["camera.turn=6"]);
    assert_eq!(scene.duration(), 6.0);
    let position = |time: f32| Vec3::from(scene.view(&scene.pose(time), 64, 64).position());
    assert!((position(0.0) - position(6.0)).length() < 1e-4);
    let step = (position(0.1) - position(0.0)).length();
    let mut fullest: f32 = 0.0;
    for k in 0..60 {
        let time = 0.1 * k as f32;
        let moved = (position(time + 0.1) - position(time)).length();
        assert!((moved / step - 1.0).abs() < 1e-3, "{moved} after {step} at {time} s");
        let (low, high) = seen(&scene, triangles.as_flattened(), time, (512, 512));
        assert!(low.min_element() > 0.05 && high.max_element() < 0.95, "{low} to {high} at {time} s");
        fullest = fullest.max((high - low).max_element());
    }
    assert!(fullest > 0.65, "at most {fullest} of the picture");
}

/// The empty ground has the color of the background, in every studio and with every background. Path tracing measures
/// the ground's light independently.
#[test]
fn the_ground_has_the_color_of_the_background() {
    let folder = tempfile::tempdir().unwrap();
    let path = written(&folder, &triangles(5, Vec3::splat(0.01), Vec3::ZERO));
    for settings in [
        vec!["studio.kind=\"soft\""],
        vec!["studio.kind=\"product\""],
        vec!["studio.kind=\"outdoor\""],
        vec!["studio.background=[3.5,3.5,3.5]"],
        vec!["studio.background=[0.01,0.05,0.2]"],
    ] {
        let mut scene = loaded(&path, &settings);
        let background = scene.background.unwrap();
        // Look at the ground beside the scene.
        scene.settings.camera.name = None;
        scene.cameras.clear();
        let view = ["camera.orbit=\"30,50,0.06\"", "camera.target=[0.04,-0.005,0.02]", "camera.fov=8"];
        let aside = loaded(&path, &[settings.as_slice(), view.as_slice()].concat());
        let still = Still { time: 0.0, width: 16, height: 16 };
        let estimate = path_traced(&aside, still, &PathOptions { samples: 256, ..PathOptions::default() }, |_, _| ());
        let sum: Vec3 = estimate.mean.samples().iter().map(|&rgb| Vec3::from(rgb)).sum();
        let ratio = sum / 256.0 / background;
        assert!((ratio - 1.0).abs().max_element() < 0.03, "{settings:?}: {ratio} of the background");
    }
}

/// Scenes with a lamp or a sky have no studio unless one is requested, and `off` gives a plain sky without a ground.
#[test]
fn studios_are_for_scenes_without_lamps() {
    let folder = tempfile::tempdir().unwrap();
    let path = written(&folder, &triangles(7, Vec3::ONE, Vec3::ZERO));
    let has_ground = |set: &[&str]| loaded(&path, set).ground.is_some();
    let sky = ["sky.zenith=[1,1,1]", "sky.horizon=[1,1,1]"];
    assert!(has_ground(&[]) && !has_ground(&sky) && !has_ground(&["studio.kind=\"off\""]));
    assert!(has_ground(&[sky[0], sky[1], "studio.kind=\"product\""]));
    let plain = loaded(&path, &["studio.kind=\"off\"", "studio.background=[1,0,0]"]);
    assert!(plain.sky.is_some() && plain.background == Some(Vec3::X));
    // The ground is below all corners, and does not touch them.
    let scene = loaded(&path, &[]);
    let (low, _) = scene.bounds(&scene.pose(0.0)).unwrap();
    let lowest = triangles(7, Vec3::ONE, Vec3::ZERO).as_flattened().iter().fold(f32::MAX, |low, c| low.min(c.y));
    assert!(low.y < lowest && lowest - low.y < 1e-4, "{} below {lowest}", low.y);
}

/// Views of one scene show it whole, one view per frame.
#[test]
fn views_show_the_whole_scene() {
    let mut scene = Scene::default();
    let board = quad(vec3(-0.8, -0.8, 0.0), Vec3::X * 1.6, Vec3::Y * 1.6);
    add(&mut scene, rest(vec3(0.3, 0.0, 0.0)), board.clone(), material(Vec3::ONE, Vec3::ZERO));
    let orbits: Vec<Orbit> = ["0,90", "90,45", "200,20", "300,100"].iter().map(|text| text.parse().unwrap()).collect();
    scene.set_views(&orbits, 25.0);
    let corners: Vec<Vec3> = board.positions.iter().map(|&corner| corner + vec3(0.3, 0.0, 0.0)).collect();
    for (k, orbit) in orbits.iter().enumerate() {
        let time = k as f32 / 25.0;
        let (low, high) = seen(&scene, &corners, time, (128, 128));
        assert!(((high - low).max_element() - 0.78).abs() < 0.005, "{orbit:?}: {low} to {high}");
        // The camera is in the direction of the orbit.
        let axis: Vec3A = scene.view(&scene.pose(time), 128, 128).world_from_camera().matrix3.z_axis;
        let around = Quat::from_rotation_y(orbit.azimuth.to_radians());
        let expected = around * Quat::from_rotation_x(orbit.polar.to_radians() - FRAC_PI_2) * Vec3::Z;
        assert!((Vec3::from(axis) - expected).length() < 1e-5, "{orbit:?}: {axis} for {expected}");
    }
}

/// Large meshes are measured by their extreme vertices. A ball of 12 000 vertices fills the picture within 1 %.
#[test]
fn large_meshes_fill_the_picture() {
    let corner = |k: usize| {
        let height = 1.0 - 2.0 * (k as f32 + 0.5) / 12_000.0;
        let (sine, cosine) = (k as f32 * 2.4).sin_cos();
        vec3(cosine, 0.0, sine) * (1.0 - height * height).sqrt() + Vec3::Y * height
    };
    let corners: Vec<Vec3> = (0..12_000).map(corner).collect();
    let triangles: Vec<[Vec3; 3]> = corners.chunks(3).map(|three| [three[0], three[1], three[2]]).collect();
    let folder = tempfile::tempdir().unwrap();
    let path = written(&folder, &triangles);
    for orbit in ["0,90", "25,74", "100,13", "211,150", "333,55"] {
        let scene = loaded(&path, &[&format!("camera.orbit=\"{orbit}\"")]);
        let (low, high) = seen(&scene, &corners, 0.0, (512, 512));
        let extent = high - low;
        assert!((extent / 0.78 - 1.0).abs().max_element() < 0.012, "{orbit}: {extent}");
    }
}

/// Far from the origin of the file, a target is in the file's coordinates.
#[test]
fn targets_are_in_coordinates_of_the_file() {
    let middle = vec3(2000.0, -300.0, 100.0);
    let triangles = triangles(11, Vec3::ONE, middle);
    let folder = tempfile::tempdir().unwrap();
    let path = written(&folder, &triangles);
    let scene = loaded(&path, &["camera.orbit=\"0,90,3\"", "camera.target=[2000.25, -300, 100]"]);
    assert!(scene.displacement != Vec3::ZERO);
    let view = scene.view(&scene.pose(0.0), 100, 100);
    let position = Vec3::from(view.position()) - scene.displacement;
    assert!((position - vec3(2000.25, -300.0, 103.0)).length() < 1e-3, "{position}");
}

/// A field of view alone changes the lens of the file's camera, not its position.
#[test]
fn a_lens_keeps_the_camera() {
    let mut scene = Scene::default();
    add(&mut scene, rest(Vec3::ZERO), quad(Vec3::ZERO, Vec3::X, Vec3::Y), material(Vec3::ONE, Vec3::ONE));
    scene.nodes.push(Node { name: "camera".into(), parent: None, rest: rest(vec3(0.0, 1.0, 5.0)) });
    scene.cameras.push(Camera { node: 1, ..Camera::default() });
    scene.settings.camera.fov = Some(90.0);
    scene.furnish();
    assert_eq!((scene.cameras.len(), scene.cameras[0].projection), (1, Projection::Perspective { yfov: FRAC_PI_2 }));
}
