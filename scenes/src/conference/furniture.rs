//! Furniture of the conference room: the table and the objects on it, the chairs, the plants.

use std::f32::consts::{FRAC_PI_2, PI, TAU};

use glam::{Vec2, Vec3, vec2, vec3};

use super::RoomMaterials;
use crate::glb::{Model, Scene};
use crate::mesh::{Mesh, Vertex};
use crate::noise::hash;
use crate::shapes::{Frame, arc, ball, bar, chain, lathe, sweep};

/// Half the table's length \[m\].
const LENGTH: f32 = 3.5;
/// Height of the tabletop \[m\].
const TOP: f32 = 0.75;

/// Returns half the table's width at position `x` \[m\]. The table is widest in the middle.
fn half_width(x: f32) -> f32 {
    1.02 - 0.24 * (x / LENGTH).powi(2)
}

/// Returns the outline of the table, reduced by `inset` \[m\].
fn outline(inset: f32) -> Vec<Vec2> {
    let n = 20;
    let round = 0.22 - inset.min(0.2);
    let mut side = Vec::new();
    for i in 0..=n {
        let x = -(LENGTH - inset - round) + 2.0 * (LENGTH - inset - round) * i as f32 / n as f32;
        side.push(vec2(x, half_width(x) - inset));
    }
    // Round the corners, and mirror the side for the other half.
    let end = half_width(LENGTH - inset - round) - inset - round;
    side.extend(arc(vec2(LENGTH - inset - round, end), round, 75.0, 0.0, 5));
    let other: Vec<Vec2> = side.iter().map(|p| -*p).collect();
    let first: Vec<Vec2> = arc(vec2(-(LENGTH - inset - round), end), round, 180.0, 105.0, 5);
    let mut all = first.clone();
    all.extend(side);
    all.extend(first.iter().map(|p| -*p));
    all.extend(other);
    all
}

/// Adds the table, papers, cups and a bowl.
pub(super) fn table(scene: &mut Scene, f: &RoomMaterials) {
    let mut model = Model::new();
    // The edge profile follows the outline: underside, nosing, top rim.
    let profile = [(0.08, -0.045), (0.01, -0.040), (0.0, -0.030), (0.0, -0.012), (0.008, 0.0), (0.03, 0.0)];
    for w in profile.windows(2) {
        let (a, b) = (outline(w[0].0), outline(w[1].0));
        let n = a.len();
        // Tilt the outline's outward normal by the slope of the profile.
        let normal = |i: usize| {
            let d = (a[(i + 1) % n] - a[(i + n - 1) % n]).normalize();
            let out = vec2(d.y, -d.x);
            let out = out * out.dot(a[i]).signum();
            let (inward, up) = (w[1].0 - w[0].0, w[1].1 - w[0].1);
            let len = inward.hypot(up);
            (vec3(out.x, 0.0, out.y) * up / len + Vec3::Y * inward / len).normalize()
        };
        model.of(f.table).grid(n, 1, |i, j| {
            let i = i % n;
            let (p, y) = if j == 0 { (a[i], w[0].1) } else { (b[i], w[1].1) };
            Vertex { position: vec3(p.x, TOP + y, p.y), normal: normal(i), uv: vec2(p.y + y, p.x) }
        });
    }
    for (inset, y, normal) in [(0.03, 0.0, Vec3::Y), (0.08, -0.045, Vec3::NEG_Y)] {
        fan(model.of(f.table), &outline(inset), TOP + y, normal);
    }
    // Add an inlaid strip of darker leather along the middle.
    model.of(f.dark).cuboid(vec3(-2.4, TOP + 0.001, -0.14), vec3(2.4, TOP + 0.005, 0.14));
    // Add three pedestals.
    for x in [-1.9, 0.0, 1.9] {
        let body = model.of(f.walnut);
        body.cuboid(vec3(x - 0.45, 0.06, -0.30), vec3(x + 0.45, TOP - 0.046, 0.30));
        body.cuboid(vec3(x - 0.52, 0.002, -0.37), vec3(x + 0.52, 0.06, 0.37));
    }
    // Set a place in front of each seat.
    for (i, (at, angle)) in seats().into_iter().enumerate() {
        let towards = vec3(-angle.sin(), 0.0, -angle.cos());
        let edge = vec3(at.x, TOP, at.z) + towards * if i < 14 { 0.72 } else { 0.80 };
        setting(&mut model, f, edge, angle, i as i32);
    }
    bowl(&mut model, f);
    scene.show("table", model);
}

/// Adds a flat plate with this outline, built from strips between its edges and its center line.
fn fan(mesh: &mut Mesh, outline: &[Vec2], y: f32, normal: Vec3) {
    let n = outline.len();
    for i in 0..n {
        let (a, b) = (outline[i], outline[(i + 1) % n]);
        let corner = |p: Vec2, mesh: &mut Mesh| mesh.vertex(vec3(p.x, y, p.y), normal, vec2(p.y, p.x));
        // Build strips to the center line, so that no sliver spans the table.
        let line = |p: Vec2| vec2(p.x.clamp(-LENGTH + 0.6, LENGTH - 0.6), 0.0);
        let v = [corner(a, mesh), corner(b, mesh), corner(line(b), mesh), corner(line(a), mesh)];
        mesh.face(v[0], v[1], v[2]);
        mesh.face(v[0], v[2], v[3]);
    }
}

/// Adds paper or a laptop, and sometimes a cup, in front of a seat.
fn setting(model: &mut Model, f: &RoomMaterials, at: Vec3, angle: f32, seed: i32) {
    // Rotate each setting slightly, as if placed by hand.
    let turn = angle + 0.5 * (hash(seed, 1, 3) - 0.5);
    let (sin, cos) = turn.sin_cos();
    let place = |x: f32, y: f32, z: f32| at + vec3(x * cos + z * sin, y, z * cos - x * sin);
    // Blocks rotate with the setting, so they are not axis-aligned.
    let mut block = |material, x: [f32; 2], z: [f32; 2], low: f32, high: f32| {
        let corner = |i: usize, y: f32| {
            let (x, z) = [(x[0], z[0]), (x[1], z[0]), (x[1], z[1]), (x[0], z[1])][i];
            place(x, y, z)
        };
        let mesh: &mut Mesh = model.of(material);
        mesh.quad_facing([0, 1, 2, 3].map(|i| corner(i, high)), Vec3::Y);
        for i in 0..4 {
            let k = (i + 1) % 4;
            let middle = (corner(0, 0.0) + corner(2, 0.0)) / 2.0;
            let out = (corner(i, 0.0) + corner(k, 0.0)) / 2.0 - middle;
            mesh.quad_facing([corner(i, low), corner(k, low), corner(k, high), corner(i, high)], out);
        }
    };
    if seed % 4 == 1 {
        // Add a closed laptop.
        block(f.metal, [-0.16, 0.16], [-0.11, 0.11], 0.003, 0.022);
    } else {
        block(f.white, [-0.105, 0.105], [-0.148, 0.148], 0.002, 0.008 + 0.01 * hash(seed, 2, 3));
    }
    // Add a cup on a saucer.
    if seed % 3 != 2 {
        let cup = [
            vec2(0.026, 0.004),
            vec2(0.036, 0.03),
            vec2(0.041, 0.085),
            vec2(0.037, 0.085),
            vec2(0.033, 0.03),
            vec2(0.0, 0.02),
        ];
        let side = if seed % 2 == 0 { 0.22 } else { -0.22 };
        lathe(model.of(f.white), place(side, 0.0, -0.10), &cup, 16, 0.3);
        let saucer = [vec2(0.04, 0.002), vec2(0.075, 0.012), vec2(0.0, 0.004)];
        lathe(model.of(f.white), place(side, 0.0, -0.10), &saucer, 16, 0.3);
    }
}

/// Adds a wide bowl with green apples in the middle of the table, and two carafes.
fn bowl(model: &mut Model, f: &RoomMaterials) {
    let at = vec3(0.0, TOP + 0.006, 0.0);
    let profile = [
        vec2(0.08, 0.0),
        vec2(0.09, 0.01),
        vec2(0.17, 0.05),
        vec2(0.21, 0.11),
        vec2(0.20, 0.11),
        vec2(0.16, 0.055),
        vec2(0.0, 0.03),
    ];
    lathe(model.of(f.walnut), at, &profile, 28, 1.0);
    // Arrange six apples in a ring, with one on top.
    for i in 0..6 {
        let a = TAU * i as f32 / 6.0;
        ball(model.of(f.leaf), at + vec3(0.10 * a.cos(), 0.085, 0.10 * a.sin()), 0.042, 14);
    }
    ball(model.of(f.leaf), at + vec3(0.0, 0.125, 0.0), 0.044, 14);
    // Add the carafes.
    let carafe = chain(&[
        &[vec2(0.055, 0.0), vec2(0.07, 0.02), vec2(0.068, 0.10), vec2(0.03, 0.18), vec2(0.028, 0.22), vec2(0.04, 0.26)],
        &[vec2(0.034, 0.26), vec2(0.0, 0.24)],
    ]);
    for x in [-1.5, 1.5] {
        lathe(model.of(f.glass), vec3(x, TOP + 0.006, 0.0), &carafe, 20, 0.5);
    }
}

/// Returns the positions of the chairs, and the direction of each as an angle about y from -z \[rad\].
pub(super) fn seats() -> Vec<(Vec3, f32)> {
    let mut out = Vec::new();
    for i in 0..7 {
        let x = -2.85 + 0.95 * i as f32;
        for (side, angle) in [(1.0, 0.0), (-1.0, PI)] {
            let jitter = 0.12 * (hash(i, side as i32, 5) - 0.5);
            out.push((vec3(x, 0.0, side * (half_width(x) + 0.30 + jitter.abs())), angle + 2.0 * jitter));
        }
    }
    // Add one seat at each end.
    out.push((vec3(LENGTH + 0.42, 0.0, 0.1), FRAC_PI_2 + 0.12));
    out.push((vec3(-LENGTH - 0.42, 0.0, -0.05), -FRAC_PI_2 - 0.08));
    out
}

/// Adds a cushion: a box with rounded edges and the extents `size` \[m\].
fn cushion(mesh: &mut Mesh, center: Vec3, size: Vec3, bend: impl Fn(Vec3) -> Vec3) {
    let (nu, nv) = (20, 10);
    // The shape is a superellipsoid: rounder than a box, flatter than a ball.
    let power = |x: f32, e: f32| x.signum() * x.abs().powf(e);
    mesh.surface(nu, nv, vec2(1.6, 0.8), |u, v| {
        let (a, b) = (TAU * u, PI * (v.clamp(0.004, 0.996) - 0.5));
        let p = vec3(
            power(b.cos(), 0.4) * power(a.cos(), 0.35),
            power(b.sin(), 0.4),
            -power(b.cos(), 0.4) * power(a.sin(), 0.35),
        );
        center + bend(p * size / 2.0)
    });
}

/// Returns an office chair that faces -z. The foot is at the origin.
pub(super) fn chair(f: &RoomMaterials) -> Model {
    let mut model = Model::new();
    cushion(model.of(f.cloth), vec3(0.0, 0.47, 0.0), vec3(0.50, 0.09, 0.50), |p| p - Vec3::Y * 0.25 * p.x * p.x);
    // The back curves around the sitter and leans away from the seat.
    cushion(model.of(f.cloth), vec3(0.0, 0.80, 0.26), vec3(0.46, 0.52, 0.065), |p| {
        p + Vec3::Z * (0.14 * p.y - 0.55 * p.x * p.x - 0.12 * p.y * p.y)
    });
    // Add the column and five feet with casters.
    let metal = model.of(f.metal);
    bar(metal, vec3(0.0, 0.10, 0.0), vec3(0.0, 0.44, 0.0), 0.028, 10);
    for i in 0..5 {
        let (sin, cos) = (TAU * i as f32 / 5.0).sin_cos();
        bar(model.of(f.metal), vec3(0.0, 0.12, 0.0), vec3(0.29 * sin, 0.07, 0.29 * cos), 0.02, 6);
        ball(model.of(f.dark), vec3(0.29 * sin, 0.033, 0.29 * cos), 0.031, 8);
    }
    // Add the spine between seat and back, and the arms.
    bar(model.of(f.dark), vec3(0.0, 0.41, 0.12), vec3(0.0, 0.45, 0.30), 0.022, 6);
    bar(model.of(f.dark), vec3(0.0, 0.45, 0.30), vec3(0.0, 0.75, 0.295), 0.022, 6);
    for side in [-1.0, 1.0] {
        let path = [
            vec2(0.40, 0.10),
            vec2(0.42, 0.15),
            vec2(0.63, 0.20),
            vec2(0.665, 0.17),
            vec2(0.67, 0.10),
            vec2(0.665, -0.12),
            vec2(0.65, -0.16),
        ];
        // Orient the section by the path's tangent.
        let frames: Vec<Frame> = (0..path.len())
            .map(|i| {
                let (a, b) = (path[i.saturating_sub(1)], path[(i + 1).min(path.len() - 1)]);
                let d = vec3(0.0, b.x - a.x, b.y - a.y).normalize();
                let wide = if i == 0 { 0.2 } else { 0.275 };
                Frame { origin: vec3(side * wide, path[i].x, path[i].y), x: Vec3::X, y: d.cross(Vec3::X) }
            })
            .collect();
        let section = arc(Vec2::ZERO, 0.021, 0.0, 360.0, 8);
        sweep(model.of(f.dark), &frames, &section);
    }
    model
}

/// Adds two tall plants in the corners.
pub(super) fn plants(scene: &mut Scene, f: &RoomMaterials) {
    let mut model = Model::new();
    // Add the pot.
    let pot =
        [vec2(0.17, 0.0), vec2(0.24, 0.42), vec2(0.25, 0.45), vec2(0.22, 0.45), vec2(0.21, 0.40), vec2(0.0, 0.40)];
    lathe(model.of(f.soil), Vec3::ZERO, &pot, 24, 1.5);
    for i in 0..34 {
        // Spread the leaves by the golden angle, with random height and reach.
        let key = |k: i32| hash(i, k, 9);
        let angle = 2.4 * i as f32;
        let (rise, reach) = (0.5 + 0.9 * key(1), 0.30 + 0.35 * key(2));
        let out = vec3(angle.cos(), 0.0, angle.sin());
        let side = vec3(-angle.sin(), 0.0, angle.cos());
        model.of(f.leaf).surface(2, 8, vec2(0.1, 0.9), |u, v| {
            let width = 0.055 * (PI * v.clamp(0.0, 1.0).powf(0.7)).sin().max(0.0) + 0.004;
            let droop = rise * (1.9 * v - 1.15 * v * v);
            vec3(0.0, 0.38 + droop, 0.0) + out * (reach * v.powf(1.3) + 0.03) + side * (width * (2.0 * u - 1.0))
                - Vec3::Y * (0.03 * (2.0 * u - 1.0).abs() * v)
        });
    }
    let plant = scene.mesh("plant", model);
    for (x, z) in [(-6.6, -4.8), (6.6, -4.8), (6.65, 4.75)] {
        scene.node("plant", Some(plant), vec3(x, 0.0, z), glam::Quat::from_rotation_y(x * z));
    }
}
