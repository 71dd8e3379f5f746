//! Rooms with animated materials: a lamp that fades and turns red.

use super::{Room, inside, lamp, look, outside};
use glam::{Vec3, vec3};
use serde_json::json;
use tests::{Comparison, Glb};

/// Direct and reflected light of each frame follow the lamp's current radiance; the path tracer has no state between frames.
#[test]
fn light_follows_a_lamp_whose_material_changes() {
    let mut glb = Glb::default();
    glb.add(&inside(vec3(-2.0, 0.0, -1.5), vec3(2.0, 2.5, 1.5)), Vec3::splat(0.7), Vec3::ZERO);
    glb.add(&outside(vec3(-1.0, 0.001, -0.8), vec3(-0.4, 1.2, -0.2)), Vec3::splat(0.4), Vec3::ZERO);
    lamp(vec3(0.0, 2.4, 0.0), 0.6, 1.0, &mut glb);
    let material = glb.json["materials"].as_array().expect("materials").len() - 1;
    look(&mut glb, vec3(1.8, 1.6, -1.3), vec3(-1.0, 0.8, 0.4));

    // The keys of the translation serve as keys of the radiance.
    glb.animate_in_steps(0, &[(0.0, Vec3::ONE), (0.1, Vec3::splat(0.5)), (0.2, vec3(0.6, 0.1, 0.0))]);
    let pointer = format!("/materials/{material}/emissiveFactor");
    glb.json["animations"][0]["channels"][0]["target"] =
        json!({ "path": "pointer", "extensions": { "KHR_animation_pointer": { "pointer": pointer } } });
    let mut used = glb.json["extensionsUsed"].as_array().cloned().unwrap_or_default();
    used.push(json!("KHR_animation_pointer"));
    glb.json["extensionsUsed"] = json!(used);

    let room = Room::new(&glb, "");
    let mut brightness = Vec::new();
    for frame in [0, 4, 7] {
        let comparison = Comparison { frame, film: "--frames 8", ..Comparison::default() };
        let blocks = room.blocks(&format!("fading lamp, frame {frame}"), comparison);
        assert!((blocks.mean_ratio() - 1.0).abs() < 0.015, "frame {frame}: {}", blocks.mean_ratio());
        brightness.push(blocks.mean());
    }
    assert!(brightness[1] < 0.6 * brightness[0] && brightness[2] < 0.6 * brightness[1], "{brightness:?}");
}
