//! Tests of the depth ranges and aspect ratios of cameras.

use super::file::{File, notes};
use glam::{Vec3, Vec3A, vec3};
use render_core::scene::{DepthRange, Scene};
use render_core::{GBuffer, Geometry, PosedScene, Surfaces};
use serde_json::{Value, json};

/// Builds three squares at depths of 1, 2 and 3 m in front of a camera at the origin.
fn three_squares(camera: Value) -> Scene {
    let mut file = File::square();
    file.json["nodes"][0]["translation"] = json!([-0.5, -0.5, -1.0]);
    for depth in [2.0, 3.0] {
        file.node(json!({ "mesh": 0, "translation": [-0.5, -0.5, -depth] }));
    }
    file.json["cameras"] = json!([camera]);
    file.node(json!({ "camera": 0 }));
    file.load()
}

/// Returns the depth at the center of a picture \[m\].
fn depth(camera: Value) -> f32 {
    let scene = three_squares(camera);
    let pose = scene.pose(0.0);
    let accelerator = Geometry::new(&scene).place(&pose);
    let surfaces = Surfaces::new(&scene, &pose);
    let posed = PosedScene::new(&accelerator, &surfaces);
    let seen = GBuffer::trace(posed, &scene.view(&pose, 16, 16), (16, 16)).value;
    seen.pixels.get(8, 8).depth
}

/// Surfaces are visible between `znear` and `zfar` (glTF 2.0, 5.13 and 5.14). `znear` is "the distance to the near
/// clipping plane", `zfar` is "the distance to the far clipping plane".
#[test]
fn depths_outside_of_a_camera_s_range_are_not_shown() {
    for (near, far, expected) in [
        (0.1, Some(100.0), 1.0),
        (1.5, Some(100.0), 2.0),
        (2.5, None, 3.0),
        (0.1, Some(0.5), f32::INFINITY),
        (1.5, Some(1.8), f32::INFINITY),
        (3.5, None, f32::INFINITY),
    ] {
        let mut perspective = json!({ "yfov": 0.5, "znear": near });
        let orthographic = json!({ "xmag": 0.4, "ymag": 0.4, "znear": near, "zfar": far.unwrap_or(1e9) });
        if let Some(far) = far {
            perspective["zfar"] = json!(far);
        }
        for camera in [
            json!({ "type": "perspective", "perspective": perspective }),
            json!({ "type": "orthographic", "orthographic": orthographic }),
        ] {
            let found = depth(camera.clone());
            assert!(found == expected || (found - expected).abs() < 1e-4, "{camera}: {found} m, not {expected} m");
        }
    }
}

/// Shape and range come from "aspectRatio" of perspective cameras, and "xmag" over "ymag" of orthographic ones. Invalid
/// values are ignored.
#[test]
fn cameras_have_the_shape_and_range_of_their_file() {
    let read = |camera: Value| {
        let scene = three_squares(camera);
        (scene.cameras[0].aspect, scene.cameras[0].depths)
    };
    let perspective = |aspect: f32, near: f32, far: f32| {
        read(json!({ "type": "perspective",
            "perspective": { "yfov": 0.5, "aspectRatio": aspect, "znear": near, "zfar": far } }))
    };
    assert_eq!(perspective(2.0, 0.5, 9.0), (Some(2.0), DepthRange { near: 0.5, far: 9.0 }));
    assert_eq!(perspective(2.0, 9.0, 0.5).1, DepthRange::ALL);
    assert_eq!(perspective(0.0, 0.5, 9.0).0, None);
    let orthographic = json!({ "xmag": 3.0, "ymag": 1.5, "znear": 0.0, "zfar": 10.0 });
    let (aspect, depths) = read(json!({ "type": "orthographic", "orthographic": orthographic }));
    assert_eq!((aspect, depths), (Some(2.0), DepthRange { near: 0.0, far: 10.0 }));
}

/// Pictures of all shapes contain the corners of the camera's view: "The viewport's aspect ratio SHOULD NOT crop"
/// (3.10.3).
#[test]
fn pictures_of_any_shape_show_all_of_the_view() {
    let scene = three_squares(json!({ "type": "perspective",
        "perspective": { "yfov": 0.5, "aspectRatio": 2.0, "znear": 0.1 } }));
    let pose = scene.pose(0.0);
    let half = 0.25f32.tan();
    for (width, height) in [(64, 32), (32, 32), (16, 64), (128, 16)] {
        let view = scene.view(&pose, width, height);
        for (x, y) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
            let corner: Vec3 = vec3(2.0 * half * x, half * y, -1.0);
            let pixel = view.project(Vec3A::from(corner)).unwrap().pixel;
            let inside = |x: f32, side: usize| (-0.01..=side as f32 + 0.01).contains(&x);
            assert!(inside(pixel.x, width) && inside(pixel.y, height), "{pixel} of {width}x{height}");
        }
    }
}

/// Squares are at 1, 2 and 3 m. If `znear` is beyond all of them, or `zfar` in front of all, no square is visible and a
/// note is added. Ranges that contain a square add no note.
#[test]
fn cameras_that_cut_the_whole_scene_off_are_named() {
    for (near, far, nearer, beyond) in
        [(0.1, 100.0, 0, 0), (1.5, 100.0, 0, 0), (2.9, 2.95, 0, 0), (3.5, 100.0, 1, 0), (0.1, 0.5, 0, 1)]
    {
        let scene =
            three_squares(json!({ "type": "perspective", "perspective": { "yfov": 0.5, "znear": near, "zfar": far } }));
        let found = (notes(&scene, "nearer than its znear"), notes(&scene, "beyond its zfar"));
        assert_eq!(found, (nearer, beyond), "{near} to {far}: {:?}", scene.warnings);
    }
    // Geometry behind the camera adds no note.
    let mut file = File::square();
    file.json["nodes"][0]["translation"] = json!([0.0, 0.0, 5.0]);
    file.json["cameras"] = json!([{ "type": "perspective", "perspective": { "yfov": 0.5, "znear": 9.0 } }]);
    file.node(json!({ "camera": 0 }));
    assert_eq!(notes(&file.load(), "shows no surface"), 0);
}
