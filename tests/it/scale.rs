//! Light is independent of the unit of length. With all lengths halved, lamps of equal radiance give the same picture, and so
//! do point lights with a quarter of the intensity.

use glam::Vec3;
use plane::Plane;
use render_core::image_file::read_exr;
use serde_json::{Value, json};
use std::path::Path;
use tests::{Moving, checkered_room, render};

/// Returns the radiances of the second of two frames.
fn frame(folder: &Path, name: &str, scene: &Path, lighting: &str) -> Plane<Vec3> {
    let arguments = format!("--size 48x48 --frames 2 --vpls 500 --photons 50000 --lighting {lighting} --exr {name}");
    render(folder, name, scene, &arguments);
    read_exr(&folder.join(name).join("frame_00001.exr")).expect("a linear frame")
}

/// Moves all root nodes below a node that halves them, and quarters the intensity of lights.
fn halve(json: &mut Value) {
    let top = json["scenes"][0]["nodes"].take();
    let nodes = json["nodes"].as_array_mut().expect("nodes");
    nodes.push(json!({ "scale": [0.5, 0.5, 0.5], "children": top }));
    json["scenes"][0]["nodes"] = json!([nodes.len() - 1]);
    for light in json["extensions"]["KHR_lights_punctual"]["lights"].as_array_mut().into_iter().flatten() {
        light["intensity"] = json!(light["intensity"].as_f64().unwrap_or(1.0) / 4.0);
    }
}

/// Moves all root nodes below a node 1000 km away.
fn move_away(json: &mut Value) {
    let top = json["scenes"][0]["nodes"].take();
    let nodes = json["nodes"].as_array_mut().expect("nodes");
    nodes.push(json!({ "translation": [1e6, -3e5, 2e5], "children": top }));
    json["scenes"][0]["nodes"] = json!([nodes.len() - 1]);
}

/// A room 1000 km from the origin, with a moving box, gives the same picture.
#[test]
fn a_room_far_away_is_the_same_room() {
    let folder = tempfile::tempdir().unwrap();
    let (near, far) = (folder.path().join("near.glb"), folder.path().join("far.glb"));
    let mut room = checkered_room(Moving::Box);
    room.write(&near);
    move_away(&mut room.json);
    room.write(&far);
    for lighting in ["all-lights", "lightcuts"] {
        let picture =
            |name: &str, scene| frame(folder.path(), name, scene, lighting).map(|radiance| radiance.to_array());
        let error = perceptual::relative_mse(&picture("far", &far), &picture("near", &near));
        println!("{lighting}: relative MSE {error:.1e} from 1000 km away");
        assert!(error < 1e-3, "{lighting}: {error}");
    }
}

#[test]
fn half_the_lengths_make_the_same_picture() {
    let folder = tempfile::tempdir().unwrap();
    let (whole, half) = (folder.path().join("whole.glb"), folder.path().join("half.glb"));
    let mut room = checkered_room(Moving::Box);
    let light = json!({ "type": "point", "color": [1.0, 0.8, 0.6], "intensity": 40.0 });
    room.json["extensions"] = json!({ "KHR_lights_punctual": { "lights": [light] } });
    room.json["extensionsUsed"] = json!(["KHR_materials_emissive_strength", "KHR_lights_punctual"]);
    let lamp = json!({ "translation": [-1.2, 1.5, 0.5], "extensions": { "KHR_lights_punctual": { "light": 0 } } });
    let nodes = room.json["nodes"].as_array_mut().expect("nodes");
    nodes.push(lamp);
    let lamp = nodes.len() - 1;
    room.json["scenes"][0]["nodes"].as_array_mut().expect("a scene").push(json!(lamp));
    room.write(&whole);
    halve(&mut room.json);
    room.write(&half);
    for lighting in ["all-lights", "lightcuts --cache off", "lightcuts"] {
        let picture = |name: &str, scene| frame(folder.path(), name, scene, lighting);
        let (a, b) = (picture("a", &whole), picture("b", &half));
        let mean = a.samples().iter().map(|a| a.max_element()).sum::<f32>() / a.samples().len() as f32;
        assert!(mean > 0.05, "{lighting}: the room is lit");
        // A factor of one half is exact in f32, and so are all derived numbers.
        assert!(a.samples() == b.samples(), "{lighting}: a pixel is off");
    }
}
