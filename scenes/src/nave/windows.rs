//! Windows of the church: emissive leaded panes in splayed openings behind stone tracery.

use std::f32::consts::TAU;

use glam::{Vec3, vec2, vec3};

use super::Stones;
use super::walls::{aisle_wall, aisle_windows, apse_wall, apse_window, clerestory_windows, nave_wall};
use crate::arches::{Opening, Pane, Plane};
use crate::columns::archivolt;
use crate::glb::{Model, Scene};
use crate::mesh::Mesh;
use crate::shapes::{Frame, arc, ring, sweep};

/// Distance from the wall's face back to the glass \[m\].
const DEPTH: f32 = 0.42;

/// Adds all windows of the church.
pub(super) fn add(scene: &mut Scene, stones: &Stones) {
    let mut glass = Model::new();
    let mut tracery = Model::new();
    for side in [-1.0, 1.0] {
        // Clerestory and aisles have grisaille glass.
        let plane = nave_wall(side);
        for o in clerestory_windows(&plane) {
            window(glass.of(stones.high_glass), &mut tracery, stones, &plane, &o);
        }
        let plane = aisle_wall(side);
        for o in aisle_windows(&plane) {
            window(glass.of(stones.aisle_glass), &mut tracery, stones, &plane, &o);
        }
    }
    // The apse has one window per side.
    for i in 0..3 {
        window(glass.of(stones.apse_glass), &mut tracery, stones, &apse_wall(i), &apse_window());
    }
    rose_window(&mut glass, &mut tracery, stones);
    scene.show("tracery", tracery);
    scene.show("glass", glass);
}

fn window(glass: &mut Mesh, tracery: &mut Model, stones: &Stones, plane: &Plane, o: &Opening) {
    o.reveal(tracery.of(stones.trim), plane, DEPTH, 10);
    o.archivolt_with_jambs(tracery.of(stones.trim), plane, &archivolt(0.20, 0.06), 10);
    o.pane(glass, plane, Pane { depth: DEPTH - 0.01, steps: 10 }, |x, y| vec2(0.5 + 0.5 * x, 1.0 - y));
    // Two lights have pointed heads and a ring above them. The tracery's plane is 9 cm in front of the glass.
    let face = Plane { origin: plane.origin - plane.out * (DEPTH - 0.10), ..*plane };
    let stone = tracery.of(stones.trim);
    let (w, d) = (0.055, 0.07);
    // Add the mullion between the lights.
    let mullion = [vec2(w, -d), vec2(w, 0.0), vec2(0.4 * w, d), vec2(-0.4 * w, d), vec2(-w, 0.0), vec2(-w, -d)];
    let upright = |y: f32| Frame { origin: face.at(o.center, y, 0.0), x: -face.along, y: face.out };
    let low = o.spring - 0.1 * o.half;
    sweep(stone, &[upright(low + 0.55 * o.half), upright(o.sill)], &mullion);
    let edge = [vec2(0.05, -d), vec2(0.05, 0.0), vec2(0.02, d), vec2(-0.02, d), vec2(-0.05, 0.0), vec2(-0.05, -d)];
    for sign in [-1.0, 1.0] {
        let light = Opening { center: o.center + sign * o.half / 2.0, half: o.half / 2.0, spring: low, ..*o };
        light.archivolt(stone, &face, &edge, 7);
    }
    let head = face.at(o.center, o.spring + 0.80 * o.half, 0.0);
    ring(stone, head, face.out, [0.36 * o.half, 0.05], 18);
}

/// Adds the round window above the west door, mounted on the wall in a heavy ring.
fn rose_window(glass: &mut Model, tracery: &mut Model, stones: &Stones) {
    let (center, radius) = (vec3(0.0, 10.9, -0.03), 2.3);
    let rim = |i: usize| {
        let (sin, cos) = (TAU * (i % 32) as f32 / 32.0).sin_cos();
        (center + radius * Vec3::new(cos, sin, 0.0), vec2(0.5 + 0.5 * cos, 0.5 - 0.5 * sin))
    };
    let mesh = glass.of(stones.rose_glass);
    // Add the glass as a fan of triangles.
    let middle = mesh.vertex(center, Vec3::NEG_Z, vec2(0.5, 0.5));
    for i in 0..32 {
        let [a, b] = [i, i + 1].map(|k| {
            let (p, uv) = rim(k);
            mesh.vertex(p, Vec3::NEG_Z, uv)
        });
        mesh.face(middle, a, b);
    }
    for (r, t) in [(radius, 0.12), (radius + 0.25, 0.08), (radius * 0.5, 0.06), (radius * 0.25, 0.05)] {
        ring(tracery.of(stones.trim), center, Vec3::Z, [r, t], 32);
    }
    // Add twelve spokes between the inner ring and the rim.
    let section = arc(glam::Vec2::ZERO, 0.05, 0.0, 360.0, 6);
    for i in 0..12 {
        let (sin, cos) = (TAU * i as f32 / 12.0).sin_cos();
        let out = Vec3::new(cos, sin, 0.0);
        let frame = |r: f32| Frame { origin: center + out * r, x: Vec3::Z, y: out.cross(Vec3::Z) };
        sweep(tracery.of(stones.trim), &[frame(radius * 0.25), frame(radius)], &section);
    }
}
