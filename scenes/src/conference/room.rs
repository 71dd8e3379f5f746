//! The conference room: coffered ceiling, panelled walls, windows, pictures and lamps.

use glam::{Vec2, Vec3, vec2, vec3};

use super::{CEILING, HALF, RoomMaterials};
use crate::arches::Plane;
use crate::glb::{Model, Scene};
use crate::shapes::{Frame, arc, bar, molding, sweep};

/// Height of the panelling's top \[m\].
const DADO: f32 = 1.05;
/// Number of coffers in x and in z.
const COFFERS: [usize; 2] = [12, 9];
/// Side of the square that each coffer occupies \[m\].
const MODULE: f32 = 1.2;

fn wall(out: Vec3, distance: f32) -> Plane {
    Plane { origin: -out * distance, along: Vec3::Y.cross(out), out }
}

/// Adds the room.
pub(super) fn add(scene: &mut Scene, f: &RoomMaterials) {
    let mut room = Model::new();
    let mut lamps = Model::new();
    let [hx, hz] = HALF;
    room.of(f.carpet).quad_facing([(-hx, -hz), (hx, -hz), (hx, hz), (-hx, hz)].map(|(x, z)| vec3(x, 0.0, z)), Vec3::Y);
    ceiling(&mut room, &mut lamps, f);

    // Panel the walls up to the dado.
    let back = wall(Vec3::Z, hz);
    let windows = wall(Vec3::NEG_Z, hz);
    let left = wall(Vec3::X, hx);
    let right = wall(Vec3::NEG_X, hx);
    panelling(&mut room, f, &back, [-hx, hx], 12);
    panelling(&mut room, f, &windows, [-hx, hx], 12);
    panelling(&mut room, f, &left, [-hz, hz], 9);
    // The door replaces two panels.
    let door = [2.4, 3.5];
    panelling(&mut room, f, &right, [-hz, door[0] - 0.1], 6);
    panelling(&mut room, f, &right, [door[1] + 0.1, hz], 2);
    // Add the plain walls above the dado, around the door.
    for (plane, half) in [(&back, hx), (&left, hz)] {
        plane.rectangle(room.of(f.wall), [-half, half], [DADO, CEILING], 0.0);
    }
    right.rectangle(room.of(f.wall), [-hz, door[0] - 0.1], [DADO, CEILING], 0.0);
    right.rectangle(room.of(f.wall), [door[1] + 0.1, hz], [DADO, CEILING], 0.0);
    right.rectangle(room.of(f.wall), [door[0] - 0.1, door[1] + 0.1], [2.25, CEILING], 0.0);
    door_with_frame(&mut room, f, &right, door);
    window_wall(&mut room, &mut lamps, f, &windows);

    // Add dado rail, skirting and cornice. The dado rail and the skirting end at the door.
    let rail = [vec2(0.0, 0.0), vec2(0.03, 0.0), vec2(0.045, 0.02), vec2(0.045, 0.045), vec2(0.0, 0.06)];
    let skirting = [vec2(0.028, 0.0), vec2(0.028, 0.11), vec2(0.018, 0.13), vec2(0.0, 0.135)];
    let corner = |x: f32, z: f32, y: f32| vec3(x, y, z);
    let line = |y: f32| {
        vec![
            right.at(door[1] + 0.1, y, 0.0),
            corner(hx, hz, y),
            corner(-hx, hz, y),
            corner(-hx, -hz, y),
            corner(hx, -hz, y),
            right.at(door[0] - 0.1, y, 0.0),
        ]
    };
    molding(room.of(f.walnut), &line(DADO), false, &rail);
    molding(room.of(f.walnut), &line(0.0), false, &skirting);
    // Add a concave quarter round, slightly below the beams.
    let crown: Vec<Vec2> =
        arc(vec2(0.10, -0.10), 0.10, 180.0, 90.0, 4).iter().map(|p| vec2(p.x, p.y - 0.003)).collect();
    let ring = [corner(-hx, -hz, CEILING), corner(hx, -hz, CEILING), corner(hx, hz, CEILING), corner(-hx, hz, CEILING)];
    molding(room.of(f.ceiling), &ring, true, &crown);

    // Add pictures and lamps.
    hangings(&mut room, f, &back, &left);
    for s in [-6.6, -3.3, 3.3, 6.6] {
        sconce(&mut room, &mut lamps, f, &back, s);
    }
    for s in [-4.9, 4.9] {
        sconce(&mut room, &mut lamps, f, &left, s);
        sconce(&mut room, &mut lamps, f, &right, s);
    }
    for s in [-3.45, 0.0, 3.45] {
        sconce(&mut room, &mut lamps, f, &windows, s);
    }
    pendant(&mut room, &mut lamps, f);
    scene.show("room", room);
    scene.show("lamps", lamps);
}

fn ceiling(room: &mut Model, lamps: &mut Model, f: &RoomMaterials) {
    let [nx, nz] = COFFERS;
    let (beam, depth, panel) = (0.075, 0.2, 0.3);
    for i in 0..nx {
        for k in 0..nz {
            let x = -HALF[0] + MODULE * (i as f32 + 0.5);
            let z = -HALF[1] + MODULE * (k as f32 + 0.5);
            let square = |h: f32, y: f32| [(-h, -h), (h, -h), (h, h), (-h, h)].map(|(a, b)| vec3(x + a, y, z + b));
            // Build the coffer from nested squares: beam, ledge and recessed top.
            let outer = square(MODULE / 2.0, CEILING);
            let inner = square(MODULE / 2.0 - beam, CEILING);
            let step = square(MODULE / 2.0 - beam, CEILING + 0.07);
            let ledge = square(MODULE / 2.0 - beam - 0.045, CEILING + 0.07);
            let top = square(MODULE / 2.0 - beam - 0.045, CEILING + depth);
            let mesh = room.of(f.ceiling);
            for a in 0..4 {
                let b = (a + 1) % 4;
                let inward = vec3(x, 0.0, z) - (outer[a] + outer[b]) * 0.5 * vec3(1.0, 0.0, 1.0);
                mesh.quad_facing([outer[a], outer[b], inner[b], inner[a]], Vec3::NEG_Y);
                mesh.quad_facing([inner[a], inner[b], step[b], step[a]], inward);
                mesh.quad_facing([step[a], step[b], ledge[b], ledge[a]], Vec3::NEG_Y);
                mesh.quad_facing([ledge[a], ledge[b], top[b], top[a]], inward);
            }
            mesh.quad_facing(top, Vec3::NEG_Y);
            // Add the panel's housing, 3 cm high, and the pane slightly inside it.
            let low = CEILING + depth - 0.03;
            room.of(f.metal).cuboid_without(
                vec3(x - panel, low, z - panel),
                vec3(x + panel, CEILING + depth, z + panel),
                &[crate::mesh::Side::Top, crate::mesh::Side::Bottom],
            );
            // Close the underside of the housing around the pane.
            let rim = square(panel, low);
            let edge = square(panel - 0.02, low);
            for a in 0..4 {
                let b = (a + 1) % 4;
                room.of(f.metal).quad_facing([rim[a], rim[b], edge[b], edge[a]], Vec3::NEG_Y);
            }
            // Panels near the walls are dimmer.
            let from_edge = i.min(nx - 1 - i).min(k.min(nz - 1 - k));
            let group = if from_edge == 0 {
                2
            } else if from_edge < 3 {
                1
            } else {
                0
            };
            lamps.of(f.panels[group]).quad_facing(square(panel - 0.02, low + 0.003), Vec3::NEG_Y);
        }
    }
}

/// Adds a wainscot of raised panels between flat frames.
fn panelling(room: &mut Model, f: &RoomMaterials, plane: &Plane, s: [f32; 2], count: usize) {
    plane.rectangle(room.of(f.walnut), s, [0.0, DADO], 0.0);
    let width = (s[1] - s[0]) / count as f32;
    for i in 0..count {
        let a = s[0] + width * i as f32;
        plane.field(room.of(f.walnut), [[a + 0.07, a + width - 0.07], [0.22, DADO - 0.09]], 0.05, [0.003, 0.022]);
    }
}

fn door_with_frame(room: &mut Model, f: &RoomMaterials, plane: &Plane, s: [f32; 2]) {
    let wood = room.of(f.walnut);
    plane.block(wood, [s[0] - 0.1, s[0]], [0.0, 2.25], [-0.05, 0.05]);
    plane.block(wood, [s[1], s[1] + 0.1], [0.0, 2.25], [-0.05, 0.05]);
    plane.block(wood, [s[0], s[1]], [2.15, 2.25], [-0.05, 0.05]);
    plane.rectangle(wood, s, [0.0, 2.15], -0.03);
    // Add four raised fields and the knob.
    for (y0, y1) in [(0.15, 0.95), (1.10, 2.02)] {
        for (a, b) in [(s[0] + 0.10, s[0] + 0.51), (s[1] - 0.51, s[1] - 0.10)] {
            plane.field(wood, [[a, b], [y0, y1]], 0.05, [-0.027, -0.008]);
        }
    }
    let knob = plane.at(s[0] + 0.06, 1.03, 0.0);
    crate::shapes::ball(room.of(f.metal), knob + plane.out * 0.03, 0.028, 12);
    bar(room.of(f.metal), knob - plane.out * 0.03, knob + plane.out * 0.03, 0.01, 8);
}

/// Adds four windows with half-lowered blinds and the evening sky outside.
fn window_wall(room: &mut Model, lamps: &mut Model, f: &RoomMaterials, plane: &Plane) {
    let (sill, head, half) = (DADO + 0.1, 2.75, 1.2);
    let centers = [-5.15, -1.72, 1.72, 5.15];
    let mut from = -HALF[0];
    for c in centers {
        plane.rectangle(room.of(f.wall), [from, c - half], [DADO, CEILING], 0.0);
        plane.rectangle(room.of(f.wall), [c - half, c + half], [DADO, sill], 0.0);
        plane.rectangle(room.of(f.wall), [c - half, c + half], [head, CEILING], 0.0);
        from = c + half;
        // Add the reveals and the frame, and behind them the pane that emits the light of dusk.
        let deep = -0.22;
        let wood = room.of(f.walnut);
        plane.block(wood, [c - half - 0.06, c + half + 0.06], [sill - 0.04, sill], [deep, 0.07]);
        plane.block(wood, [c - half - 0.05, c - half], [sill, head], [deep, 0.02]);
        plane.block(wood, [c + half, c + half + 0.05], [sill, head], [deep, 0.02]);
        plane.block(wood, [c - half - 0.05, c + half + 0.05], [head, head + 0.06], [deep, 0.02]);
        plane.block(wood, [c - 0.03, c + 0.03], [sill, head], [deep - 0.01, deep + 0.05]);
        plane.block(wood, [c - half, c - 0.03], [2.2, 2.25], [deep - 0.01, deep + 0.05]);
        plane.block(wood, [c + 0.03, c + half], [2.2, 2.25], [deep - 0.01, deep + 0.05]);
        plane.rectangle(lamps.of(f.dusk), [c - half, c + half], [sill, head], deep);
        // Add tilted slats. Each slat is a shallow trough.
        let (count, pitch) = (if c.abs() > 3.0 { 30 } else { 20 }, 0.05);
        for k in 0..count {
            let y = head - 0.07 - pitch * k as f32;
            let frame = |s: f32| Frame { origin: plane.at(s, y, -0.09), x: plane.out, y: Vec3::Y };
            let slat = [vec2(0.022, 0.012), vec2(0.0, 0.004), vec2(-0.022, -0.016)];
            sweep(room.of(f.slat), &[frame(c - half + 0.02), frame(c + half - 0.02)], &slat);
        }
        // Add the bottom rail and the headbox of the blind.
        let low = head - 0.07 - pitch * count as f32;
        plane.block(room.of(f.slat), [c - half + 0.02, c + half - 0.02], [low - 0.01, low + 0.015], [-0.11, -0.07]);
        plane.block(room.of(f.slat), [c - half + 0.01, c + half - 0.01], [head - 0.05, head - 0.003], [-0.12, -0.06]);
    }
    plane.rectangle(room.of(f.wall), [from, HALF[0]], [DADO, CEILING], 0.0);
}

/// Adds pictures to the long wall and a whiteboard to the short wall.
fn hangings(room: &mut Model, f: &RoomMaterials, back: &Plane, left: &Plane) {
    let mut framed = |plane: &Plane, s: [f32; 2], y: [f32; 2], rim: f32, frame, picture| {
        let mesh = room.of(frame);
        plane.block(mesh, [s[0] - rim, s[0]], [y[0] - rim, y[1] + rim], [0.002, 0.045]);
        plane.block(mesh, [s[1], s[1] + rim], [y[0] - rim, y[1] + rim], [0.002, 0.045]);
        plane.block(mesh, [s[0], s[1]], [y[0] - rim, y[0]], [0.002, 0.045]);
        plane.block(mesh, [s[0], s[1]], [y[1], y[1] + rim], [0.002, 0.045]);
        plane.picture(room.of(picture), s, y, 0.02);
    };
    framed(back, [-0.95, 0.95], [1.35, 2.75], 0.07, f.walnut, f.pictures[0]);
    framed(back, [-5.6, -4.3], [1.40, 2.70], 0.05, f.dark, f.pictures[1]);
    framed(back, [4.3, 5.6], [1.40, 2.70], 0.05, f.dark, f.pictures[2]);
    framed(left, [-1.6, 1.6], [1.25, 2.65], 0.035, f.metal, f.board);
    left.block(room.of(f.metal), [-1.5, 1.5], [1.19, 1.214], [0.045, 0.11]);
}

/// Adds a half-round lamp shade that emits light up and down the wall.
fn sconce(room: &mut Model, lamps: &mut Model, f: &RoomMaterials, plane: &Plane, s: f32) {
    let (y, half, radius) = (2.05, 0.13, 0.10);
    let curve: Vec<Frame> = (0..=8)
        .map(|i| {
            let (sin, cos) = (std::f32::consts::PI * i as f32 / 8.0).sin_cos();
            let out = plane.along * -cos + plane.out * sin;
            Frame { origin: plane.at(s, y, 0.005) + out * radius, x: out, y: Vec3::Y }
        })
        .collect();
    let shade = [vec2(-0.006, -half), vec2(0.0, -half), vec2(0.0, half), vec2(-0.006, half), vec2(-0.006, -half)];
    sweep(room.of(f.metal), &curve, &shade);
    // Add glowing panes at the upper and lower openings.
    let pane = |y: f32| [(-0.06, 0.02), (0.06, 0.02), (0.06, 0.07), (-0.06, 0.07)].map(|(a, o)| plane.at(s + a, y, o));
    lamps.of(f.sconce).quad_facing(pane(y + 0.04), Vec3::Y);
    lamps.of(f.sconce).quad_facing(pane(y - 0.04), Vec3::NEG_Y);
}

/// Adds a slim bar with eight lamps over the table.
fn pendant(room: &mut Model, lamps: &mut Model, f: &RoomMaterials) {
    let (y, half) = (2.20, 2.6);
    room.of(f.dark).cuboid(vec3(-half, y, -0.06), vec3(half, y + 0.05, 0.06));
    for x in [-2.0, 2.0] {
        bar(room.of(f.metal), vec3(x, y + 0.05, 0.0), vec3(x, CEILING + 0.01, 0.0), 0.006, 6);
    }
    for i in 0..8 {
        let x = -half + 2.0 * half * (i as f32 + 0.5) / 8.0;
        let p = [(-0.16, -0.04), (0.16, -0.04), (0.16, 0.04), (-0.16, 0.04)];
        lamps.of(f.pendant).quad_facing(p.map(|(a, b)| vec3(x + a, y - 0.003, b)), Vec3::NEG_Y);
    }
}
