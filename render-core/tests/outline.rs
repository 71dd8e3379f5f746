//! Bodies seen exactly along their edges, where the near side and the far one are equally far away.

mod common;

use common::{add, material, rest};
use glam::{Quat, Vec2, Vec3, Vec3A, vec3};
use render_core::scene::{Mesh, Projection, Scene, View};
use render_core::{Busy, GBuffer, Geometry, NOTHING, Surfaces};
use std::f32::consts::TAU;

const SIZE: usize = 64;
/// Sides of a column, its radius and its length \[m\].
const SIDES: u32 = 14;
const RADIUS: f32 = 0.2;
const LENGTH: f32 = 30.0;

/// A column without ends around the y axis, facing outward, of two triangles a side.
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

/// Columns are put where pixel centres see one of their outer edges, turned a little more each time.
#[test]
fn no_pixel_sees_the_far_side_of_a_closed_body() {
    let view = View::new(glam::Affine3A::IDENTITY, Projection::Perspective { yfov: 1.2 }, SIZE, SIZE);
    let mut seen = 0;
    for k in 0..200 {
        let turn = Quat::from_rotation_y(0.37 * k as f32);
        // Where the ray through the middle row comes to a few metres from the viewer, and the column that has its rightmost
        // edge there, or its leftmost.
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
        add(&mut scene, place, column(), material(Vec3::ONE, Vec3::ZERO));
        let pose = scene.pose(0.0);
        let (surfaces, accelerator) = (Surfaces::new(&scene, &pose), Geometry::new(&scene).place(&pose));
        let picture = GBuffer::trace(&accelerator, &surfaces, &view, (SIZE, SIZE), &Busy::default());
        for pixel in picture.pixels.samples().iter().filter(|pixel| pixel.instance != NOTHING) {
            seen += 1;
            let outward = (Vec3A::from(pixel.position) - Vec3A::from(axis)).with_y(0.0);
            assert!(outward.dot(pixel.geometric_normal.into()) > 0.0, "column {k} from within: {pixel:?}");
        }
    }
    assert!(seen > 20_000, "only {seen} pixels saw a column");
}
