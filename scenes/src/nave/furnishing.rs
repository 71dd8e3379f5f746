//! Furnishing of the church: pews, altar, chandeliers.

use std::f32::consts::TAU;

use glam::{Quat, Vec2, Vec3, vec2, vec3};

use super::{APSE, BAY, BAYS, CHANCEL, Stones};
use crate::glb::{Model, Scene};
use crate::mesh::Mesh;
use crate::shapes::{bar, lathe, ring};

/// Adds the furniture and the chandeliers of the church.
pub(super) fn add(scene: &mut Scene, stones: &Stones) {
    let mut pew = Model::new();
    one_pew(pew.of(stones.oak));
    let pew = scene.mesh("pew", pew);
    // Place the pews in two columns along the central aisle.
    let rows = 21;
    for i in 0..rows {
        let z = -4.2 - 1.05 * i as f32;
        for x in [-2.45, 2.45] {
            scene.node("pew", Some(pew), vec3(x, 0.002, z), Quat::IDENTITY);
        }
    }
    let mut model = Model::new();
    altar(&mut model, stones);
    runner(&mut model, stones);
    scene.show("altar", model);

    // All chandeliers share one mesh.
    let mut wheel = Model::new();
    chandelier(&mut wheel, stones);
    let wheel = scene.mesh("chandelier", wheel);
    for i in [1, 3, 5] {
        let at = vec3(0.0, 5.4, -BAY * (i as f32 - 0.5) - BAY / 2.0);
        scene.node("chandelier", Some(wheel), at, Quat::from_rotation_y(0.3 * i as f32));
    }
}

/// Adds a bench 2.9 m long that faces -z, with carved ends.
fn one_pew(mesh: &mut Mesh) {
    let half = 1.45;
    let block = |mesh: &mut Mesh, x: [f32; 2], y: [f32; 2], z: [f32; 2]| {
        mesh.cuboid(vec3(x[0], y[0], z[0]), vec3(x[1], y[1], z[1]));
    };
    // Add the seat, the board below it, the back, its rail and the book rest.
    let inside = [-half + 0.03, half - 0.03];
    block(mesh, inside, [0.42, 0.46], [-0.22, 0.20]);
    block(mesh, inside, [0.12, 0.42], [0.12, 0.15]);
    block(mesh, inside, [0.50, 0.90], [0.20, 0.235]);
    block(mesh, inside, [0.90, 0.935], [0.16, 0.28]);
    block(mesh, inside, [0.70, 0.725], [0.236, 0.38]);
    // The ends have an outline with a rounded shoulder and a small finial.
    let outline: [Vec2; 13] = [
        vec2(-0.26, 0.0),
        vec2(-0.26, 0.52),
        vec2(-0.22, 0.60),
        vec2(-0.10, 0.64),
        vec2(0.02, 0.70),
        vec2(0.10, 0.84),
        vec2(0.13, 0.98),
        vec2(0.17, 1.04),
        vec2(0.22, 1.06),
        vec2(0.27, 1.04),
        vec2(0.30, 0.98),
        vec2(0.30, 0.30),
        vec2(0.33, 0.0),
    ];
    let middle = vec2(0.12, 0.42);
    for side in [-1.0, 1.0] {
        let (a, b) = (side * (half - 0.03), side * (half + 0.03));
        for i in 0..outline.len() {
            let (p, q) = (outline[i], outline[(i + 1) % outline.len()]);
            let d = (q - p).normalize();
            let out = vec3(0.0, d.x, -d.y);
            let at = |x: f32, p: Vec2| vec3(x, p.y, p.x);
            mesh.quad_facing([at(a, p), at(a, q), at(b, q), at(b, p)], out);
            // Close both faces of the end with a fan of triangles.
            for (x, normal) in [(a, -side), (b, side)] {
                let corner = |p: Vec2, mesh: &mut Mesh| mesh.vertex(at(x, p), Vec3::X * normal, vec2(p.x, -p.y));
                let v = [corner(p, mesh), corner(q, mesh), corner(middle, mesh)];
                mesh.face(v[0], v[1], v[2]);
            }
        }
    }
}

fn altar(model: &mut Model, stones: &Stones) {
    let z = APSE.y - 0.6;
    let floor = CHANCEL;
    // Add a step on all sides, the table and its cloth.
    model.of(stones.steps).cuboid(vec3(-2.2, floor - 0.05, z - 1.1), vec3(2.2, floor + 0.14, z + 1.2));
    let top = floor + 0.14;
    model.of(stones.trim).cuboid(vec3(-1.3, top - 0.01, z - 0.45), vec3(1.3, top + 0.95, z + 0.45));
    model.of(stones.trim).cuboid(vec3(-1.45, top + 0.95, z - 0.55), vec3(1.45, top + 1.05, z + 0.55));
    model.of(stones.linen).cuboid(vec3(-1.47, top + 1.052, z - 0.50), vec3(1.47, top + 1.06, z + 0.50));
    model.of(stones.carpet).surface(40, 8, vec2(2.4, 0.8), |u, v| {
        let fold = 0.012 * (TAU * 9.0 * u).sin() * v;
        vec3(-1.2 + 2.4 * u, top + 0.94 - 0.8 * v, z + 0.475 + fold)
    });
    model.of(stones.linen).cuboid(vec3(-1.3, top + 0.86, z + 0.552), vec3(1.3, top + 1.058, z + 0.56));
    // Add the gilded cross on its foot, between the candlesticks.
    let gold = model.of(stones.gold);
    let table = top + 1.06;
    gold.cuboid(vec3(-0.035, table + 0.25, z - 0.235), vec3(0.035, table + 1.15, z - 0.165));
    gold.cuboid(vec3(-0.28, table + 0.78, z - 0.23), vec3(0.28, table + 0.85, z - 0.17));
    let foot = [vec2(0.17, 0.0), vec2(0.16, 0.04), vec2(0.05, 0.10), vec2(0.06, 0.16), vec2(0.03, 0.26)];
    lathe(gold, vec3(0.0, table, z - 0.2), &foot, 16, 0.5);
    // Add four candlesticks with candles.
    for x in [-1.1, -0.75, 0.75, 1.1] {
        let at = vec3(x, table, z - 0.2);
        let stick = [
            vec2(0.09, 0.0),
            vec2(0.08, 0.03),
            vec2(0.025, 0.08),
            vec2(0.04, 0.14),
            vec2(0.022, 0.20),
            vec2(0.022, 0.32),
            vec2(0.06, 0.36),
            vec2(0.0, 0.36),
        ];
        lathe(model.of(stones.gold), at, &stick, 12, 0.5);
        lathe(model.of(stones.candle), at, &[vec2(0.022, 0.36), vec2(0.022, 0.68), vec2(0.0, 0.69)], 10, 0.2);
    }
}

/// Adds the carpet of the central aisle, up to the steps.
fn runner(model: &mut Model, stones: &Stones) {
    let end = -BAY * BAYS as f32 + 0.82;
    let p = |w: f32, y: f32| [(-w, -1.5), (w, -1.5), (w, end), (-w, end)].map(|(x, z)| vec3(x, y, z));
    model.of(stones.carpet).quad_facing(p(0.55, 0.006), Vec3::Y);
    for side in [-1.0, 1.0] {
        let (a, b) = (side * 0.48, side * 0.51);
        let strip = [(a, -1.5), (b, -1.5), (b, end), (a, end)].map(|(x, z)| vec3(x, 0.009, z));
        model.of(stones.gold).quad_facing(strip, Vec3::Y);
    }
}

/// Adds an iron wheel with twelve candles on four chains.
fn chandelier(model: &mut Model, stones: &Stones) {
    for (r, y) in [(1.05, 0.0), (1.05, 0.12), (0.35, 0.55)] {
        ring(model.of(stones.iron), vec3(0.0, y, 0.0), Vec3::Y, [r, 0.022], 36);
    }
    // Add a candle on a pricket with a drip pan.
    for i in 0..12 {
        let (sin, cos) = (TAU * i as f32 / 12.0).sin_cos();
        let out = vec3(cos, 0.0, sin);
        let at = out * 1.05;
        bar(model.of(stones.iron), at, at + Vec3::Y * 0.2, 0.015, 6);
        lathe(
            model.of(stones.iron),
            at,
            &[vec2(0.0, 0.17), vec2(0.06, 0.19), vec2(0.07, 0.22), vec2(0.0, 0.2)],
            10,
            0.3,
        );
        lathe(model.of(stones.candle), at, &[vec2(0.02, 0.2), vec2(0.02, 0.40), vec2(0.0, 0.41)], 8, 0.2);
        // Add a chain at every third candle.
        if i % 3 == 0 {
            bar(model.of(stones.iron), at + Vec3::Y * 0.12, out * 0.35 + Vec3::Y * 0.55, 0.012, 6);
            bar(model.of(stones.iron), out * 0.35 + Vec3::Y * 0.55, vec3(0.0, 1.3, 0.0), 0.012, 6);
        }
    }
    // Hang the chandelier from the vault's boss.
    bar(model.of(stones.iron), vec3(0.0, 1.28, 0.0), vec3(0.0, 8.72, 0.0), 0.012, 6);
}
