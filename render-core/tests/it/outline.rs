//! Tests of the visibility of fronts and backs, and of bodies seen exactly along their edges, where front and
//! back are at the same distance.

use crate::common::{add, material, quad, rest};
use glam::{Quat, Vec2, Vec3, Vec3A, vec3};
use render_core::scene::{Material, Mesh, Projection, Scene, View};
use render_core::{
    Emitters, GBuffer, Geometry, NOTHING, PathOptions, PathTracer, PixelSampling, PosedScene, Surfaces, Units,
};
use std::f32::consts::TAU;

const SIZE: usize = 64;
/// Number of sides of a column.
const SIDES: u32 = 14;
/// Radius of a column \[m\].
const RADIUS: f32 = 0.2;
/// Length of a column \[m\].
const LENGTH: f32 = 30.0;

/// Builds an open column around the y axis, facing outward, with two triangles per side.
fn column() -> Mesh {
    let mut mesh = Mesh::default();
    for k in 0..SIDES {
        let (z, x) = (TAU * k as f32 / SIDES as f32).sin_cos();
        mesh.positions.extend([-0.5, 0.5].map(|y| vec3(x * RADIUS, y * LENGTH, z * RADIUS)));
        let (a, b) = (2 * k, 2 * ((k + 1) % SIDES));
        mesh.triangles.extend([[a, a + 1, b], [b, a + 1, b + 1]]);
    }
    mesh
}

/// Columns have an outer edge at pixel centers, and each column is rotated slightly more than the previous one.
#[test]
fn no_pixel_sees_the_far_side_of_a_closed_body() {
    let view = View::new(glam::Affine3A::IDENTITY, Projection::Perspective { yfov: 1.2 }, SIZE, SIZE);
    let mut seen = 0;
    for k in 0..200 {
        let turn = Quat::from_rotation_y(0.37 * k as f32);
        // Find a point a few meters along the ray through the middle row. Add a column with its rightmost or
        // leftmost edge at this point.
        let column_of_pixels = 8 + k % 48;
        let (_, direction) = view.ray(Vec2::new(column_of_pixels as f32 + 0.5, SIZE as f32 / 2.0));
        let edge = Vec3::from(direction) * (6.0 + k as f32 / 20.0);
        let across = Vec3::Y.cross(edge).normalize() * if k % 2 == 0 { 1.0 } else { -1.0 };
        let outermost = (0..SIDES)
            .map(|side| turn * (Quat::from_rotation_y(-TAU * side as f32 / SIDES as f32) * Vec3::X * RADIUS))
            .max_by(|p, q| p.dot(across).total_cmp(&q.dot(across)))
            .unwrap();
        let axis = edge - outermost;
        let mut scene = Scene::default();
        let mut place = rest(axis);
        place.rotation = turn;
        // Backs of single-sided surfaces would be invisible.
        let double_sided = Material { double_sided: true, ..material(Vec3::ONE, Vec3::ZERO) };
        add(&mut scene, place, column(), double_sided);
        let pose = scene.pose(0.0);
        let (surfaces, accelerator) = (Surfaces::new(&scene, &pose), Geometry::new(&scene).place(&pose));
        let picture = GBuffer::trace(PosedScene::new(&accelerator, &surfaces), &view, (SIZE, SIZE)).value;
        for pixel in picture.pixels.samples().iter().filter(|pixel| pixel.instance != NOTHING) {
            seen += 1;
            let outward = (Vec3A::from(pixel.position) - Vec3A::from(axis)).with_y(0.0);
            assert!(outward.dot(pixel.geometric_normal.into()) > 0.0, "column {k} from within: {pixel:?}");
        }
    }
    assert!(seen > 20_000, "only {seen} pixels saw a column");
}

/// Of three sheets in sequence, the first two are seen from behind. In films and in the path tracer, single-sided
/// sheets show the sheets behind them. A double-sided sheet shows itself.
#[test]
fn the_back_of_a_single_sided_surface_is_not_shown() {
    let view = View::new(glam::Affine3A::IDENTITY, Projection::Perspective { yfov: 1.2 }, SIZE, SIZE);
    for (middle_double_sided, expected) in [(false, 2), (true, 1)] {
        let mut scene = Scene::default();
        for (k, towards) in [false, false, true].into_iter().enumerate() {
            let corner = vec3(-40.0, -40.0, -4.0 - k as f32);
            let sheet = if towards { [Vec3::X, Vec3::Y] } else { [Vec3::Y, Vec3::X] }.map(|side| 80.0 * side);
            // Use a distinct unlit color for each sheet.
            let glow = Vec3::splat(k as f32 + 1.0);
            let double_sided = k == 1 && middle_double_sided;
            let sheet_material = Material { double_sided, ..material(Vec3::ZERO, glow) };
            add(&mut scene, rest(Vec3::ZERO), quad(corner, sheet[0], sheet[1]), sheet_material);
        }
        let pose = scene.pose(0.0);
        let (surfaces, accelerator) = (Surfaces::new(&scene, &pose), Geometry::new(&scene).place(&pose));
        let picture = GBuffer::trace(PosedScene::new(&accelerator, &surfaces), &view, (SIZE, SIZE)).value;
        let depth = 4.0 + expected as f32;
        for pixel in picture.pixels.samples() {
            assert_eq!(pixel.instance, expected);
            assert!((pixel.depth / depth - 1.0).abs() < 1e-4, "{} instead of {depth}", pixel.depth);
        }
        let units = Units::of(&scene);
        let emitters = Emitters::new(&surfaces, &pose, &units);
        let tracer = PathTracer::new(PosedScene::new(&accelerator, &surfaces), &emitters, &units);
        for pixel in [PixelSampling::Center, PixelSampling::Area] {
            let options = PathOptions { samples: 4, max_bounces: Some(0), pixel, ..PathOptions::default() };
            let traced = tracer.render(&view, &options, |_, _| ());
            let glow = if expected == 1 { 2.0 } else { 3.0 };
            assert!(traced.mean.samples().iter().all(|&rgb| rgb == [glow; 3]), "{:?}", traced.mean.get(0, 0));
        }
    }
}

/// Surfaces behind a back are visible in two difficult cases. In one, the back's triangle is so large that hits are off
/// by more than a step past it. In the other, the viewer is inside the back, and a fraction of the distance is zero.
#[test]
fn huge_and_close_backs_are_seen_through() {
    let view = View::new(glam::Affine3A::IDENTITY, Projection::Perspective { yfov: 1.2 }, SIZE, SIZE);
    for (side, distance) in [(1e2, 4.0), (1e5, 4.0), (1e6, 4.0), (1e7, 4.0), (1e2, 0.0), (1e7, 0.0)] {
        let mut scene = Scene::default();
        // The front is small, and far enough behind the back to be a separate hit despite rounding.
        let tilted = vec3(0.0, 1.0, -0.3).normalize();
        let corner = vec3(0.0, 0.0, -distance) - side * (0.31 * Vec3::X + 0.37 * tilted);
        add(&mut scene, rest(Vec3::ZERO), quad(corner, side * tilted, side * Vec3::X), material(Vec3::ONE, Vec3::ZERO));
        let front = quad(vec3(-400.0, -400.0, -90.0), 800.0 * Vec3::X, 800.0 * Vec3::Y);
        add(&mut scene, rest(Vec3::ZERO), front, material(Vec3::ONE, Vec3::ZERO));
        let pose = scene.pose(0.0);
        let (surfaces, accelerator) = (Surfaces::new(&scene, &pose), Geometry::new(&scene).place(&pose));
        let picture = GBuffer::trace(PosedScene::new(&accelerator, &surfaces), &view, (SIZE, SIZE)).value;
        let shown = picture.pixels.samples().iter().filter(|pixel| pixel.instance == 1).count();
        assert_eq!(shown, SIZE * SIZE, "{side} m wide, {distance} m away");
    }
}
