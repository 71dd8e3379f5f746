//! The scene `nave`: a vaulted church lit only through its windows.
//!
//! The church has six bays of 5 m with aisles, a chancel bay, and an apse of three sides. The nave is 8.4 m wide
//! between its walls and 14.4 m high. It extends from the west wall at z = 0 along -z.

mod furnishing;
mod shell;
mod walls;
mod windows;

use glam::{Vec2, Vec3, vec3};

use crate::animation::{Path, look_at, rotation};
use crate::glass::{grisaille, medallions, rose};
use crate::glb::{Material, MaterialId, Scene};
use crate::patterns::plaster;
use crate::stone::{ashlar, checker, plain_stone};
use crate::texture::Texture;
use crate::wood::veneer;

/// Duration of the animation \[s\].
pub const DURATION: f32 = 10.0;

/// Length of a bay \[m\].
const BAY: f32 = 5.0;
/// Number of bays with aisles. The chancel is one more bay.
const BAYS: usize = 6;
/// Half the width between the nave's walls \[m\].
const NAVE: f32 = 4.2;
/// Thickness of the nave's walls \[m\].
const THICK: f32 = 0.6;
/// Distance of the aisles' outer walls from the axis \[m\].
const AISLE: f32 = 9.0;
/// Height of the springing of the arcade and the aisle vaults \[m\].
const LOW_SPRING: f32 = 3.6;
/// Height of the springing of the high vault \[m\].
const HIGH_SPRING: f32 = 9.6;
/// Rise \[m\] and pointedness of the high vault's arches.
const HIGH: (f32, f32) = (4.8, 0.5);
/// Rise \[m\] and pointedness of the aisle vaults' arches.
const LOW: (f32, f32) = (3.1, 0.5);
/// Height of the chancel's floor \[m\].
const CHANCEL: f32 = 0.48;
/// Middle of the chord of the apse, x and z \[m\].
const APSE: Vec2 = Vec2::new(0.0, -(BAY * (BAYS as f32 + 1.0)));

/// Materials of the church.
struct Stones {
    ashlar: MaterialId,
    trim: MaterialId,
    web: MaterialId,
    floor: MaterialId,
    steps: MaterialId,
    oak: MaterialId,
    iron: MaterialId,
    linen: MaterialId,
    carpet: MaterialId,
    gold: MaterialId,
    candle: MaterialId,
    aisle_glass: MaterialId,
    high_glass: MaterialId,
    apse_glass: MaterialId,
    rose_glass: MaterialId,
}

/// Returns the corners of the apse, from the left end of its chord around to the right end.
fn apse_corners() -> [Vec2; 4] {
    let side = NAVE * 3f32.sqrt() / 2.0;
    [
        APSE + Vec2::new(-NAVE, 0.0),
        APSE + Vec2::new(-NAVE / 2.0, -side),
        APSE + Vec2::new(NAVE / 2.0, -side),
        APSE + Vec2::new(NAVE, 0.0),
    ]
}

/// Builds the scene `nave`.
#[must_use]
pub fn build() -> Scene {
    let mut scene = Scene::new("nave");
    // Glass emits its texture, as if lit from outside by an even sky.
    let glass = |scene: &mut Scene, name: &'static str, radiance: f32, texture: &Texture| {
        let picture = scene.texture(name, texture);
        scene.material(Material { emission_texture: Some(picture), ..Material::glowing(name, Vec3::splat(radiance)) })
    };
    // Create the materials: stones, wood, metals, cloths and glass.
    let lime = vec3(0.74, 0.69, 0.59);
    let pale = vec3(0.80, 0.77, 0.66);
    let stones = Stones {
        ashlar: scene.textured("limestone courses", 2.4, &ashlar(1024, lime, 6, 0.22, 5)),
        trim: scene.textured("limestone", 1.0, &plain_stone(512, vec3(0.75, 0.70, 0.61), 18)),
        web: scene.textured("vault webs", 1.6, &ashlar(512, vec3(0.78, 0.74, 0.66), 8, 0.12, 9)),
        floor: scene.textured(
            "checker floor",
            2.4,
            &checker(1024, vec3(0.66, 0.62, 0.54), vec3(0.24, 0.22, 0.21), 4, 12),
        ),
        steps: scene.textured("steps", 1.5, &plaster(512, vec3(0.55, 0.51, 0.44), 0.3, 13)),
        oak: scene.textured("oak", 0.8, &veneer(512, vec3(0.34, 0.20, 0.105), 15)),
        iron: scene.plain("iron", vec3(0.06, 0.055, 0.05)),
        linen: scene.plain("altar linen", vec3(0.82, 0.80, 0.75)),
        carpet: scene.plain("red carpet", vec3(0.38, 0.045, 0.04)),
        gold: scene.plain("gilding", vec3(0.72, 0.50, 0.17)),
        candle: scene.plain("wax", vec3(0.80, 0.74, 0.60)),
        aisle_glass: glass(&mut scene, "aisle glass", 6.5, &grisaille(512, 2.1, pale, vec3(0.07, 0.20, 0.60), 3)),
        high_glass: glass(&mut scene, "clerestory glass", 9.0, &grisaille(512, 1.8, pale, vec3(0.60, 0.09, 0.05), 7)),
        apse_glass: glass(&mut scene, "apse glass", 12.0, &medallions(1024, 3.8, 5)),
        rose_glass: glass(&mut scene, "rose glass", 12.0, &rose(512, 8)),
    };
    // Add the building, then its windows and furniture.
    shell::add(&mut scene, &stones);
    windows::add(&mut scene, &stones);
    furnishing::add(&mut scene, &stones);

    // The camera walks along the central aisle and looks up.
    let walk = Path::new(&[
        (0.0, vec3(0.10, 1.68, -2.2)),
        (2.5, vec3(-0.05, 1.72, -5.6)),
        (5.0, vec3(0.08, 1.68, -9.2)),
        (7.5, vec3(-0.06, 1.72, -13.0)),
        (DURATION, vec3(0.05, 1.68, -16.6)),
    ]);
    let aim = Path::new(&[
        (0.0, vec3(0.0, 5.4, -26.0)),
        (2.5, vec3(-3.0, 5.0, -24.0)),
        (5.0, vec3(-4.5, 5.2, -26.0)),
        (7.5, vec3(2.5, 6.0, -34.0)),
        (DURATION, vec3(0.0, 6.2, -38.0)),
    ]);
    let view = |t: f32| look_at(walk.at(t), aim.at(t));
    let camera = scene.camera(66f32.to_radians(), walk.at(0.0), view(0.0));
    scene.animate(camera, walk.translation());
    scene.animate(camera, rotation(DURATION, 25.0, view));
    scene
}
