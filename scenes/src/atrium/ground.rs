//! The ground floor: paving, the columns and arches around the court, and the vaults behind the arches.

use glam::{Quat, Vec2, Vec3, vec2, vec3};

use super::{COURT, CourtSide, OUTER, Stones, THICK, UPPER, round, sides};
use crate::arches::{Opening, Pane, RibSection, groin_vault, rib, wall};
use crate::columns::{archivolt, band, column, cornice};
use crate::glb::{Model, Scene};
use crate::mesh::Side;
use crate::shapes::molding;

/// Height of the capitals' upper edge, where the arches begin \[m\].
const SPRING: f32 = 3.3;
/// Depth of the court below the arcade's floor \[m\].
const STEP: f32 = 0.16;
/// Rise of the vaults \[m\].
const RISE: f32 = 1.55;

/// Returns the arch of each bay of a side.
pub(super) fn arches(side: &CourtSide) -> Vec<Opening> {
    let bay = 2.0 * side.half / side.bays as f32;
    (0..side.bays)
        .map(|i| Opening {
            center: -side.half + bay * (i as f32 + 0.5),
            half: bay / 2.0 - 0.29,
            sill: SPRING,
            spring: SPRING,
            point: 0.0,
        })
        .collect()
}

/// Adds the ground floor.
pub(super) fn add(scene: &mut Scene, stones: &Stones) {
    let mut model = Model::new();
    floors(&mut model, stones);
    for side in sides() {
        arcade(&mut model, stones, &side);
        outer_wall(&mut model, stones, &side);
    }
    corner_piers(&mut model, stones);
    vaults(&mut model, stones);
    // The string course between the storeys runs around the whole court.
    let ring = round(COURT, UPPER - 0.34);
    molding(model.of(stones.trim), &ring, true, &cornice(0.30, 0.36));
    scene.show("ground floor", model);

    // Columns between the bays support the arches.
    let mesh = scene.mesh("column", column(stones.trim, stones.shaft, 0.235, SPRING, 20));
    for side in sides() {
        let bay = 2.0 * side.half / side.bays as f32;
        for i in 1..side.bays {
            let at = side.plane.at(-side.half + bay * i as f32, 0.0, -THICK / 2.0);
            scene.node("column", Some(mesh), at, Quat::IDENTITY);
        }
    }
}

fn floors(model: &mut Model, stones: &Stones) {
    let [cx, cz] = [COURT[0] - 0.25, COURT[1] - 0.25];
    let [ox, oz] = OUTER;
    let (court, arcade) = (-STEP, 0.0);
    let mesh = model.of(stones.paving);
    mesh.quad_facing([(-cx, -cz), (cx, -cz), (cx, cz), (-cx, cz)].map(|(x, z)| vec3(x, court, z)), Vec3::Y);
    // Surround the court with the higher floor of the arcade.
    let mesh = model.of(stones.slabs);
    for (x0, x1, z0, z1) in [(-ox, ox, cz, oz), (-ox, ox, -oz, -cz), (-ox, -cx, -cz, cz), (cx, ox, -cz, cz)] {
        mesh.quad_facing([(x0, z0), (x1, z0), (x1, z1), (x0, z1)].map(|(x, z)| vec3(x, arcade, z)), Vec3::Y);
    }
    // Add the step down to the court, with a rounded nosing.
    let nosing = [
        vec2(0.0, -STEP),
        vec2(0.0, -0.06),
        vec2(0.035, -0.05),
        vec2(0.04, -0.02),
        vec2(0.025, 0.004),
        vec2(-0.3, 0.004),
    ];
    molding(model.of(stones.trim), &round([cx, cz], 0.0), true, &nosing);
}

fn arcade(model: &mut Model, stones: &Stones, side: &CourtSide) {
    let openings = arches(side);
    let s = [-side.half, side.half];
    wall(model.of(stones.ashlar), &side.plane, [s, [SPRING, UPPER]], &openings, 10);
    // The inner face is longer, because it reaches around the corners.
    let inner = side.plane.behind(THICK);
    let s = [-side.half - THICK, side.half + THICK];
    wall(model.of(stones.plaster), &inner, [s, [SPRING, UPPER]], &openings, 10);
    for o in &openings {
        o.reveal(model.of(stones.trim), &side.plane, THICK, 10);
        o.archivolt(model.of(stones.trim), &side.plane, &archivolt(0.26, 0.07), 10);
        // Add a keystone that supports the string course.
        let key = [[o.center - 0.11, o.center + 0.11], [o.crown() - 0.03, o.crown() + 0.42]];
        side.plane.block(model.of(stones.trim), key[0], key[1], [0.0, 0.10]);
        side.plane.block(
            model.of(stones.trim),
            [key[0][0] - 0.03, key[0][1] + 0.03],
            [key[1][1], key[1][1] + 0.06],
            [0.0, 0.125],
        );
    }
    // Add a plain disc to each spandrel, high enough to clear the capitals.
    let bay = 2.0 * side.half / side.bays as f32;
    for i in 1..side.bays {
        let at = side.plane.at(-side.half + bay * i as f32, SPRING + 1.08, 0.0);
        disc(model, stones, at, side.plane.out);
    }
}

/// Adds a molded stone disc on a wall.
fn disc(model: &mut Model, stones: &Stones, at: Vec3, out: Vec3) {
    let mut mesh = crate::mesh::Mesh::new();
    let profile = [
        vec2(0.23, 0.0),
        vec2(0.23, 0.035),
        vec2(0.20, 0.05),
        vec2(0.17, 0.035),
        vec2(0.165, 0.015),
        vec2(0.09, 0.02),
        vec2(0.05, 0.05),
        vec2(0.0, 0.06),
    ];
    crate::shapes::lathe(&mut mesh, Vec3::ZERO, &profile, 12, 1.0);
    let turn = Quat::from_rotation_arc(Vec3::Y, out);
    model.of(stones.trim).append(&mesh, glam::Mat4::from_rotation_translation(turn, at));
}

fn outer_wall(model: &mut Model, stones: &Stones, side: &CourtSide) {
    let plane = &side.outer;
    let s = [-side.outer_half, side.outer_half];
    let bay = 2.0 * side.half / side.bays as f32;
    // Every third bay has a door.
    let mut doors: Vec<Opening> = Vec::new();
    for i in (1..side.bays).step_by(3) {
        let center = -side.half + bay * (i as f32 + 0.5);
        doors.push(Opening { center, half: 0.62, sill: 0.0, spring: 2.0, point: 0.0 });
    }
    wall(model.of(stones.ashlar), plane, [s, [0.0, UPPER]], &doors, 12);
    for o in &doors {
        o.reveal(model.of(stones.trim), plane, 0.22, 12);
        o.archivolt_with_jambs(model.of(stones.trim), plane, &archivolt(0.20, 0.06), 12);
        o.pane(model.of(stones.door), plane, Pane { depth: 0.2, steps: 12 }, |x, y| vec2(0.62 * x, -2.6 * y));
        door_leaves(model, stones, side, o);
    }
    // Pilasters support the vaults opposite the columns.
    for i in 0..=side.bays {
        let edge = i == 0 || i == side.bays;
        let at = -side.half + bay * i as f32 + if edge { 0.25 * if i == 0 { -1.0 } else { 1.0 } } else { 0.0 };
        let trim = model.of(stones.trim);
        plane.block(trim, [at - 0.25, at + 0.25], [0.0, SPRING - 0.24], [-0.01, 0.12]);
        plane.block(trim, [at - 0.30, at + 0.30], [0.0, 0.32], [-0.01, 0.17]);
        plane.block(trim, [at - 0.28, at + 0.28], [SPRING - 0.24, SPRING - 0.12], [-0.01, 0.15]);
        plane.block(trim, [at - 0.33, at + 0.33], [SPRING - 0.12, SPRING], [-0.01, 0.20]);
    }
    // Add a dado band between the doors.
    let ends = [plane.at(-side.outer_half, 0.9, 0.0), plane.at(side.outer_half, 0.9, 0.0)];
    for pair in spans(&doors, side.outer_half) {
        let line = [plane.at(pair[0], ends[0].y, 0.0), plane.at(pair[1], ends[0].y, 0.0)];
        molding(model.of(stones.trim), &line, false, &band(0.045, 0.12));
    }
}

/// Returns the sections of a wall between doors. The sections exclude the door frames.
fn spans(doors: &[Opening], half: f32) -> Vec<[f32; 2]> {
    let mut out = Vec::new();
    let mut from = -half;
    for o in doors {
        out.push([from, o.center - o.half - 0.19]);
        from = o.center + o.half + 0.19;
    }
    out.push([from, half]);
    out
}

/// Adds the panels, rails and studs of a double door.
fn door_leaves(model: &mut Model, stones: &Stones, side: &CourtSide, o: &Opening) {
    let mesh = model.of(stones.door);
    for sign in [-1.0, 1.0] {
        for (y0, y1) in [(0.14, 0.80), (0.92, 1.90)] {
            let (a, b) = (o.center + sign * 0.08, o.center + sign * 0.52);
            side.outer.block(mesh, [a.min(b), a.max(b)], [y0, y1], [-0.21, -0.165]);
            let (a, b) = (o.center + sign * 0.14, o.center + sign * 0.46);
            side.outer.block(mesh, [a.min(b), a.max(b)], [y0 + 0.06, y1 - 0.06], [-0.21, -0.15]);
        }
    }
    side.outer.block(mesh, [o.center - 0.025, o.center + 0.025], [0.0, 2.55], [-0.21, -0.14]);
}

fn corner_piers(model: &mut Model, stones: &Stones) {
    for (sx, sz) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
        let block = |model: &mut Model, low: f32, high: f32, grow: f32, trim: bool| {
            let material = if trim { stones.trim } else { stones.ashlar };
            let (a, b) = (0.29 + grow, 0.56 + grow);
            let (x0, x1) = (sx * (COURT[0] - a), sx * (COURT[0] + b));
            let (z0, z1) = (sz * (COURT[1] - a), sz * (COURT[1] + b));
            model.of(material).cuboid_without(
                vec3(x0.min(x1), low, z0.min(z1)),
                vec3(x0.max(x1), high, z0.max(z1)),
                if low == 0.0 { &[Side::Bottom] } else { &[] },
            );
        };
        // Add the shaft, the base and two courses of the capital.
        block(model, 0.0, SPRING - 0.3, -0.02, false);
        block(model, 0.0, 0.34, 0.06, true);
        block(model, SPRING - 0.30, SPRING - 0.14, 0.02, true);
        block(model, SPRING - 0.14, SPRING, 0.07, true);
    }
}

fn vaults(model: &mut Model, stones: &Stones) {
    // The vaults end in the middle of the arcade walls, which hide their edges.
    let inner = [COURT[0] + THICK / 2.0, COURT[1] + THICK / 2.0];
    let mut xs: Vec<f32> = (0..=8).map(|i| -COURT[0] + 3.0 * i as f32).collect();
    (xs[0], xs[8]) = (-inner[0], inner[0]);
    let mut zs: Vec<f32> = (0..=3).map(|i| -COURT[1] + 10.0 / 3.0 * i as f32).collect();
    (zs[0], zs[3]) = (-inner[1], inner[1]);
    // List the bays: both long aisles with their corners, then both short aisles.
    let mut bays: Vec<[Vec2; 2]> = Vec::new();
    for z in [[-OUTER[1], -inner[1]], [inner[1], OUTER[1]]] {
        for x in xs.windows(2) {
            bays.push([vec2(x[0], z[0]), vec2(x[1], z[1])]);
        }
        for x in [[-OUTER[0], -inner[0]], [inner[0], OUTER[0]]] {
            bays.push([vec2(x[0], z[0]), vec2(x[1], z[1])]);
        }
    }
    for x in [[-OUTER[0], -inner[0]], [inner[0], OUTER[0]]] {
        for z in zs.windows(2) {
            bays.push([vec2(x[0], z[0]), vec2(x[1], z[1])]);
        }
    }
    // Each bay gets a groin vault, and each border between bays a rib.
    for [min, max] in bays {
        groin_vault(model.of(stones.plaster), [min, max], SPRING, (RISE, 0.0), 10);
    }
    // Lower the ribs by 1 cm, so that they do not coincide with the webs.
    let mut transverse = |a: Vec3, b: Vec3| {
        rib(model.of(stones.trim), [a, b], (RISE - 0.01, 0.0), RibSection { width: 0.42, depth: 0.11, half: false }, 7);
    };
    for z in [-1.0, 1.0] {
        for &x in &xs {
            transverse(vec3(x, SPRING, z * inner[1]), vec3(x, SPRING, z * OUTER[1]));
        }
    }
    for x in [-1.0, 1.0] {
        for &z in &zs {
            transverse(vec3(x * inner[0], SPRING, z), vec3(x * OUTER[0], SPRING, z));
        }
    }
}
