//! The scene `atrium`: a two-storey colonnaded courtyard under the open sky.
//!
//! The court is 24 m by 10 m inside its columns and 30.8 m by 16.8 m inside its outer walls. The arcade is vaulted, and
//! the gallery above it has a beamed ceiling. The parapet is 11.6 m high.

mod gallery;
mod ground;
mod objects;

use glam::{Vec3, vec3};

use crate::animation::{Path, look_at, rotation};
use crate::arches::Plane;
use crate::cloth::brocade;
use crate::glb::{Light, MaterialId, Scene};
use crate::patterns::{marble, plaster};
use crate::stone::{ashlar, leaves, octagons, plain_stone};
use crate::texture::from_srgb;
use crate::toml::Sky;
use crate::wood::veneer;

/// Duration of the animation \[s\].
pub const DURATION: f32 = 9.0;

/// Radiance of the sky on a clear morning.
pub const SKY: Sky = Sky {
    zenith: vec3(0.30, 0.52, 1.05),
    horizon: vec3(1.0, 1.15, 1.35),
    ground: vec3(0.12, 0.10, 0.08),
    sun_diameter: 0.53,
};

/// Half the distance between the short colonnades, and half the distance between the long colonnades \[m\].
const COURT: [f32; 2] = [12.0, 5.0];
/// Thickness of the arcade walls \[m\].
const THICK: f32 = 0.5;
/// Half the sides of the rectangle of the outer walls \[m\].
const OUTER: [f32; 2] = [15.4, 8.4];
/// Height of the gallery floor \[m\].
const UPPER: f32 = 5.6;
/// Height of the top of the gallery's walls \[m\].
const EAVES: f32 = 10.4;

/// Materials of the building.
struct Stones {
    ashlar: MaterialId,
    trim: MaterialId,
    shaft: MaterialId,
    plaster: MaterialId,
    ochre: MaterialId,
    paving: MaterialId,
    slabs: MaterialId,
    wood: MaterialId,
    door: MaterialId,
}

/// One side of the court: its plane, half its length, and its number of arcade bays.
struct CourtSide {
    plane: Plane,
    half: f32,
    bays: usize,
    /// Outer wall opposite the side.
    outer: Plane,
    outer_half: f32,
}

fn sides() -> [CourtSide; 4] {
    let side = |out: Vec3, distance: f32, outer: f32, half: f32, outer_half: f32, bays: usize| CourtSide {
        plane: Plane { origin: -out * distance, along: Vec3::Y.cross(out), out },
        half,
        bays,
        outer: Plane { origin: -out * outer, along: Vec3::Y.cross(out), out },
        outer_half,
    };
    [
        side(Vec3::Z, COURT[1], OUTER[1], COURT[0], OUTER[0], 8),
        side(Vec3::NEG_Z, COURT[1], OUTER[1], COURT[0], OUTER[0], 8),
        side(Vec3::X, COURT[0], OUTER[0], COURT[1], OUTER[1], 3),
        side(Vec3::NEG_X, COURT[0], OUTER[0], COURT[1], OUTER[1], 3),
    ]
}

/// Returns the corners of a rectangle, ordered so that its inside is on the right.
fn round(half: [f32; 2], y: f32) -> [Vec3; 4] {
    let [x, z] = half;
    [vec3(-x, y, -z), vec3(x, y, -z), vec3(x, y, z), vec3(-x, y, z)]
}

/// Builds the scene `atrium`.
#[must_use]
pub fn build() -> Scene {
    let mut scene = Scene::new("atrium");
    let sand = vec3(0.55, 0.44, 0.305);
    let stones = Stones {
        ashlar: scene.textured("sandstone courses", 2.2, &ashlar(1024, sand, 5, 0.42, 3)),
        trim: scene.textured("limestone", 1.0, &plain_stone(512, vec3(0.60, 0.52, 0.40), 8)),
        shaft: scene.textured("shaft marble", 2.0, &marble(512, vec3(0.62, 0.53, 0.44), vec3(0.36, 0.24, 0.19), 14)),
        plaster: scene.textured("vault plaster", 2.0, &plaster(512, vec3(0.74, 0.68, 0.58), 0.25, 5)),
        ochre: scene.textured("ochre plaster", 2.5, &plaster(512, vec3(0.66, 0.45, 0.26), 0.40, 25)),
        paving: scene.textured(
            "octagon paving",
            2.4,
            &octagons(1024, vec3(0.55, 0.49, 0.41), vec3(0.24, 0.15, 0.11), 4, 6),
        ),
        slabs: scene.textured("arcade slabs", 2.0, &ashlar(512, vec3(0.50, 0.44, 0.36), 3, 0.3, 10)),
        wood: scene.textured("beams", 1.0, &veneer(512, vec3(0.26, 0.15, 0.085), 4)),
        door: scene.textured("doors", 0.9, &veneer(512, vec3(0.20, 0.105, 0.055), 9)),
    };
    // Add cloths, plants and metals of the objects.
    let gold = vec3(0.42, 0.27, 0.09);
    let cloths = [
        scene.textured("red cloth", 0.5, &brocade(512, vec3(0.48, 0.035, 0.030), gold, 1)),
        scene.textured("blue cloth", 0.5, &brocade(512, vec3(0.045, 0.10, 0.38), gold, 2)),
        scene.textured("green cloth", 0.5, &brocade(512, vec3(0.05, 0.24, 0.085), gold, 3)),
    ];
    let hedge = scene.textured("box leaves", 0.7, &leaves(512, vec3(0.065, 0.125, 0.030), 2));
    let terracotta = scene.plain("terracotta", from_srgb(186, 104, 68));
    let bronze = scene.plain("bronze", vec3(0.34, 0.22, 0.10));
    let brass = scene.plain("brass", vec3(0.62, 0.44, 0.16));
    let water = scene.plain("water", vec3(0.09, 0.20, 0.22));

    ground::add(&mut scene, &stones);
    gallery::add(&mut scene, &stones);
    // Cloths reflect on both sides.
    let cloths = cloths.map(|cloth| scene.sheet(cloth));
    objects::drapes(&mut scene, &cloths, brass);
    objects::fountain(&mut scene, stones.trim, water, bronze, brass);
    objects::pots(&mut scene, terracotta, hedge, stones.trim);
    objects::lamps(&mut scene, bronze, brass);

    // The sun shines at a slant into the open court.
    let sun = Light { kind: "directional", color: vec3(1.0, 0.90, 0.74), intensity: 6.5 };
    scene.light("sun", sun, vec3(0.0, 30.0, 0.0), vec3(0.42, -0.86, -0.40));

    // The camera walks along the court. `aim` is the path of the point that it looks at.
    let walk = Path::new(&[
        (0.0, vec3(-11.2, 1.60, 1.6)),
        (2.0, vec3(-8.6, 1.64, 2.1)),
        (4.0, vec3(-5.6, 1.60, 2.6)),
        (6.0, vec3(-2.6, 1.64, 3.0)),
        (7.5, vec3(-0.4, 1.62, 2.9)),
        (DURATION, vec3(1.6, 1.60, 2.4)),
    ]);
    let aim = Path::new(&[
        (0.0, vec3(4.0, 3.6, -1.6)),
        (2.0, vec3(2.5, 4.2, -3.4)),
        (4.0, vec3(2.5, 3.4, -3.6)),
        (6.0, vec3(6.0, 2.8, -2.0)),
        (7.5, vec3(9.5, 3.6, 0.0)),
        (DURATION, vec3(12.5, 4.6, 0.6)),
    ]);
    let view = |t: f32| look_at(walk.at(t), aim.at(t));
    let camera = scene.camera(66f32.to_radians(), walk.at(0.0), view(0.0));
    scene.animate(camera, walk.translation());
    scene.animate(camera, rotation(DURATION, 25.0, view));
    scene
}
