//! Light does not leak through walls: without a path from a lamp, every layer of the film is dark.

use super::{Room, WHITE_SKY, inside, lamp, look, outside};
use glam::{Quat, Vec3, vec3};
use render_core::sampling::hash_unit;
use serde_json::json;
use tests::{Comparison, Glb, Quad, render2mpeg};

/// Maximum mean radiance of a closed dark room under a sky of radiance 1.
const LEAK: f32 = 2e-4;

/// Builds ground of 20 m and a house with walls of 20 cm that reach `depth` meters into the ground.
fn house(depth: f32) -> Glb {
    let mut glb = Glb::default();
    glb.add(&[[vec3(-10.0, 0.0, -10.0), Vec3::Z * 20.0, Vec3::X * 20.0]], Vec3::splat(0.5), Vec3::ZERO);
    let mut walls = inside(vec3(-2.0, -depth, -2.0), vec3(2.0, 2.5, 2.0));
    walls.extend(outside(vec3(-2.2, -depth, -2.2), vec3(2.2, 2.7, 2.2)));
    // Both boxes are open below.
    walls.retain(|&[corner, a, b]| a.y != 0.0 || b.y != 0.0 || corner.y > 0.0);
    glb.add(&walls, Vec3::splat(0.7), Vec3::ZERO);
    look(&mut glb, vec3(1.5, 1.6, 1.8), vec3(-0.5, 0.6, -1.0));
    glb
}

/// Builds two adjacent rooms of 2×2×2 m on one floor and below one ceiling, with a wall of `thickness` meters between them.
/// The camera is in the right room.
fn pair_of_rooms(thickness: f32) -> Glb {
    let mut glb = Glb::default();
    let (low, high) = (vec3(-2.0, 0.0, -1.0), vec3(2.0, 2.0, 1.0));
    glb.add(&inside(low, high), Vec3::splat(0.7), Vec3::ZERO);
    let half = thickness / 2.0;
    glb.add(&outside(vec3(-half, 0.0, -1.0), vec3(half, 2.0, 1.0)), Vec3::splat(0.7), Vec3::ZERO);
    look(&mut glb, vec3(1.9, 1.3, 0.9), vec3(0.4, 0.5, -0.4));
    glb
}

fn assert_dark(room: &Room, name: &str) {
    for film in ["", "--cache off"] {
        let (mean, most) = room.leak(&format!("{name} {film}"), film);
        assert!(mean < LEAK && most < 10.0 * LEAK, "{name} {film}: {mean} of a sky of 1, up to {most}");
    }
}

/// The true radiance is 0, although ground and walls continue behind each other.
#[test]
fn a_house_on_the_ground_is_dark_inside() {
    assert_dark(&Room::new(&house(0.1), WHITE_SKY), "house");
    assert_dark(&Room::new(&house(0.5), WHITE_SKY), "house, deep walls");
}

/// The house has no other light than its own lamp.
#[test]
fn a_lamp_in_a_house_is_not_outshone_by_the_sky() {
    let mut glb = house(0.1);
    lamp(vec3(0.0, 2.4, 0.0), 0.1, 1.0, &mut glb);
    let blocks = Room::new(&glb, WHITE_SKY).blocks("house with a lamp", Comparison::default());
    assert!((blocks.mean_ratio() - 1.0).abs() < 0.03, "{}", blocks.mean_ratio());
}

/// A dark room behind a double-sided wall without thickness.
#[test]
fn the_other_side_of_a_sheet_is_dark() {
    let mut glb = pair_of_rooms(0.1);
    // Replace the wall of the pair of rooms by a sheet.
    glb.json["scenes"][0]["nodes"].as_array_mut().unwrap().retain(|node| node != 1);
    let sheet: Quad = [vec3(0.0, 0.0, -1.0), Vec3::Y * 2.0, Vec3::Z * 2.0];
    let node = glb.add(&[sheet], Vec3::splat(0.7), Vec3::ZERO);
    let material = glb.json["meshes"][node - 1]["primitives"][0]["material"].as_u64().unwrap() as usize;
    glb.json["materials"][material]["doubleSided"] = true.into();
    lamp(vec3(-1.0, 1.99, 0.0), 0.6, 8.0, &mut glb);
    assert_dark(&Room::new(&glb, ""), "sheet");
}

/// The bright room has 1440 times the light of the dark one, and keeps it.
#[test]
fn thin_walls_keep_light_out_of_a_dim_room() {
    for thickness in [0.001, 0.01, 0.05, 0.2] {
        let mut glb = pair_of_rooms(thickness);
        lamp(vec3(-1.0, 1.99, 0.0), 0.6, 8.0, &mut glb);
        lamp(vec3(1.0, 1.99, 0.0), 0.2, 0.05, &mut glb);
        let blocks = Room::new(&glb, "").blocks(&format!("wall of {thickness} m"), Comparison::default());
        assert!((blocks.mean_ratio() - 1.0).abs() < 0.05, "{thickness}: {}", blocks.mean_ratio());
    }
}

/// A box of 40 cm on the floor contains a lamp; the room around it is dark.
#[test]
fn a_closed_box_keeps_its_lamp() {
    let mut glb = Glb::default();
    glb.add(&inside(vec3(-1.0, 0.0, -1.0), vec3(1.0, 2.0, 1.0)), Vec3::splat(0.7), Vec3::ZERO);
    // Both shells reach into the floor and are open below.
    let (low, high) = (vec3(-0.2, -0.05, -0.2), vec3(0.2, 0.4, 0.2));
    let rim = vec3(0.01, 0.0, 0.01);
    let mut walls = outside(low, high);
    walls.extend(inside(low + rim, high - rim - Vec3::Y * 0.01));
    walls.retain(|&[corner, a, b]| a.y != 0.0 || b.y != 0.0 || corner.y > 0.0);
    glb.add(&walls, Vec3::splat(0.7), Vec3::ZERO);
    lamp(vec3(0.0, 0.35, 0.0), 0.1, 100.0, &mut glb);
    look(&mut glb, vec3(0.9, 1.3, 0.9), vec3(0.0, 0.1, 0.0));
    assert_dark(&Room::new(&glb, ""), "lamp in a box");
}

/// Two rooms seen from above, one with a lamp: pixels on opposite sides of the wall share no light.
#[test]
fn neighbors_in_the_picture_share_no_light_over_a_wall() {
    // Without the ceiling, no surface sends light over the wall.
    let mut glb = Glb::default();
    let mut walls = inside(vec3(-2.0, 0.0, -1.0), vec3(2.0, 2.0, 1.0));
    walls.retain(|&[corner, a, b]| a.y != 0.0 || b.y != 0.0 || corner.y == 0.0);
    glb.add(&walls, Vec3::splat(0.7), Vec3::ZERO);
    glb.add(&outside(vec3(-0.005, 0.0, -1.0), vec3(0.005, 2.0, 1.0)), Vec3::splat(0.7), Vec3::ZERO);
    lamp(vec3(-1.0, 1.5, 0.0), 0.6, 8.0, &mut glb);
    look(&mut glb, vec3(1.0, 5.0, 0.01), vec3(1.0, 0.0, 0.0));
    glb.json["cameras"][0]["perspective"]["yfov"] = 0.3.into();
    assert_dark(&Room::new(&glb, ""), "room seen from above");
}

/// Closed boxes of any size and rotation, in a lit room and partly inside each other: areas without a path to light are dark
/// in every layer.
#[test]
fn where_no_ray_leads_no_layer_has_light() {
    for key in 0..8u64 {
        let u = |k| hash_unit(7, key, k);
        let mut glb = Glb::default();
        glb.add(&inside(vec3(-3.0, 0.0, -3.0), vec3(3.0, 3.0, 3.0)), Vec3::splat(0.7), Vec3::ZERO);
        lamp(vec3(2.0 * u(0) - 1.0, 2.9, 2.0 * u(1) - 1.0), 0.6, 10.0, &mut glb);

        // Walls of 2 to 50 mm, which end in the floor or continue below it. Some boxes are rotated, some have one sheet for
        // both sides.
        let half = vec3(0.4 + u(2), 0.5 + u(3), 0.4 + u(4));
        let (thickness, depth) = (0.002 + 0.048 * u(5), 0.3 * u(6));
        let (low, high) = (vec3(-half.x, -depth, -half.z), vec3(half.x, 2.0 * half.y, half.z));
        let is_sheet = u(7) < 0.3;
        let mut walls = inside(low, high);
        if !is_sheet {
            walls.extend(outside(low - thickness, high + thickness));
        }
        walls.retain(|&[corner, a, b]| a.y != 0.0 || b.y != 0.0 || corner.y > 0.0);
        let turn = Quat::from_rotation_y(if u(8) < 0.3 { 0.0 } else { 3.0 * u(9) });
        let node = glb.add(&walls, Vec3::splat(0.7), Vec3::ZERO);
        glb.json["nodes"][node]["rotation"] = json!(turn.to_array());
        let material = glb.json["materials"].as_array_mut().unwrap().last_mut().unwrap();
        material["doubleSided"] = is_sheet.into();

        let from = turn * vec3(0.8 * half.x, 1.2 * half.y, 0.8 * half.z);
        look(&mut glb, from, turn * vec3(-0.5 * half.x, 0.3 * half.y, -0.3 * half.z));
        let film = if key % 2 == 0 { "" } else { "--cache off" };
        let (mean, _) = Room::new(&glb, "").leak(&format!("box {key}, {} mm {film}", 1000.0 * thickness), film);
        assert!(mean < LEAK, "box {key}: {mean}");
    }
}

/// Baked light does not leak either.
#[test]
fn baked_rooms_are_dark() {
    let room = Room::new(&house(0.1), WHITE_SKY);
    let baked = render2mpeg(room.folder.path(), &["bake", "room.glb", "-q"]);
    assert_eq!(baked.code, Some(0), "{}", baked.stderr);
    let (mean, _) = room.leak("house, baked", "--lighting baked");
    assert!(mean < LEAK, "{mean}");
}

/// A crate in a doorway leaves gaps of 2 cm, which transmit little light.
#[test]
fn a_thing_that_closes_a_doorway_keeps_light_out() {
    let mut glb = Glb::default();
    glb.add(&inside(vec3(-2.025, 0.0, -1.0), vec3(2.025, 2.0, 1.0)), Vec3::splat(0.7), Vec3::ZERO);
    for (low, high) in [
        (vec3(-0.025, 0.0, -1.0), vec3(0.025, 2.0, -0.3)),
        (vec3(-0.025, 0.0, 0.3), vec3(0.025, 2.0, 1.0)),
        (vec3(-0.025, 1.5, -0.3), vec3(0.025, 2.0, 0.3)),
    ] {
        glb.add(&outside(low, high), Vec3::splat(0.7), Vec3::ZERO);
    }
    lamp(vec3(-1.0, 1.99, 0.0), 0.6, 16.0, &mut glb);
    let thing = glb.add(&outside(vec3(-0.28, 0.001, -0.28), vec3(0.28, 1.401, 0.28)), Vec3::splat(0.7), Vec3::ZERO);
    // At frame 6 of 25 per second, the crate is in the doorway.
    glb.animate(thing, vec3(-1.2, 0.0, 0.0), vec3(3.8, 0.0, 0.0));
    look(&mut glb, vec3(1.95, 1.4, 0.9), vec3(0.3, 0.5, -0.3));
    let room = Room::new(&glb, "");
    for (frame, most) in [(4, 0.05), (6, 0.15), (8, 0.05)] {
        let film = Comparison { frame, film: "--frames 9", ..Comparison::default() };
        let ratio = room.blocks(&format!("doorway, frame {frame}"), film).mean_ratio();
        assert!((ratio - 1.0).abs() < most, "frame {frame}: {ratio}");
    }
}

/// Sky light through a window, and the next room's light through a slit of 1 cm.
#[test]
fn light_through_small_openings_is_that_of_paths() {
    // Ten times the default number of photons, as its noise is 4 % of the mean.
    let film = Comparison { film: "--photons 720000", ..Comparison::default() };
    let blocks = Room::new(&room_with_a_window(), WHITE_SKY).blocks("window", film);
    assert!((blocks.mean_ratio() - 1.0).abs() < 0.02, "window: {}", blocks.mean_ratio());

    let mut glb = Glb::default();
    glb.add(&inside(vec3(-2.0, 0.0, -1.0), vec3(2.0, 2.0, 1.0)), Vec3::splat(0.7), Vec3::ZERO);
    glb.add(&outside(vec3(-0.025, 0.0, -1.0), vec3(0.025, 2.0, 0.0)), Vec3::splat(0.7), Vec3::ZERO);
    glb.add(&outside(vec3(-0.025, 0.0, 0.01), vec3(0.025, 2.0, 1.0)), Vec3::splat(0.7), Vec3::ZERO);
    lamp(vec3(-1.0, 1.99, 0.0), 0.6, 16.0, &mut glb);
    look(&mut glb, vec3(1.95, 1.4, 0.9), vec3(0.3, 0.5, -0.3));
    let blocks = Room::new(&glb, "").blocks("slit", Comparison::default());
    assert!((blocks.mean_ratio() - 1.0).abs() < 0.1, "slit: {}", blocks.mean_ratio());
}

/// Builds a room of 2 m, 30 cm above the ground, with a window of 80 cm in a wall of 10 cm.
fn room_with_a_window() -> Glb {
    let mut glb = Glb::default();
    glb.add(&[[vec3(-10.0, -0.3, -10.0), Vec3::Z * 20.0, Vec3::X * 20.0]], Vec3::splat(0.5), Vec3::ZERO);
    let mut walls: Vec<Quad> = inside(vec3(-1.0, 0.0, -1.0), vec3(1.0, 2.0, 1.0));
    walls.extend(outside(vec3(-1.1, -0.1, -1.1), vec3(1.1, 2.1, 1.1)));
    walls.retain(|&[corner, a, b]| a.x != 0.0 || b.x != 0.0 || corner.x < 0.0);
    // Both sides of the wall around the window: below, above, left and right of it.
    for ([bottom, top], [left, right]) in
        [([0.0, 0.8], [-1.0, 1.0]), ([1.6, 2.0], [-1.0, 1.0]), ([0.8, 1.6], [-1.0, -0.4]), ([0.8, 1.6], [0.4, 1.0])]
    {
        let (up, along) = (Vec3::Y * (top - bottom), Vec3::Z * (right - left));
        walls.push([vec3(1.0, bottom, left), along, up]);
    }
    for ([bottom, top], [left, right]) in
        [([-0.1, 0.8], [-1.1, 1.1]), ([1.6, 2.1], [-1.1, 1.1]), ([0.8, 1.6], [-1.1, -0.4]), ([0.8, 1.6], [0.4, 1.1])]
    {
        let (up, along) = (Vec3::Y * (top - bottom), Vec3::Z * (right - left));
        walls.push([vec3(1.1, bottom, left), up, along]);
    }
    // The reveal of the window.
    let (deep, up, along) = (Vec3::X * 0.1, Vec3::Y * 0.8, Vec3::Z * 0.8);
    walls.push([vec3(1.0, 0.8, -0.4), along, deep]);
    walls.push([vec3(1.0, 1.6, -0.4), deep, along]);
    walls.push([vec3(1.0, 0.8, -0.4), deep, up]);
    walls.push([vec3(1.0, 0.8, 0.4), up, deep]);
    glb.add(&walls, Vec3::splat(0.7), Vec3::ZERO);
    look(&mut glb, vec3(-0.9, 1.6, 0.9), vec3(0.3, 0.7, -0.3));
    glb
}
