//! Tests that compare layers in pixels and transmitted light with closed forms, for blended surfaces and distant masks.

use crate::common::{add, material, quad, rest, room};
use glam::{Affine3A, Vec2, Vec3, Vec3A, Vec4, vec3};
use plane::Plane;
use render_core::sampling::hash_unit;
use render_core::scene::{
    Alpha, Material, Mesh, Node, Projection, PunctualKind, PunctualLight, Scene, Texture, TextureSlot, View, Wrap,
};
use render_core::{
    Anchors, Coverage, DirectLights, Emitters, GBuffer, Geometry, PixelSample, PosedScene, ShadingPoint, Surfaces,
    Units, sample_offsets,
};

const SIZE: usize = 48;

/// Returns an unlit material of this color.
fn flat(color: Vec3, alpha: Alpha, opacity: f32) -> Material {
    Material { base_color: color, unlit: true, double_sided: true, alpha, opacity, ..Material::default() }
}

/// Builds a square of side 4 m at a depth, in front of a camera at the origin.
fn square(depth: f32) -> Mesh {
    quad(vec3(-2.0, -2.0, -depth), Vec3::X * 4.0, Vec3::Y * 4.0)
}

const PROJECTIONS: [Projection; 2] = [Projection::Perspective { yfov: 0.5 }, Projection::Orthographic { ymag: 1.0 }];

/// Returns the colors of all pixels, from one sample or several samples per pixel.
fn picture(scene: &Scene, projection: Projection, samples: usize) -> Plane<Vec3> {
    let pose = scene.pose(0.0);
    let (surfaces, accelerator) = (Surfaces::new(scene, &pose), Geometry::new(scene).place(&pose));
    let posed = PosedScene::new(&accelerator, &surfaces);
    let view = View::new(Affine3A::IDENTITY, projection, SIZE, SIZE);
    let colors = |seen: &GBuffer| seen.pixels.map(|pixel| Vec3::from(pixel.emission));
    if samples == 1 {
        let seen = GBuffer::trace(posed, &view, (SIZE, SIZE)).value;
        let centers = colors(&seen);
        return Coverage::of(&seen, posed, &centers).value.blend(&centers);
    }
    let mut sum = Plane::filled(SIZE, SIZE, Vec3::ZERO);
    for offset in sample_offsets(samples) {
        let sample = PixelSample::one_of(samples, offset);
        let seen = GBuffer::trace_at(sample, posed, &view, (SIZE, SIZE)).value;
        let shown = colors(&seen);
        let blended = Coverage::of_layers(&seen, posed, &shown, sample).value.blend(&shown);
        sum.samples_mut().iter_mut().zip(blended.samples()).for_each(|(sum, &color)| *sum += color / samples as f32);
    }
    sum
}

/// Pixels show Porter & Duff's "over", front to back: c = Σ αᵢ cᵢ Π_{j<i} (1 − αⱼ), for any number of surfaces.
#[test]
fn pixels_show_each_layer_by_its_share() {
    let colors = [vec3(1.0, 0.1, 0.2), vec3(0.1, 0.9, 0.1), vec3(0.2, 0.2, 0.8), vec3(0.9, 0.9, 0.1)];
    for opacities in [[0.5, 0.0, 0.0], [0.5, 0.25, 0.1], [0.03, 0.97, 0.4], [0.9, 0.9, 0.9]] {
        let mut scene = Scene::default();
        let mut expected = Vec3::ZERO;
        let mut left = 1.0;
        for (k, (&color, opacity)) in colors.iter().zip(opacities.into_iter().chain([1.0])).enumerate() {
            let alpha = if k == 3 { Alpha::Opaque } else { Alpha::Blend };
            add(&mut scene, rest(Vec3::ZERO), square(2.0 + k as f32 * 0.3), flat(color, alpha, opacity));
            expected += color * opacity * left;
            left *= 1.0 - opacity;
        }
        for projection in PROJECTIONS {
            for samples in [1, 4] {
                let shown = picture(&scene, projection, samples);
                for &color in shown.samples() {
                    // A layer that covers less than 1/512 is omitted.
                    let apart = (color - expected).abs().max_element();
                    assert!(apart < 0.003, "{color} instead of {expected}, {opacities:?} by {samples} samples");
                }
            }
        }
    }
}

/// The opacity of a surface may vary, since it is interpolated between corners.
#[test]
fn opacity_that_changes_along_a_surface_is_shown_without_steps() {
    let mut scene = Scene::default();
    let mut mesh = quad(vec3(-1.0, -1.0, -1.0), Vec3::X * 2.0, Vec3::Y * 2.0);
    mesh.colors = [0.0, 1.0, 1.0, 0.0].map(|w| Vec4::new(1.0, 1.0, 1.0, w)).to_vec();
    add(&mut scene, rest(Vec3::ZERO), mesh, flat(Vec3::ONE, Alpha::Blend, 1.0));
    add(&mut scene, rest(Vec3::ZERO), square(2.0), flat(Vec3::ZERO, Alpha::Opaque, 1.0));
    let shown = picture(&scene, Projection::Orthographic { ymag: 1.0 }, 1);
    for y in 0..SIZE {
        for x in 0..SIZE {
            let expected = (x as f32 + 0.5) / SIZE as f32;
            assert!((shown.get(x, y).x - expected).abs() < 0.004, "{} for {expected} at {x} {y}", shown.get(x, y).x);
        }
    }
}

/// A texture of 2×2 texels, one of them opaque, is repeated over a card. From afar a quarter of each pixel is covered
/// (glTF 2.0, 3.9.4: a masked surface is opaque or absent). From nearby, each texel is present or absent.
#[test]
fn masks_keep_their_coverage_from_afar() {
    for (cutoff, opacity) in [(0.5, 1.0), (0.25, 0.5)] {
        for per_pixel in [0.02, 3.0, 7.3] {
            let mut scene = Scene::default();
            let texel = |i: usize| [255, 255, 255, if i == 0 { 255 } else { 0 }];
            scene.textures.push(Texture::new(2, 2, (0..4).map(texel).collect(), [Wrap::Repeat; 2]).blocky());
            let mut mesh = quad(vec3(-1.5, -1.5, -1.0), Vec3::X * 3.0, Vec3::Y * 3.0);
            let repeats = per_pixel * 1.5 * SIZE as f32 / 2.0;
            mesh.uvs[0] = [Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y].map(|uv| uv * repeats).to_vec();
            let slot = TextureSlot { texture: 0, uv_set: 0, transform: None };
            let leaf = Material { base_color_texture: Some(slot), ..flat(Vec3::ONE, Alpha::Mask { cutoff }, opacity) };
            add(&mut scene, rest(Vec3::ZERO), mesh, leaf);
            add(&mut scene, rest(Vec3::ZERO), square(2.0), flat(Vec3::ZERO, Alpha::Opaque, 1.0));
            let shown = picture(&scene, Projection::Orthographic { ymag: 1.0 }, 1);
            let mean = shown.samples().iter().map(|color| color.x).sum::<f32>() / (SIZE * SIZE) as f32;
            if per_pixel > 1.0 {
                // With more than two texels per pixel, no single texel is visible.
                assert!((mean - 0.25).abs() < 0.01, "{mean} of the picture at {per_pixel} texels a pixel");
                let least = shown.samples().iter().map(|color| color.x).fold(1.0, f32::min);
                let most = shown.samples().iter().map(|color| color.x).fold(0.0, f32::max);
                assert!(most - least < 0.2, "{least} to {most} at {per_pixel} texels a pixel");
            } else {
                let between = shown.samples().iter().filter(|color| color.x > 0.01 && color.x < 0.99).count();
                assert!(between < SIZE * SIZE / 10, "{between} pixels are partly covered");
            }
        }
    }
}

/// Builds a room with lamps of all types above a card.
fn lit_room(alpha: Alpha, opacity: f32, with_card: bool) -> Scene {
    let mut scene = Scene::default();
    add(&mut scene, rest(Vec3::ZERO), room(), material(Vec3::splat(0.5), Vec3::ZERO));
    let panel = quad(vec3(-0.3, 0.95, -0.2), Vec3::X * 0.6, Vec3::Z * 0.4);
    add(&mut scene, rest(Vec3::ZERO), panel, material(Vec3::ZERO, vec3(5.0, 4.0, 3.0)));
    if with_card {
        let card = quad(vec3(-0.4, 0.1, -0.4), vec3(0.8, 0.1, 0.0), Vec3::Z * 0.8);
        let blended = Material { alpha, opacity, double_sided: true, ..material(Vec3::splat(0.7), Vec3::ZERO) };
        add(&mut scene, rest(Vec3::ZERO), card, blended);
    }
    scene.nodes.push(Node { name: String::new(), parent: None, rest: rest(vec3(0.3, 0.8, 0.3)) });
    let node = scene.nodes.len() - 1;
    scene.punctual_lights.push(PunctualLight { node, color: Vec3::splat(3.0), kind: PunctualKind::Point });
    scene
}

/// Returns the irradiance on the floor.
fn floor_light(scene: &Scene) -> Vec<Vec3> {
    let pose = scene.pose(0.0);
    let surfaces = Surfaces::new(scene, &pose);
    let units = Units::of(scene);
    let emitters = Emitters::new(&surfaces, &pose, &units);
    let anchors = Anchors::spread(&surfaces, &units, 0, 1);
    let all: Vec<usize> = (0..emitters.areas.len()).collect();
    let direct = DirectLights::new(&emitters, &surfaces, &anchors, &[], &all);
    let accelerator = Geometry::new(scene).place(&pose);
    let receivers: Vec<ShadingPoint> = (0..300)
        .map(|k| ShadingPoint {
            position: Vec3A::new(hash_unit(5, k, 0) * 1.8 - 0.9, -0.999, hash_unit(5, k, 1) * 1.8 - 0.9),
            normal: Vec3A::Y,
            geometric_normal: Vec3A::Y,
        })
        .collect();
    direct.irradiance_tile(&accelerator, &receivers).value
}

/// A card blocks the fraction α of the light of all lamps: E = (1 − α) E(no card) + α E(opaque card), since visibility
/// is linear in α.
#[test]
fn shadows_of_blended_surfaces_are_shares_of_full_ones() {
    let (bare, full) =
        (floor_light(&lit_room(Alpha::Opaque, 1.0, false)), floor_light(&lit_room(Alpha::Opaque, 1.0, true)));
    for opacity in [0.1, 0.5, 0.9] {
        let found = floor_light(&lit_room(Alpha::Blend, opacity, true));
        let mut shaded = 0;
        for ((&found, &bare), &full) in found.iter().zip(&bare).zip(&full) {
            let expected = bare * (1.0 - opacity) + full * opacity;
            let apart = (found - expected).abs().max_element() / bare.max_element();
            // If votes agree, the light of the whole panel is exact. Otherwise the light is a sum over the panel's samples.
            assert!(apart < 0.004, "{found} instead of {expected} behind {opacity}");
            shaded += usize::from(full.max_element() < 0.5 * bare.max_element());
        }
        assert!(shaded > 30, "{shaded} of 300 points lie in the shadow");
    }
}
