//! Walls, piers and vaults of the church.

use std::f32::consts::TAU;

use glam::{Quat, Vec2, Vec3, vec2, vec3};

use super::walls::{
    aisle_wall, aisle_windows, along, apse_wall, apse_window, clerestory_windows, nave_wall, sorted, stretch,
};
use super::{AISLE, APSE, BAY, BAYS, CHANCEL, HIGH, HIGH_SPRING, LOW, LOW_SPRING, NAVE, Stones, THICK, apse_corners};
use crate::arches::{Opening, Pane, Plane, RibSection, groin_vault, half_web, rib, wall};
use crate::columns::archivolt;
use crate::glb::{Model, Scene};
use crate::mesh::Mesh;
use crate::shapes::{lathe, loft, molding};

/// Heights of the lower and upper edge of the blind arcade between the nave's arches and windows \[m\].
const TRIFORIUM: [f32; 2] = [6.9, 8.5];
/// Height of the top of the nave's walls, which is hidden behind the vault's edge \[m\].
const TOP: f32 = 14.6;
/// Height of the top of the aisles' walls \[m\].
const AISLE_TOP: f32 = 6.9;

fn arcade(plane: &Plane) -> Vec<Opening> {
    let one = |i: usize| Opening {
        center: along(plane, BAY * (i as f32 + 0.5)),
        half: BAY / 2.0 - 0.55,
        sill: LOW_SPRING,
        spring: LOW_SPRING,
        point: 0.5,
    };
    sorted((0..BAYS).map(one).collect())
}

fn blind_arcade(plane: &Plane, bays: usize) -> Vec<Opening> {
    let one = |i: usize| Opening {
        center: along(plane, BAY * (i / 4) as f32 + 1.0 + (i % 4) as f32),
        half: 0.38,
        sill: 7.12,
        spring: 7.75,
        point: 0.8,
    };
    sorted((0..4 * bays).map(one).collect())
}

/// Adds the walls, piers and vaults of the church.
pub(super) fn add(scene: &mut Scene, stones: &Stones) {
    let mut model = Model::new();
    floors(&mut model, stones);
    for side in [-1.0, 1.0] {
        nave_side(&mut model, stones, side);
        aisle_side(&mut model, stones, side);
    }
    west_wall(&mut model, stones);
    apse(&mut model, stones);
    scene.show("walls", model);
    let mut vaults = Model::new();
    high_vault(&mut vaults, stones);
    low_vaults(&mut vaults, stones);
    scene.show("vaults", vaults);

    // Piers, vault shafts and responds have one mesh each, which nodes position.
    let mut pier = Model::new();
    let outline = pier_outline();
    // Scale the outline along the height: base, shaft with a ring, capital.
    let profile: Vec<Vec2> = [
        (1.42, 0.0),
        (1.42, 0.30),
        (1.34, 0.36),
        (1.22, 0.40),
        (1.25, 0.47),
        (1.20, 0.53),
        (1.0, 0.58),
        (1.0, 3.02),
        (1.07, 3.05),
        (1.07, 3.10),
        (1.0, 3.13),
        (1.04, 3.26),
        (1.16, 3.37),
        (1.30, 3.42),
        (1.30, 3.48),
        (1.36, 3.50),
        (1.36, LOW_SPRING),
    ]
    .iter()
    .map(|&(s, y)| vec2(s, y))
    .collect();
    loft(pier.of(stones.trim), Vec3::ZERO, &outline, &profile);
    let pier = scene.mesh("pier", pier);
    let mut shaft = Model::new();
    vault_shaft(shaft.of(stones.trim));
    let shaft = scene.mesh("vault shaft", shaft);
    // Responds support the aisle vaults on the outer walls.
    let mut respond = Model::new();
    let profile = [
        vec2(0.30, 0.0),
        vec2(0.30, 0.4),
        vec2(0.24, 0.5),
        vec2(0.19, 0.56),
        vec2(0.19, 3.1),
        vec2(0.22, 3.13),
        vec2(0.19, 3.17),
        vec2(0.22, 3.35),
        vec2(0.33, 3.48),
        vec2(0.33, LOW_SPRING),
        vec2(0.0, LOW_SPRING),
    ];
    lathe(respond.of(stones.trim), Vec3::ZERO, &profile, 16, 1.0);
    let respond = scene.mesh("respond", respond);
    // Add supports on both sides of every bay border. The chancel has no aisles.
    for i in 0..=BAYS + 1 {
        let z = -BAY * i as f32;
        for side in [-1.0, 1.0] {
            let turn = if side > 0.0 { Quat::from_rotation_y(std::f32::consts::PI) } else { Quat::IDENTITY };
            if i <= BAYS {
                scene.node("pier", Some(pier), vec3(side * (NAVE + THICK / 2.0), 0.0, z), turn);
                scene.node("respond", Some(respond), vec3(side * AISLE, 0.0, z), turn);
            }
            scene.node("vault shaft", Some(shaft), vec3(side * NAVE, 0.0, z), turn);
        }
    }
    // The inner corners of the apse have shafts too.
    for p in &apse_corners()[1..3] {
        let inward = vec3(APSE.x - p.x, 0.0, APSE.y - p.y).normalize();
        let turn = Quat::from_rotation_arc(Vec3::X, inward);
        scene.node("vault shaft", Some(shaft), vec3(p.x, 0.0, p.y), turn);
    }
}

/// Returns the outline of a pier: a round core with four shafts.
fn pier_outline() -> Vec<Vec2> {
    (0..48)
        .map(|i| {
            let a = TAU * i as f32 / 48.0;
            let near = ((a + TAU / 8.0).rem_euclid(TAU / 4.0) - TAU / 8.0).abs();
            // Compute the distance along the ray to a circle with radius 0.155 and center at 0.395.
            let (c, r) = (0.395f32, 0.155f32);
            let reach = r * r - (c * near.sin()).powi(2);
            let shaft = if reach > 0.0 { c * near.cos() + reach.sqrt() } else { 0.0 };
            Vec2::from_angle(a) * shaft.max(0.40)
        })
        .collect()
}

/// Adds three shafts on the nave's wall, from the pier's capital or a corbel to the springing of the high vault. The
/// wall is at x = 0, and the nave is towards +x.
fn vault_shaft(mesh: &mut Mesh) {
    for (x, z, r) in [(0.03, 0.0, 0.13), (0.0, 0.17, 0.08), (0.0, -0.17, 0.08)] {
        let low = LOW_SPRING - 0.12;
        let p = [
            (0.0, low),
            (1.25, low + 0.03),
            (1.25, low + 0.16),
            (1.0, low + 0.22),
            (1.0, HIGH_SPRING - 0.42),
            (1.2, HIGH_SPRING - 0.40),
            (1.0, HIGH_SPRING - 0.36),
            (1.1, HIGH_SPRING - 0.24),
            (1.55, HIGH_SPRING - 0.12),
        ];
        let profile: Vec<Vec2> = p.iter().map(|&(s, y)| vec2(s * r, y)).collect();
        lathe(mesh, vec3(x, 0.0, z), &profile, 14, 0.8);
    }
    mesh.cuboid(vec3(-0.05, HIGH_SPRING - 0.12, -0.34), vec3(0.26, HIGH_SPRING, 0.34));
}

fn floors(model: &mut Model, stones: &Stones) {
    let end = -BAY * BAYS as f32;
    let mut flat = |material, x: f32, z: [f32; 2], y: f32| {
        let p = [(-x, z[0]), (x, z[0]), (x, z[1]), (-x, z[1])];
        model.of(material).quad_facing(p.map(|(x, z)| vec3(x, y, z)), Vec3::Y);
    };
    flat(stones.floor, AISLE, [0.0, end], 0.0);
    // Add the treads of three steps, then their risers.
    let edge = end + 0.8;
    for k in 0..3 {
        let y = CHANCEL / 3.0 * (k as f32 + 1.0);
        let z = edge - 0.38 * k as f32;
        let back = if k == 2 { APSE.y } else { z - 0.38 };
        let material = if k == 2 { stones.floor } else { stones.steps };
        flat(material, NAVE, [z, back], y);
    }
    for k in 0..3 {
        let y = CHANCEL / 3.0 * k as f32;
        let z = edge - 0.38 * k as f32;
        let riser = [(-NAVE, y), (NAVE, y), (NAVE, y + CHANCEL / 3.0), (-NAVE, y + CHANCEL / 3.0)];
        model.of(stones.steps).quad_facing(riser.map(|(x, y)| vec3(x, y, z)), Vec3::Z);
    }
    // The steps end at the piers. Beyond the last pair of piers, the chancel's walls start at the height of its floor.
    let [a, b, c, d] = apse_corners();
    model.of(stones.floor).quad_facing([a, b, c, d].map(|p| vec3(p.x, CHANCEL, p.y)), Vec3::Y);
}

fn nave_side(model: &mut Model, stones: &Stones, side: f32) {
    let plane = nave_wall(side);
    let (nave, all) = (BAY * BAYS as f32, BAY * (BAYS as f32 + 1.0));
    let arches = arcade(&plane);
    let blind = blind_arcade(&plane, BAYS + 1);
    let windows = clerestory_windows(&plane);
    // Stack the storeys: arcade, triforium with blind arches, clerestory.
    let whole = stretch(&plane, 0.0, all);
    wall(model.of(stones.ashlar), &plane, [stretch(&plane, 0.0, nave), [LOW_SPRING, TRIFORIUM[0]]], &arches, 12);
    wall(model.of(stones.ashlar), &plane, [stretch(&plane, nave, all), [0.0, TRIFORIUM[0]]], &[], 1);
    wall(model.of(stones.ashlar), &plane, [whole, TRIFORIUM], &blind, 5);
    wall(model.of(stones.ashlar), &plane, [whole, [TRIFORIUM[1], TOP]], &windows, 10);
    let back = plane.behind(THICK);
    wall(model.of(stones.ashlar), &back, [stretch(&plane, 0.0, nave), [LOW_SPRING, AISLE_TOP]], &arches, 12);
    for o in &arches {
        o.reveal(model.of(stones.trim), &plane, THICK, 12);
        o.archivolt(model.of(stones.trim), &plane, &archivolt(0.32, 0.09), 12);
        o.archivolt(model.of(stones.trim), &back, &archivolt(0.24, 0.06), 12);
        // Add a second order inside the arch, narrower than the wall.
        let inner = Opening { half: o.half - 0.005, ..*o };
        let order = [
            vec2(0.0, -0.14),
            vec2(-0.13, -0.18),
            vec2(-0.16, -0.24),
            vec2(-0.16, -0.36),
            vec2(-0.13, -0.42),
            vec2(0.0, -0.46),
        ];
        inner.archivolt(model.of(stones.trim), &plane, &order, 12);
    }
    for o in &blind {
        o.reveal(model.of(stones.trim), &plane, 0.24, 5);
        o.archivolt(
            model.of(stones.trim),
            &plane,
            &[vec2(0.09, 0.0), vec2(0.09, 0.03), vec2(0.03, 0.05), vec2(0.0, 0.02), vec2(0.0, -0.01)],
            5,
        );
        // Close the blind arch with stone.
        o.pane(model.of(stones.web), &plane, Pane { depth: 0.22, steps: 5 }, |x, y| vec2(0.4 * x, -1.2 * y));
    }
    // Add small shafts between the blind arches.
    let shaft =
        [vec2(0.085, 7.12), vec2(0.05, 7.18), vec2(0.045, 7.60), vec2(0.08, 7.70), vec2(0.08, 7.75), vec2(0.0, 7.75)];
    for w in blind.windows(2) {
        let gap = w[1].center - w[0].center;
        if gap < 1.2 {
            let at = plane.at((w[0].center + w[1].center) / 2.0, 0.0, 0.0);
            lathe(model.of(stones.trim), at, &shaft, 8, 0.3);
        }
    }
    // Mark both ends of the triforium by string courses.
    for y in TRIFORIUM {
        let [a, b] = whole;
        let string = [vec2(0.0, -0.05), vec2(0.06, 0.0), vec2(0.10, 0.03), vec2(0.10, 0.10), vec2(0.0, 0.17)];
        molding(model.of(stones.trim), &[plane.at(a, y, 0.0), plane.at(b, y, 0.0)], false, &string);
    }
}

fn aisle_side(model: &mut Model, stones: &Stones, side: f32) {
    let plane = aisle_wall(side);
    let nave = BAY * BAYS as f32;
    let span = stretch(&plane, 0.0, nave);
    wall(model.of(stones.ashlar), &plane, [span, [0.0, AISLE_TOP]], &aisle_windows(&plane), 8);
    // Add the string course below the windows.
    let string = [vec2(0.0, -0.04), vec2(0.05, 0.0), vec2(0.08, 0.03), vec2(0.08, 0.08), vec2(0.0, 0.14)];
    let ends = |y: f32| [plane.at(span[0], y, 0.0), plane.at(span[1], y, 0.0)];
    molding(model.of(stones.trim), &ends(1.62), false, &string);
    // Add the bench along the wall.
    let bench = [vec2(0.36, 0.0), vec2(0.36, 0.38), vec2(0.40, 0.40), vec2(0.40, 0.45), vec2(-0.01, 0.45)];
    molding(model.of(stones.steps), &ends(0.0), false, &bench);
    // Close the east end of the aisle.
    let (a, b) = (side * NAVE, side * AISLE);
    let p = [(a, 0.0), (b, 0.0), (b, AISLE_TOP), (a, AISLE_TOP)].map(|(x, y)| vec3(x, y, -nave));
    model.of(stones.ashlar).quad_facing(p, Vec3::Z);
}

fn west_wall(model: &mut Model, stones: &Stones) {
    let plane = Plane { origin: Vec3::ZERO, along: Vec3::NEG_X, out: Vec3::NEG_Z };
    let door = Opening { center: 0.0, half: 1.1, sill: 0.0, spring: 2.6, point: 0.7 };
    wall(model.of(stones.ashlar), &plane, [[-AISLE, AISLE], [0.0, AISLE_TOP]], &[door], 10);
    wall(model.of(stones.ashlar), &plane, [[-NAVE, NAVE], [AISLE_TOP, TOP]], &[], 1);
    door.reveal(model.of(stones.trim), &plane, 0.4, 10);
    door.archivolt_with_jambs(model.of(stones.trim), &plane, &archivolt(0.4, 0.12), 10);
    door.pane(model.of(stones.oak), &plane, Pane { depth: 0.36, steps: 10 }, |x, y| vec2(1.1 * x, -4.0 * y));
}

fn apse(model: &mut Model, stones: &Stones) {
    for i in 0..3 {
        let plane = apse_wall(i);
        let window = apse_window();
        wall(model.of(stones.ashlar), &plane, [[0.0, NAVE], [0.0, TOP]], &[window], 12);
    }
    let corners = apse_corners().map(|p| vec3(p.x, 2.7, p.y));
    let string = [vec2(0.0, -0.05), vec2(0.06, 0.0), vec2(0.10, 0.03), vec2(0.10, 0.10), vec2(0.0, 0.17)];
    molding(model.of(stones.trim), &corners, false, &string);
}

fn high_vault(model: &mut Model, stones: &Stones) {
    let section = RibSection { width: 0.26, depth: 0.19, half: false };
    let boss = |model: &mut Model, at: Vec3| {
        let profile = [
            vec2(0.0, -0.34),
            vec2(0.12, -0.33),
            vec2(0.22, -0.27),
            vec2(0.30, -0.17),
            vec2(0.33, -0.04),
            vec2(0.28, 0.05),
        ];
        lathe(model.of(stones.gold), at, &profile, 16, 1.0);
    };
    // Each bay has a groin vault, diagonal ribs and a boss.
    for i in 0..=BAYS {
        let (a, b) = (-BAY * i as f32, -BAY * (i as f32 + 1.0));
        groin_vault(model.of(stones.web), [vec2(-NAVE, b), vec2(NAVE, a)], HIGH_SPRING, HIGH, 16);
        let corner = |x: f32, z: f32| vec3(x * NAVE, HIGH_SPRING, z);
        rib(model.of(stones.trim), [corner(-1.0, a), corner(1.0, b)], HIGH, section, 12);
        rib(model.of(stones.trim), [corner(-1.0, b), corner(1.0, a)], HIGH, section, 12);
        boss(model, vec3(0.0, HIGH_SPRING + HIGH.0, (a + b) / 2.0));
    }
    for i in 0..=BAYS + 1 {
        let z = -BAY * i as f32;
        // Transverse ribs between the bays are wider.
        let wide = RibSection { width: 0.46, depth: 0.27, half: false };
        rib(model.of(stones.trim), [vec3(-NAVE, HIGH_SPRING, z), vec3(NAVE, HIGH_SPRING, z)], HIGH, wide, 14);
    }
    // The webs and ribs of the apse meet at the middle of the apse's chord.
    let corners = apse_corners();
    for i in 0..3 {
        let (p, q) = (corners[i], corners[i + 1]);
        for corner in [p, q] {
            half_web(model.of(stones.web), [APSE, (p + q) / 2.0, corner], HIGH_SPRING, HIGH, 16);
        }
    }
    // Ribs rise from the inner corners to the boss.
    for p in &corners[1..3] {
        let a = vec3(p.x, HIGH_SPRING, p.y);
        let b = vec3(2.0 * APSE.x - p.x, HIGH_SPRING, 2.0 * APSE.y - p.y);
        rib(model.of(stones.trim), [a, b], HIGH, RibSection { half: true, ..section }, 12);
    }
    boss(model, vec3(APSE.x, HIGH_SPRING + HIGH.0 - 0.08, APSE.y));
}

fn low_vaults(model: &mut Model, stones: &Stones) {
    let inner = NAVE + THICK;
    for side in [-1.0, 1.0] {
        let (x0, x1) = (side * inner, side * AISLE);
        for i in 0..BAYS {
            let (a, b) = (-BAY * i as f32, -BAY * (i as f32 + 1.0));
            // Each bay has a groin vault and diagonal ribs.
            groin_vault(model.of(stones.web), [vec2(x0.min(x1), b), vec2(x0.max(x1), a)], LOW_SPRING, LOW, 12);
            let section = RibSection { width: 0.22, depth: 0.15, half: false };
            let corner = |x: f32, z: f32| vec3(x, LOW_SPRING, z);
            rib(model.of(stones.trim), [corner(x0, a), corner(x1, b)], LOW, section, 9);
            rib(model.of(stones.trim), [corner(x0, b), corner(x1, a)], LOW, section, 9);
        }
        for i in 0..=BAYS {
            let z = -BAY * i as f32;
            // Transverse ribs between the bays are wider.
            let section = RibSection { width: 0.40, depth: 0.20, half: false };
            rib(model.of(stones.trim), [vec3(x0, LOW_SPRING, z), vec3(x1, LOW_SPRING, z)], LOW, section, 10);
        }
    }
}
