//! Tests that compare outlines from one shaded sample per pixel with pictures of many samples.

use crate::common::{add, quad, rest};
use glam::{Affine3A, Quat, Vec2, Vec3, vec3};
use plane::Plane;
use render_core::scene::{Gradient, Material, Projection, Scene, View};
use render_core::{
    Coverage, Environment, GBuffer, Geometry, NOTHING, PixelSample, PixelSurface, PosedScene, Surfaces, luminance,
    sample_offsets,
};

const SIZE: usize = 96;

/// Builds unlit cards of uniform colors, at different depths and angles.
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

/// Blended outlines are compared with the mean over 256 rays per pixel. Their squared error is less than a tenth of the
/// centers' error, and pixels without an outline stay unchanged.
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
        let coverage = Coverage::of(&seen, scene, &centers).value;
        let blended = coverage.blend(&centers);
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

/// A picture of one surface has no mixed pixels, regardless of the surface's slant.
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
    // Light has no effect, since only other surfaces are searched.
    let light = Plane::from_fn(SIZE, SIZE, |x, y| Vec3::splat((x ^ y) as f32));
    assert_eq!(Coverage::of(&seen, scene, &light).value, Coverage::default());
}

/// Brightness of the sky, relative to the bars in front of it.
const BRIGHTER: f32 = 50.0;

/// Builds window bars in front of the sky, 0.25 to 1 pixel wide, and a wall with slanted moldings in different
/// orientations.
fn window() -> Scene {
    let mut scene = Scene { sky: Environment::gradient(Gradient::constant([2.0; 3])), ..Scene::default() };
    let even = |albedo: f32| Material { base_color: Vec3::splat(albedo), double_sided: true, ..Material::default() };
    let pixel = 2.0 * 5.0 * (0.5 * YFOV).tan() / SIZE as f32;
    // Add a strip `width` pixels wide around a position, rotated in the picture, then about the strip's own axis.
    let mut strip = |(x, y): (f32, f32), width: f32, turn: f32, tilt: f32, albedo: f32| {
        let turn = Quat::from_rotation_z(turn) * Quat::from_rotation_y(tilt);
        let (across, along) = (turn * Vec3::X * width * pixel, turn * Vec3::Y * 2.0);
        add(&mut scene, rest(vec3(x, y, -5.0)), quad(-0.5 * (across + along), across, along), even(albedo));
    };
    for (k, width) in [0.25, 0.5, 0.75, 1.0].into_iter().enumerate() {
        let dark = 2.0 / BRIGHTER;
        strip((0.5 * k as f32 - 1.7, 1.1), width, 0.03 + 0.02 * k as f32, 0.0, dark);
        strip((1.2, 0.5 + 0.4 * k as f32), width, 1.5 + 0.1 * k as f32, 0.0, dark);
        strip((0.9 * k as f32 - 1.4, -1.3), 2.0 * width, 0.3 + 0.35 * k as f32, 0.7, 0.5);
    }
    let wall = quad(vec3(-3.0, -3.0, -5.3), Vec3::X * 6.0, Vec3::Y * 3.1);
    add(&mut scene, rest(Vec3::ZERO), wall, even(0.5));
    scene
}

const YFOV: f32 = 0.9;

/// Returns light that depends only on the surface: light from one direction without shadows.
fn lit(seen: &GBuffer) -> Plane<Vec3> {
    seen.pixels.map(|pixel| {
        let facing = Vec3::from(pixel.shading_normal).dot(vec3(0.6, 0.6, 0.5)).max(0.0);
        Vec3::from(pixel.emission) + Vec3::from(pixel.albedo) * (0.1 + 0.9 * facing)
    })
}

/// Returns displayed light: white is 1, and brighter light is clipped to white.
fn shown(light: Vec3) -> Vec3 {
    light.clamp(Vec3::ZERO, Vec3::ONE)
}

/// Returns the luma PSNR with the transfer curve of sRGB \[dB\].
fn psnr(picture: &Plane<Vec3>, truth: &Plane<Vec3>) -> f32 {
    let transfer = |v: f32| if v <= 0.003_130_8 { 12.92 * v } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 };
    let luma = |rgb: Vec3| luminance(rgb.to_array().map(transfer).into());
    let errors = picture.samples().iter().zip(truth.samples()).map(|(a, b)| (luma(*a) - luma(*b)).powi(2));
    -10.0 * (errors.sum::<f32>() / picture.samples().len() as f32).log10()
}

/// Outlines are as accurate as with 64 samples per pixel. The scene has moldings, and thin dark bars in front of a light
/// 50 times as bright.
///
/// The reference is the mean of displayed light over a pixel's area, from 1024 samples: the view of a finer display
/// from afar. A mean before display would differ, since half a pixel of sky would be as white as the sky.
#[test]
fn thin_things_before_bright_ones_are_those_of_64_samples() {
    let scene = window();
    let pose = scene.pose(0.0);
    let (surfaces, accelerator) = (Surfaces::new(&scene, &pose), Geometry::new(&scene).place(&pose));
    let scene = PosedScene::new(&accelerator, &surfaces);
    let view = View::new(Affine3A::IDENTITY, Projection::Perspective { yfov: YFOV }, SIZE, SIZE);
    // Compute means of displayed light, and of light before display.
    let samples = |count: usize| {
        let mut means = [Plane::filled(SIZE, SIZE, Vec3::ZERO), Plane::filled(SIZE, SIZE, Vec3::ZERO)];
        for offset in sample_offsets(count) {
            let sample = lit(&GBuffer::trace_at(PixelSample::one_of(count, offset), scene, &view, (SIZE, SIZE)).value);
            for (index, &light) in sample.samples().iter().enumerate() {
                means[0].samples_mut()[index] += shown(light) / count as f32;
                means[1].samples_mut()[index] += light / count as f32;
            }
        }
        means
    };
    let seen = GBuffer::trace(scene, &view, (SIZE, SIZE)).value;
    let light = lit(&seen);
    let coverage = Coverage::of(&seen, scene, &light).value;
    let mut blended = light.map(shown);
    for pixel in coverage.pixels() {
        let share: f32 = pixel.parts.iter().map(|part| part.share).sum();
        assert!((share - 1.0).abs() < 1e-5, "shares of pixel {}: {share}", pixel.index);
        blended.samples_mut()[pixel.index] = pixel.mean(|part| shown(part.radiance(&light)));
    }
    let ([truth, bright], [many, many_bright]) = (samples(1024), samples(64));
    let [ours, many] = [&blended, &many].map(|picture| psnr(picture, &truth));
    let linear = coverage.blend(&light).map(shown);
    let [centers, before] = [&light.map(shown), &linear].map(|picture| psnr(picture, &truth));
    println!("luma PSNR: {ours} dB, of 64 samples {many}, of centers {centers}, blended before the display {before}");
    let [linear, many_bright] = [&linear, &many_bright.map(shown)].map(|picture| psnr(picture, &bright.map(shown)));
    println!("all blended before the display: {linear} dB, of 64 samples {many_bright}");
    assert!(ours > many - 2.0, "{ours} dB, and {many} of 64 samples");
    assert!(linear > many_bright - 2.0, "{linear} dB, and {many_bright} of 64 samples, before the display");
    assert!(
        ours > before + 6.0 && ours > centers + 12.0,
        "{ours} dB: {before} before the display, {centers} of centers"
    );
    // The sky is a region like any other. The test has sky on both sides of a bar.
    assert!(seen.pixels.samples().iter().any(|pixel| pixel.instance == NOTHING));
}

/// Traces some pixels of a picture, and compares them with the whole picture.
#[test]
fn wanted_pixels_are_traced_as_in_the_whole_picture() {
    let scene = cards();
    let pose = scene.pose(0.0);
    let (surfaces, accelerator) = (Surfaces::new(&scene, &pose), Geometry::new(&scene).place(&pose));
    let scene = PosedScene::new(&accelerator, &surfaces);
    let wanted = Plane::from_fn(SIZE, SIZE, |x, y| (x * 7 + y * 3) % 5 == 0 && y != 9);
    for projection in [Projection::Perspective { yfov: 0.9 }, Projection::Orthographic { ymag: 1.7 }] {
        let view = View::new(Affine3A::IDENTITY, projection, SIZE, SIZE);
        let sample = PixelSample::one_of(4, Vec2::new(0.3, 0.8));
        let whole = GBuffer::trace_at(sample, scene, &view, (SIZE, SIZE)).value;
        let some = GBuffer::trace_wanted(sample, scene, &view, &wanted).value;
        for ((own, all), &wanted) in some.pixels.samples().iter().zip(whole.pixels.samples()).zip(wanted.samples()) {
            assert_eq!(own, if wanted { all } else { &PixelSurface::EMPTY });
        }
        for index in 0..SIZE * SIZE {
            assert_eq!(some.is_layered(index), wanted.samples()[index] && whole.is_layered(index));
        }
    }
}
