//! Tests that compare motion vectors with analytic projection.

use crate::common::{add, material, quad, rest};
use glam::{Quat, Vec2, Vec3, vec3};
use plane::NO_MATCH;
use render_core::scene::{
    Camera, Channel, Interpolation, MaterialLobes, Node, Projection, Scene, Track, Transform, Transmission,
};
use render_core::{Accelerator, GBuffer, Geometry, NOTHING, PosedScene, Surfaces};

const SIZE: usize = 128;
const YFOV: f32 = 0.9;

fn seen(scene: &Scene, time: f32) -> GBuffer {
    let pose = scene.pose(time);
    let accelerator: Accelerator = Geometry::new(scene).place(&pose);
    let (surfaces, view) = (Surfaces::new(scene, &pose), scene.view(&pose, SIZE, SIZE));
    GBuffer::trace(PosedScene::new(&accelerator, &surfaces), &view, (SIZE, SIZE)).value
}

/// Builds a wall at z = −6, a board in front of it that moves and rotates, and a camera that moves and rotates.
fn scene() -> Scene {
    let mut scene = Scene::default();
    let gray = || material(Vec3::splat(0.5), Vec3::ZERO);
    add(&mut scene, rest(Vec3::ZERO), quad(vec3(-20.0, -20.0, -6.0), Vec3::X * 40.0, Vec3::Y * 40.0), gray());
    let board = quad(vec3(-0.8, -0.8, 0.0), Vec3::X * 1.6, Vec3::Y * 1.6);
    let node = add(&mut scene, rest(vec3(0.0, 0.0, -3.0)), board, gray());
    let camera = scene.nodes.len();
    scene.nodes.push(Node { name: "camera".into(), parent: None, rest: rest(Vec3::ZERO) });
    scene.cameras.push(Camera {
        name: "camera".into(),
        node: camera,
        projection: Projection::Perspective { yfov: YFOV },
        ..Camera::default()
    });
    let mut animate = |node, track| {
        scene.channels.push(Channel { node, times: vec![0.0, 1.0], track, interpolation: Interpolation::Linear });
    };
    animate(node, Track::Translation(vec![vec3(0.0, 0.0, -3.0), vec3(0.21, -0.1, -3.0)]));
    animate(node, Track::Rotation(vec![Quat::IDENTITY, Quat::from_rotation_z(0.12)]));
    animate(camera, Track::Translation(vec![Vec3::ZERO, vec3(0.13, 0.07, -0.2)]));
    animate(camera, Track::Rotation(vec![Quat::IDENTITY, Quat::from_rotation_y(0.05)]));
    scene
}

/// Returns the pixel of the world point `p` for a camera at `place`, in closed form.
fn pixel(place: Transform, p: Vec3) -> Vec2 {
    let local = place.rotation.inverse() * (p - place.translation);
    let focal = SIZE as f32 / 2.0 / (YFOV / 2.0).tan();
    Vec2::new(SIZE as f32 / 2.0 + focal * local.x / -local.z, SIZE as f32 / 2.0 - focal * local.y / -local.z)
}

/// Compares vectors with the closed form. `shows_board` is whether the board's pixels show the board, not the wall
/// behind it. Returns the number of vectors, and of those at the board.
fn assert_closed_form(scene: &Scene, shows_board: bool) -> (usize, usize) {
    let (before, now) = (seen(scene, 0.0), seen(scene, 1.0));
    let correspondence = now.reproject(&before).value;
    let camera =
        [rest(Vec3::ZERO), Transform { rotation: Quat::from_rotation_y(0.05), ..rest(vec3(0.13, 0.07, -0.2)) }];
    let (mut checked, mut board, mut worst) = (0, 0, 0.0f32);
    for y in 0..SIZE {
        for x in 0..SIZE {
            let Some([dx, dy]) = correspondence.motion_of(x, y) else { continue };
            // Intersect the pixel's analytic ray with the plane of its surface.
            let center = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
            let focal = SIZE as f32 / 2.0 / (YFOV / 2.0).tan();
            let half = SIZE as f32 / 2.0;
            let ray = camera[1].rotation * vec3((center.x - half) / focal, (half - center.y) / focal, -1.0);
            let meets_board = now.pixels.get(x, y).instance == 1;
            let on_board = meets_board && shows_board;
            let plane_z = if on_board { -3.0 } else { -6.0 };
            let p = camera[1].translation + ray * ((plane_z - camera[1].translation.z) / ray.z);
            // Compute the point's previous position: invert the board's pose in this frame, and apply the pose in the
            // other frame.
            let then = if on_board {
                Quat::from_rotation_z(-0.12) * (p - vec3(0.21, -0.1, -3.0)) + vec3(0.0, 0.0, -3.0)
            } else {
                p
            };
            let error = (center + Vec2::new(dx, dy) - pixel(camera[0], then)).length();
            worst = worst.max(error);
            checked += 1;
            board += usize::from(meets_board);
        }
    }
    assert!(worst <= 1.0 / 16.0, "worst vector is {worst} pixels off");
    (checked, board)
}

#[test]
fn vectors_are_within_a_sixteenth_of_a_pixel_of_the_closed_form() {
    let (checked, board) = assert_closed_form(&scene(), true);
    assert!(checked > SIZE * SIZE * 8 / 10 && board > 1000, "{checked} vectors, {board} on the board");
}

/// Changes the material of the scene's second instance to a thin wall of glass.
fn make_pane(scene: &mut Scene, factor: f32, roughness: f32, tint: f32) {
    let transmission = Transmission { factor, ..Transmission::default() };
    let material = &mut scene.materials[1];
    material.base_color = Vec3::splat(tint);
    material.roughness = roughness;
    material.metallic = 0.0;
    material.double_sided = true;
    material.lobes = Some(Box::new(MaterialLobes { transmission, ..MaterialLobes::default() }));
}

/// Pixels of a moving pane, clear or tinted, have the motion of the wall behind it, also at borders of the pane. Dark,
/// rough and mostly opaque panes have their own motion.
#[test]
fn panes_move_as_the_surface_behind_them() {
    for (factor, roughness, tint, shows_board) in [
        (1.0, 0.0, 1.0, false),
        (0.7, 0.0, 1.0, false),
        (1.0, 0.0, 0.5, false),
        (1.0, 0.0, 0.1, true),
        (1.0, 0.6, 1.0, true),
        (0.2, 0.0, 1.0, true),
    ] {
        let mut scene = scene();
        make_pane(&mut scene, factor, roughness, tint);
        let (checked, board) = assert_closed_form(&scene, shows_board);
        // A pane hides nothing, so more pixels have a vector.
        let least = if shows_board { 8 } else { 9 };
        assert!(checked > SIZE * SIZE * least / 10 && board > 1000, "{checked} vectors, {board} on the pane");
    }
}

/// Two panes in front of the sky: the camera's rotation moves the sky, at any position of the panes.
#[test]
fn sky_behind_panes_moves_with_the_camera() {
    let mut scene = scene();
    scene.channels.remove(2);
    make_pane(&mut scene, 1.0, 0.0, 1.0);
    scene.materials[0] = scene.materials[1].clone();
    let correspondence = seen(&scene, 1.0).reproject(&seen(&scene, 0.0)).value;
    let (half, focal) = (SIZE as f32 / 2.0, SIZE as f32 / 2.0 / (YFOV / 2.0).tan());
    let mut checked = 0;
    for (k, motion) in correspondence.motion().samples().iter().enumerate() {
        let (x, y) = (k % SIZE, k / SIZE);
        if correspondence.match_of(x, y).is_none() {
            continue;
        }
        let center = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
        let ray = vec3((center.x - half) / focal, (half - center.y) / focal, -1.0);
        let turned = Quat::from_rotation_y(0.05) * ray;
        let error = center + Vec2::from(*motion) - pixel(rest(Vec3::ZERO), turned);
        assert!(error.length() < 1.0 / 16.0, "vector at ({x}, {y}) is {error} pixels off");
        checked += 1;
    }
    assert!(checked > SIZE * SIZE * 8 / 10, "{checked} vectors");
}

#[test]
fn what_was_hidden_has_no_vector() {
    let mut scene = scene();
    scene.channels.truncate(1);
    // The board slides right by 0.6 m and uncovers a strip of wall at its left border.
    scene.channels[0].track = Track::Translation(vec![vec3(0.0, 0.0, -3.0), vec3(0.6, 0.0, -3.0)]);
    let correspondence = seen(&scene, 1.0).reproject(&seen(&scene, 0.0)).value;
    let focal = SIZE as f32 / 2.0 / (YFOV / 2.0).tan();
    let border = |left: f32| SIZE as f32 / 2.0 + focal * left / 3.0;
    let (was, is) = (border(-0.8), border(-0.2));
    let row = SIZE / 2;
    for x in 0..SIZE {
        let uncovered = (x as f32 + 1.0) > was + 1.5 && (x as f32) < is - 1.5;
        if uncovered {
            assert_eq!(correspondence.matches().get(x, row), NO_MATCH, "column {x} was behind the board");
        } else if (x as f32) < was - 2.0 {
            let index = (row * SIZE + x) as u32;
            assert_eq!(correspondence.matches().get(x, row), index, "column {x} showed the same wall");
        }
    }
}

#[test]
fn at_rest_everything_is_its_own_match() {
    let mut scene = scene();
    scene.channels.clear();
    let frame = seen(&scene, 0.0);
    let correspondence = frame.reproject(&seen(&scene, 1.0)).value;
    for (index, (motion, &found)) in
        correspondence.motion().samples().iter().zip(correspondence.matches().samples()).enumerate()
    {
        assert_eq!(found, index as u32);
        assert!(motion.iter().all(|m| m.abs() < 1e-2), "{motion:?}");
    }
    assert!(frame.pixels.samples().iter().all(|pixel| pixel.instance != NOTHING));
}
