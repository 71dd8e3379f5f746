//! Tests of `KHR_animation_pointer`: animated properties other than transforms of nodes.

use super::file::{File, notes};
use glam::{Vec3, Vec3A, vec3};
use render_core::scene::{DepthRange, Projection, PunctualKind, Scene};
use render_core::{PathOptions, Still, path_traced};
use serde_json::{Value, json};

/// Returns the target of a channel that animates the property at `pointer`.
fn target(pointer: &str) -> Value {
    json!({ "path": "pointer", "extensions": { "KHR_animation_pointer": { "pointer": pointer } } })
}

/// Builds a square and two cameras.
fn filmed() -> File {
    let mut file = File::square();
    file.json["cameras"] = json!([
        { "type": "perspective", "perspective": { "yfov": 0.5, "aspectRatio": 1.0, "znear": 0.1, "zfar": 10.0 } },
        { "type": "orthographic", "orthographic": { "xmag": 2.0, "ymag": 1.0, "znear": 0.1, "zfar": 10.0 } },
    ]);
    file.node(json!({ "camera": 0, "name": "perspective" }));
    file.node(json!({ "camera": 1, "name": "orthographic" }));
    file
}

/// Returns the distance from the axis to the upper border, at a depth of 1 m \[m\].
fn half_height(scene: &Scene, time: f32, size: (usize, usize)) -> f32 {
    let pose = scene.pose(time);
    let view = scene.view(&pose, size.0, size.1);
    view.pixel_width(1.0) * size.1 as f32 / 2.0
}

#[test]
fn pointers_animate_nodes_and_lenses() {
    let mut file = filmed();
    let (moved, angles) = (file.vectors(&[Vec3::ZERO, Vec3::Y]), file.scalars(&[0.5, 1.0]));
    file.clip(
        "a",
        &[
            (target("/nodes/0/translation"), moved),
            (target("/cameras/0/perspective/yfov"), angles),
            (target("/cameras/0/perspective/znear"), angles),
        ],
    );
    let scene = file.load();
    assert_eq!(scene.pose(0.5).world[0].translation, Vec3A::Y * 0.5);
    assert_eq!((scene.duration(), scene.warnings.iter().filter(|note| note.contains("left out")).count()), (1.0, 0));
    for (time, angle) in [(0.0, 0.5f32), (0.5, 0.75), (1.0, 1.0)] {
        let found = half_height(&scene, time, (64, 64));
        assert!((found - (angle / 2.0).tan()).abs() < 1e-6, "{found} at {time} s");
        let view = scene.view(&scene.pose(time), 64, 64);
        assert!((view.distances(-Vec3A::Z).0 - angle).abs() < 1e-6);
    }
    // The scene's cameras have the values of the file.
    assert_eq!(scene.cameras[0].projection, Projection::Perspective { yfov: 0.5 });
    assert_eq!(scene.cameras[0].depths, DepthRange { near: 0.1, far: 10.0 });
}

#[test]
fn magnifications_are_animated() {
    let mut file = filmed();
    let (half, wide) = (file.scalars(&[1.0, 3.0]), file.scalars(&[2.0, 4.0]));
    file.clip("a", &[(target("/cameras/1/orthographic/ymag"), half), (target("/cameras/1/orthographic/xmag"), wide)]);
    let scene = file.load_with(&["camera.name=orthographic"]).unwrap();
    // At 0.5 s the camera shows 6 m by 4 m. A square picture and a 3:2 picture contain the complete view.
    assert!((half_height(&scene, 0.5, (60, 40)) - 2.0).abs() < 1e-5);
    assert!((half_height(&scene, 0.5, (60, 60)) - 3.0).abs() < 1e-5);
}

/// The value false of "KHR_node_visibility/visible" hides the meshes of the node and its descendants, from one key to
/// the next.
#[test]
fn visibility_is_animated() {
    let mut file = File::square();
    let below = file.push("nodes", json!({ "mesh": 0, "translation": [2.0, 0.0, 0.0] }));
    file.json["nodes"][0]["children"] = json!([below]);
    file.json["nodes"][0]["extensions"] = json!({ "KHR_node_visibility": { "visible": false } });
    let visible = file.scalars(&[0.0, 1.0]);
    file.clip("a", &[(target("/nodes/0/extensions/KHR_node_visibility/visible"), visible)]);
    let scene = file.load();
    assert_eq!(scene.instances.len(), 2);
    for (time, size) in [(0.0, 0.0), (0.9, 0.0), (1.0, 1.0)] {
        let pose = scene.pose(time);
        for instance in 0..2 {
            let world = scene.instance_world(&pose, instance);
            assert_eq!(world.transform_vector3(Vec3::X).length(), size, "instance {instance} at {time} s");
        }
    }
    assert!(scene.moving_instances().iter().all(|&moves| moves));
}

/// Color, intensity and cone of lights are animated. The light's strength is the product of color and intensity, in the
/// file's units or Blender's.
#[test]
fn lights_are_animated() {
    let mut file = File::square();
    let lights = json!([
        { "type": "point", "intensity": 100.0 },
        { "type": "spot", "color": [1.0, 0.5, 0.0], "intensity": 4.0, "spot": { "outerConeAngle": 0.5 } },
    ]);
    file.json["extensions"] = json!({ "KHR_lights_punctual": { "lights": lights } });
    for light in 0..2 {
        file.node(json!({ "extensions": { "KHR_lights_punctual": { "light": light } } }));
    }
    let light = |path: &str| target(&format!("/extensions/KHR_lights_punctual/lights/1/{path}"));
    let (colors, intensities) = (file.vectors(&[Vec3::X, Vec3::Y]), file.scalars(&[10.0, -30.0]));
    let angles = file.scalars(&[0.2, 0.4]);
    file.clip(
        "a",
        &[(light("color"), colors), (light("intensity"), intensities), (light("spot/outerConeAngle"), angles)],
    );
    for (settings, factor) in [(&[][..], 1.0), (&["lamps=0.5"], 0.5)] {
        let scene = file.load_with(settings).unwrap();
        assert_eq!(notes(&scene, "animated property"), 0, "{:?}", scene.warnings);
        let at = |time: f32| scene.pose(time).punctual_lights(&scene).to_vec();
        assert_eq!(at(0.0)[0].color, Vec3::splat(100.0 * factor));
        assert_eq!(at(0.0)[1].color, Vec3::X * 10.0 * factor);
        // At a quarter of the duration the intensity is zero.
        assert_eq!(at(0.25)[1].color, Vec3::ZERO);
        assert_eq!(at(0.125)[1].color, vec3(0.875, 0.125, 0.0) * 5.0 * factor);
        // Light is never negative.
        assert_eq!(at(1.0)[1].color, Vec3::ZERO);
        assert!(matches!(at(0.5)[1].kind, PunctualKind::Spot { outer, .. } if (outer - 0.3).abs() < 1e-6));
        assert_eq!(scene.moving_nodes(), [false, false, true]);
    }
    // With a radius, points become spheres; animated lights stay in the list.
    let scene = file.load_with(&["lamp_radius=0.1"]).unwrap();
    assert_eq!((scene.punctual_lights.len(), scene.light_channels[0].light), (1, 0));
}

/// The brightness of a wall in a picture matches the wall's lamp at the time of the picture.
#[test]
fn pictures_show_the_light_of_their_time() {
    let mut file = File::square();
    file.json["extensions"] = json!({ "KHR_lights_punctual": { "lights": [{ "type": "point" }] } });
    file.node(json!({ "translation": [0.5, 0.5, 2.0], "extensions": { "KHR_lights_punctual": { "light": 0 } } }));
    file.json["cameras"] = json!([{ "type": "orthographic",
        "orthographic": { "xmag": 0.1, "ymag": 0.1, "znear": 0.1, "zfar": 9.0 } }]);
    file.node(json!({ "camera": 0, "translation": [0.5, 0.5, 1.0] }));
    file.json["materials"] = json!([{ "pbrMetallicRoughness": { "metallicFactor": 0.0 } }]);
    file.json["meshes"][0]["primitives"][0]["material"] = json!(0);
    let intensities = file.scalars(&[8.0, 0.0]);
    file.clip("a", &[(target("/extensions/KHR_lights_punctual/lights/0/intensity"), intensities)]);
    let scene = file.load();
    for (time, intensity) in [(0.0, 8.0f32), (0.5, 4.0), (1.0, 0.0)] {
        let options = PathOptions { samples: 16, max_bounces: Some(1), ..PathOptions::default() };
        let found = path_traced(&scene, Still { time, width: 8, height: 8 }, &options, |_, _| ()).mean.get(4, 4)[0];
        // Expect I / (4 π) from a white Lambert surface 2 m below a point light of I cd.
        let expected = intensity / (4.0 * std::f32::consts::PI);
        assert!((found - expected).abs() < 0.01 * expected.max(0.01), "{found} at {time} s, not {expected}");
    }
}

/// Unsupported properties keep the file's value, and one note names them.
#[test]
fn other_pointers_are_named() {
    let mut file = filmed();
    let keys = file.scalars(&[0.5, 1.0]);
    file.clip(
        "a",
        &[
            (target("/materials/0/occlusionTexture/strength"), keys),
            (target("/materials/0/extensions/KHR_materials_clearcoat/clearcoatFactor"), keys),
            // Animate a hint without effect on pictures.
            (target("/extensions/KHR_lights_punctual/lights/0/range"), keys),
            (target("/cameras/0/perspective/yfov"), keys),
            (target("nonsense"), keys),
        ],
    );
    let scene = file.load();
    assert_eq!(notes(&scene, "and 2 more is left out"), 1, "{:?}", scene.warnings);
    assert_eq!(scene.camera_channels.len(), 1);
}
