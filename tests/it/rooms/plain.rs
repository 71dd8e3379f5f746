//! Rooms in the middle of a wide plain, which must not attract anchors from the camera's room.

use super::{Room, WHITE_SKY, inside, lamp, look, outside};
use glam::{Vec3, vec3};
use tests::{Comparison, Glb};

/// Builds a closed room of 4×3×2.5 m with a table, a shelf and a ceiling lamp of 0.4 m, on ground of `reach` meters.
fn room_on_a_plain(reach: f32) -> Glb {
    let mut glb = Glb::default();
    let ground = [vec3(-reach, -0.01, -reach), Vec3::Z * 2.0 * reach, Vec3::X * 2.0 * reach];
    glb.add(&[ground], Vec3::splat(0.5), Vec3::ZERO);
    glb.add(&inside(vec3(-2.0, 0.0, -1.5), vec3(2.0, 2.5, 1.5)), Vec3::splat(0.7), Vec3::ZERO);
    glb.add(&outside(vec3(-2.1, -0.1, -1.6), vec3(2.1, 2.6, 1.6)), Vec3::splat(0.5), Vec3::ZERO);

    let mut table = outside(vec3(-1.0, 0.7, -0.5), vec3(0.2, 0.74, 0.3));
    for (x, z) in [(-0.95, -0.45), (-0.95, 0.2), (0.1, -0.45), (0.1, 0.2)] {
        table.extend(outside(vec3(x, 0.001, z), vec3(x + 0.05, 0.699, z + 0.05)));
    }
    glb.add(&table, Vec3::splat(0.6), Vec3::ZERO);
    glb.add(&outside(vec3(-1.9, 0.001, 0.9), vec3(-1.5, 1.8, 1.4)), Vec3::splat(0.3), Vec3::ZERO);
    lamp(vec3(0.0, 2.4, 0.0), 0.4, 10.0, &mut glb);
    look(&mut glb, vec3(1.8, 1.6, -1.3), vec3(-1.0, 0.8, 0.4));
    glb
}

/// A plain of up to 2 km, like the terrain below a scene, does not darken the room.
#[test]
fn a_plain_takes_no_light_from_a_room() {
    for reach in [5.0, 20.0, 200.0, 1000.0] {
        let room = Room::new(&room_on_a_plain(reach), WHITE_SKY);
        let blocks = room.blocks(&format!("room on a plain of {reach} m"), Comparison::default());
        assert!((blocks.mean_ratio() - 1.0).abs() < 0.015, "{reach} m: {}", blocks.mean_ratio());
        let far_off = blocks.ratios().into_iter().filter(|ratio| (ratio - 1.0).abs() > 0.05).count();
        assert!(far_off * 20 <= blocks.ratios().len(), "{reach} m: {far_off} blocks are off by more than 5 %");
    }
}

/// Zones surround all positions of the camera.
#[test]
fn a_plain_takes_no_light_from_rooms_on_the_way_of_a_camera() {
    let mut glb = room_on_a_plain(200.0);
    let node = glb.json["nodes"].as_array().unwrap().len() - 1;
    glb.animate_in_steps(node, &[(0.0, vec3(60.0, 1.6, -1.3)), (0.2, vec3(1.8, 1.6, -1.3))]);
    let room = Room::new(&glb, WHITE_SKY);
    let frame = Comparison { frame: 7, film: "--frames 8", ..Comparison::default() };
    let blocks = room.blocks("room at the end of a way", frame);
    assert!((blocks.mean_ratio() - 1.0).abs() < 0.03, "{}", blocks.mean_ratio());
}
