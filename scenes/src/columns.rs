//! Classical building elements: columns, balusters, urns, cornices.

use std::f32::consts::{PI, TAU};

use glam::{Vec2, Vec3, vec2, vec3};

use crate::glb::{MaterialId, Model};
use crate::mesh::{Mesh, Side};
use crate::shapes::{arc, chain, lathe};

/// Returns a round column with an attic base and a leafy capital. The foot is at the origin.
///
/// `radius` is the radius at the foot of the shaft, and `height` is the height of the abacus's top \[m\]. With fewer
/// than 20 `segments`, a plain cushion replaces the capital.
#[must_use]
pub fn column(trim: MaterialId, shaft: MaterialId, radius: f32, height: f32, segments: usize) -> Model {
    let r = radius;
    let mut model = Model::new();
    let mesh = model.of(trim);
    // Add the square plinth.
    let plinth = 0.45 * r;
    let w = 1.48 * r;
    mesh.cuboid_without(vec3(-w, 0.0, -w), vec3(w, plinth, w), &[Side::Bottom]);
    // The base consists of torus, scotia, torus and fillet.
    let fine = segments >= 20;
    let steps = if fine { [5, 2, 4, 3] } else { [3, 1, 2, 2] };
    let base = chain(&[
        &[vec2(1.2 * r, 0.0)],
        &arc(vec2(1.24 * r, 0.2 * r), 0.2 * r, -90.0, 90.0, steps[0]),
        &[vec2(1.22 * r, 0.44 * r)],
        &arc(vec2(1.24 * r, 0.56 * r), 0.12 * r, 270.0, 180.0, steps[1]),
        &arc(vec2(1.14 * r, 0.78 * r), 0.12 * r, -90.0, 90.0, steps[2]),
        &[vec2(1.06 * r, 0.94 * r), vec2(1.02 * r, 1.02 * r)],
    ]);
    lathe(mesh, vec3(0.0, plinth, 0.0), &base, segments, 3.0);
    let foot = plinth + 1.02 * r;
    let capital = 2.2 * r;
    let neck = height - capital;
    // The shaft swells slightly before it narrows.
    let entasis: Vec<Vec2> = (0..=4)
        .map(|i| {
            let t = i as f32 / 4.0;
            vec2(r * (1.0 + 0.012 * (PI * t * 1.2).sin() - 0.15 * t * t), foot + (neck - foot) * t)
        })
        .collect();
    lathe(model.of(shaft), Vec3::ZERO, &entasis, segments, 2.0);
    let mesh = model.of(trim);
    let top = 0.85 * r;
    // Add the ring at the neck.
    let ring = arc(vec2(top, neck), 0.09 * r, -90.0, 90.0, steps[3]);
    lathe(mesh, Vec3::ZERO, &ring, segments, 2.0);
    // Add the capital: a bell with leaves, or a plain cushion.
    let abacus = 0.32 * r;
    if fine {
        bell(mesh, top, neck + 0.08 * r, height - abacus, 1.5 * r);
    } else {
        let cushion = arc(vec2(top, height - abacus), 1.0, -90.0, -15.0, 4);
        let (wide, high) = (0.62 * r, height - abacus - neck - 0.08 * r);
        let cushion: Vec<Vec2> = cushion
            .iter()
            .map(|p| vec2(top + (p.x - top) * wide, height - abacus + (p.y - height + abacus) * high))
            .collect();
        lathe(mesh, Vec3::ZERO, &cushion, segments, 2.0);
    }
    let w = 1.45 * r;
    mesh.cuboid(vec3(-w, height - abacus, -w), vec3(w, height - 0.45 * abacus, w));
    let w = 1.58 * r;
    mesh.cuboid(vec3(-w, height - 0.45 * abacus, -w), vec3(w, height, w));
    model
}

/// Adds the bell of a capital with two rows of eight leaves that curl outwards at their tips.
fn bell(mesh: &mut Mesh, radius: f32, low: f32, high: f32, top: f32) {
    let height = high - low;
    mesh.surface(32, 10, vec2(2.0, height), |u, v| {
        let angle = TAU * u;
        let bell = radius + (top - radius) * (0.12 * v + 0.88 * v.powf(3.5));
        let leaf = |phase: f32, from: f32, to: f32| {
            let t = ((v - from) / (to - from)).clamp(0.0, 1.0);
            let lobe = (8.0 * angle + phase).cos().max(0.0).powf(0.6);
            // A leaf is thickest at the curl and has no thickness above it.
            let fall = if v > to { (1.0 - (v - to) * 14.0).max(0.0) } else { 1.0 };
            lobe * (0.10 + 0.32 * t.powi(3)) * fall * radius
        };
        let r = bell + leaf(0.0, 0.0, 0.42).max(leaf(PI, 0.1, 0.78));
        // The angle rises clockwise, so that the cross product points outwards.
        vec3(r * angle.cos(), low + height * v, -r * angle.sin())
    });
}

/// Adds a baluster with this height \[m\]. The foot is at the origin.
pub fn baluster(mesh: &mut Mesh, height: f32, segments: usize) {
    let h = height;
    let w = 0.105 * h;
    mesh.cuboid_without(vec3(-w, 0.0, -w), vec3(w, 0.08 * h, w), &[Side::Bottom]);
    mesh.cuboid_without(vec3(-w, 0.92 * h, -w), vec3(w, h, w), &[Side::Top]);
    let profile: Vec<Vec2> = [
        (0.095, 0.08),
        (0.095, 0.12),
        (0.055, 0.17),
        (0.115, 0.30),
        (0.110, 0.38),
        (0.075, 0.52),
        (0.046, 0.76),
        (0.075, 0.82),
        (0.095, 0.92),
    ]
    .iter()
    .map(|&(r, y)| vec2(r, y) * h)
    .collect();
    lathe(mesh, Vec3::ZERO, &profile, segments, 0.6);
}

/// Returns the profile of an urn of unit height, which is open at the top.
#[must_use]
pub fn urn() -> Vec<Vec2> {
    chain(&[
        &[vec2(0.20, 0.0), vec2(0.20, 0.05), vec2(0.17, 0.08), vec2(0.07, 0.14), vec2(0.06, 0.2), vec2(0.10, 0.24)],
        &arc(vec2(0.04, 0.52), 0.29, -78.0, 0.0, 4),
        &[vec2(0.31, 0.62), vec2(0.24, 0.76), vec2(0.22, 0.84), vec2(0.26, 0.92), vec2(0.33, 0.97), vec2(0.33, 1.0)],
        &[vec2(0.28, 1.0), vec2(0.22, 0.94), vec2(0.0, 0.92)],
    ])
}

/// Returns the profile of a crowning cornice, starting at its foot. `out` is its projection and `height` its height
/// \[m\].
#[must_use]
pub fn cornice(out: f32, height: f32) -> Vec<Vec2> {
    let (o, h) = (out, height);
    chain(&[
        &[vec2(0.0, 0.0), vec2(0.10 * o, 0.0), vec2(0.10 * o, 0.14 * h), vec2(0.18 * o, 0.14 * h)],
        &arc(vec2(0.18 * o, 0.34 * h), 0.20 * h, -90.0, 0.0, 5)
            .iter()
            .map(|p| vec2(0.18 * o + (p.x - 0.18 * o) * 1.2 * o / h, p.y))
            .collect::<Vec<_>>(),
        &[vec2(0.72 * o, 0.40 * h), vec2(0.72 * o, 0.66 * h), vec2(0.78 * o, 0.66 * h)],
        &arc(vec2(0.78 * o, 0.90 * h), 0.24 * h, -90.0, 0.0, 4)
            .iter()
            .map(|p| vec2(0.78 * o + (p.x - 0.78 * o) * 0.2 * o / (0.24 * h), p.y))
            .collect::<Vec<_>>(),
        &[vec2(o, 0.90 * h), vec2(o, h), vec2(-0.02, h)],
    ])
}

/// Returns the profile of a flat band with a small molding above and below.
#[must_use]
pub fn band(out: f32, height: f32) -> Vec<Vec2> {
    let (o, h) = (out, height);
    vec![
        vec2(0.0, 0.0),
        vec2(0.5 * o, 0.0),
        vec2(0.5 * o, 0.25 * h),
        vec2(o, 0.4 * h),
        vec2(o, 0.85 * h),
        vec2(0.6 * o, h),
        vec2(-0.02, h),
    ]
}

/// Returns the profile of an archivolt with this `width` \[m\], for [`crate::arches::Opening::archivolt`].
#[must_use]
pub fn archivolt(width: f32, out: f32) -> Vec<Vec2> {
    let (w, o) = (width, out);
    vec![
        vec2(w, 0.0),
        vec2(w, 0.9 * o),
        vec2(0.86 * w, o),
        vec2(0.74 * w, 0.6 * o),
        vec2(0.40 * w, 0.6 * o),
        vec2(0.40 * w, 0.35 * o),
        vec2(0.0, 0.35 * o),
        vec2(0.0, -0.01),
    ]
}
