//! Outlines of one shaded sample a pixel against pictures of many.

use crate::common::{add, quad, rest};
use glam::{Affine3A, Quat, Vec2, Vec3, vec3};
use plane::Plane;
use render_core::scene::{Material, Projection, Scene, View};
use render_core::{Coverage, GBuffer, Geometry, PixelSample, PosedScene, Surfaces, sample_offsets};

const SIZE: usize = 96;

/// Cards of even colors at different depths and angles, which glow without being lit.
fn cards() -> Scene {
    let mut scene = Scene::default();
    for k in 0..7 {
        let color = vec3(0.2 + 0.1 * k as f32, 0.9 - 0.1 * k as f32, 0.5);
        let flat = Material { base_color: color, unlit: true, double_sided: true, ..Material::default() };
        let turn = Quat::from_euler(glam::EulerRot::ZXY, 0.7 * k as f32, 0.3 * k as f32, 0.2);
        let place = vec3((k % 3) as f32 - 1.0, (k / 3) as f32 - 1.0, -4.0 - 0.3 * k as f32);
        let mesh = quad(turn * vec3(-0.6, -0.4, 0.0), turn * Vec3::X * 1.2, turn * Vec3::Y * 0.8);
        add(&mut scene, rest(place), mesh, flat);
    }
    scene
}

fn colors(seen: &GBuffer) -> Plane<Vec3> {
    seen.pixels.map(|pixel| Vec3::from(pixel.emission))
}

/// The mean over 256 rays of each pixel is what a pixel shows. Blended outlines have less than a tenth of the squared error of
/// centers, and pixels without an outline are untouched.
#[test]
fn blended_outlines_are_those_of_many_samples() {
    let scene = cards();
    let pose = scene.pose(0.0);
    let (surfaces, accelerator) = (Surfaces::new(&scene, &pose), Geometry::new(&scene).place(&pose));
    let scene = PosedScene::new(&accelerator, &surfaces);
    for projection in [Projection::Perspective { yfov: 0.9 }, Projection::Orthographic { ymag: 1.7 }] {
        let view = View::new(Affine3A::IDENTITY, projection, SIZE, SIZE);
        let seen = GBuffer::trace(scene, &view, (SIZE, SIZE)).value;
        let centers = colors(&seen);
        let coverage = Coverage::of(&seen, scene).value;
        let blended = coverage.blend(&centers).value;
        let mut truth = Plane::filled(SIZE, SIZE, Vec3::ZERO);
        let offsets: Vec<Vec2> = sample_offsets(256);
        for &offset in &offsets {
            let sample = GBuffer::trace_at(PixelSample::one_of(256, offset), scene, &view, (SIZE, SIZE)).value;
            let colors = colors(&sample);
            truth.samples_mut().iter_mut().zip(colors.samples()).for_each(|(sum, &color)| *sum += color / 256.0);
        }
        let error = |picture: &Plane<Vec3>| -> f32 {
            picture.samples().iter().zip(truth.samples()).map(|(a, b)| a.distance_squared(*b)).sum()
        };
        let (before, after) = (error(&centers), error(&blended));
        println!(
            "{projection:?}: squared error {before} of centers, {after} blended, {} mixed",
            coverage.mixed_pixels()
        );
        assert!(after < 0.1 * before, "{after} of {before}");
        let touched = blended.samples().iter().zip(centers.samples()).filter(|(a, b)| a != b).count();
        assert!(touched <= coverage.mixed_pixels() && coverage.mixed_pixels() < SIZE * SIZE / 4);
    }
}

/// A picture of one surface has no mixed pixels, however slanted the surface is.
#[test]
fn a_plane_has_no_mixed_pixels() {
    let mut scene = Scene::default();
    let floor = quad(vec3(-500.0, -1.0, 500.0), Vec3::X * 1000.0, Vec3::NEG_Z * 1000.0);
    let white = Material { unlit: true, double_sided: true, ..Material::default() };
    add(&mut scene, rest(Vec3::ZERO), floor, white);
    let pose = scene.pose(0.0);
    let (surfaces, accelerator) = (Surfaces::new(&scene, &pose), Geometry::new(&scene).place(&pose));
    let scene = PosedScene::new(&accelerator, &surfaces);
    let down = Affine3A::from_rotation_x(-0.8);
    let view = View::new(down, Projection::Perspective { yfov: 0.9 }, SIZE, SIZE);
    let seen = GBuffer::trace(scene, &view, (SIZE, SIZE)).value;
    assert_eq!(Coverage::of(&seen, scene).value, Coverage::default());
}
