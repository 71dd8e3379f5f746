//! The scene `conference`: a meeting room lit by more than a hundred small lamps.
//!
//! The room measures 14.4 m by 10.8 m and is 3.4 m high. Each of the 12 by 9 coffers of the ceiling has its own
//! panel. A pendant over the table and sconces on the walls add further lamps.

mod furniture;
mod room;

use std::f32::consts::TAU;

use glam::{Quat, Vec3, vec3};

use crate::animation::{Path, look_at, rotation};
use crate::glb::{Material, MaterialId, Scene};
use crate::patterns::{linen, plaster};
use crate::pictures::{abstract_picture, carpet, landscape, whiteboard};
use crate::stone::leaves;
use crate::wood::veneer;

/// Duration of the animation \[s\].
pub const DURATION: f32 = 8.0;

/// Half the room's extents in x and z \[m\].
const HALF: [f32; 2] = [7.2, 5.4];
/// Height of the underside of the beams between the coffers \[m\].
const CEILING: f32 = 3.2;

/// Materials of the room.
struct RoomMaterials {
    carpet: MaterialId,
    walnut: MaterialId,
    table: MaterialId,
    wall: MaterialId,
    ceiling: MaterialId,
    cloth: MaterialId,
    metal: MaterialId,
    dark: MaterialId,
    white: MaterialId,
    slat: MaterialId,
    soil: MaterialId,
    leaf: MaterialId,
    glass: MaterialId,
    pictures: [MaterialId; 3],
    board: MaterialId,
    /// Emissive materials of the ceiling panels: over the table, around it, along the walls.
    panels: [MaterialId; 3],
    sconce: MaterialId,
    pendant: MaterialId,
    dusk: MaterialId,
}

/// Builds the scene `conference`.
#[must_use]
pub fn build() -> Scene {
    let mut scene = Scene::new("conference");
    let glow = |scene: &mut Scene, name, color: Vec3| scene.material(Material::glowing(name, color));
    let finish = RoomMaterials {
        carpet: scene.textured("carpet", 1.2, &carpet(768, vec3(0.20, 0.27, 0.30), vec3(0.48, 0.42, 0.28), 3)),
        walnut: scene.textured("walnut", 0.9, &veneer(768, vec3(0.36, 0.20, 0.105), 12)),
        table: scene.textured("cherry", 1.4, &veneer(768, vec3(0.46, 0.25, 0.12), 31)),
        wall: scene.textured("wall", 1.8, &plaster(512, vec3(0.72, 0.69, 0.62), 0.12, 4)),
        ceiling: scene.textured("ceiling", 1.2, &plaster(256, vec3(0.78, 0.77, 0.74), 0.10, 7)),
        cloth: scene.textured("upholstery", 0.22, &linen(512, vec3(0.09, 0.21, 0.25), 64, 8)),
        metal: scene.plain("brushed steel", vec3(0.55, 0.55, 0.56)),
        dark: scene.plain("black plastic", vec3(0.045, 0.045, 0.05)),
        white: scene.plain("paper", vec3(0.80, 0.79, 0.76)),
        slat: scene.plain("blind", vec3(0.70, 0.66, 0.58)),
        soil: scene.plain("planter", vec3(0.50, 0.45, 0.38)),
        leaf: scene.textured("leaf", 0.8, &leaves(256, vec3(0.08, 0.19, 0.05), 6)),
        glass: scene.plain("tinted glass", vec3(0.25, 0.38, 0.36)),
        pictures: [
            scene.textured("landscape", 1.0, &landscape(512, 3)),
            scene.textured("discs", 1.0, &abstract_picture(512, 4)),
            scene.textured("bands", 1.0, &abstract_picture(512, 11)),
        ],
        board: scene.textured("whiteboard", 1.0, &whiteboard(1024)),
        panels: [
            glow(&mut scene, "panel, middle", vec3(9.0, 7.7, 6.1)),
            glow(&mut scene, "panel, ring", vec3(6.8, 6.1, 5.3)),
            glow(&mut scene, "panel, edge", vec3(4.9, 4.7, 4.4)),
        ],
        sconce: glow(&mut scene, "sconce", vec3(52.5, 34.5, 18.0)),
        pendant: glow(&mut scene, "pendant", vec3(15.0, 11.6, 7.5)),
        dusk: glow(&mut scene, "dusk", vec3(0.30, 0.46, 0.84)),
    };
    room::add(&mut scene, &finish);
    furniture::table(&mut scene, &finish);
    // Thin surfaces reflect on both sides.
    for thin in [finish.white, finish.slat, finish.leaf] {
        scene.sheet(thin);
    }
    furniture::plants(&mut scene, &finish);

    // All chairs share one mesh.
    let chair = furniture::chair(&finish);
    let chair = scene.mesh("chair", chair);
    for (i, (at, angle)) in furniture::seats().into_iter().enumerate() {
        let node = scene.node("chair", Some(chair), at, Quat::from_rotation_y(angle));
        if i == 9 {
            // Someone has just left the chair, which swings back and forth and comes to a stop.
            let swing = move |t: f32| 1.1 * (TAU * t / 4.0).sin() * (-0.18 * t).exp();
            scene.animate(node, rotation(DURATION, 10.0, move |t| Quat::from_rotation_y(angle + swing(t))));
        }
    }

    // The camera walks along the windows and looks across the table.
    let walk = Path::new(&[
        (0.0, vec3(-6.0, 1.62, 3.7)),
        (2.5, vec3(-3.2, 1.60, 4.1)),
        (5.0, vec3(0.6, 1.63, 4.1)),
        (DURATION, vec3(4.6, 1.60, 3.5)),
    ]);
    let aim = Path::new(&[
        (0.0, vec3(1.2, 1.25, -1.2)),
        (2.5, vec3(0.4, 1.25, -1.8)),
        (5.0, vec3(-0.6, 1.20, -2.0)),
        (DURATION, vec3(-2.6, 1.30, -1.2)),
    ]);
    let view = |t: f32| look_at(walk.at(t), aim.at(t));
    let camera = scene.camera(62f32.to_radians(), walk.at(0.0), view(0.0));
    scene.animate(camera, walk.translation());
    scene.animate(camera, rotation(DURATION, 25.0, view));
    scene
}
