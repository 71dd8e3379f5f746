//! Tests that compare rays through masks and blended surfaces with their opacity.

use crate::common::{add, quad, rest};
use glam::{Quat, Vec2, Vec3, Vec3A, Vec4, vec3};
use render_core::scene::{
    Alpha, Channel, Interpolation, Material, Scene, Texture, TextureSlot, Track, Transform, Wrap,
};
use render_core::{Geometry, sampling::hash_unit};

/// Builds a texture of 4 × 4 texels, with every other texel transparent.
fn checker() -> Texture {
    let texels = (0..16).map(|i| [200, 200, 200, if (i % 4 + i / 4) % 2 == 0 { 255 } else { 0 }]).collect();
    Texture::new(4, 4, texels, [Wrap::Repeat; 2])
}

/// Builds a unit square in the plane z = 0 with its corner at the origin, and a wall at z = −1 behind it.
fn scene(alpha: Alpha, opacity: f32, textured: bool) -> Scene {
    let mut scene = Scene::default();
    let mut mesh = quad(Vec3::ZERO, Vec3::X, Vec3::Y);
    mesh.uvs[0] = vec![Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y];
    let slot = TextureSlot { texture: 0, uv_set: 0, transform: None };
    let material = Material { alpha, opacity, base_color_texture: textured.then_some(slot), ..Material::default() };
    add(&mut scene, rest(Vec3::ZERO), mesh, material);
    add(
        &mut scene,
        rest(Vec3::ZERO),
        quad(vec3(-5.0, -5.0, -1.0), Vec3::X * 10.0, Vec3::Y * 10.0),
        Material::default(),
    );
    scene.textures.push(checker());
    scene
}

fn random_point(key: u64) -> (f32, f32) {
    (hash_unit(3, key, 0), hash_unit(3, key, 1))
}

#[test]
fn a_mask_has_holes_where_its_texture_says() {
    let scene = scene(Alpha::Mask { cutoff: 0.5 }, 1.0, true);
    let accelerator = Geometry::new(&scene).place(&scene.pose(0.0));
    let mut holes = 0;
    for key in 0..2000 {
        let (x, y) = random_point(key);
        let from = Vec3A::new(x, y, 1.0);
        let hole = scene.textures[0].sample(Vec2::new(x, y), 1.0).opacity < 0.5;
        holes += usize::from(hole);
        let hit = accelerator.closest(from, -Vec3A::Z).expect("the wall at least");
        assert_eq!(hit.instance, u32::from(hole), "at {x} {y}");
        let exact = accelerator.closest_by_exhaustion(from, -Vec3A::Z).expect("the wall at least");
        assert_eq!((exact.instance, exact.triangle), (hit.instance, hit.triangle));
        assert_eq!(accelerator.occluded(from, Vec3A::new(x, y, -0.5)), !hole, "shadows have the same holes");
    }
    assert!((800..1200).contains(&holes), "{holes} of 2000 rays meet a hole");
}

#[test]
fn opaque_materials_ignore_opacity() {
    let scene = scene(Alpha::Opaque, 0.0, true);
    let accelerator = Geometry::new(&scene).place(&scene.pose(0.0));
    for key in 0..200 {
        let (x, y) = random_point(key);
        assert_eq!(accelerator.closest(Vec3A::new(x, y, 1.0), -Vec3A::Z).unwrap().instance, 0);
    }
}

#[test]
fn a_blended_surface_stops_its_share_of_rays() {
    let count = 20_000;
    for opacity in [0.0f32, 0.2, 0.7, 1.0] {
        let mut scene = scene(Alpha::Blend, opacity, false);
        // Opacity of vertices also has an effect.
        scene.meshes[0].colors = vec![Vec4::new(1.0, 1.0, 1.0, 0.5); 4];
        let accelerator = Geometry::new(&scene).place(&scene.pose(0.0));
        let stopped = (0..count)
            .filter(|&key| {
                let (x, y) = random_point(key);
                accelerator.closest(Vec3A::new(x, y, 1.0), -Vec3A::Z).unwrap().instance == 0
            })
            .count();
        let (share, expected) = (stopped as f32 / count as f32, opacity * 0.5);
        // The tolerance is five standard deviations of a binomial distribution.
        let tolerance = 5.0 * (expected * (1.0 - expected) / count as f32).sqrt();
        assert!((share - expected).abs() <= tolerance, "{share} instead of {expected}");
    }
}

#[test]
fn all_rays_see_the_same_grain_wherever_the_object_goes() {
    let mut scene = scene(Alpha::Blend, 0.5, false);
    let moved = Transform { rotation: Quat::from_rotation_y(0.4), ..rest(vec3(0.3, -0.2, 0.1)) };
    let track = |track| Channel { node: 0, times: vec![0.0, 1.0], track, interpolation: Interpolation::Linear };
    scene.channels.push(track(Track::Translation(vec![Vec3::ZERO, moved.translation])));
    scene.channels.push(track(Track::Rotation(vec![Quat::IDENTITY, moved.rotation])));
    let geometry = Geometry::new(&scene);
    let (before, after) = (geometry.place(&scene.pose(0.0)), geometry.place(&scene.pose(1.0)));
    let mut differing = 0;
    for key in 0..2000 {
        let (x, y) = random_point(key);
        let there = |point: Vec3A, towards: Vec3A, accelerator: &render_core::Accelerator| {
            accelerator.occluded(point - towards * 0.01, point + towards * 0.01)
        };
        let point = Vec3A::new(x, y, 0.0);
        let straight = there(point, -Vec3A::Z, &before);
        let slanted = there(point, Vec3A::new(0.5, 0.3, -0.8).normalize(), &before);
        let carried =
            there(moved.matrix().transform_point3a(point), moved.matrix().transform_vector3a(-Vec3A::Z), &after);
        differing += usize::from(straight != slanted || straight != carried);
    }
    // Only points within rounding of a cell's border may differ.
    assert!(differing <= 10, "{differing} of 2000 points");
}
