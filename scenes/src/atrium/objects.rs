//! Objects in the courtyard, some of them animated.

use std::f32::consts::TAU;

use glam::{Quat, Vec2, Vec3, vec2, vec3};

use super::{DURATION, sides};
use crate::animation::rotation;
use crate::cloth::{Curtain, banner};
use crate::columns::urn;
use crate::glb::{MaterialId, Model, Scene};
use crate::shapes::{arc, ball, bar, chain, lathe, ring};

/// Adds curtains in some of the arches, and banners on the gallery's rail.
pub(super) fn drapes(scene: &mut Scene, cloths: &[MaterialId; 3], brass: MaterialId) {
    let mut model = Model::new();
    let all = sides();
    // Each entry lists side, bay, and half of the arch. Half 0 is gathered towards the left column, half 1 towards the
    // right column.
    let hung = [
        (0, 1, 0),
        (0, 1, 1),
        (0, 4, 0),
        (0, 4, 1),
        (0, 6, 0),
        (1, 2, 0),
        (1, 2, 1),
        (1, 5, 0),
        (1, 5, 1),
        (3, 0, 0),
        (3, 2, 1),
    ];
    for (k, &(s, bay, half)) in hung.iter().enumerate() {
        let side = &all[s];
        let o = super::ground::arches(side)[bay];
        let y = o.spring - 0.16;
        let edge = if half == 0 { -1.0 } else { 1.0 };
        let a = side.plane.at(o.center + edge * (o.half + 0.02), y, -0.25);
        let b = side.plane.at(o.center + edge * 0.06, y, -0.25);
        let curtain = Curtain { a, b, drop: 2.95, folds: 6.0, depth: 0.05, gather: 0.62 };
        let color = cloths[[0, 0, 1, 1, 2, 2, 2, 0, 0, 1, 1][k]];
        curtain.add(model.of(color), 36, 9, k as u32);
        // Add one curtain rod per arch.
        let (l, r) =
            (side.plane.at(o.center - o.half - 0.05, y, -0.25), side.plane.at(o.center + o.half + 0.05, y, -0.25));
        if half == 0 || s == 3 {
            bar(model.of(brass), l, r, 0.016, 8);
        }
    }
    // Each banner hangs in front of the gallery's rail, from a bar with two brackets.
    for (k, &(s, bay)) in [(0, 2), (0, 4), (0, 6), (1, 1), (1, 3), (1, 5), (3, 1)].iter().enumerate() {
        let side = &all[s];
        let width = 2.0 * side.half / side.bays as f32;
        let middle = -side.half + width * bay as f32 + if s == 3 { width / 2.0 } else { 0.0 };
        let y = super::UPPER + 0.93;
        let a = side.plane.at(middle - 0.45, y, 0.40);
        let b = side.plane.at(middle + 0.45, y, 0.40);
        banner(model.of(cloths[k % 3]), a, b, 2.1, k as u32);
        for end in [-0.5, 0.5] {
            let foot = side.plane.at(middle + end * 0.9, y, 0.0);
            bar(model.of(brass), foot, side.plane.at(middle + end * 0.9, y, 0.42), 0.014, 6);
        }
        let (l, r) = (side.plane.at(middle - 0.52, y, 0.40), side.plane.at(middle + 0.52, y, 0.40));
        bar(model.of(brass), l, r, 0.018, 8);
        ball(model.of(brass), l, 0.035, 10);
        ball(model.of(brass), r, 0.035, 10);
    }
    scene.show("drapes", model);
}

/// Adds an octagonal basin with a raised bowl, and a rotating armillary sphere above it.
pub(super) fn fountain(scene: &mut Scene, stone: MaterialId, water: MaterialId, bronze: MaterialId, brass: MaterialId) {
    let mut model = Model::new();
    let foot = vec3(3.0, -0.16, 0.0);
    let step = [vec2(2.3, 0.0), vec2(2.3, 0.12), vec2(2.26, 0.15), vec2(1.6, 0.15)];
    lathe(model.of(stone), foot, &step, 8, 12.0);
    // Add the basin and its water.
    let basin = [
        vec2(1.82, 0.15),
        vec2(1.82, 0.22),
        vec2(1.74, 0.27),
        vec2(1.74, 0.50),
        vec2(1.80, 0.56),
        vec2(1.86, 0.58),
        vec2(1.86, 0.66),
        vec2(1.50, 0.66),
        vec2(1.50, 0.20),
    ];
    lathe(model.of(stone), foot, &basin, 8, 12.0);
    lathe(model.of(water), foot, &[vec2(1.50, 0.53), vec2(0.0, 0.53)], 8, 8.0);
    // Add the raised bowl and its water.
    let stem = chain(&[
        &[
            vec2(0.34, 0.2),
            vec2(0.34, 0.62),
            vec2(0.28, 0.68),
            vec2(0.17, 0.76),
            vec2(0.14, 0.95),
            vec2(0.20, 1.08),
            vec2(0.22, 1.12),
        ],
        &arc(vec2(0.1, 1.95), 0.80, -82.0, -40.0, 8),
        &[vec2(0.78, 1.46), vec2(0.78, 1.52), vec2(0.72, 1.52), vec2(0.66, 1.47), vec2(0.60, 1.42)],
    ]);
    lathe(model.of(stone), foot, &stem, 32, 3.0);
    lathe(model.of(water), foot, &[vec2(0.66, 1.465), vec2(0.0, 1.465)], 32, 3.0);
    // Add the post that supports the sphere.
    let post =
        [vec2(0.12, 1.40), vec2(0.12, 1.56), vec2(0.07, 1.62), vec2(0.05, 1.80), vec2(0.08, 1.86), vec2(0.0, 1.90)];
    lathe(model.of(stone), foot, &post, 16, 1.0);
    scene.show("fountain", model);

    // The outer rings of the sphere rotate about the vertical axis.
    let center = foot + vec3(0.0, 2.55, 0.0);
    let mut outer = Model::new();
    bar(outer.of(bronze), vec3(0.0, -0.68, 0.0), vec3(0.0, 0.72, 0.0), 0.022, 8);
    ring(outer.of(bronze), Vec3::ZERO, Vec3::Z, [0.62, 0.028], 30);
    ring(outer.of(brass), Vec3::ZERO, vec3(0.0, 0.92, 0.39), [0.58, 0.035], 30);
    ball(outer.of(brass), vec3(0.0, 0.74, 0.0), 0.05, 12);
    let outer = scene.mesh("armillary", outer);
    let outer = scene.node("armillary", Some(outer), center, Quat::IDENTITY);
    scene.animate(outer, rotation(DURATION, 6.0, |t| Quat::from_rotation_y(TAU * t / DURATION)));
    // The inner rings are a separate mesh, because they move independently.
    let mut inner = Model::new();
    ring(inner.of(bronze), Vec3::ZERO, Vec3::X, [0.50, 0.024], 28);
    ring(inner.of(bronze), Vec3::ZERO, Vec3::Y, [0.47, 0.022], 28);
    ball(inner.of(brass), Vec3::ZERO, 0.17, 24);
    let inner = scene.mesh("armillary rings", inner);
    let inner = scene.node("armillary rings", Some(inner), Vec3::ZERO, Quat::IDENTITY);
    // The inner rings hang in the outer rings and counterrotate about a slanted axis.
    let axis = vec3(0.2, 1.0, 0.35).normalize();
    scene.animate(inner, rotation(DURATION, 6.0, |t| Quat::from_axis_angle(axis, -2.0 * TAU * t / DURATION)));
    scene.attach(inner, outer);
}

/// Adds clipped box trees in terracotta, and urns on pedestals.
pub(super) fn pots(scene: &mut Scene, terracotta: MaterialId, hedge: MaterialId, stone: MaterialId) {
    // All box trees share one mesh.
    let mut pot = Model::new();
    let profile = [
        vec2(0.24, 0.0),
        vec2(0.26, 0.05),
        vec2(0.35, 0.46),
        vec2(0.36, 0.50),
        vec2(0.40, 0.50),
        vec2(0.41, 0.58),
        vec2(0.35, 0.585),
        vec2(0.32, 0.5),
        vec2(0.0, 0.5),
    ];
    lathe(pot.of(terracotta), Vec3::ZERO, &profile, 28, 2.0);
    bush(&mut pot, hedge, vec3(0.0, 1.02, 0.0), 0.55, 3);
    bush(&mut pot, hedge, vec3(0.0, 1.72, 0.0), 0.30, 9);
    bar(pot.of(terracotta), vec3(0.0, 0.5, 0.0), vec3(0.0, 1.6, 0.0), 0.03, 6);
    let pot = scene.mesh("box tree", pot);
    for (i, (x, z)) in [(-9.0, -3.9), (-3.0, -3.9), (9.0, -3.9), (-6.0, 3.9), (6.0, 3.9), (10.6, 3.6), (10.6, -2.4)]
        .into_iter()
        .enumerate()
    {
        scene.node("box tree", Some(pot), vec3(x, -0.16, z), Quat::from_rotation_y(i as f32 * 1.3));
    }
    // Place urns on pedestals around the fountain.
    let mut urns = Model::new();
    let high: Vec<Vec2> = urn().iter().map(|p| *p * 1.1).collect();
    for (x, z) in [(0.1, -3.4), (5.9, -3.4), (0.1, 3.4), (5.9, 3.4)] {
        let mesh = urns.of(stone);
        mesh.cuboid(vec3(x - 0.34, -0.165, z - 0.34), vec3(x + 0.34, 0.0, z + 0.34));
        mesh.cuboid(vec3(x - 0.27, 0.0, z - 0.27), vec3(x + 0.27, 0.62, z + 0.27));
        mesh.cuboid(vec3(x - 0.32, 0.62, z - 0.32), vec3(x + 0.32, 0.70, z + 0.32));
        lathe(urns.of(terracotta), vec3(x, 0.70, z), &high, 28, 2.0);
        bush(&mut urns, hedge, vec3(x, 1.90, z), 0.315, (x + z) as u32 + 20);
    }
    scene.show("urns", urns);
}

/// Adds a slightly uneven ball of leaves in the material `hedge`.
fn bush(model: &mut Model, hedge: MaterialId, center: Vec3, radius: f32, seed: u32) {
    let p = seed as f32 * 1.9;
    model.of(hedge).surface(18, 10, vec2(TAU * radius, 3.1 * radius), |u, v| {
        let (sin, cos) = (TAU * u).sin_cos();
        let (low, up) = ((v * 0.998 + 0.001) * TAU / 2.0).sin_cos();
        let bump = 1.0
            + 0.03 * ((3.0 * TAU * u + p).sin() + (9.0 * v + p).sin()) * low
            + 0.02 * (8.0 * TAU * u + p).sin() * (17.0 * v).sin() * low;
        center + radius * bump * vec3(low * cos, -up, -low * sin)
    });
}

/// Adds bronze lamps on chains in the arches of the long sides. Two of them swing.
pub(super) fn lamps(scene: &mut Scene, bronze: MaterialId, brass: MaterialId) {
    let mut lamp = Model::new();
    let body = chain(&[
        &[vec2(0.0, -1.02), vec2(0.03, -1.0), vec2(0.03, -0.97)],
        &[vec2(0.10, -0.93), vec2(0.17, -0.84), vec2(0.19, -0.74), vec2(0.17, -0.66)],
        &[vec2(0.20, -0.64), vec2(0.20, -0.61), vec2(0.14, -0.60), vec2(0.05, -0.50), vec2(0.0, -0.47)],
    ]);
    lathe(lamp.of(bronze), Vec3::ZERO, &body, 16, 1.0);
    ring(lamp.of(brass), vec3(0.0, -0.72, 0.0), Vec3::Y, [0.195, 0.012], 16);
    bar(lamp.of(bronze), vec3(0.0, -0.48, 0.0), vec3(0.0, 0.04, 0.0), 0.009, 6);
    let lamp = scene.mesh("lamp", lamp);
    let all = sides();
    for (k, &(s, bay)) in [(0, 2), (0, 5), (1, 3), (1, 6), (0, 3), (1, 4)].iter().enumerate() {
        let o = super::ground::arches(&all[s])[bay];
        let hook = all[s].plane.at(o.center, o.crown(), -0.25);
        let node = scene.node("lamp", Some(lamp), hook, Quat::IDENTITY);
        // Two lamps swing from their hooks.
        if k < 2 {
            // A pendulum with a length of about one meter has a period of about two seconds.
            let period = DURATION / 4.0;
            scene.animate(
                node,
                rotation(DURATION, 12.0, |t| Quat::from_rotation_z(0.30 * (TAU * t / period + k as f32).sin())),
            );
        }
    }
}
