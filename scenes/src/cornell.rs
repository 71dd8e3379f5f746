//! The Cornell box in two versions: with wallpaper, parquet and two moving blocks, and as published.
//!
//! Measurements and reflectances are the values published by Cornell's Program of Computer Graphics. The coordinates
//! are converted to meters and rotated about the vertical axis, so that the camera looks along -z as in glTF. The red
//! wall is on the left, as in the published box.

use std::f32::consts::TAU;

use glam::{Quat, Vec3, vec3};

use crate::animation::{Path, look_at, rotation};
use crate::glb::{Material, MaterialId, Model, Scene};
use crate::mesh::{Mesh, Vertex};
use crate::patterns::{damask, linen, marble, plaster};
use crate::wood::herringbone;

/// Duration of the animation \[s\].
pub const DURATION: f32 = 4.0;

const WHITE: Vec3 = vec3(0.725, 0.71, 0.68);
const RED: Vec3 = vec3(0.63, 0.065, 0.05);
const GREEN: Vec3 = vec3(0.14, 0.45, 0.091);
/// The published emission, scaled so that white surfaces reflect a radiance of about 0.4 \[W·m⁻²·sr⁻¹\].
const EMISSION: Vec3 = vec3(17.0 * 3.0, 12.0 * 3.0, 4.0 * 3.0);

/// Corners of the floor \[mm\], as seen by the viewer: front left, front right, back right, back left.
const FLOOR: [[f32; 3]; 4] = [[552.8, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 559.2], [549.6, 0.0, 559.2]];
/// Corners of the ceiling \[mm\], in the order of `FLOOR`.
const CEILING: [[f32; 3]; 4] = [[556.0, 548.8, 0.0], [0.0, 548.8, 0.0], [0.0, 548.8, 559.2], [556.0, 548.8, 559.2]];
/// Corners of the top of the short block, x and z \[mm\].
const SHORT_BLOCK: [[f32; 2]; 4] = [[130.0, 65.0], [82.0, 225.0], [240.0, 272.0], [290.0, 114.0]];
/// Corners of the top of the tall block, x and z \[mm\].
const TALL_BLOCK: [[f32; 2]; 4] = [[423.0, 247.0], [265.0, 296.0], [314.0, 456.0], [472.0, 406.0]];

/// Converts a published point \[mm\] to the scene's coordinates \[m\].
fn point([x, y, z]: [f32; 3]) -> Vec3 {
    at(x, y, z)
}

/// Converts published coordinates \[mm\] to the scene's coordinates \[m\].
fn at(x: f32, y: f32, z: f32) -> Vec3 {
    vec3(278.0 - x, y, -z) / 1000.0
}

/// Returns a block without its bottom, relative to its vertical axis, and the position of the axis. `corners` are the
/// published corners of the top.
fn block(corners: [[f32; 2]; 4], height: f32) -> (Mesh, Vec3) {
    let mut top = corners.map(|[x, z]| at(x, height, z));
    let center = top.iter().sum::<Vec3>() / 4.0;
    let center = vec3(center.x, 0.0, center.z);
    top = top.map(|p| p - center);
    let mut mesh = Mesh::new();
    mesh.quad_facing(top, Vec3::Y);
    // Add the sides, each facing away from the axis.
    for i in 0..4 {
        let (a, b) = (top[i], top[(i + 1) % 4]);
        let floor = |p: Vec3| vec3(p.x, 0.0, p.z);
        mesh.quad_facing([floor(a), floor(b), b, a], a + b - 2.0 * Vec3::Y * a.y);
    }
    (mesh, center)
}

/// Adds a wall that faces `towards`. It is subdivided, so that it bends evenly if its four corners are not exactly in
/// one plane.
fn wall(mesh: &mut Mesh, [a, b, c, d]: [Vec3; 4], towards: Vec3) {
    let normal = (c - a).cross(d - b).normalize();
    let normal = normal * normal.dot(towards).signum();
    mesh.grid(4, 4, |i, j| {
        let (s, t) = (i as f32 / 4.0, j as f32 / 4.0);
        let position = a.lerp(b, s).lerp(d.lerp(c, s), t);
        Vertex { position, normal, uv: crate::mesh::planar_uv(position, normal) }
    });
}

/// Builds the box as published, with plain static surfaces, for comparison with other renderers.
///
/// The lamp is half a millimeter below the ceiling. In the published data, both are in the same plane.
pub fn published() -> Scene {
    let mut scene = Scene::new("cornell-box");
    let white = scene.plain("white", WHITE);
    let red = scene.plain("red", RED);
    let green = scene.plain("green", GREEN);
    let lamp = scene.material(Material::glowing("lamp", EMISSION / 3.0));
    // Corners are f (front) and b (back) on the floor, c (front) and ct (back) on the ceiling.
    let ([fl, fr, br, bl], [cl, cr, ctr, ctl]) = (FLOOR.map(point), CEILING.map(point));
    let mut room = Model::new();
    room.of(white).quad_facing([fl, fr, br, bl], Vec3::Y);
    room.of(white).quad_facing([cl, cr, ctr, ctl], Vec3::NEG_Y);
    room.of(white).quad_facing([bl, br, ctr, ctl], Vec3::Z);
    room.of(red).quad_facing([fl, bl, ctl, cl], Vec3::X);
    room.of(green).quad_facing([fr, br, ctr, cr], Vec3::NEG_X);
    scene.show("room", room);
    // Add the lamp.
    let mut panel = Model::new();
    let corners = [(343.0, 227.0), (343.0, 332.0), (213.0, 332.0), (213.0, 227.0)];
    panel.of(lamp).quad_facing(corners.map(|(x, z)| at(x, 548.3, z)), Vec3::NEG_Y);
    scene.show("lamp", panel);
    // Add both blocks as nodes at their published positions.
    for (name, corners, height) in [("short block", SHORT_BLOCK, 165.0), ("tall block", TALL_BLOCK, 330.0)] {
        let (mesh, home) = block(corners, height);
        let mut model = Model::new();
        *model.of(white) = mesh;
        let mesh = scene.mesh(name, model);
        scene.node(name, Some(mesh), home, Quat::IDENTITY);
    }
    // The published focal length is 0.035 and the film width is 0.025.
    let yfov = 2.0 * (0.0125f32 / 0.035).atan();
    let eye = at(278.0, 273.0, -800.0);
    scene.camera(yfov, eye, look_at(eye, at(278.0, 273.0, 0.0)));
    scene
}

/// Materials of the room.
struct Room {
    red: MaterialId,
    green: MaterialId,
    plaster: MaterialId,
    oak: MaterialId,
    frame: MaterialId,
    skirting: MaterialId,
    lamp: MaterialId,
}

/// Builds the scene `cornell`, with textures and moving blocks.
pub fn build() -> Scene {
    let mut scene = Scene::new("cornell");
    let red = scene.textured("red damask", 0.14, &damask(768, RED, 0.42));
    let green = scene.textured("green damask", 0.14, &damask(768, GREEN, 0.42));
    let plaster = scene.textured("plaster", 0.6, &plaster(512, WHITE, 0.16, 1));
    let oak = scene.textured("oak parquet", 0.32, &herringbone(1024, vec3(0.68, 0.57, 0.43), 16, 3));
    let linen = scene.textured("linen", 0.10, &linen(512, WHITE, 64, 21));
    // The marble has the published reflectance of the blocks on average.
    let stone = marble(768, vec3(0.78, 0.77, 0.75), vec3(0.20, 0.22, 0.25), 4).with_mean(WHITE);
    let stone = scene.textured("marble", 0.36, &stone);
    let frame = scene.plain("frame", vec3(0.45, 0.38, 0.26));
    let skirting = scene.plain("skirting", vec3(0.62, 0.60, 0.56));
    let lamp = scene.material(Material::glowing("lamp", EMISSION));
    add_room(&mut scene, &Room { red, green, plaster, oak, frame, skirting, lamp });
    add_blocks(&mut scene, linen, stone);

    // The camera starts near the published viewpoint, slightly closer so that the walls' edges stay outside the
    // picture. It moves slowly forward and to the side.
    let walk = Path::new(&[
        (0.0, at(278.0, 273.0, -755.0)),
        (DURATION / 3.0, at(290.0, 279.0, -735.0)),
        (DURATION / 1.5, at(304.0, 285.0, -705.0)),
        (DURATION, at(300.0, 283.0, -675.0)),
    ]);
    let view = |t: f32| look_at(walk.at(t), at(278.0, 268.0, 280.0));
    let camera = scene.camera(39.3f32.to_radians(), walk.at(0.0), view(0.0));
    scene.animate(camera, walk.translation());
    scene.animate(camera, rotation(DURATION, 25.0, view));
    scene
}

/// Adds walls, floor and ceiling, and the lamp in its frame.
fn add_room(scene: &mut Scene, materials: &Room) {
    let &Room { red, green, plaster, oak, frame, skirting, lamp } = materials;
    let mut room = Model::new();
    let (floor, ceiling) = (FLOOR.map(point), CEILING.map(point));
    // Corners are f (front) and b (back) on the floor, c (front) and ct (back) on the ceiling.
    let [fl, fr, br, bl] = floor;
    let [cl, cr, ctr, ctl] = ceiling;
    wall(room.of(oak), floor, Vec3::Y);
    wall(room.of(plaster), ceiling, Vec3::NEG_Y);
    wall(room.of(plaster), [bl, br, ctr, ctl], Vec3::Z);
    wall(room.of(red), [fl, bl, ctl, cl], Vec3::X);
    wall(room.of(green), [fr, br, ctr, cr], Vec3::NEG_X);
    // Add a skirting board along the three walls, 4 mm in front of them.
    let board = |model: &mut Model, a: Vec3, b: Vec3, inward: Vec3| {
        let (height, depth) = (Vec3::Y * 0.016, inward * 0.004);
        let (a, b) = (a + depth, b + depth);
        model.of(skirting).quad_facing([a, b, b + height, a + height], inward);
        let (a, b) = (a + height, b + height);
        model.of(skirting).quad_facing([a, b, b - 1.5 * depth, a - 1.5 * depth], Vec3::Y);
    };
    board(&mut room, fl, bl, Vec3::X);
    board(&mut room, fr, br, Vec3::NEG_X);
    board(&mut room, bl, br, Vec3::Z);
    // The lamp hangs 3 mm below the ceiling, in a frame that extends 3 mm lower.
    let (x0, x1) = (at(343.0, 0.0, 0.0).x, at(213.0, 0.0, 0.0).x);
    let (z0, z1) = (at(0.0, 0.0, 332.0).z, at(0.0, 0.0, 227.0).z);
    let (top, bottom, rim) = (0.5488, 0.5428, 0.006);
    let mut panel = Model::new();
    panel.of(lamp).quad_facing([(x0, z0), (x1, z0), (x1, z1), (x0, z1)].map(|(x, z)| vec3(x, 0.5458, z)), Vec3::NEG_Y);
    // Surround the panel with four bars.
    let bars = [
        (x0 - rim, x0, z0 - rim, z1 + rim),
        (x1, x1 + rim, z0 - rim, z1 + rim),
        (x0, x1, z0 - rim, z0),
        (x0, x1, z1, z1 + rim),
    ];
    for (a, b, c, d) in bars {
        room.of(frame).cuboid_without(vec3(a, bottom, c), vec3(b, top, d), &[crate::mesh::Side::Top]);
    }
    scene.show("room", room);
    scene.show("lamp", panel);
}

/// Adds both blocks with their animations.
fn add_blocks(scene: &mut Scene, linen: MaterialId, stone: MaterialId) {
    let (mesh, home) = block(SHORT_BLOCK, 165.0);
    let mut model = Model::new();
    *model.of(linen) = mesh;
    let short = scene.mesh("short block", model);
    let short = scene.node("short block", Some(short), home, Quat::IDENTITY);
    // The short block follows a loop in the free corner of the floor. The blocks never touch.
    let step = |x: f32, z: f32| home + vec3(-x, 0.0, -z) / 1000.0;
    let slide = Path::closed(&[
        (0.0, step(0.0, 0.0)),
        (0.25 * DURATION, step(-35.0, 12.0)),
        (0.5 * DURATION, step(-5.0, -18.0)),
        (0.75 * DURATION, step(32.0, -26.0)),
        (DURATION, step(0.0, 0.0)),
    ]);
    scene.animate(short, slide.translation());

    let (mesh, home) = block(TALL_BLOCK, 330.0);
    let mut model = Model::new();
    *model.of(stone) = mesh;
    let tall = scene.mesh("tall block", model);
    let tall = scene.node("tall block", Some(tall), home, Quat::IDENTITY);
    // The tall block rotates by a quarter turn per second, like a display stand.
    scene.animate(tall, rotation(DURATION, 8.0, |t| Quat::from_rotation_y(TAU * t / DURATION)));
}
