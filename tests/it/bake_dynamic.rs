//! Films with baked light of scenes in which something moves, against closed forms, and normals of texels.

use crate::bake::{add, gray};
use glam::{Quat, Vec2, Vec3, vec3};
use pipeline::stage::{LastThresholds, Shade};
use render_core::scene::{
    Camera, Channel, Encoding, Gradient, Interpolation, Material, Node, Projection, Scene, Texture, TextureSlot, Track,
    Transform, Wrap,
};
use render_core::{Environment, Surfaces};
use render2mpeg::{Options, Settings};
use renderer::bake::{BakeRun, bake};
use renderer::plan::Plan;
use renderer::settings::{Lighting, RenderSettings};
use renderer::texels::BakedTexels;
use renderer::{Preparation, Shading};
use std::f32::consts::PI;
use std::sync::Arc;

/// Number of pixels along a side of a frame.
const SIDE: usize = 32;
/// Radiance of the sky \[W·m⁻²·sr⁻¹\].
const SKY: f32 = 2.0;

/// Returns a scene under a uniform sky, seen by a camera 0.4 m above the origin that looks down. Node 2 moves.
fn under_a_sky() -> Scene {
    let mut scene = Scene::default();
    let down =
        Transform { translation: vec3(0.0, 0.4, 0.0), rotation: Quat::from_rotation_x(-PI / 2.0), scale: Vec3::ONE };
    for rest in [Transform::IDENTITY, down, Transform::IDENTITY] {
        scene.nodes.push(Node { name: String::new(), parent: None, rest });
    }
    let projection = Projection::Perspective { yfov: 0.6 };
    scene.cameras.push(Camera { name: String::new(), node: 1, projection, ..Camera::default() });
    scene.sky = Environment::gradient(Gradient::constant([SKY; 3]));
    scene
}

/// Bakes the light of a scene, and returns it with the settings of a film.
fn baked(scene: &Scene, texels: usize) -> (Arc<BakedTexels>, RenderSettings) {
    let size = format!("{SIDE}x{SIDE}").parse().ok();
    let options = Options { vpls: Some(1000), photons: Some(50_000), size, frames: Some(2), ..Options::default() };
    let settings = Settings::new("stage.glb".into(), scene, &options).expect("right settings").render;
    let bake = bake(scene, &settings, texels, &BakeRun::alone(), &|_, _| ()).expect("the scene can be baked");
    (Arc::new(bake.expect("it was not stopped").texels), RenderSettings { lighting: Lighting::Baked, ..settings })
}

/// Returns the form factor of a square of side 2 `half` at `height` over a point, parallel to the plane of the point.
/// The point is below the middle of the square.
fn form_factor_of_square(half: f32, height: f32) -> f32 {
    // Sum four rectangles with a corner over the point (Howell, configuration C-14).
    let x = half / height;
    let root = (1.0 + x * x).sqrt();
    4.0 * (2.0 * x / root * (x / root).atan()) / (2.0 * PI)
}

/// A black plate that moves over a floor hides a part of the sky: E = π L (1 − F), with the form factor F of the plate.
#[test]
fn a_plate_hides_the_sky_from_a_baked_floor() {
    for height in [0.5, 1.0, 3.0] {
        let mut scene = under_a_sky();
        let square = |half: f32, y: f32| [vec3(-half, y, -half), Vec3::Z * 2.0 * half, Vec3::X * 2.0 * half];
        add(&mut scene, gray(0.5), &[square(20.0, 0.0)]);
        let [corner, a, b] = square(1.0, height);
        add(&mut scene, gray(0.0), &[[corner, b, a]]);
        scene.instances[1].node = 2;
        scene.channels.push(Channel {
            node: 2,
            times: vec![0.0, 1.0],
            track: Track::Translation(vec![Vec3::ZERO, Vec3::X]),
            interpolation: Interpolation::Linear,
        });
        let (light, settings) = baked(&scene, 4000);
        let plan = Plan::new(&scene, &settings);
        let prepared = Preparation::new(&scene, &settings, &plan).frame(0);
        let mut shading = Shading::new(&settings, &plan).with_baked(light);
        let shaded = shading.step(&prepared, LastThresholds::none());

        let (x, y) = (SIDE / 2, SIDE / 2);
        let pixel = prepared.frame.seen.pixels.get(x, y);
        assert_eq!(pixel.instance, 0, "the camera sees the floor");
        let found = shaded.radiance.get(x, y)[0] * PI / 0.5;
        let expected = PI * SKY * (1.0 - form_factor_of_square(1.0, height));
        println!("{height} m: {found} in place of {expected}");
        assert!((found - expected).abs() < 0.02 * PI * SKY, "{height} m: {found} in place of {expected}");
    }
}

/// Returns a floor with a map of ridges, whose sides have slopes of ±30°.
fn ridged_floor() -> Scene {
    let mut scene = under_a_sky();
    let (sine, cosine) = 30f32.to_radians().sin_cos();
    let code = |value: f32| ((0.5 + 0.5 * value) * 255.0).round() as u8;
    let texel = |column: usize| {
        let x = if column % 4 < 2 { sine } else { -sine };
        [code(x), code(0.0), code(cosine), 255]
    };
    let texels = (0..16 * 16).map(|place| texel(place % 16)).collect();
    scene.textures.push(Texture::with_encoding(16, 16, texels, [Wrap::Repeat; 2], Encoding::Normal));
    let slot = TextureSlot { texture: 0, uv_set: 0, transform: None };
    let material = Material { normal_texture: Some((slot, 1.0)), ..gray(0.5) };
    add(&mut scene, material, &[[vec3(-10.0, 0.0, -10.0), Vec3::Z * 20.0, Vec3::X * 20.0]]);
    scene.meshes[0].uvs[0] = [Vec2::ZERO, Vec2::Y, Vec2::ONE, Vec2::X].map(|uv| uv * 40.0).to_vec();
    scene
}

/// Texels of a normal map have the irradiance of each normal under a uniform sky, E = π L (1 + cos θ) / 2.
#[test]
fn texels_of_normal_maps_have_light_by_normal() {
    let scene = ridged_floor();
    let (light, _) = baked(&scene, 500);
    let pose = scene.pose(0.0);
    let surfaces = Surfaces::new(&scene, &pose);
    assert_eq!(light.normals.len(), light.atlas.len(), "every texel has a normal map");
    let (mut sum, mut count) = (0.0, 0.0);
    for texel in 0..light.atlas.len() {
        let site = light.atlas.sites(texel, &surfaces)[0];
        assert!(site.position.y.abs() < 1e-3);
        for degrees in [-30.0f32, 0.0, 30.0] {
            let (sine, cosine) = degrees.to_radians().sin_cos();
            let found = light.normals.irradiance(texel as u32, vec3(sine, cosine, 0.0).into()).expect("a normal map").x;
            let expected = PI * SKY * (1.0 + cosine) / 2.0;
            assert!((found / expected - 1.0).abs() < 0.02, "{found} in place of {expected} at {degrees}°");
            (sum, count) = (sum + found / expected, count + 1.0);
        }
    }
    let mean: f32 = sum / count;
    assert!((mean - 1.0).abs() < 0.005, "{mean}");
}

/// Between two plates, texels are reliable if they are at most half as wide as the harmonic mean distance of their
/// surroundings, 3/2 of the distance of the plates.
#[test]
fn texels_wider_than_a_gap_are_not_reliable() {
    let mut scene = under_a_sky();
    let gap = 1.0;
    add(&mut scene, gray(0.5), &[[vec3(-20.0, 0.0, -20.0), Vec3::Z * 40.0, Vec3::X * 40.0]]);
    add(&mut scene, gray(0.5), &[[vec3(-20.0, gap, -20.0), Vec3::X * 40.0, Vec3::Z * 40.0]]);
    for (texels, is_reliable) in [(2_000, false), (10_000, true)] {
        let (light, _) = baked(&scene, texels);
        let width = 1.0 / light.atlas.texels_per_meter();
        assert_eq!(width <= 0.75 * gap, is_reliable, "texels of {width} m");
        let pose = scene.pose(0.0);
        let surfaces = Surfaces::new(&scene, &pose);
        let mut wrong = 0;
        for texel in 0..light.atlas.len() {
            // Skip the borders, which are near the open sides.
            let place = light.atlas.sites(texel, &surfaces)[0].position;
            let is_inner = place.x.abs().max(place.z.abs()) < 10.0;
            wrong += usize::from(is_inner && light.is_reliable[texel] != is_reliable);
        }
        assert_eq!(wrong, 0, "texels of {width} m");
    }
}
