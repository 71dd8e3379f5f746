//! Light that surfaces with tilted shading normals reflect to other surfaces, compared with path tracing.

use super::bake::{add, gray};
use glam::{Quat, Vec3, vec3};
use pipeline::stage::{LastThresholds, Shade};
use render_core::scene::{Camera, Material, Node, Projection, Scene, Transform};
use render_core::{PathOptions, Still, path_traced};
use render2mpeg::{Options, Settings};
use renderer::plan::Plan;
use renderer::settings::SampleCount;
use renderer::{Preparation, Shading};
use std::f32::consts::PI;

/// Number of pixels along a side of a frame.
const SIDE: usize = 16;

/// Returns a lamp over a floor of strips whose shading normals have slopes of ±`slope` \[rad\]. The camera looks up at a
/// panel that faces the floor and not the lamp.
fn lit_floor(slope: f32) -> Scene {
    let mut scene = Scene::default();
    let up = Quat::from_rotation_x(PI / 2.0);
    for rest in [Transform::IDENTITY, Transform { translation: vec3(2.4, 0.1, 0.0), rotation: up, scale: Vec3::ONE }] {
        scene.nodes.push(Node { name: String::new(), parent: None, rest });
    }
    let projection = Projection::Perspective { yfov: 0.6 };
    scene.cameras.push(Camera { name: String::new(), node: 1, projection, ..Camera::default() });

    // Give each strip of the floor its own vertices, so that normals do not blend.
    let strips: Vec<[Vec3; 3]> =
        (0..16).map(|k| [vec3(-2.0 + 0.25 * k as f32, 0.0, -2.0), Vec3::Z * 4.0, Vec3::X * 0.25]).collect();
    add(&mut scene, gray(0.6), &strips);
    let normal = |strip: usize| {
        let (sine, cosine) = slope.sin_cos();
        vec3(if strip.is_multiple_of(2) { sine } else { -sine }, cosine, 0.0)
    };
    scene.meshes[0].normals = (0..4 * strips.len()).map(|vertex| normal(vertex / 4)).collect();
    // Add the panel, which faces down, and the lamp.
    add(&mut scene, gray(0.5), &[[vec3(1.9, 1.0, -0.5), Vec3::X, Vec3::Z]]);
    let lamp = Material { emission: Vec3::splat(20.0), ..gray(0.0) };
    add(&mut scene, lamp, &[[vec3(-0.25, 2.5, -0.25), Vec3::X * 0.5, Vec3::Z * 0.5]]);
    scene
}

/// Returns the mean radiance of the panel in a film without cache, and by path tracing.
fn panel(scene: &Scene) -> [f32; 2] {
    let size = format!("{SIDE}x{SIDE}").parse().ok();
    let options = Options {
        vpls: Some(2000),
        photons: Some(200_000),
        size,
        frames: Some(1),
        samples: Some(SampleCount::Each(1)),
        ..Options::default()
    };
    let mut settings = Settings::new("floor.glb".into(), scene, &options).expect("right settings").render;
    settings.cache = false;
    let plan = Plan::new(scene, &settings);
    let prepared = Preparation::new(scene, &settings, &plan).frame(0);
    let shaded = Shading::new(&settings, &plan).step(&prepared, LastThresholds::none());
    let still = Still { time: 0.0, width: SIDE, height: SIDE };
    let traced = path_traced(scene, still, &PathOptions { samples: 1024, ..PathOptions::default() }, |_, _| ()).mean;
    [shaded.radiance, traced].map(|picture| {
        let pixels = picture.samples().iter().map(|rgb| rgb[0]);
        pixels.sum::<f32>() / (SIDE * SIDE) as f32
    })
}

/// The light of tilted strips, relative to a flat floor. Steeper strips face away from much of the panel, and path
/// tracing bends their normals toward the panel.
#[test]
fn tilted_normals_reflect_the_light_that_they_receive() {
    let flat = panel(&lit_floor(0.0));
    assert!((flat[0] / flat[1] - 1.0).abs() < 0.02, "{flat:?}");
    for (degrees, most) in [(20f32, 0.985), (30.0, 0.94)] {
        let tilted = panel(&lit_floor(degrees.to_radians()));
        let [found, expected] = [tilted[0] / flat[0], tilted[1] / flat[1]];
        println!("{degrees}°: {found} for {expected}");
        assert!(expected < most, "{degrees}°: the slope does not matter");
        assert!((found / expected - 1.0).abs() < 0.01, "{degrees}°: {found} for {expected}");
    }
}
