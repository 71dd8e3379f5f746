//! Baked light: closed forms, walls, files, and films that look it up.

use glam::{Vec3, vec3};
use perceptual::psnr;
use pipeline::bake::{self, Bake};
use pipeline::{Options, Settings};
use render_core::scene::{Gradient, Instance, Material, Mesh, Node, Scene, Transform};
use render_core::{Environment, Surfaces, luminance};
use std::path::{Path, PathBuf};
use tests::{assert_fails, cornell, read_y4m, render, render2mpeg};

/// Parallelograms that face a × b, as one instance.
fn add(scene: &mut Scene, material: Material, faces: &[[Vec3; 3]]) {
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

/// The faces of a box, seen from outside.
fn outside(low: Vec3, high: Vec3) -> [[Vec3; 3]; 6] {
    let [x, y, z] = [Vec3::X, Vec3::Y, Vec3::Z].map(|axis| axis * (high - low));
    [[low, y, x], [low, x, z], [low, z, y], [high, -x, -y], [high, -z, -x], [high, -y, -z]]
}

/// The faces of a box, seen from within.
fn within(low: Vec3, high: Vec3) -> [[Vec3; 3]; 6] {
    outside(low, high).map(|[corner, a, b]| [corner, b, a])
}

fn empty_scene() -> Scene {
    let mut scene = Scene::default();
    scene.nodes.push(Node { name: String::new(), parent: None, rest: Transform::IDENTITY });
    scene
}

fn gray(albedo: f32) -> Material {
    Material { base_color: Vec3::splat(albedo), ..Material::default() }
}

fn baked(scene: &Scene, texels: usize) -> Bake {
    let options = Options { vpls: Some(1000), photons: Some(100_000), ..Options::default() };
    let settings = Settings::new("stage.glb".into(), scene, &options).expect("right settings");
    bake::bake(scene, &settings, texels, &|_, _| ()).expect("the scene can be baked")
}

/// A box under a sky of radiance L from everywhere is lit by half of it at each point: E = π L.
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

/// Two rooms with a wall of a centimeter between them, a lamp in one: none of its light gets into the other.
#[test]
fn a_thin_wall_keeps_light_in() {
    let mut scene = empty_scene();
    let (low, high) = (vec3(0.0, 0.0, 0.0), vec3(2.0, 2.0, 2.0));
    add(&mut scene, gray(0.7), &within(low, high));
    let beside = Vec3::X * 2.01;
    add(&mut scene, gray(0.7), &within(low + beside, high + beside));
    let lamp = Material { emission: Vec3::splat(20.0), ..gray(0.0) };
    add(&mut scene, lamp, &[[vec3(0.7, 1.9, 0.7), vec3(0.6, 0.0, 0.0), vec3(0.0, 0.0, 0.6)]]);
    let bake = baked(&scene, 6000);
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
    assert!(dark <= 0.01 * bright, "{dark} beside {bright}");
}

/// The shipped scene in which nothing moves but the camera.
fn cornell_box() -> PathBuf {
    PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../scenes/cornell-box/cornell-box.glb"))
}

/// Bakes `scene` into `folder/NAME.slf` with `extra` arguments, and gives its bytes.
fn bake_file(folder: &Path, scene: &Path, name: &str, extra: &str) -> Vec<u8> {
    let output = format!("{name}.slf");
    let mut arguments = vec!["bake", scene.to_str().expect("a path in UTF-8"), "-o", &output, "--quiet"];
    arguments.extend(extra.split_whitespace());
    let finished = render2mpeg(folder, &arguments);
    assert_eq!((finished.code, finished.stderr.as_str()), (Some(0), ""), "render2mpeg {arguments:?}");
    std::fs::read(folder.join(output)).expect("the baked light is there")
}

/// Where nothing moves, the film that looks its light up is that of cuts, nearly, and takes no photon for it.
#[test]
fn a_film_of_baked_light_looks_like_one_of_cuts() {
    let folder = tempfile::tempdir().unwrap();
    let (folder, scene) = (folder.path(), cornell_box());
    let slf = bake_file(folder, &scene, "box", "--texels 20000 --vpls 1000 --threads 2");
    assert!(
        slf == bake_file(folder, &scene, "again", "--texels 20000 --vpls 1000 --threads 1"),
        "any number of threads"
    );
    let film = |name: &str, more: &str| {
        let arguments = format!("--size 64x64 --frames 2 --vpls 1000 --y4m {name}.y4m {more}");
        let rendered = render(folder, name, &scene, &arguments);
        (rendered, read_y4m(&folder.join(format!("{name}.y4m")), (64, 64)))
    };
    let (_, cuts) = film("cuts", "");
    let (baked, looked_up) = film("baked", "--lighting baked --baked box.slf");
    for name in ["cache_records", "cache_new", "photons_traced"] {
        assert_eq!(baked.figures(&[name]), [0.0; 2], "{name}");
    }
    for (cuts, looked_up) in cuts.iter().zip(&looked_up) {
        let psnr = psnr(looked_up.luma(), cuts.luma());
        assert!(psnr > 36.0, "{psnr} dB");
    }
}

/// What moves is lit as usual, on surfaces that look their light up.
#[test]
fn things_that_move_are_lit_beside_baked_light() {
    let folder = tempfile::tempdir().unwrap();
    let (folder, scene) = (folder.path(), cornell());
    bake_file(folder, &scene, "cornell", "--texels 10000 --vpls 500");
    let film = |name: &str, more: &str| {
        let arguments = format!("--size 64x64 --frames 3 --vpls 500 --y4m {name}.y4m {more}");
        let rendered = render(folder, name, &scene, &arguments);
        (rendered, read_y4m(&folder.join(format!("{name}.y4m")), (64, 64)))
    };
    let (usual, cuts) = film("cuts", "");
    let (baked, looked_up) = film("baked", "--lighting baked --baked cornell.slf");
    let records = |film: &tests::Rendered| film.figures(&["cache_records"])[0];
    assert!(records(&baked) > 0.0 && records(&baked) < 0.5 * records(&usual), "records on what moves alone");
    for (cuts, looked_up) in cuts.iter().zip(&looked_up) {
        let psnr = psnr(looked_up.luma(), cuts.luma());
        // Walls and floor know nothing of the blocks: neither of the light that these reflect nor of what they hide.
        assert!(psnr > 28.0, "{psnr} dB");
    }
}

#[test]
fn bad_files_of_baked_light_are_told_in_one_line() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let (still, moving) = (cornell_box(), cornell());
    let whole = bake_file(folder, &still, "whole", "--texels 500 --vpls 100");
    let write = |name: &str, bytes: &[u8]| std::fs::write(folder.join(name), bytes).expect("a file");
    write("short.slf", &whole[..whole.len() - 1]);
    let mut changed = whole.clone();
    changed[whole.len() / 2] ^= 1;
    write("changed.slf", &changed);
    let mut newer = whole;
    newer[4] += 1;
    write("newer.slf", &newer);
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
