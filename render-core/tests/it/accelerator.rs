//! Tests that compare rays through both levels of the tree with brute force over all triangles.

use crate::common::{add, rest};
use glam::{Quat, Vec3, Vec3A, vec3};
use render_core::sampling::{hash, hash_unit};
use render_core::scene::{Channel, Interpolation, Material, Mesh, Scene, Track, Transform};
use render_core::{Geometry, Hit, PACKET};
use std::f32::consts::PI;

fn random_vector(key: u64) -> Vec3 {
    let r = |d| hash_unit(9, key, d) * 2.0 - 1.0;
    vec3(r(0), r(1), r(2))
}

/// Builds `count` triangles, each about a quarter as large as the space that contains all of them.
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

/// Builds a static soup of triangles, and `movers` rotating soups. One of the rotating soups is mirrored.
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
                        assert!(!accelerator.occluded(origin, before), "nothing is in front of the first hit");
                        assert!(accelerator.occluded(origin, behind));
                    }
                }
                assert!(hits > 50, "only {hits} rays hit: too few for a test");
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
            // Test spreads from a narrow beam to all directions, and from one ray to more than a packet.
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
    let square = crate::common::quad(vec3(-1.0, -1.0, 0.0), Vec3::X * 2.0, Vec3::Y * 2.0);
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

/// Builds a closed sphere of triangles around the origin: `rings` × 2 `rings` quads.
fn ball(rings: u32) -> Mesh {
    let mut mesh = Mesh::default();
    for ring in 0..=rings {
        for k in 0..2 * rings {
            let (down, around) = (PI * ring as f32 / rings as f32, PI * k as f32 / rings as f32);
            mesh.positions.push(vec3(down.sin() * around.cos(), down.cos(), down.sin() * around.sin()));
        }
    }
    let at = |ring: u32, k: u32| ring * 2 * rings + k % (2 * rings);
    for ring in 0..rings {
        for k in 0..2 * rings {
            let [a, b, c, d] = [at(ring, k), at(ring, k + 1), at(ring + 1, k + 1), at(ring + 1, k)];
            // At the poles, all corners of a ring are exactly the same point.
            mesh.triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    for k in 0..2 * rings as usize {
        mesh.positions[k] = Vec3::Y;
        let last = mesh.positions.len() - 1 - k;
        mesh.positions[last] = -Vec3::Y;
    }
    mesh
}

#[test]
fn no_ray_slips_through_edges_or_corners() {
    let mut scene = Scene::default();
    let mesh = ball(24);
    let corners = mesh.positions.clone();
    let triangles = mesh.triangles.clone();
    add(&mut scene, rest(vec3(0.1, -0.7, 0.3)), mesh, Material::default());
    let accelerator = Geometry::new(&scene).place(&scene.pose(0.0));
    let center = vec3(0.1, -0.7, 0.3);
    for k in 0..20u64 {
        let origin = Vec3A::from(center + random_vector(k) * 0.3);
        let mut targets: Vec<Vec3> = corners.iter().map(|&corner| center + corner).collect();
        targets.extend(triangles.iter().map(|t| {
            let (a, b) = (corners[t[0] as usize], corners[t[1 + k as usize % 2] as usize]);
            center + a + (b - a) * hash_unit(5, k, u64::from(t[0]))
        }));
        let directions: Vec<Vec3A> = targets.iter().map(|&target| (Vec3A::from(target) - origin).normalize()).collect();
        let mut hits = vec![None; directions.len()];
        accelerator.closest_packet(origin, &directions, &mut hits);
        for (direction, hit) in directions.iter().zip(hits) {
            assert!(hit.is_some(), "from {origin} towards {direction} out of a closed ball");
            assert_eq!(hit, accelerator.closest(origin, *direction));
        }
    }
}

/// Returns numerically difficult rays: along axes, with zeros of both signs, within planes, and from a point on a
/// surface.
fn awkward_rays(size: f32) -> Vec<(Vec3A, Vec3A)> {
    let mut rays = Vec::new();
    for k in 0..200u64 {
        // Start at a lattice point, where the walls of `lattice` intersect.
        let origin = Vec3A::from((random_vector(31 * k) * 3.0).round() * (0.5 * size));
        let mut direction = Vec3A::ZERO;
        direction[k as usize % 3] = if k % 2 == 0 { 1.0 } else { -1.0 };
        rays.push((origin, direction));
        rays.push((origin + Vec3A::splat(0.1 * size), direction * -1.0));
        let mut slanted = Vec3A::from(random_vector(7 * k + 1));
        slanted[k as usize % 3] = if k % 2 == 0 { 0.0 } else { -0.0 };
        rays.push((origin, slanted.normalize()));
        rays.push((origin, Vec3A::from(random_vector(7 * k + 2).round()).normalize_or(Vec3A::ONE.normalize())));
    }
    rays
}

/// Builds walls in the planes x, y, z = −1, −0.5 … 1, with coplanar neighbors and with each wall doubled.
fn lattice(size: f32) -> Mesh {
    let mut mesh = Mesh::default();
    for k in 0..15u32 {
        let (axis, height) = (k as usize % 3, ((k / 3) as f32 * 0.5 - 1.0) * size);
        for corner in 0..4 {
            let mut p = Vec3::ZERO;
            p[axis] = height;
            p[(axis + 1) % 3] = if corner == 1 || corner == 2 { size } else { -size };
            p[(axis + 2) % 3] = if corner >= 2 { size } else { -size };
            mesh.positions.push(p);
        }
        let v = 4 * k;
        mesh.triangles.extend([[v, v + 1, v + 2], [v, v + 2, v + 3], [v + 1, v + 2, v]]);
    }
    mesh
}

#[test]
fn alone_or_together_with_or_without_vector_instructions_the_bits_are_the_same() {
    for (size, movers) in [(1e-3, 0), (1.0, 0), (1.0, 3), (1e4, 12)] {
        let mut scene = scene(size, movers);
        add(&mut scene, rest(Vec3::ZERO), lattice(size), Material::default());
        let geometry = Geometry::new(&scene);
        let pose = scene.pose(0.3);
        let (vector, scalar) = (geometry.place(&pose), geometry.place(&pose).without_vector_instructions());
        let mut rays = awkward_rays(size);
        rays.extend(
            (0..500).map(|k| {
                (Vec3A::from(random_vector(600 + k) * size), Vec3A::from(random_vector(1600 + k)).normalize())
            }),
        );
        for &(origin, direction) in &rays {
            let hit = vector.closest(origin, direction);
            assert_eq!(hit, scalar.closest(origin, direction));
            assert_eq!(vector.occluded_towards(origin, direction), hit.is_some());
            assert_eq!(scalar.occluded_towards(origin, direction), hit.is_some());
        }
        for origin in rays.iter().step_by(40).map(|ray| ray.0) {
            let directions: Vec<Vec3A> = rays.iter().map(|ray| ray.1).collect();
            let alone: Vec<_> = directions.iter().map(|&direction| vector.closest(origin, direction)).collect();
            for accelerator in [&vector, &scalar] {
                let mut hits = vec![None; directions.len()];
                accelerator.closest_packet(origin, &directions, &mut hits);
                assert_eq!(hits, alone);
            }
            for (k, ends) in rays.chunks(PACKET - 7).enumerate() {
                let ends: Vec<Vec3A> = ends.iter().map(|ray| ray.0).collect();
                let active = hash(1, k as u64, 2) | 1;
                let alone = ends.iter().enumerate().fold(0, |hidden, (i, &end)| {
                    hidden | u64::from(active >> i & 1 == 1 && vector.occluded(origin, end)) << i
                });
                assert_eq!(vector.occluded_packet(origin, &ends, active), alone);
                assert_eq!(scalar.occluded_packet(origin, &ends, active), alone);
            }
        }
    }
}

#[test]
fn along_axes_and_from_surfaces_exhaustion_agrees() {
    let mut scene = Scene::default();
    add(&mut scene, rest(Vec3::ZERO), lattice(1.0), Material::default());
    let accelerator = Geometry::new(&scene).place(&scene.pose(0.0));
    let mut hits = 0;
    for (origin, direction) in awkward_rays(1.0) {
        let (expected, found) =
            (accelerator.closest_by_exhaustion(origin, direction), accelerator.closest(origin, direction));
        let Some(expected) = expected else { continue };
        // A ray that leaves the lattice exactly along its border may hit or miss it. Inside the lattice it must hit.
        let end = origin + direction * expected.distance;
        if end.abs().max_element() < 0.999 {
            let found = found.unwrap_or_else(|| panic!("{origin} {direction} missed {expected:?}"));
            assert!((found.distance - expected.distance).abs() < 1e-6, "{origin} {direction}: {found:?} {expected:?}");
            hits += 1;
        }
    }
    assert!(hits > 100, "only {hits} hits: too few for a test");
}

#[test]
fn a_single_triangle_is_met_where_it_is() {
    let mut scene = Scene::default();
    let mesh = Mesh {
        positions: vec![Vec3::ZERO, Vec3::X * 4.0, Vec3::Y * 8.0],
        triangles: vec![[0, 1, 2]],
        ..Mesh::default()
    };
    add(&mut scene, rest(Vec3::ZERO), mesh, Material::default());
    let accelerator = Geometry::new(&scene).place(&scene.pose(0.0));
    let hit = accelerator.closest(Vec3A::new(1.0, 1.0, 3.0), -Vec3A::Z).unwrap();
    assert_eq!((hit.distance, hit.u, hit.v, hit.instance, hit.triangle), (3.0, 0.25, 0.125, 0, 0));
    assert!(accelerator.closest(Vec3A::new(3.0, 7.0, 3.0), -Vec3A::Z).is_none());
    assert!(accelerator.closest(Vec3A::new(1.0, 1.0, 3.0), Vec3A::ZERO).is_none(), "a ray that goes nowhere");
    assert!(accelerator.closest(Vec3A::NAN, Vec3A::X).is_none());
    assert!(!accelerator.occluded(Vec3A::new(1.0, 1.0, 3.0), Vec3A::new(1.0, 1.0, 3.0)));
    assert_eq!(accelerator.occluded_packet(Vec3A::Z, &[], u64::MAX), 0);
}

/// A shaft lists all triangles that its rays hit, at every scale and with moving objects. Narrow shafts are often
/// empty, which is correct.
#[test]
fn within_a_shaft_rays_meet_what_they_meet_without() {
    for (movers, size) in [(0, 1.0f32), (3, 1e-3), (3, 1e4)] {
        let scene = scene(size, movers);
        let accelerator = Geometry::new(&scene).place(&scene.pose(0.6));
        let (mut empty, mut hidden) = (0, 0);
        for k in 0..400u64 {
            let spread = [0.003, 0.03, 0.1][k as usize % 3] * size;
            let around = |key: u64, count: u64| -> Vec<Vec3A> {
                let center = random_vector(key) * size * 1.2;
                (0..count).map(|i| Vec3A::from(center + random_vector(key + 7 * i + 1) * spread)).collect()
            };
            let (from, to) = (around(31_000 + 1000 * k, PACKET as u64), around(631_000 + 1000 * k, 9));
            let shaft = accelerator.shaft(&from, &to);
            let columns = std::array::from_fn(|axis| std::array::from_fn(|i| from[i][axis]));
            empty += u32::from(shaft.is_empty());
            for &light in &to {
                let expected = accelerator.occluded_packet(light, &from, u64::MAX);
                let found = accelerator.occluded_packet_within(&shaft, light, &columns, u64::MAX);
                assert_eq!(found, expected, "size {size}, {movers} movers, shaft {k}");
                assert!(!shaft.is_empty() || expected == 0);
                hidden += expected.count_ones();
            }
        }
        println!("size {size}, {movers} movers: {empty} of 400 shafts are empty, {hidden} segments hidden");
        assert!(empty > 20 && hidden > 20_000, "{empty} empty shafts, {hidden} hidden segments: too few for a test");
    }
}

/// Rays from the distance of the sky's dome, 100 radii, end at a surface as reliably as they start there. Lightcuts of
/// neighboring pixels trace rays from the light. (From 1000 radii, at least one ray in four would end below the
/// surface.)
#[test]
fn rays_from_far_lights_end_above_the_surface() {
    for (turn, offset) in [(0.7, Vec3::ZERO), (0.2, vec3(3.0, -5.0, 2.0)), (2.1, vec3(0.0, 40.0, 0.0))] {
        let mut scene = Scene::default();
        let corners = [[-1.0, -1.0], [1.1, -1.0], [1.1, 1.3], [-1.0, 1.3]];
        let positions = corners.map(|[x, y]| vec3(x, y, 0.3)).into();
        let floor = Mesh { positions, triangles: vec![[0, 1, 2], [0, 2, 3]], ..Mesh::default() };
        let rotation = Quat::from_rotation_x(turn) * Quat::from_rotation_y(0.4);
        add(&mut scene, Transform { rotation, ..rest(offset) }, floor, Material::default());
        let units = render_core::Units::of(&scene);
        let accelerator = Geometry::new(&scene).place(&scene.pose(0.0));
        for k in 0..200u64 {
            let (angle, sine) = (2.0 * PI * hash_unit(3, k, 5), [0.003f32, 0.01, 0.03, 0.1, 0.5][k as usize % 5]);
            let along = vec3(angle.cos(), angle.sin(), 0.0) * (1.0 - sine * sine).sqrt();
            let direction = rotation * (along + Vec3::Z * sine);
            let light = units.center + Vec3A::from(direction) * units.radius * 100.0;
            let above = |i: u64| offset + rotation * (random_vector(77 * k + i).with_z(0.0) * 0.9 + Vec3::Z * 0.3);
            let lifted = |i: u64| Vec3A::from(above(i) + rotation * Vec3::Z * units.epsilon);
            let receivers: Vec<Vec3A> = (0..PACKET as u64).map(lifted).collect();
            assert_eq!(accelerator.occluded_packet(light, &receivers, u64::MAX), 0, "{offset}, light {k}");
            assert!(receivers.iter().all(|&receiver| !accelerator.occluded(receiver, light)), "{offset}, light {k}");
        }
    }
}
