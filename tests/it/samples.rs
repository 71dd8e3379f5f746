//! Samples per pixel, compared with pictures of four times the width and height.

use glam::{Vec3, vec3};
use laboratory::compare::png_file;
use plane::Plane;
use std::path::Path;
use tests::{Glb, assert_fails, render, textured_square};

/// Side of the small pictures \[pixels\].
const SIDE: usize = 64;
/// Number of pixels of the large pictures along the side of a pixel.
const FINER: usize = 4;

/// Linear display light of a display code (IEC 61966-2-1).
fn linear(code: u8) -> f64 {
    let v = f64::from(code) / 255.0;
    if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
}

/// Display code of linear display light.
fn code(v: f64) -> f64 {
    255.0 * if v <= 0.003_130_8 { 12.92 * v } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 }
}

/// Returns the mean of each `FINER` × `FINER` block \[codes\].
fn smaller(large: &Plane<[u8; 3]>) -> Plane<[f64; 3]> {
    Plane::from_fn(SIDE, SIDE, |x, y| {
        let mut sum = [0.0; 3];
        for (u, v) in (0..FINER).flat_map(|v| (0..FINER).map(move |u| (u, v))) {
            let pixel = large.get(FINER * x + u, FINER * y + v);
            (0..3).for_each(|c| sum[c] += linear(pixel[c]));
        }
        sum.map(|sum| code(sum / (FINER * FINER) as f64))
    })
}

/// Number of pixels that differ by more than 30 codes, and the root mean square difference \[codes\].
fn difference(picture: &Plane<[u8; 3]>, truth: &Plane<[f64; 3]>) -> (usize, f64) {
    let (mut wrong, mut squares) = (0, 0.0);
    for (own, other) in picture.samples().iter().zip(truth.samples()) {
        let apart: Vec<f64> = (0..3).map(|c| (f64::from(own[c]) - other[c]).abs()).collect();
        wrong += usize::from(apart.iter().any(|&apart| apart > 30.0));
        squares += apart.iter().map(|apart| apart * apart).sum::<f64>();
    }
    (wrong, (squares / (3 * SIDE * SIDE) as f64).sqrt())
}

/// Renders the first frame of a scene with these options.
fn frame(folder: &Path, name: &str, options: &str) -> Plane<[u8; 3]> {
    let options = format!("--frames 1 --set exposure=0.5 --vpls 200 --qscale 1 --png {name} {options}");
    render(folder, name, &folder.join("scene.glb"), &options);
    png_file::read(&folder.join(name).join("frame_00000.png")).unwrap()
}

/// Returns the differences of the default picture and of one sample per pixel from the large picture.
fn differences(scene: &Glb) -> [(usize, f64); 2] {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    scene.write(&folder.join("scene.glb"));
    let side = SIDE * FINER;
    let truth = smaller(&frame(folder, "large", &format!("--size {side}x{side} --antialiasing off")));
    let size = format!("--size {SIDE}x{SIDE}");
    let auto = frame(folder, "auto", &size);
    let single = frame(folder, "single", &format!("{size} --samples 1"));
    [difference(&auto, &truth), difference(&single, &truth)]
}

/// Returns a small lamp above bars, whose shadows on the floor are about as wide as a pixel.
fn barred_lamp() -> Glb {
    let mut glb = Glb::default();
    glb.add(&[[vec3(-3.0, 0.0, -3.0), 6.0 * Vec3::Z, 6.0 * Vec3::X]], Vec3::splat(0.7), Vec3::ZERO);
    let bars: Vec<[Vec3; 3]> =
        (0..20).map(|k| [vec3(-1.0 + 0.1 * k as f32, 2.0, -1.1), 2.0 * Vec3::Z, vec3(0.047, 0.0, 0.05)]).collect();
    glb.add(&bars, Vec3::splat(0.2), Vec3::ZERO);
    let lamp = [vec3(-0.01, 3.0, -0.01), 0.02 * Vec3::X, 0.02 * Vec3::Z];
    glb.add(&[lamp], Vec3::ZERO, Vec3::splat(30_000.0));
    glb.add_camera(vec3(0.0, 1.2, 4.0));
    glb
}

/// Returns boards with gaps of a quarter of a pixel, above a dark board.
fn gaps() -> Glb {
    let mut glb = Glb::default();
    let boards: Vec<[Vec3; 3]> =
        (0..8).map(|k| [vec3(-2.0, -1.9 + 0.4 * k as f32, 0.0), vec3(4.0, 0.7, 0.0), 0.38 * Vec3::Y]).collect();
    glb.add(&boards, Vec3::splat(0.8), Vec3::ZERO);
    glb.add(&[[vec3(-2.0, -2.0, -0.004), 4.0 * Vec3::X, 4.0 * Vec3::Y]], Vec3::splat(0.01), Vec3::ZERO);
    glb.add(&[[vec3(-1.0, 3.0, 2.0), 2.0 * Vec3::X, 2.0 * Vec3::Z]], Vec3::ZERO, Vec3::splat(4.0));
    glb.add_camera(vec3(0.0, 0.0, 3.6));
    glb
}

#[test]
fn shadows_narrower_than_pixels_are_smooth() {
    let [auto, single] = differences(&barred_lamp());
    assert!(single.0 > 40, "the shadows need samples: {single:?}");
    assert!(3 * auto.0 < single.0 && auto.1 < 0.6 * single.1, "{auto:?} of {single:?}");
}

/// Denser rays find these gaps with more accuracy than a few further samples.
#[test]
fn gaps_narrower_than_pixels_are_left_to_outlines() {
    let [auto, single] = differences(&gaps());
    assert!(auto.0 == 0 && auto.1 < 1.1 * single.1, "{auto:?} and {single:?}");
}

/// Filtered textures need one sample: a picture without shadows is the same with it.
#[test]
fn textures_need_no_further_samples() {
    let folder = tempfile::tempdir().unwrap();
    textured_square().write(&folder.path().join("scene.glb"));
    let size = format!("--size {SIDE}x{SIDE} --frames 1 --vpls 100");
    let scene = folder.path().join("scene.glb");
    let samples = |name: &str, options: &str| {
        render(folder.path(), name, &scene, &format!("{size} {options}")).figures(&["samples_mean"])
    };
    assert!(samples("auto", "").iter().all(|&mean| mean < 1.01), "{:?}", samples("auto", ""));
}

#[test]
fn numbers_of_samples_are_checked() {
    let folder = tempfile::tempdir().unwrap();
    barred_lamp().write(&folder.path().join("scene.glb"));
    let fails = |options: &str, words: &[&str]| {
        let arguments: Vec<&str> = ["render", "scene.glb"].into_iter().chain(options.split(' ')).collect();
        assert_fails(folder.path(), &arguments, words);
    };
    fails("--samples 0", &["--samples", "from 1 to 64"]);
    fails("--samples many", &["--samples", "auto or a number"]);
    fails("--samples auto --importance saliency:1", &["--samples auto", "--importance"]);
    fails("--samples auto --tiles rays", &["--samples auto", "--tiles"]);
}
