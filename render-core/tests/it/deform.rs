//! Tests that compare skins and morph targets with analytic transforms: positions, normals, motion.

use crate::common::{add, material, quad, rest};
use glam::{Affine3A, Quat, Vec2, Vec3, vec3};
use render_core::scene::{
    Camera, Channel, Influence, Interpolation, Mesh, MorphTarget, MorphedNode, Node, Projection, Scene, Skin, Skinning,
    Track,
};
use render_core::{Anchors, GBuffer, Geometry, NOTHING, PixelSurface, PosedScene, Surfaces, Units};

const SIZE: usize = 128;
const YFOV: f32 = 0.9;
const ANGLE: f32 = 0.3;
/// Rotation center of the upper bone \[m\].
const ELBOW: Vec3 = vec3(0.0, 0.2, -3.0);

fn node(scene: &mut Scene, parent: Option<usize>, translation: Vec3) -> usize {
    scene.nodes.push(Node { name: String::new(), parent, rest: rest(translation) });
    scene.nodes.len() - 1
}

fn camera(scene: &mut Scene) {
    let node = node(scene, None, Vec3::ZERO);
    let projection = Projection::Perspective { yfov: YFOV };
    scene.cameras.push(Camera { name: String::new(), node, projection, ..Camera::default() });
}

fn animate(scene: &mut Scene, node: usize, track: Track) {
    scene.channels.push(Channel { node, times: vec![0.0, 1.0], track, interpolation: Interpolation::Linear });
}

/// Builds two stacked squares. The lower square follows a static bone, the upper square a bone that rotates about the
/// elbow. The mesh is bound at the origin, and its distant node has no effect.
fn arm() -> Scene {
    let mut scene = Scene::default();
    let mut mesh = quad(vec3(-0.5, -1.0, 0.0), Vec3::X, Vec3::Y);
    let upper = quad(vec3(-0.5, 0.1, 0.0), Vec3::X, Vec3::Y * 0.8);
    mesh.positions.extend(upper.positions);
    mesh.triangles.extend(upper.triangles.iter().map(|t| t.map(|v| v + 4)));
    mesh.normals = vec![Vec3::Z; 8];
    let one = |joint| [Influence { joint, weight: 0.75 }, Influence { joint, weight: 0.25 }];
    let influences = (0..8).flat_map(|vertex| one(vertex / 4)).collect();
    mesh.skinning = Some(Skinning { skin: 0, per_vertex: 2, influences });
    add(&mut scene, rest(vec3(50.0, 60.0, 70.0)), mesh, material(Vec3::splat(0.5), Vec3::ZERO));
    let root = node(&mut scene, None, vec3(0.0, 0.0, -3.0));
    let elbow = node(&mut scene, Some(root), vec3(0.0, 0.2, 0.0));
    let inverse_bind = vec![Affine3A::IDENTITY, Affine3A::from_translation(vec3(0.0, -0.2, 0.0))];
    scene.skins.push(Skin { joints: vec![root, elbow], inverse_bind });
    animate(&mut scene, elbow, Track::Rotation(vec![Quat::IDENTITY, Quat::from_rotation_z(ANGLE)]));
    camera(&mut scene);
    scene
}

/// Builds a square that shears by 0.4 times its height while its node moves to the right.
fn leaning() -> Scene {
    let mut scene = Scene::default();
    let mut mesh: Mesh = quad(vec3(-0.6, -0.6, 0.0), Vec3::X * 1.2, Vec3::Y * 1.2);
    let lean = |y: f32| vec3(0.4 * y, 0.0, 0.0);
    let target =
        MorphTarget { positions: mesh.positions.iter().map(|p| lean(p.y)).collect(), ..MorphTarget::default() };
    mesh.morph_targets.push(target);
    let square = add(&mut scene, rest(vec3(0.0, 0.0, -3.0)), mesh, material(Vec3::splat(0.5), Vec3::ZERO));
    scene.morphed_nodes.push(MorphedNode { node: square, weights: vec![0.0] });
    animate(&mut scene, square, Track::Weights(vec![0.0, 1.0]));
    animate(&mut scene, square, Track::Translation(vec![vec3(0.0, 0.0, -3.0), vec3(0.1, 0.0, -3.0)]));
    camera(&mut scene);
    scene
}

fn seen(scene: &Scene, time: f32) -> GBuffer {
    let pose = scene.pose(time);
    let accelerator = Geometry::new(scene).place(&pose);
    let view = scene.view(&pose, SIZE, SIZE);
    GBuffer::trace(PosedScene::new(&accelerator, &Surfaces::new(scene, &pose)), &view, (SIZE, SIZE)).value
}

fn focal() -> f32 {
    SIZE as f32 / 2.0 / (YFOV / 2.0).tan()
}

/// Returns the largest difference between motion vectors from time 1 to time 0 and the reference `then` \[pixels\], and
/// the number of vectors. `then` returns the position at time 0 of a point of the plane z = −3 at time 1.
fn worst_vector(scene: &Scene, then: impl Fn(&PixelSurface, Vec3) -> Vec3) -> (f32, usize) {
    let (before, now) = (seen(scene, 0.0), seen(scene, 1.0));
    let correspondence = now.reproject(&before).value;
    let (half, mut worst, mut count) = (SIZE as f32 / 2.0, 0.0f32, 0);
    for y in 0..SIZE {
        for x in 0..SIZE {
            let pixel = now.pixels.get(x, y);
            let Some([dx, dy]) = correspondence.motion_of(x, y).filter(|_| pixel.instance != NOTHING) else { continue };
            let center = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
            let point = vec3((center.x - half) / focal(), (half - center.y) / focal(), -1.0) * 3.0;
            let was = then(&pixel, point);
            let place = Vec2::new(half + focal() * was.x / -was.z, half - focal() * was.y / -was.z);
            worst = worst.max((center + Vec2::new(dx, dy) - place).length());
            count += 1;
        }
    }
    (worst, count)
}

#[test]
fn a_skin_carries_vertices_as_its_bones_turn() {
    let scene = arm();
    let pose = scene.pose(1.0);
    let bent = pose.deformed(0).expect("a skin bends it");
    for (vertex, &rest) in scene.meshes[0].positions.iter().enumerate() {
        let placed = rest + vec3(0.0, 0.0, -3.0);
        let expected = if vertex < 4 { placed } else { ELBOW + Quat::from_rotation_z(ANGLE) * (placed - ELBOW) };
        assert!((bent.positions[vertex] - expected).length() < 1e-6, "{} for {expected}", bent.positions[vertex]);
        assert!((bent.normals[vertex] - Vec3::Z).length() < 1e-6);
    }
    // The transform of the mesh's node has no effect. Only the bones determine motion.
    assert_eq!(scene.moving_instances(), [true]);
    assert_eq!(scene.instance_world(&pose, 0), Affine3A::IDENTITY);
    let (min, max) = scene.bounds(&pose).unwrap();
    assert!(max.length() < 5.0 && min.length() < 5.0, "{min} {max}");
}

#[test]
fn motion_follows_a_bone() {
    let (worst, count) = worst_vector(&arm(), |pixel, p| match pixel.triangle {
        0 | 1 => p,
        _ => ELBOW + Quat::from_rotation_z(-ANGLE) * (p - ELBOW),
    });
    assert!(count > 2500, "{count} vectors");
    assert!(worst < 1.0 / 16.0, "worst vector is {worst} pixels off");
}

#[test]
fn motion_follows_a_morph_and_its_node() {
    let (worst, count) = worst_vector(&leaning(), |_, p| vec3(p.x - 0.1 - 0.4 * p.y, p.y, p.z));
    assert!(count > 2000, "{count} vectors");
    assert!(worst < 1.0 / 16.0, "worst vector is {worst} pixels off");
}

#[test]
fn shapes_that_rest_are_at_rest() {
    for mut scene in [arm(), leaning()] {
        assert_eq!(scene.moving_instances(), [true]);
        scene.channels.clear();
        assert_eq!(scene.moving_instances(), [false]);
        let (frame, again) = (seen(&scene, 0.0), seen(&scene, 1.0));
        assert_eq!(frame.pixels.samples(), again.pixels.samples());
        let hits = frame.pixels.samples().iter().filter(|pixel| pixel.instance != NOTHING).count();
        assert!(hits > 2000, "{hits} pixels see it");
    }
}

#[test]
fn anchors_stay_on_what_bends() {
    for scene in [arm(), leaning()] {
        let units = Units::of(&scene);
        let start = scene.pose(0.0);
        let anchors = Anchors::spread(&Surfaces::new(&scene, &start), &units, 0, 200);
        let pose = scene.pose(1.0);
        let surfaces = Surfaces::new(&scene, &pose);
        let accelerator = Geometry::new(&scene).place(&pose);
        let dynamic = anchors.dynamic_in_world(&surfaces);
        assert_eq!(dynamic.len(), 200);
        for anchor in dynamic {
            let from = anchor.position + anchor.normal * 0.5;
            let hit = accelerator.closest(from, -anchor.normal).expect("a surface below the anchor");
            assert!((hit.distance - 0.5).abs() < 1e-3, "{} m above the surface", hit.distance - 0.5);
        }
    }
}
