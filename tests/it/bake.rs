//! Baked light: closed forms, walls, files, and films that sample it.

use glam::{Vec3, vec3};
use perceptual::psnr;
use plane::Picture;
use render_core::scene::{Gradient, Instance, Material, Mesh, Node, Scene, Transform};
use render_core::{Environment, NOTHING, Surfaces, luminance};
use render2mpeg::{Options, Settings};
use renderer::bake::{Bake, BakeRun};
use renderer::plan::Plan;
use renderer::{Preparation, bake};
use std::path::{Path, PathBuf};
use tests::{Rendered, assert_fails, cornell, load, read_y4m, render, render2mpeg};

/// Adds parallelograms, which face a × b, as one instance.
pub(super) fn add(scene: &mut Scene, material: Material, faces: &[[Vec3; 3]]) {
    let mut mesh = Mesh { material: scene.materials.len(), ..Mesh::default() };
    for &[corner, a, b] in faces {
        let first = mesh.positions.len() as u32;
        mesh.positions.extend([corner, corner + a, corner + a + b, corner + b]);
        mesh.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
    }
    scene.instances.push(Instance { node: 0, mesh: scene.meshes.len() });
    scene.meshes.push(mesh);
    scene.materials.push(material);
}

/// Returns the faces of a box, facing outward.
pub(super) fn outside(low: Vec3, high: Vec3) -> [[Vec3; 3]; 6] {
    let [x, y, z] = [Vec3::X, Vec3::Y, Vec3::Z].map(|axis| axis * (high - low));
    [[low, y, x], [low, x, z], [low, z, y], [high, -x, -y], [high, -z, -x], [high, -y, -z]]
}

/// Returns the faces of a box, facing inward.
pub(super) fn within(low: Vec3, high: Vec3) -> [[Vec3; 3]; 6] {
    outside(low, high).map(|[corner, a, b]| [corner, b, a])
}

fn empty_scene() -> Scene {
    let mut scene = Scene::default();
    scene.nodes.push(Node { name: String::new(), parent: None, rest: Transform::IDENTITY });
    scene
}

pub(super) fn gray(albedo: f32) -> Material {
    Material { base_color: Vec3::splat(albedo), ..Material::default() }
}

fn baked(scene: &Scene, texels: usize) -> Bake {
    let options = Options { vpls: Some(1000), photons: Some(100_000), ..Options::default() };
    let settings = Settings::new("stage.glb".into(), scene, &options).expect("right settings");
    bake::bake(scene, &settings.render, texels, &BakeRun::alone(), &|_, _| ())
        .expect("the scene can be baked")
        .expect("it was not stopped")
}

/// Each point of a box under a uniform sky of radiance L sees half of the sky: E = π L.
#[test]
fn a_box_under_an_even_sky_has_its_irradiance() {
    let mut scene = empty_scene();
    add(&mut scene, gray(0.5), &outside(vec3(-1.0, -1.0, -1.0), vec3(1.0, 1.0, 1.0)));
    scene.sky = Environment::gradient(Gradient::constant([2.0; 3]));
    let bake = baked(&scene, 2000);
    let expected = 2.0 * std::f32::consts::PI;
    let (mut least, mut most, mut sum) = (f32::INFINITY, 0.0f32, 0.0);
    for light in &bake.texels.indirect {
        let found = luminance((*light).into()) / expected;
        (least, most, sum) = (least.min(found), most.max(found), sum + found);
    }
    println!("{least} to {most}, mean {}", sum / bake.texels.indirect.len() as f32);
    for (texel, light) in bake.texels.indirect.iter().enumerate() {
        let found = luminance((*light).into());
        assert!((found / expected - 1.0).abs() < 0.01, "{found} is not {expected} at texel {texel}");
    }
    assert!(bake.texels.direct.iter().all(|light| *light == [0.0; 3]), "a sky is no lamp that pixels sample");
}

/// A wall of one centimeter between two rooms blocks all light of a lamp in one of them.
#[test]
fn a_thin_wall_keeps_light_in() {
    // Two rooms, and a lamp in the first.
    let mut scene = empty_scene();
    let (low, high) = (vec3(0.0, 0.0, 0.0), vec3(2.0, 2.0, 2.0));
    add(&mut scene, gray(0.7), &within(low, high));
    let beside = Vec3::X * 2.01;
    add(&mut scene, gray(0.7), &within(low + beside, high + beside));
    let lamp = Material { emission: Vec3::splat(20.0), ..gray(0.0) };
    add(&mut scene, lamp, &[[vec3(0.7, 1.9, 0.7), vec3(0.6, 0.0, 0.0), vec3(0.0, 0.0, 0.6)]]);
    let bake = baked(&scene, 6000);

    // Compare the floors, except next to the wall.
    let pose = scene.pose(0.0);
    let surfaces = Surfaces::new(&scene, &pose);
    let atlas = &bake.texels.atlas;
    let far = 1.5 / atlas.texels_per_meter();
    let (mut bright, mut floors, mut dark) = (0.0, 0, 0.0f32);
    for texel in 0..atlas.len() {
        let site = atlas.sites(texel, &surfaces)[0];
        if site.position.y > 1e-4 {
            continue;
        }
        let light = luminance(Vec3::from(bake.texels.direct[texel]) + Vec3::from(bake.texels.indirect[texel]));
        match site.instance {
            0 => (bright, floors) = (bright + light, floors + 1),
            _ if site.position.x > beside.x + far => dark = dark.max(light),
            _ => {}
        }
    }
    let bright = bright / floors as f32;
    assert!(floors > 100 && bright > 1.0, "{floors} texels of {bright}");
    assert!(dark <= 0.01 * bright, "{dark} in the dark room, {bright} in the bright one");
}

/// Path of the shipped scene in which only the camera moves.
fn cornell_box() -> PathBuf {
    PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../scenes/cornell-box/cornell-box.glb"))
}

/// Bakes `scene` into `folder/NAME.slf` with `extra` arguments, and returns the file's bytes.
pub(super) fn bake_file(folder: &Path, scene: &Path, name: &str, extra: &str) -> Vec<u8> {
    let output = format!("{name}.slf");
    let mut arguments = vec!["bake", scene.to_str().expect("a path in UTF-8"), "-o", &output, "--quiet", "--overwrite"];
    arguments.extend(extra.split_whitespace());
    let finished = render2mpeg(folder, &arguments);
    assert_eq!((finished.code, finished.stderr.as_str()), (Some(0), ""), "render2mpeg {arguments:?}");
    std::fs::read(folder.join(output)).expect("the baked light is there")
}

/// Asserts that `bake room.glb` with `extra` arguments fails with an error that contains all `words`.
pub(super) fn assert_bake_fails(folder: &Path, extra: &str, words: &[&str]) {
    let arguments: Vec<&str> = ["bake", "room.glb"].into_iter().chain(extra.split_whitespace()).collect();
    assert_fails(folder, &arguments, words);
}

/// A film and its frames before coding.
pub(super) struct Film {
    pub rendered: Rendered,
    pub frames: Vec<Picture>,
}

const SIDE: usize = 64;

/// Renders three frames of `scene` with lightcuts, and with the baked light of `folder/FILE`.
pub(super) fn films(folder: &Path, scene: &Path, file: &str, options: &str) -> [Film; 2] {
    let baked = format!("--lighting baked --baked {file}");
    [("cuts", ""), ("baked", &baked)].map(|(name, more)| {
        let arguments = format!("--size {SIDE}x{SIDE} --frames 3 {options} --y4m {name}.y4m {more}");
        let rendered = render(folder, name, scene, &arguments);
        Film { rendered, frames: read_y4m(&folder.join(format!("{name}.y4m")), (SIDE, SIDE)) }
    })
}

/// In a static scene, a film with baked light nearly equals one with lightcuts and traces no photons.
#[test]
fn a_film_of_baked_light_looks_like_one_of_cuts() {
    let folder = tempfile::tempdir().unwrap();
    let (folder, scene) = (folder.path(), cornell_box());
    let [two, one] = ["2", "1"]
        .map(|threads| bake_file(folder, &scene, "box", &format!("--texels 20000 --vpls 1000 --threads {threads}")));
    assert!(two == one, "the same bytes with any number of threads");
    let [cuts, baked] = films(folder, &scene, "box.slf", "--vpls 1000");
    assert_eq!(baked.rendered.figures(&["photons_traced"]), [0.0; 3]);
    // Only a few pixels in corners have records, because their surroundings are nearer than two texels.
    let records = |film: &Film| film.rendered.figures(&["cache_records"])[0];
    assert!(records(&baked) < 0.3 * records(&cuts), "{} and {} records", records(&baked), records(&cuts));
    for (cuts, baked) in cuts.frames.iter().zip(&baked.frames) {
        let psnr = psnr(baked.luma(), cuts.luma());
        assert!(psnr > 36.0, "{psnr} dB");
    }
    // Nothing moves, so later frames keep the light of the first.
    for film in [&cuts, &baked] {
        assert_eq!(film.rendered.figures(&["shaded_share"])[1..], [0.0; 2]);
        assert_eq!(film.rendered.figures(&["shadow_rays"])[1..], [0.0; 2]);
    }
}

/// Dynamic geometry is lit by records of its own, to almost the same luma as without baked light.
#[test]
fn things_that_move_are_lit_beside_baked_light() {
    let folder = tempfile::tempdir().unwrap();
    let (folder, path) = (folder.path(), cornell());
    // With fewer virtual lights, the film of lightcuts would deviate more from the truth.
    bake_file(folder, &path, "cornell", "--vpls 4000");
    let [cuts, baked] = films(folder, &path, "cornell.slf", "--vpls 4000");
    // Only dynamic geometry has records.
    let records = |film: &Film| film.rendered.figures(&["cache_records"])[0];
    assert!(records(&baked) > 0.0 && records(&baked) < 0.5 * records(&cuts), "records on dynamic geometry only");

    // The pixels of the moving blocks.
    let size = format!("{SIDE}x{SIDE}").parse().ok();
    let (scene, settings) = load(&path, Options { size, frames: Some(3), ..Options::default() });
    let renderer = settings.render.clone();
    let plan = Plan::new(&scene, &renderer);
    let mut preparation = Preparation::new(&scene, &renderer, &plan);
    for index in 0..3 {
        let frame = preparation.frame(index as u32).frame;
        let (mut squares, mut sum, mut count) = (0.0, 0.0, 0);
        for (place, pixel) in frame.seen.pixels.samples().iter().enumerate() {
            if pixel.instance != NOTHING && frame.surfaces.moving()[pixel.instance as usize] {
                let luma = |film: &Film| f64::from(film.frames[index].luma().samples()[place]);
                let change = luma(&baked) - luma(&cuts);
                (squares, sum, count) = (squares + change * change, sum + change, count + 1);
            }
        }
        let psnr = 10.0 * (255.0 * 255.0 * f64::from(count) / squares).log10();
        println!("frame {index}: {psnr} dB over {count} pixels, {} in the mean", sum / f64::from(count));
        assert!(count > 200 && psnr > 38.0, "{psnr} dB over {count} pixels");
    }
}

#[test]
fn bad_files_of_baked_light_are_told_in_one_line() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let (still, moving) = (cornell_box(), cornell());
    let whole = bake_file(folder, &still, "whole", "--texels 500 --vpls 100");
    let write = |name: &str, bytes: &[u8]| std::fs::write(folder.join(name), bytes).expect("a file");
    // Truncated, changed, and of a newer version.
    write("short.slf", &whole[..whole.len() - 1]);
    let mut changed = whole.clone();
    changed[whole.len() / 2] ^= 1;
    write("changed.slf", &changed);
    let mut newer = whole;
    newer[4] += 1;
    write("newer.slf", &newer);

    // Each file is refused, and no film is written.
    let film = |scene: &Path, file: &str, words: &[&str]| {
        let scene = scene.to_str().expect("a path in UTF-8");
        let arguments = ["render", scene, "--size", "32x32", "--frames", "1", "--lighting", "baked", "--baked", file];
        assert_fails(folder, &arguments, words);
        assert!(!folder.join("cornell-box.m2v").exists(), "nothing is written");
    };
    film(&still, "short.slf", &["short.slf", "bake"]);
    film(&still, "changed.slf", &["changed.slf", "bake"]);
    film(&still, "newer.slf", &["newer.slf", "version"]);
    film(&still, "none.slf", &["none.slf", "render2mpeg bake"]);
    film(&moving, "whole.slf", &["whole.slf", "another scene"]);
    let scene = still.to_str().expect("a path in UTF-8");
    assert_fails(folder, &["render", scene, "--baked", "whole.slf"], &["--lighting baked"]);
}
