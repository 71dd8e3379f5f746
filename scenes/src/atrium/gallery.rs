//! The upper gallery: balustrade, twin arches, back walls, beams and the parapet.

use glam::{Quat, Vec3, vec2, vec3};

use super::{COURT, CourtSide, EAVES, OUTER, Stones, UPPER, round, sides};
use crate::arches::{Opening, Pane, wall};
use crate::columns::{archivolt, baluster, column, cornice, urn};
use crate::glb::{Model, Scene};
use crate::shapes::{lathe, molding};

/// Height of the balustrade's top and the small columns' feet \[m\].
const RAIL: f32 = UPPER + 1.0;
/// Height of the springing of the small arches \[m\].
const SPRING: f32 = UPPER + 2.95;
/// Thickness of the gallery's wall \[m\].
const THIN: f32 = 0.36;
/// Height of the parapet's top \[m\].
const PARAPET: f32 = 11.6;

/// Adds the gallery.
pub(super) fn add(scene: &mut Scene, stones: &Stones) {
    let mut model = Model::new();
    slabs(&mut model, stones);
    // All nodes share one baluster mesh.
    let mut one = Model::new();
    baluster(one.of(stones.trim), RAIL - UPPER - 0.26, 6);
    let one = scene.mesh("baluster", one);
    for side in sides() {
        arches(&mut model, stones, &side);
        back_wall(&mut model, stones, &side);
        beams(&mut model, stones, &side);
        // Distribute four balusters between each pair of pedestals.
        let bay = side.half / side.bays as f32;
        for i in 0..2 * side.bays {
            for k in 0..4 {
                let s = -side.half + bay * i as f32 + bay * (k as f32 + 1.0) / 5.0;
                let at = side.plane.at(s, UPPER + 0.12, -THIN / 2.0);
                scene.node("baluster", Some(one), at, Quat::IDENTITY);
            }
        }
    }
    crown(&mut model, stones);
    scene.show("gallery", model);

    // Small columns between the bays support the arches.
    let mesh = scene.mesh("small column", column(stones.trim, stones.shaft, 0.125, SPRING - RAIL, 12));
    for side in sides() {
        let bay = side.half / side.bays as f32;
        for i in 1..2 * side.bays {
            let at = side.plane.at(-side.half + bay * i as f32, RAIL, -THIN / 2.0);
            scene.node("small column", Some(mesh), at, Quat::IDENTITY);
        }
    }
}

/// Adds the gallery's floor and the roof above it. Both are rings around the court.
fn slabs(model: &mut Model, stones: &Stones) {
    let mut ring = |material, inner: [f32; 2], y: f32, facing: Vec3| {
        let ([ix, iz], [ox, oz]) = (inner, OUTER);
        for (x0, x1, z0, z1) in [(-ox, ox, iz, oz), (-ox, ox, -oz, -iz), (-ox, -ix, -iz, iz), (ix, ox, -iz, iz)] {
            let p = [(x0, z0), (x1, z0), (x1, z1), (x0, z1)].map(|(x, z)| vec3(x, y, z));
            model.of(material).quad_facing(p, facing);
        }
    };
    // Add the floor, the wooden ceiling and the roof.
    ring(stones.slabs, COURT, UPPER, Vec3::Y);
    ring(stones.wood, COURT, EAVES - 0.12, Vec3::NEG_Y);
    ring(stones.slabs, COURT, EAVES, Vec3::Y);
}

fn arches(model: &mut Model, stones: &Stones, side: &CourtSide) {
    let bay = side.half / side.bays as f32;
    let openings: Vec<Opening> = (0..2 * side.bays)
        .map(|i| Opening {
            center: -side.half + bay * (i as f32 + 0.5),
            half: bay / 2.0 - 0.16,
            sill: SPRING,
            spring: SPRING,
            point: 0.0,
        })
        .collect();
    let plane = &side.plane;
    wall(model.of(stones.ashlar), plane, [[-side.half, side.half], [SPRING, EAVES]], &openings, 6);
    // The inner face is longer, because it reaches around the corners.
    let inner = plane.behind(THIN);
    let s = [-side.half - THIN, side.half + THIN];
    wall(model.of(stones.ochre), &inner, [s, [SPRING, EAVES - 0.12]], &openings, 6);
    // Add the inner faces and the archivolts.
    for o in &openings {
        o.reveal(model.of(stones.trim), plane, THIN, 6);
        o.archivolt(model.of(stones.trim), plane, &archivolt(0.15, 0.05), 6);
    }
    // Add pedestals under the small columns, with plinth and rail of the balustrade between the pedestals.
    let trim = model.of(stones.trim);
    for i in 1..2 * side.bays {
        let s = -side.half + bay * i as f32;
        plane.block(trim, [s - 0.17, s + 0.17], [UPPER, RAIL - 0.135], [-THIN / 2.0 - 0.17, -THIN / 2.0 + 0.17]);
    }
    let s = [-side.half - 0.1, side.half + 0.1];
    let (back, front) = (-THIN / 2.0 - 0.13, -THIN / 2.0 + 0.13);
    plane.block(trim, s, [UPPER, UPPER + 0.12], [back, front]);
    let (back, front) = (-THIN / 2.0 - 0.20, -THIN / 2.0 + 0.20);
    plane.block(trim, s, [RAIL - 0.14, RAIL - 0.06], [back + 0.03, front - 0.03]);
    plane.block(trim, s, [RAIL - 0.06, RAIL], [back, front]);
}

fn back_wall(model: &mut Model, stones: &Stones, side: &CourtSide) {
    let plane = &side.outer;
    let bay = 2.0 * side.half / side.bays as f32;
    let doors: Vec<Opening> = (0..side.bays)
        .map(|i| Opening {
            center: -side.half + bay * (i as f32 + 0.5),
            half: 0.5,
            sill: UPPER + 0.02,
            spring: UPPER + 2.1,
            point: 0.0,
        })
        .collect();
    let s = [-side.outer_half, side.outer_half];
    wall(model.of(stones.ochre), plane, [s, [UPPER, EAVES]], &doors, 10);
    // Frame each door, and fill it with a leaf.
    for o in &doors {
        o.reveal(model.of(stones.trim), plane, 0.16, 10);
        o.archivolt_with_jambs(model.of(stones.trim), plane, &archivolt(0.16, 0.05), 5);
        o.pane(model.of(stones.door), plane, Pane { depth: 0.14, steps: 10 }, |x, y| vec2(0.5 * x, -2.6 * y));
    }
    // Add a band at the springing height of the arches.
    let line = [plane.at(-side.outer_half, SPRING, 0.0), plane.at(side.outer_half, SPRING, 0.0)];
    molding(model.of(stones.trim), &line, false, &crate::columns::band(0.05, 0.14));
}

fn beams(model: &mut Model, stones: &Stones, side: &CourtSide) {
    let wood = model.of(stones.wood);
    let count = (2.0 * side.half / 0.75) as usize;
    let top = EAVES - 0.12;
    for i in 0..=count {
        let s = -side.half + 0.75 * i as f32;
        let depth = OUTER[1] - COURT[1];
        side.plane.block(wood, [s - 0.07, s + 0.07], [top - 0.2, top + 0.02], [-depth, -THIN + 0.05]);
    }
}

/// Adds the main cornice with its brackets, the parapet and its urns.
fn crown(model: &mut Model, stones: &Stones) {
    let foot = EAVES - 0.42;
    molding(model.of(stones.trim), &round(COURT, foot), true, &cornice(0.55, 0.62));
    // Add a bracket about every half meter.
    for side in sides() {
        let count = (2.0 * side.half / 0.5).round() as usize;
        for i in 0..count {
            let s = -side.half + 2.0 * side.half * (i as f32 + 0.5) / count as f32;
            side.plane.block(model.of(stones.trim), [s - 0.07, s + 0.07], [foot + 0.10, foot + 0.245], [-0.01, 0.37]);
        }
    }
    // The parapet is set back from the cornice.
    let set = [COURT[0] + 0.1, COURT[1] + 0.1];
    let low = EAVES + 0.2;
    let mut line = |y: f32, profile: &[glam::Vec2]| {
        molding(model.of(stones.trim), &round(set, y), true, profile);
    };
    line(low - 0.2, &[vec2(0.0, 0.0), vec2(0.0, 0.3), vec2(-0.05, 0.33)]);
    line(low + 0.1, &[vec2(-0.05, 0.0), vec2(-0.05, PARAPET - low - 0.25)]);
    line(
        PARAPET - 0.16,
        &[vec2(-0.05, 0.0), vec2(0.06, 0.03), vec2(0.06, 0.12), vec2(0.0, 0.16), vec2(-0.4, 0.16), vec2(-0.4, -0.9)],
    );
    // Place urns on the parapet at every second bay border.
    let profile: Vec<glam::Vec2> = urn().iter().map(|p| *p * 0.9).collect();
    for side in sides() {
        let bay = 2.0 * side.half / side.bays as f32;
        for i in (1..side.bays).step_by(2) {
            let at = side.plane.at(-side.half + bay * i as f32, PARAPET - 0.002, -0.26);
            lathe(model.of(stones.trim), at, &profile, 10, 1.0);
        }
    }
}
