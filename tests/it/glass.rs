//! Light through glass in films, compared with path tracing.

use glam::{Vec3, vec3};
use serde_json::{Value, json};
use std::path::Path;
use tests::{Ball, Blocks, Comparison, Glb, Quad, render2mpeg, sorted_names};

/// Walls of a room of 2 m, without its left wall and its front.
fn room() -> Glb {
    let mut glb = walls();
    glb.add_camera(vec3(0.0, 1.0, 3.2));
    glb
}

fn walls() -> Glb {
    let mut glb = Glb::default();
    let (x, y, z) = (Vec3::X * 2.0, Vec3::Y * 2.0, Vec3::Z * 2.0);
    let corner = vec3(-1.0, 0.0, -1.0);
    let walls: [Quad; 4] = [[corner, z, x], [corner + y, x, z], [corner, x, y], [corner + x, z, y]];
    glb.add(&walls, Vec3::splat(0.7), Vec3::ZERO);
    glb
}

/// Changes the last material to smooth glass with further extensions. Without a volume, the glass is a thin wall.
fn make_glass(glb: &mut Glb, extensions: &[(&str, Value)]) {
    let material = glb.json["materials"].as_array_mut().unwrap().last_mut().unwrap();
    material["pbrMetallicRoughness"]["roughnessFactor"] = json!(0.0);
    material["extensions"] = json!({ "KHR_materials_transmission": { "transmissionFactor": 1.0 } });
    for (name, extension) in extensions {
        material["extensions"][name] = extension.clone();
    }
}

/// Returns a ball with its front outside.
fn ball(center: Vec3, radius: f32) -> Ball {
    Ball { center, radius, columns: 32, rows: 16, half: false, inward: false }
}

fn blocks(glb: &Glb, paths: u32) -> Blocks {
    let folder = tempfile::tempdir().unwrap();
    let scene = folder.path().join("scene.glb");
    glb.write(&scene);
    Blocks::of(folder.path(), &scene, Comparison { side: 48, paths, ..Comparison::default() })
}

/// Checks a film's mean against path tracing, and the middle nine tenths of its blocks.
fn assert_close(name: &str, blocks: &Blocks, mean: f32, block: f32) {
    println!("{}", blocks.row(name));
    let (ratio, ratios) = (blocks.mean_ratio(), blocks.ratios());
    let [low, high] = [0.05, 0.95].map(|place| ratios[(place * ratios.len() as f32) as usize]);
    assert!((ratio - 1.0).abs() < mean, "{name}: mean {ratio}");
    assert!(low > 1.0 - block && high < 1.0 + block, "{name}: blocks {low} to {high}");
}

/// All light of the room comes through a colored window.
#[test]
fn a_colored_window_lights_a_room() {
    let mut glb = room();
    let (low, high) = (vec3(-1.0, 0.0, -1.0), vec3(-1.0, 1.5, -1.0));
    glb.add(&[[low, Vec3::Y * 0.6, Vec3::Z * 2.0], [high, Vec3::Y * 0.5, Vec3::Z * 2.0]], Vec3::splat(0.6), Vec3::ZERO);
    glb.add(&[[vec3(-2.0, 1.0, -0.5), Vec3::Y, Vec3::Z]], Vec3::ZERO, Vec3::splat(20.0));
    glb.add(&[[vec3(-1.0, 0.6, -1.0), Vec3::Y * 0.9, Vec3::Z * 2.0]], vec3(0.9, 0.4, 0.1), Vec3::ZERO);
    make_glass(&mut glb, &[]);
    assert_close("window", &blocks(&glb, 1024), 0.02, 0.05);
}

/// A glowing ball in a shell of colored glass lights a room.
#[test]
fn a_bulb_in_glass_lights_a_room() {
    let mut glb = room();
    let center = vec3(0.0, 1.2, 0.0);
    glb.add_ball(ball(center, 0.08), Vec3::ZERO, vec3(30.0, 28.0, 20.0));
    glb.add_ball(ball(center, 0.25), vec3(1.0, 0.9, 0.7), Vec3::ZERO);
    make_glass(&mut glb, &[]);
    assert_close("bulb", &blocks(&glb, 1024), 0.02, 0.05);
}

/// A pane in a lit room shows the room in its color, and reflects it. The film lacks the light of the lamp that the pane
/// reflects to the floor, up to 13 % there.
#[test]
fn panes_show_the_surfaces_behind_them() {
    let mut glb = room();
    glb.add(&[[vec3(-0.3, 1.98, -0.3), Vec3::X * 0.6, Vec3::Z * 0.6]], Vec3::ZERO, Vec3::splat(12.0));
    glb.add(&[[vec3(-0.9, 0.01, 0.3), Vec3::X * 1.2, Vec3::Y * 1.5]], vec3(0.4, 0.8, 0.4), Vec3::ZERO);
    make_glass(&mut glb, &[]);
    let blocks = blocks(&glb, 512);
    assert_close("pane", &blocks, 0.02, 0.12);
    let ratios = blocks.ratios();
    assert!((ratios[ratios.len() / 2] - 1.0).abs() < 0.01, "median {}", ratios[ratios.len() / 2]);
}

/// A glass bar guides light by 10 to 28 total reflections, as the wall of a vase does.
#[test]
fn bars_guide_light_to_the_viewer() {
    let mut glb = walls();
    glb.add(&[[vec3(-0.3, 1.98, -0.3), Vec3::X * 0.6, Vec3::Z * 0.6]], Vec3::ZERO, Vec3::splat(12.0));
    // The end faces the camera, and the sides are at 35° to the line of sight.
    let (sine, cosine) = 35f32.to_radians().sin_cos();
    let (c, x, y) = (vec3(-0.03, 0.97, 0.8), Vec3::X * 0.06, Vec3::Y * 0.06);
    let along = 0.9 * vec3(sine, 0.0, -cosine);
    glb.add(
        &[[c, x, y], [c + along, y, x], [c, y, along], [c + x, along, y], [c + y, x, along], [c, along, x]],
        Vec3::ONE,
        Vec3::ZERO,
    );
    make_glass(&mut glb, &[("KHR_materials_volume", json!({ "thicknessFactor": 0.1 }))]);
    glb.add_camera(vec3(0.0, 1.0, 0.9));
    assert_close("bar", &blocks(&glb, 512), 0.02, 0.05);
}

/// Without motion, frames of a glass block are equal to the last bit: refraction uses no random numbers per frame.
#[test]
fn still_glass_has_no_grain() {
    let mut glb = room();
    glb.add(&[[vec3(-0.3, 1.98, -0.3), Vec3::X * 0.6, Vec3::Z * 0.6]], Vec3::ZERO, Vec3::splat(12.0));
    glb.add_ball(ball(vec3(0.2, 0.5, 0.2), 0.4), Vec3::ONE, Vec3::ZERO);
    make_glass(&mut glb, &[("KHR_materials_volume", json!({ "thicknessFactor": 0.1 }))]);
    let folder = tempfile::tempdir().unwrap();
    glb.write(&folder.path().join("scene.glb"));
    let arguments = "render scene.glb -o film.mpg --size 48x48 --frames 3 --exr linear -q";
    let finished = render2mpeg(folder.path(), &arguments.split(' ').collect::<Vec<_>>());
    assert_eq!(finished.code, Some(0), "{}", finished.stderr);
    let linear = folder.path().join("linear");
    let names = sorted_names(&linear);
    let pixels = |name: &String| render_core::image_file::read_exr(&linear.join(Path::new(name))).unwrap();
    let first = pixels(&names[0]);
    assert!(names.len() == 3 && names[1..].iter().all(|name| pixels(name) == first));
}
