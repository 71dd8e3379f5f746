//! Tests that compare the path tracer with closed forms.

use crate::common::{add, material, quad, rest, room};
use glam::{Quat, Vec3, vec3};
use plane::Plane;
use render_core::scene::{
    Camera, Gradient, Material, Mesh, Node, Projection, PunctualKind, PunctualLight, Scene, Transform,
};
use render_core::{
    Environment, GBuffer, Geometry, PathEstimate, PathOptions, PixelSampling, PosedScene, Still, Surfaces, path_traced,
};
use std::f32::consts::FRAC_PI_2;

fn level() -> Transform {
    askew(Vec3::ZERO, Quat::IDENTITY)
}

/// Adds a camera at `position` that looks along −z of the `rotation`.
fn film(scene: &mut Scene, position: Vec3, rotation: Quat, projection: Projection) {
    scene.nodes.push(Node { name: String::new(), parent: None, rest: askew(position, rotation) });
    scene.cameras = vec![Camera { name: String::new(), node: scene.nodes.len() - 1, projection, ..Camera::default() }];
}

fn render(scene: &Scene, size: usize, options: PathOptions) -> PathEstimate {
    path_traced(scene, Still { time: 0.0, width: size, height: size }, &options, |_, _| ())
}

fn mean(plane: &Plane<[f32; 3]>) -> Vec3 {
    plane.samples().iter().map(|&c| Vec3::from(c)).sum::<Vec3>() / plane.samples().len() as f32
}

/// Returns the standard error of the mean over a picture.
fn standard_error(estimate: &PathEstimate) -> Vec3 {
    let count = estimate.variance_of_mean.samples().len() as f32;
    (mean(&estimate.variance_of_mean) / count).map(f32::sqrt)
}

const DOWN: f32 = -FRAC_PI_2;

/// Returns a tilted frame of reference, so that no ray runs along an axis by chance.
fn askew(position: Vec3, rotation: Quat) -> Transform {
    let turn = Quat::from_euler(glam::EulerRot::XYZ, 0.3, 0.5, 0.7);
    Transform { rotation: turn * rotation, ..rest(turn * position) }
}

/// In a closed room of albedo ρ with walls that emit Lₑ, radiance is Lₑ/(1 − ρ) everywhere.
#[test]
fn a_furnace_shines_as_the_geometric_series_says() {
    for albedo in [0.2f32, 0.5, 0.8, 0.95] {
        let mut scene = Scene::default();
        let emission = vec3(1.0, 2.0, 0.5);
        add(&mut scene, level(), room(), material(Vec3::splat(albedo), emission));
        film(&mut scene, vec3(0.1, 0.2, 0.3), Quat::from_rotation_y(0.4), Projection::Perspective { yfov: 1.5 });
        let estimate = render(&scene, 16, PathOptions { samples: 64, ..PathOptions::default() });
        let ratio = mean(&estimate.mean) / (emission / (1.0 - albedo));
        let error = standard_error(&estimate) / (emission / (1.0 - albedo));
        println!("albedo {albedo}: {ratio} ± {error}");
        assert!((ratio - Vec3::ONE).abs().max_element() < 0.01, "albedo {albedo}: {ratio}");
    }
}

/// Returns the form factor between two unit squares that face each other at distance `h` (Howell's catalog, C-11).
fn parallel_form_factor(h: f64) -> f64 {
    let x = 1.0 / h;
    let a = 1.0 + x * x;
    let root = a.sqrt();
    2.0 / (std::f64::consts::PI * x * x)
        * ((a * a / (1.0 + 2.0 * x * x)).ln() / 2.0 + 2.0 * x * root * (x / root).atan() - 2.0 * x * x.atan())
}

/// Returns the form factor between two unit squares at right angles with a common edge (Howell's catalog, C-14
/// with H = W = 1).
fn perpendicular_form_factor() -> f64 {
    let root = 2f64.sqrt();
    (2.0 * 1f64.atan() - root * (1.0 / root).atan() + 0.25 * (4.0f64 / 3.0 * (3.0 / 4.0) * (3.0 / 4.0)).ln())
        / std::f64::consts::PI
}

/// Seen from directly above, the radiance of a white square lit by another square shows their form factor.
#[test]
fn squares_light_each_other_as_their_form_factors_say() {
    let floor = || quad(Vec3::ZERO, Vec3::Z, Vec3::X);
    let ceiling = |h: f32| quad(Vec3::Y * h, Vec3::X, Vec3::Z);
    let wall = quad(Vec3::ZERO, Vec3::Y, Vec3::Z);
    let cases = [
        (ceiling(1.0), parallel_form_factor(1.0)),
        (ceiling(0.5), parallel_form_factor(0.5)),
        (wall, perpendicular_form_factor()),
    ];
    for (lamp, expected) in cases {
        let mut scene = Scene::default();
        add(&mut scene, level(), floor(), material(Vec3::ONE, Vec3::ZERO));
        add(&mut scene, level(), lamp, material(Vec3::ZERO, Vec3::ONE));
        let ymag = Projection::Orthographic { ymag: 0.5 };
        film(&mut scene, vec3(0.5, 0.25, 0.5), Quat::from_rotation_x(DOWN), ymag);
        let estimate = render(&scene, 16, PathOptions { samples: 256, ..PathOptions::default() });
        let found = f64::from(mean(&estimate.mean).x);
        println!("{found} for {expected} ± {}", standard_error(&estimate).x);
        assert!((found / expected - 1.0).abs() < 0.005, "{found} instead of {expected}");
    }
}

/// Under a uniform sky, a surface without loss is indistinguishable from the sky, matte or glossy.
#[test]
fn white_things_vanish_in_a_white_sky() {
    for (base_color, metallic, roughness) in [(1.0, 0.0, 1.0), (1.0, 1.0, 0.3), (1.0, 0.0, 0.2), (1.0, 1.0, 0.05)] {
        let mut scene = Scene { sky: Environment::gradient(Gradient::constant([2.0; 3])), ..Scene::default() };
        let coated = Material { metallic, roughness, base_color: Vec3::splat(base_color), ..Material::default() };
        add(&mut scene, level(), quad(vec3(-1.0, 0.0, -1.0), Vec3::Z * 2.0, Vec3::X * 2.0), coated);
        let rotation = Quat::from_rotation_x(-0.5);
        film(&mut scene, vec3(0.0, 0.6, 1.2), rotation, Projection::Perspective { yfov: 0.8 });
        let estimate = render(&scene, 16, PathOptions { samples: 256, ..PathOptions::default() });
        let found = mean(&estimate.mean).x;
        println!("metallic {metallic}, roughness {roughness}: {found} ± {}", standard_error(&estimate).x);
        assert!((found / 2.0 - 1.0).abs() < 0.01, "metallic {metallic}, roughness {roughness}: {found}");
    }
}

/// A panel spans 60°. It is sampled by its own points and by rays from the surface. A mirror shows the panel's radiance, and
/// any mixture of both strategies has the same result.
#[test]
fn a_glossy_floor_shows_the_lamp() {
    for roughness in [0.02, 0.1] {
        let mut scene = Scene::default();
        let mirror = Material { metallic: 1.0, roughness, base_color: Vec3::splat(0.5), ..Material::default() };
        add(&mut scene, level(), quad(vec3(-1.0, 0.0, -1.0), Vec3::Z * 2.0, Vec3::X * 2.0), mirror);
        let lamp = quad(vec3(-4.0, 4.0, -4.0), Vec3::X * 8.0, Vec3::Z * 8.0);
        add(&mut scene, level(), lamp, material(Vec3::ZERO, Vec3::splat(3.0)));
        let ymag = Projection::Orthographic { ymag: 0.2 };
        film(&mut scene, vec3(0.0, 0.5, 0.0), Quat::from_rotation_x(DOWN), ymag);
        let estimate = render(&scene, 16, PathOptions { samples: 64, ..PathOptions::default() });
        let (found, error) = (mean(&estimate.mean).x, standard_error(&estimate).x);
        println!("roughness {roughness}: {found} ± {error}");
        assert!((found / 1.5 - 1.0).abs() < 0.01, "roughness {roughness}: {found}");
    }
}

fn lamp_lit_room(scale: f32) -> Scene {
    let mut scene = Scene::default();
    let mut walls = room();
    walls.positions.iter_mut().for_each(|p| *p *= scale);
    add(&mut scene, level(), walls, material(vec3(0.7, 0.5, 0.3), Vec3::ZERO));
    let panel: Mesh = quad(vec3(-0.3, 0.9, -0.3) * scale, Vec3::X * 0.6 * scale, Vec3::Z * 0.6 * scale);
    add(&mut scene, level(), panel, material(Vec3::ZERO, Vec3::splat(4.0)));
    scene.nodes.push(Node {
        name: String::new(),
        parent: None,
        rest: askew(vec3(-0.4, -0.3, 0.2) * scale, Quat::IDENTITY),
    });
    let color = Vec3::splat(scale * scale);
    scene.punctual_lights = vec![PunctualLight { node: scene.nodes.len() - 1, color, kind: PunctualKind::Point }];
    film(&mut scene, vec3(0.0, 0.1, 0.8) * scale, Quat::IDENTITY, Projection::Perspective { yfov: 1.7 });
    scene
}

#[test]
fn half_the_size_is_the_same_picture() {
    let options = PathOptions { samples: 16, ..PathOptions::default() };
    let (whole, half) = (render(&lamp_lit_room(1.0), 16, options), render(&lamp_lit_room(0.5), 16, options));
    assert!(mean(&whole.mean).min_element() > 0.0);
    for (a, b) in whole.mean.samples().iter().zip(half.mean.samples()) {
        let (a, b) = (Vec3::from(*a), Vec3::from(*b));
        assert!((a - b).abs().max_element() <= 1e-4 * a.max_element(), "{a} and {b}");
    }
}

#[test]
fn threads_do_not_change_a_bit_and_seeds_do() {
    let scene = lamp_lit_room(1.0);
    let with = |threads, seed| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| render(&scene, 40, PathOptions { samples: 5, seed, ..PathOptions::default() }))
    };
    let one = with(1, 1);
    assert_eq!(one, with(3, 1));
    assert_ne!(one.mean, with(3, 2).mean);
}

/// The spread over seeds matches the estimated variance. Otherwise, comparisons based on the variance would be
/// meaningless.
#[test]
fn the_variance_is_that_of_the_mean() {
    let scene = lamp_lit_room(1.0);
    let runs: Vec<PathEstimate> =
        (0..24).map(|seed| render(&scene, 12, PathOptions { samples: 32, seed, ..PathOptions::default() })).collect();
    let pixels = 12 * 12;
    let (mut told, mut found) = (0.0f64, 0.0f64);
    for pixel in 0..pixels {
        let values: Vec<f64> = runs.iter().map(|run| f64::from(run.mean.samples()[pixel][1])).collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        found += values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (values.len() - 1) as f64;
        told +=
            runs.iter().map(|run| f64::from(run.variance_of_mean.samples()[pixel][1])).sum::<f64>() / runs.len() as f64;
    }
    println!("variance estimated {told}, found {found}");
    assert!((told / found - 1.0).abs() < 0.15, "estimated {told}, found {found}");
}

#[test]
fn without_bounces_from_pixel_centers_it_is_what_primary_rays_see() {
    let scene = lamp_lit_room(1.0);
    let options = PathOptions { samples: 1, max_bounces: Some(0), pixel: PixelSampling::Center, seed: 1 };
    let estimate = render(&scene, 40, options);
    let pose = scene.pose(0.0);
    let view = scene.view(&pose, 40, 40);
    let accelerator = Geometry::new(&scene).place(&pose);
    let seen = GBuffer::trace(PosedScene::new(&accelerator, &Surfaces::new(&scene, &pose)), &view, (40, 40)).value;
    assert_eq!(estimate.mean, seen.pixels.map(|pixel| pixel.emission));
    assert!(mean(&estimate.mean).x > 0.0, "the lamp is in the picture");
    assert_eq!(estimate.variance_of_mean, Plane::filled(40, 40, [0.0; 3]));
}
