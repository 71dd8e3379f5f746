//! Rays through the two levels against every triangle in turn.

mod common;

use common::{add, rest};
use glam::{Quat, Vec3, Vec3A, vec3};
use render_core::scene::{Channel, Interpolation, Material, Mesh, Scene, Track, Transform};
use render_core::{Geometry, Hit, sampling::hash_unit};

fn random_vector(key: u64) -> Vec3 {
    let r = |d| hash_unit(9, key, d) * 2.0 - 1.0;
    vec3(r(0), r(1), r(2))
}

/// `count` triangles about a quarter as large as the space they fill.
fn soup(seed: u64, count: u64, size: f32) -> Mesh {
    let mut mesh = Mesh::default();
    for t in 0..count {
        let center = random_vector(seed + 10 * t) * size;
        for corner in 0..3 {
            mesh.positions.push(center + random_vector(seed + 10 * t + corner + 1) * size * 0.25);
        }
        let v = 3 * t as u32;
        mesh.triangles.push([v, v + 1, v + 2]);
    }
    mesh
}

/// Static soup, and `movers` that turn, one of them mirrored.
fn scene(size: f32, movers: u64) -> Scene {
    let mut scene = Scene::default();
    add(&mut scene, rest(vec3(0.3, 0.0, 0.0) * size), soup(1, 300, size), Material::default());
    for k in 0..movers {
        let place = Transform {
            translation: random_vector(900 + k) * size,
            rotation: Quat::from_rotation_y(k as f32),
            scale: vec3(if k == 1 { -0.5 } else { 0.5 }, 0.7, 1.3),
        };
        let node = add(&mut scene, place, soup(5000 * (k + 1), 60, size), Material::default());
        scene.channels.push(Channel {
            node,
            times: vec![0.0, 1.0],
            track: Track::Rotation(vec![Quat::IDENTITY, Quat::from_rotation_x(1.0)]),
            interpolation: Interpolation::Linear,
        });
    }
    scene
}

#[test]
fn finds_what_exhaustion_finds_at_every_scale() {
    for movers in [0, 1, 3, 12] {
        for size in [1e-3f32, 1.0, 1e5] {
            let scene = scene(size, movers);
            let geometry = Geometry::new(&scene);
            for time in [0.0, 0.6] {
                let accelerator = geometry.place(&scene.pose(time));
                let mut hits = 0;
                for k in 0..500u64 {
                    let origin = Vec3A::from(random_vector(77_000 + k) * size * 1.5);
                    let direction = Vec3A::from(random_vector(99_000 + k)).normalize();
                    let expected = accelerator.closest_by_exhaustion(origin, direction);
                    let found = accelerator.closest(origin, direction);
                    let same = |a: &Hit, b: &Hit| (a.distance - b.distance).abs() <= 1e-5 * a.distance;
                    assert!(
                        matches!((&expected, &found), (None, None))
                            || expected.as_ref().zip(found.as_ref()).is_some_and(|(a, b)| same(a, b)),
                        "size {size}, {movers} movers, ray {k}: {found:?} instead of {expected:?}"
                    );
                    assert_eq!(accelerator.occluded_towards(origin, direction), expected.is_some());
                    if let Some(hit) = expected {
                        hits += 1;
                        let before = origin + direction * hit.distance * 0.999;
                        let behind = origin + direction * hit.distance * 1.001;
                        assert!(!accelerator.occluded(origin, before), "nothing stands before the first hit");
                        assert!(accelerator.occluded(origin, behind));
                    }
                }
                assert!(hits > 50, "only {hits} rays hit: the test says little");
            }
        }
    }
}

#[test]
fn barycentrics_give_the_point_back() {
    let scene = scene(1.0, 0);
    let pose = scene.pose(0.0);
    let accelerator = Geometry::new(&scene).place(&pose);
    let surfaces = render_core::Surfaces::new(&scene, &pose);
    for k in 0..300u64 {
        let origin = Vec3A::from(random_vector(k) * 1.5);
        let direction = Vec3A::from(random_vector(50_000 + k)).normalize();
        let Some(hit) = accelerator.closest(origin, direction) else { continue };
        let surface = surfaces.at(&hit, direction, 0.0);
        assert!((surface.position - (origin + direction * hit.distance)).length() < 1e-5);
        assert!(surface.geometric_normal.dot(direction) <= 0.0, "normals face the viewer");
    }
}

#[test]
fn an_empty_scene_is_empty() {
    let scene = Scene::default();
    let accelerator = Geometry::new(&scene).place(&scene.pose(0.0));
    assert!(accelerator.closest(Vec3A::ZERO, Vec3A::X).is_none());
    assert!(!accelerator.occluded(Vec3A::ZERO, Vec3A::ONE));
}

#[test]
fn triangles_without_area_are_no_obstacle() {
    let mut scene = Scene::default();
    let flat =
        Mesh { positions: vec![Vec3::ZERO, Vec3::X, Vec3::X * 2.0], triangles: vec![[0, 1, 2]; 5], ..Mesh::default() };
    add(&mut scene, rest(Vec3::ZERO), flat, Material::default());
    let accelerator = Geometry::new(&scene).place(&scene.pose(0.0));
    assert!(accelerator.closest(Vec3A::new(0.5, 0.0, 1.0), -Vec3A::Z).is_none());
}

#[test]
fn a_packet_finds_what_its_rays_find_alone() {
    for movers in [0, 2, 20] {
        let scene = scene(1.0, movers);
        let accelerator = Geometry::new(&scene).place(&scene.pose(0.4));
        for k in 0..60u64 {
            let origin = Vec3A::from(random_vector(3_000 + k) * 2.0);
            let forward = (Vec3A::from(random_vector(4_000 + k)) * 0.3 - origin).normalize();
            let (x, y) = forward.any_orthonormal_pair();
            // From a narrow beam to all ways at once, from one ray to more than a packet.
            let spread = [1e-3, 0.05, 0.5, 1e3][k as usize % 4];
            let directions: Vec<Vec3A> = (0..=k * 3)
                .map(|i| {
                    let u = |d| (hash_unit(4, 200 * k + i, d) * 2.0 - 1.0) * spread;
                    (forward + x * u(0) + y * u(1)).normalize()
                })
                .collect();
            let mut hits = vec![None; directions.len()];
            accelerator.closest_packet(origin, &directions, &mut hits);
            for (&direction, &hit) in directions.iter().zip(&hits) {
                assert_eq!(hit, accelerator.closest(origin, direction));
            }
        }
    }
}

#[test]
fn rays_along_an_axis_hit_whatever_the_signs_of_their_zeros() {
    let mut scene = Scene::default();
    let square = common::quad(vec3(-1.0, -1.0, 0.0), Vec3::X * 2.0, Vec3::Y * 2.0);
    add(&mut scene, rest(Vec3::ZERO), square, Material::default());
    let accelerator = Geometry::new(&scene).place(&scene.pose(0.0));
    for (x, y) in [(0.0f32, 0.0f32), (-0.0, 0.0), (0.0, -0.0), (-0.0, -0.0)] {
        for z in [-1.0f32, 1.0] {
            let (from, direction) = (Vec3A::new(0.3, 0.2, -z), Vec3A::new(x, y, z));
            assert!(accelerator.closest(from, direction).is_some(), "{direction}");
            assert!(accelerator.occluded_towards(from, direction), "{direction}");
        }
    }
}
