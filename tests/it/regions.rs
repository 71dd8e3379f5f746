//! Light by region: a mean over the picture hides excess in one area and loss in another.
//!
//! Films are compared with path tracing in blocks of 8×8 pixels, without emissive pixels.

use glam::{Vec3, vec3};
use std::path::Path;
use tests::{Blocks, Comparison, Glb, Quad, cornell};

/// Returns the ratio of film to path tracing for each block, in ascending order.
fn ratios(folder: &Path, scene: &Path, side: usize, paths: u32) -> Vec<f32> {
    Blocks::of(folder, scene, Comparison { side, paths, ..Comparison::default() }).ratios()
}

/// Checks that the median is within 1 % of path tracing, and at least `share` of the blocks within 5 %.
fn check(name: &str, ratios: &[f32], share: f32) {
    let median = ratios[ratios.len() / 2];
    let near = ratios.iter().filter(|ratio| (**ratio - 1.0).abs() < 0.05).count() as f32 / ratios.len() as f32;
    let (low, high) = (ratios[ratios.len() / 20], ratios[ratios.len() - 1 - ratios.len() / 20]);
    println!("{name}: median {median:.4}, {near:.3} of {} blocks within 5 %, 90 % in {low:.3}…{high:.3}", ratios.len());
    assert!((median - 1.0).abs() < 0.01, "{name}: median {median}");
    assert!(near >= share, "{name}: {near} of the blocks within 5 %: {ratios:?}");
}

/// Returns the faces of a box, facing outward.
fn faces(low: Vec3, high: Vec3) -> Vec<Quad> {
    let (x, y, z) = (Vec3::X * (high - low), Vec3::Y * (high - low), Vec3::Z * (high - low));
    vec![[low, z, y], [low, x, z], [low, y, x], [high, -y, -z], [high, -z, -x], [high, -x, -y]]
}

/// Builds a closed room of 2 m with a block on its floor.
fn room() -> Glb {
    let mut room = Glb::default();
    let walls = faces(vec3(-1.0, 0.0, -1.0), vec3(1.0, 2.0, 1.0)).into_iter().map(|[corner, a, b]| [corner, b, a]);
    room.add(&walls.collect::<Vec<Quad>>(), Vec3::splat(0.3), Vec3::ZERO);
    room.add(&faces(vec3(-0.6, 0.0, -0.6), vec3(-0.1, 0.9, -0.1)), vec3(0.6, 0.5, 0.4), Vec3::ZERO);
    room.add_camera(vec3(0.0, 1.0, 0.95));
    room
}

fn check_room(name: &str, room: &Glb) {
    let folder = tempfile::tempdir().unwrap();
    let scene = folder.path().join("room.glb");
    room.write(&scene);
    check(name, &ratios(folder.path(), &scene, 64, 512), 0.95);
}

/// A lamp of six faces is many lights in the tree: their positions must not correlate with the faces.
#[test]
fn a_room_with_a_box_lamp_is_lit_as_by_paths() {
    let mut room = room();
    room.add(&faces(vec3(-0.3, 1.5, -0.3), vec3(0.3, 1.7, 0.3)), Vec3::ZERO, Vec3::splat(10.0));
    check_room("box lamp", &room);
}

/// Ten lamps of one shape, each with few lights: a bias towards one side would repeat in all of them.
#[test]
fn a_room_with_ten_lamps_is_lit_as_by_paths() {
    let mut room = room();
    for (x, z) in [-0.7, -0.35, 0.0, 0.35, 0.7].into_iter().flat_map(|x| [(x, -0.5), (x, 0.4)]) {
        let lamp = faces(vec3(x - 0.05, 1.7, z - 0.05), vec3(x + 0.05, 1.8, z + 0.05));
        room.add(&lamp, Vec3::ZERO, Vec3::splat(40.0));
    }
    check_room("ten lamps", &room);
}

/// Chairs, blinds, moldings and 44 lamps. Measured: 92 % of the blocks are within 5 %; the path-traced picture is noisy too.
#[test]
fn the_conference_room_is_lit_as_by_paths() {
    let folder = tempfile::tempdir().unwrap();
    let scene = cornell().with_file_name("../conference/conference.glb");
    check("conference", &ratios(folder.path(), &scene, 64, 1024), 0.9);
}
