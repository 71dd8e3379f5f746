//! Tests of points and lines as thin bodies.

use super::file::{File, notes};
use glam::{Vec3, vec3};
use render_core::scene::Scene;
use serde_json::{Value, json};

/// Returns the volume of a closed mesh that faces outward \[m³\].
fn volume(scene: &Scene) -> f32 {
    let mesh = &scene.meshes[0];
    let corners = mesh.triangles.iter().map(|triangle| triangle.map(|vertex| mesh.positions[vertex as usize]));
    corners.map(|[a, b, c]| a.dot(b.cross(c)) / 6.0).sum()
}

/// Builds a file with vertices at the corners of a square of side 3 m, drawn in this mode.
fn drawn(mode: u32, indices: Option<&[u32]>) -> File {
    let mut file = File::square();
    let corners = file.vectors(&[Vec3::ZERO, vec3(3.0, 0.0, 0.0), vec3(3.0, 3.0, 0.0), vec3(0.0, 3.0, 0.0)]);
    file.json["meshes"][0]["primitives"][0] = json!({ "attributes": { "POSITION": corners }, "mode": mode });
    if let Some(indices) = indices {
        let numbers: Vec<f32> = indices.iter().map(|&index| f32::from_bits(index)).collect();
        let accessor = file.scalars(&numbers);
        file.json["accessors"][accessor]["componentType"] = json!(5125);
        file.json["meshes"][0]["primitives"][0]["indices"] = json!(accessor);
    }
    file
}

/// The modes (glTF 2.0, 5.24.4) are 0 for points, 1 for lines, 2 for a loop and 3 for a strip. An octahedron of width w has
/// volume w³ / 6. A square tube with diagonal w has volume w² / 2 per meter.
#[test]
fn points_and_lines_are_closed_bodies() {
    let (point, meter) = (0.001 / 6.0, 0.01 / 2.0);
    for (mode, indices, expected) in [
        (0, None, 4.0 * point),
        (1, None, 6.0 * meter),
        (2, None, 12.0 * meter),
        (3, None, 9.0 * meter),
        (0, Some(&[2][..]), point),
        (1, Some(&[0, 1, 1, 2, 0, 3]), 9.0 * meter),
        (3, Some(&[0, 1, 0]), 6.0 * meter),
    ] {
        let scene = drawn(mode, indices).load_with(&["point_size=0.1"]).unwrap();
        let found = volume(&scene);
        assert!((found / expected - 1.0).abs() < 1e-3, "mode {mode}: {found} m³, not {expected} m³");
        assert_eq!(notes(&scene, "--point-size"), 1);
    }
    // By default, the width of lines is 1/200 of the diagonal.
    let found = volume(&drawn(1, None).load());
    let expected = 6.0 * (18f32.sqrt() / 200.0).powi(2) / 2.0;
    assert!((found / expected - 1.0).abs() < 1e-3, "{found} m³, not {expected} m³");
}

/// Points and lines without normals are unlit (3.9.5: "Points or Lines with no NORMAL attribute SHOULD be rendered
/// without lighting and instead use the sum of the base color value and the emissive value"). Vertex colors apply to
/// all corners of their bodies.
#[test]
fn points_without_normals_are_unlit() {
    let mut file = drawn(0, None);
    file.json["materials"] = json!([{ "emissiveFactor": [0.25, 0.0, 0.0],
        "pbrMetallicRoughness": { "baseColorFactor": [0.25, 0.5, 0.75, 1.0] } }]);
    let numbers: Vec<f32> = (0..12).map(|k| k as f32 / 12.0).collect();
    let colors = file.accessor("VEC3", 4, &numbers);
    let primitive = &mut file.json["meshes"][0]["primitives"][0];
    primitive["material"] = json!(0);
    primitive["attributes"]["COLOR_0"] = json!(colors);
    let scene = file.load();
    let mesh = &scene.meshes[0];
    let material = &scene.materials[mesh.material];
    assert!(material.unlit && !material.emits());
    assert_eq!(material.base_color, vec3(0.5, 0.5, 0.75));
    assert_eq!(mesh.colors.len(), mesh.positions.len());
    for (position, color) in mesh.positions.iter().zip(&mesh.colors) {
        let corner = [Vec3::ZERO, vec3(3.0, 0.0, 0.0), vec3(3.0, 3.0, 0.0), vec3(0.0, 3.0, 0.0)]
            .iter()
            .position(|corner| corner.distance(*position) < 0.1)
            .unwrap();
        assert_eq!(color.x, numbers[3 * corner]);
    }
    let normals = file.vectors(&[Vec3::Z; 4]);
    file.json["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = json!(normals);
    let scene = file.load();
    assert!(!scene.materials[scene.meshes[0].material].unlit);
}

/// Primitives without a material use the default one, regardless of earlier primitives.
#[test]
fn strokes_leave_the_default_material() {
    let mut file = drawn(0, None);
    let other = file.json["meshes"][0]["primitives"][0].clone();
    let primitives = file.json["meshes"][0]["primitives"].as_array_mut().unwrap();
    primitives.push(other);
    primitives.push(json!({ "attributes": { "POSITION": 0 } }));
    primitives[1]["mode"] = Value::from(1);
    let scene = file.load();
    let unlit: Vec<bool> = scene.meshes.iter().map(|mesh| scene.materials[mesh.material].unlit).collect();
    assert_eq!((unlit, scene.materials.len()), (vec![true, true, false], 2));
}

/// Morph targets displace whole bodies.
#[test]
fn points_morph() {
    let mut file = drawn(0, None);
    let moved = file.vectors(&[Vec3::Z; 4]);
    file.json["meshes"][0]["primitives"][0]["targets"] = json!([{ "POSITION": moved }]);
    file.json["meshes"][0]["weights"] = json!([2.0]);
    let scene = file.load_with(&["point_size=0.1"]).unwrap();
    let (low, high) = scene.bounds(&scene.pose(0.0)).unwrap();
    assert!((low.z - 1.95).abs() < 1e-5 && (high.z - 2.05).abs() < 1e-5, "{low} to {high}");
}
