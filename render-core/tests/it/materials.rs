//! Tests that compare textured surface properties with analytic values.

use crate::common::{add, quad, rest};
use glam::{Quat, Vec2, Vec3, Vec3A, Vec4, vec3};
use render_core::scene::{Encoding, Material, Mesh, Scene, Texture, TextureSlot, Transform, Wrap};
use render_core::{Geometry, Surface, Surfaces};

fn slot(texture: usize) -> TextureSlot {
    TextureSlot { texture, uv_set: 0, transform: None }
}

/// Builds a texture of one color.
fn plain(texel: [u8; 3], encoding: Encoding) -> Texture {
    let [r, g, b] = texel;
    Texture::with_encoding(2, 2, vec![[r, g, b, 255]; 4], [Wrap::Repeat; 2], encoding)
}

/// Builds a unit square facing +z, with u to the right and v downward, as in glTF.
fn square() -> Mesh {
    let mut mesh = quad(Vec3::ZERO, Vec3::X, Vec3::Y);
    mesh.uvs[0] = vec![Vec2::Y, Vec2::ONE, Vec2::X, Vec2::ZERO];
    mesh.normals = vec![Vec3::Z; 4];
    mesh
}

/// Returns the center of a square transformed by `place`, seen along `direction`.
fn seen(mesh: Mesh, material: Material, textures: Vec<Texture>, place: Transform, direction: Vec3) -> Surface {
    let mut scene = Scene { textures, ..Scene::default() };
    add(&mut scene, place, mesh, material);
    let pose = scene.pose(0.0);
    let (direction, middle) = (direction.normalize(), place.matrix().transform_point3(vec3(0.4, 0.45, 0.0)));
    let hit = Geometry::new(&scene).place(&pose).closest((middle - direction).into(), direction.into());
    Surfaces::new(&scene, &pose).at(&hit.expect("the square"), direction.into(), 1e-3)
}

/// Normal (0.6, 0, 0.8) in tangent space, in 8 bits.
const RIGHT: [u8; 3] = [204, 128, 230];
/// Normal (0, 0.6, 0.8) in tangent space, in 8 bits.
const UP: [u8; 3] = [128, 204, 230];

fn mapped(texel: [u8; 3], mesh: Mesh, place: Transform, direction: Vec3) -> Surface {
    let material = Material { normal_texture: Some((slot(0), 1.0)), double_sided: true, ..Material::default() };
    seen(mesh, material, vec![plain(texel, Encoding::Normal)], place, direction)
}

fn assert_near(found: Vec3A, expected: Vec3, what: &str) {
    assert!((Vec3::from(found) - expected).length() < 0.01, "{what}: {found} instead of {expected}");
}

#[test]
fn normal_maps_point_where_they_are_drawn() {
    let given = |w: f32, x: f32| Mesh { tangents: vec![Vec4::new(x, 0.0, 0.0, w); 4], ..square() };
    let mirrored = || {
        let mut mesh = square();
        mesh.uvs[0].iter_mut().for_each(|uv| uv.x = 1.0 - uv.x);
        mesh
    };
    let turned = || {
        // Let u point upward and v to the right.
        let mut mesh = square();
        mesh.uvs[0] = vec![Vec2::ZERO, Vec2::Y, Vec2::ONE, Vec2::X];
        mesh
    };
    for (what, mesh, right, up) in [
        ("derived", square(), vec3(0.6, 0.0, 0.8), vec3(0.0, 0.6, 0.8)),
        ("given", given(1.0, 1.0), vec3(0.6, 0.0, 0.8), vec3(0.0, 0.6, 0.8)),
        ("derived, mirrored", mirrored(), vec3(-0.6, 0.0, 0.8), vec3(0.0, 0.6, 0.8)),
        ("given, mirrored", given(-1.0, -1.0), vec3(-0.6, 0.0, 0.8), vec3(0.0, 0.6, 0.8)),
        ("turned", turned(), vec3(0.0, 0.6, 0.8), vec3(-0.6, 0.0, 0.8)),
    ] {
        let at = |texel| mapped(texel, mesh.clone(), rest(Vec3::ZERO), -Vec3::Z);
        assert_near(at(RIGHT).shading_normal, right, what);
        assert_near(at(UP).shading_normal, up, what);
        assert_eq!(at(UP).geometric_normal, Vec3A::Z);
        // Seen from behind, bumps are hollows.
        let behind = mapped(RIGHT, mesh.clone(), rest(Vec3::ZERO), Vec3::Z);
        assert_near(behind.shading_normal, -right, what);
    }
}

#[test]
fn normal_maps_follow_their_object() {
    let turn = Quat::from_rotation_x(0.7) * Quat::from_rotation_y(0.5);
    for mesh in [square(), Mesh { tangents: vec![Vec4::new(1.0, 0.0, 0.0, 1.0); 4], ..square() }] {
        let place = Transform { rotation: turn, ..rest(vec3(1.0, 2.0, 3.0)) };
        let surface = mapped(RIGHT, mesh.clone(), place, turn * -Vec3::Z);
        assert_near(surface.shading_normal, turn * vec3(0.6, 0.0, 0.8), "turned");
        // A mirrored object has mirrored bumps.
        let place = Transform { scale: vec3(-2.0, 1.0, 1.0), ..rest(Vec3::ZERO) };
        let surface = mapped(RIGHT, mesh, place, -Vec3::Z);
        assert_near(surface.shading_normal, vec3(-0.6, 0.0, 0.8), "mirrored");
    }
}

#[test]
fn no_normal_turns_away_from_the_viewer() {
    for texel in [[255, 128, 128], [0, 128, 128], [128, 0, 128], [0, 255, 140]] {
        for k in 0..40 {
            let angle = k as f32 * 0.157;
            for slope in [0.05f32, 0.5, 2.0] {
                let direction = vec3(angle.cos(), angle.sin(), -slope);
                let surface = mapped(texel, square(), rest(Vec3::ZERO), direction);
                let cos = surface.shading_normal.dot(direction.normalize().into());
                assert!(cos < 0.0, "{texel:?} seen along {direction}: cosine {cos}");
                assert!((surface.shading_normal.length() - 1.0).abs() < 1e-5);
            }
        }
    }
}

/// The mirrored ray of a glossy surface leaves outward wherever the plane's own mirrored ray does. Normals that satisfy
/// this stay as they are, and matte surfaces keep all normals.
#[test]
fn no_normal_mirrors_the_viewer_into_the_surface() {
    let seen_by = |texel, direction, roughness| {
        let material = Material { normal_texture: Some((slot(0), 1.0)), roughness, ..Material::default() };
        let surface = seen(square(), material, vec![plain(texel, Encoding::Normal)], rest(Vec3::ZERO), direction);
        let direction = Vec3A::from(direction.normalize());
        let mirrored = direction - surface.shading_normal * (2.0 * surface.shading_normal.dot(direction));
        (surface, mirrored)
    };
    let mut bent = 0;
    for texel in [[255, 128, 128], [0, 128, 128], [128, 0, 128], RIGHT, UP, [128, 128, 255]] {
        for k in 0..40 {
            let angle = k as f32 * 0.157;
            for slope in [0.002f32, 0.05, 0.5, 2.0] {
                let direction = vec3(angle.cos(), angle.sin(), -slope);
                let (glossy, mirrored) = seen_by(texel, direction, 0.4);
                let (matte, straight) = seen_by(texel, direction, 1.0);
                assert!(mirrored.z > 0.0, "{texel:?} seen along {direction} mirrors it to {mirrored}");
                assert!(glossy.shading_normal.dot(direction.into()) < 0.0);
                if straight.z > 0.01 {
                    assert_eq!(glossy.shading_normal, matte.shading_normal);
                } else {
                    bent += 1;
                }
            }
        }
    }
    // Both cases occur among the 960 views.
    assert!((100..860).contains(&bent), "{bent} normals would mirror inward");
}

/// Normals of any length, as compressed and painted maps have, show the same direction without added roughness.
#[test]
fn short_and_long_normals_count_as_unit_normals() {
    let seen_with = |texel| {
        let material = Material { normal_texture: Some((slot(0), 1.0)), roughness: 0.1, ..Material::default() };
        seen(square(), material, vec![plain(texel, Encoding::Normal)], rest(Vec3::ZERO), -Vec3::Z)
    };
    for length in [0.7f32, 0.9, 0.97, 1.03, 1.25] {
        let texel = (vec3(0.6, 0.0, 0.8) * length * 127.5 + 127.5).round().to_array().map(|c| c as u8);
        let surface = seen_with(texel);
        assert_near(surface.shading_normal, vec3(0.6, 0.0, 0.8), &format!("length {length}"));
        assert_eq!(surface.roughness, 0.1, "length {length}");
    }
    // A texel without direction is flat.
    assert_near(seen_with([128, 127, 128]).shading_normal, Vec3::Z, "no direction");
}

#[test]
fn the_scale_of_a_normal_map_acts_on_x_and_y() {
    let material = Material { normal_texture: Some((slot(0), 0.5)), ..Material::default() };
    let surface = seen(square(), material, vec![plain(RIGHT, Encoding::Normal)], rest(Vec3::ZERO), -Vec3::Z);
    assert_near(surface.shading_normal, vec3(0.3, 0.0, 0.8).normalize(), "half");
}

#[test]
fn metalness_and_roughness_are_numbers_and_base_color_is_srgb() {
    // The same texel, 188 of 255, is 0.737 as a number and 0.503 as light.
    let texel = [188; 3];
    let material = Material {
        base_color_texture: Some(slot(0)),
        metallic_roughness_texture: Some(slot(1)),
        metallic: 0.5,
        roughness: 0.8,
        ..Material::default()
    };
    let textures = vec![plain(texel, Encoding::Srgb), plain(texel, Encoding::Linear)];
    let surface = seen(square(), material, textures, rest(Vec3::ZERO), -Vec3::Z);
    let (base, metallic) = (0.5029f32, 0.5 * 188.0 / 255.0);
    assert!((surface.roughness - 0.8 * 188.0 / 255.0).abs() < 1e-4, "{}", surface.roughness);
    assert!((surface.albedo.x - base * (1.0 - metallic)).abs() < 1e-3, "{}", surface.albedo);
    assert!((surface.specular.x - (0.04 * (1.0 - metallic) + base * metallic)).abs() < 1e-3, "{}", surface.specular);
}

#[test]
fn bumps_below_a_pixel_become_roughness() {
    // Alternate slopes to the left and to the right, one texel each.
    let texels = (0..64).map(|i| if i % 2 == 0 { [204, 128, 230, 255] } else { [51, 128, 230, 255] }).collect();
    let texture = Texture::with_encoding(8, 8, texels, [Wrap::Repeat; 2], Encoding::Normal);
    let material = Material { normal_texture: Some((slot(0), 1.0)), roughness: 0.2, ..Material::default() };
    let mut scene = Scene { textures: vec![texture], ..Scene::default() };
    add(&mut scene, rest(Vec3::ZERO), square(), material);
    let pose = scene.pose(0.0);
    let from = Vec3A::new(0.43, 0.44, 1.0);
    let hit = Geometry::new(&scene).place(&pose).closest(from, -Vec3A::Z).unwrap();
    let surfaces = Surfaces::new(&scene, &pose);
    let (near, far) = (surfaces.at(&hit, -Vec3A::Z, 1e-3), surfaces.at(&hit, -Vec3A::Z, 1.0));
    assert_near(far.shading_normal, Vec3::Z, "far away");
    // The mean of the two normals is (0, 0, 0.8). Expect Toksvig's roughness for l = 0.8, minus the tolerance for rounding.
    let inverse_exponent = 0.2f32.powi(4) / (2.0 - 2.0 * 0.2f32.powi(4)) + (1.0 - 0.8 - 0.01) / 0.8;
    let expected = (2.0 * inverse_exponent / (1.0 + 2.0 * inverse_exponent)).powf(0.25);
    assert!((far.roughness - expected).abs() < 0.01, "{} instead of {expected}", far.roughness);
    assert!(near.roughness <= far.roughness);
}
