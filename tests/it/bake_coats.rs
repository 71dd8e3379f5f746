//! Baked light of coats: a closed form, comparison with path tracing, and files.

use super::bake::{add, gray, outside, within};
use glam::{Quat, Vec3, vec3};
use pipeline::stage::{LastThresholds, Shade};
use plane::Plane;
use render_core::scene::{Camera, Gradient, Material, Node, Projection, Scene, Transform};
use render_core::{Environment, PathOptions, PixelSampling, Surfaces, luminance};
use render2mpeg::{Options, Settings};
use renderer::bake::{Bake, BakeRun};
use renderer::plan::Plan;
use renderer::reference::by_paths;
use renderer::settings::Lighting;
use renderer::{Preparation, Shading, bake};
use std::sync::Arc;

/// Returns an empty scene with a camera at `eye` that looks towards −z, tilted down by `tilt`.
pub(super) fn seen_from(eye: Vec3, tilt: f32) -> Scene {
    let mut scene = Scene::default();
    let turned = Transform { translation: eye, rotation: Quat::from_rotation_x(-tilt), scale: Vec3::ONE };
    for rest in [Transform::IDENTITY, turned] {
        scene.nodes.push(Node { name: String::new(), parent: None, rest });
    }
    scene.cameras.push(Camera {
        name: String::new(),
        node: 1,
        projection: Projection::Perspective { yfov: 0.9 },
        ..Camera::default()
    });
    scene
}

pub(super) fn metal(color: Vec3, roughness: f32) -> Material {
    Material { base_color: color, metallic: 1.0, roughness, ..Material::default() }
}

pub(super) fn settings(scene: &Scene, side: usize) -> Settings {
    let size = format!("{side}x{side}").parse().ok();
    let options = Options { size, frames: Some(1), vpls: Some(2000), photons: Some(200_000), ..Options::default() };
    Settings::new("room.glb".into(), scene, &options).expect("right settings")
}

pub(super) fn baked(scene: &Scene, texels: usize) -> Bake {
    bake::bake(scene, &settings(scene, 16).render, texels, &BakeRun::alone(), &|_, _| ())
        .expect("the scene can be baked")
        .expect("it was not stopped")
}

/// Under a uniform sky of radiance L, the mean radiance reflected by a coat is L in every direction, for every lobe.
#[test]
fn a_coat_under_an_even_sky_shows_it_in_every_direction() {
    for (roughness, side) in [(0.36, 24), (0.5, 16), (0.8, 6)] {
        let mut scene = seen_from(vec3(0.0, 1.0, 3.0), 0.4);
        let floor = [vec3(-1.0, 0.0, -1.0), vec3(0.0, 0.0, 2.0), vec3(2.0, 0.0, 0.0)];
        add(&mut scene, metal(vec3(0.9, 0.6, 0.3), roughness), &[floor]);
        scene.sky = Environment::gradient(Gradient::constant([3.0; 3]));
        let Bake { texels, .. } = baked(&scene, 200);
        let coats = &texels.coats;
        assert_eq!((coats.texels(), coats.samples()), (texels.atlas.len(), texels.atlas.len() * side * side));
        for texel in 0..texels.atlas.len() {
            for mirrored in [vec3(0.0, 1.0, 0.0), vec3(0.6, 0.8, 0.0), vec3(-0.6, 0.1, 0.8), vec3(0.0, 0.0, -1.0)] {
                let light = coats.mean_radiance(texel, mirrored).expect("a coat");
                // Codes are off by at most 2 and a rounding: 2^(2.5/256) − 1 of the light and of L₀, a 64th of the mean.
                assert!((light / 3.0 - 1.0).abs().max_element() < 0.008, "{light} towards {mirrored}, {roughness}");
            }
        }
    }
}

/// Only texels of rough coats have directions; texels of matte surfaces and smooth coats have none.
#[test]
fn only_rough_coats_have_directions() {
    let mut scene = seen_from(vec3(0.0, 1.0, 3.0), 0.4);
    for (place, material) in [gray(0.5), metal(Vec3::ONE, 0.3), metal(Vec3::ONE, 0.4)].into_iter().enumerate() {
        let corner = vec3(3.0 * place as f32, 0.0, -1.0);
        add(&mut scene, material, &[[corner, vec3(0.0, 0.0, 2.0), vec3(2.0, 0.0, 0.0)]]);
    }
    scene.sky = Environment::gradient(Gradient::constant([1.0; 3]));
    let Bake { texels, .. } = baked(&scene, 600);
    let pose = scene.pose(0.0);
    let surfaces = Surfaces::new(&scene, &pose);
    for texel in 0..texels.atlas.len() {
        let instance = texels.atlas.sites(texel, &surfaces)[0].instance;
        let has_directions = texels.coats.mean_radiance(texel, Vec3::Y).is_some();
        assert_eq!(has_directions, instance == 2, "texel {texel} of instance {instance}");
    }
}

/// Returns a room with a glossy floor (instance 1) and a metal block (instance 2).
pub(super) fn coated_room() -> Scene {
    let mut scene = seen_from(vec3(1.0, 1.1, 3.6), 0.1);
    let (low, high) = (Vec3::ZERO, vec3(2.0, 2.0, 2.0));
    // The room is open towards the viewer; its floor is a separate instance.
    let mut walls = within(low, high).to_vec();
    walls.retain(|[_, a, b]| a.cross(*b).normalize().z > -0.5 && a.cross(*b).normalize().y < 0.5);
    add(&mut scene, gray(0.7), &walls);
    let floor = Material { base_color: Vec3::splat(0.7), roughness: 0.5, ..Material::default() };
    add(&mut scene, floor, &[[low, vec3(0.0, 0.0, 2.0), vec3(2.0, 0.0, 0.0)]]);
    add(&mut scene, metal(vec3(0.9, 0.75, 0.5), 0.4), &outside(vec3(0.9, 0.0, 0.6), vec3(1.5, 0.6, 1.2)));
    let lamp = Material { emission: Vec3::splat(15.0), ..gray(0.0) };
    add(&mut scene, lamp, &[[vec3(0.7, 1.99, 0.7), vec3(0.6, 0.0, 0.0), vec3(0.0, 0.0, 0.6)]]);
    scene
}

/// A frame with baked light in all rough coats is as bright as path tracing, and closer to it than with live coats.
#[test]
fn coats_that_look_their_light_up_are_those_of_paths() {
    const SIDE: usize = 64;
    // A frame with live and with baked coats, and a path-traced one.
    let scene = coated_room();
    let settings = settings(&scene, SIDE);
    let light = Arc::new(baked(&scene, 6000).texels);
    let frame = |lighting: Lighting| {
        let renderer = renderer::settings::RenderSettings { lighting, ..settings.render.clone() };
        let plan = Plan::new(&scene, &renderer);
        let prepared = Preparation::new(&scene, &renderer, &plan).frame(0);
        let shading = Shading::new(&renderer, &plan);
        let mut shading = if lighting.is_baked() { shading.with_baked(light.clone()) } else { shading };
        (shading.step(&prepared, LastThresholds::none()).radiance, prepared.frame.seen)
    };
    let ((live, _), (looked_up, seen)) = (frame(Lighting::Lightcuts), frame(Lighting::Baked));
    let options = PathOptions { samples: 256, seed: 1, max_bounces: None, pixel: PixelSampling::Area };
    let paths = by_paths(&scene, &settings.render, 0, &options, |_, _| ()).radiance;

    // Only pixels surrounded by the same surface.
    let of = |picture: &Plane<[f32; 3]>, x, y| f64::from(luminance(picture.get(x, y).into()));
    for (instance, name) in [(1, "the floor"), (2, "the metal")] {
        let (mut sums, mut errors, mut count) = ([0.0; 2], [0.0; 2], 0);
        for (y, x) in (1..SIDE - 1).flat_map(|y| (1..SIDE - 1).map(move |x| (y, x))) {
            let around = [(x, y), (x - 1, y), (x + 1, y), (x, y - 1), (x, y + 1)];
            if around.iter().any(|&(x, y)| seen.pixels.get(x, y).instance != instance) {
                continue;
            }
            let (truth, found) = (of(&paths, x, y), [of(&looked_up, x, y), of(&live, x, y)]);
            sums = [sums[0] + truth, sums[1] + found[0]];
            for (error, found) in errors.iter_mut().zip(found) {
                *error += ((found - truth) / (truth + 0.01)).powi(2);
            }
            count += 1;
        }
        let (mean, [looked_up, live]) = (sums[1] / sums[0] - 1.0, errors.map(|error| error / f64::from(count)));
        println!(
            "{name}, {count} pixels: {:+.2} % in the mean, relative MSE {looked_up:.1e}, live {live:.1e}",
            100.0 * mean
        );
        assert!(count > 100 && mean.abs() < 0.015, "{name}: {mean}");
        assert!(looked_up < live, "{name}: {looked_up}, live {live}");
    }
}
