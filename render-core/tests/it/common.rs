//! Small hand-made scenes for tests.

use glam::{Quat, Vec3, vec3};
use render_core::scene::{Instance, Material, Mesh, Node, Scene, Transform};

pub fn rest(translation: Vec3) -> Transform {
    Transform { translation, rotation: Quat::IDENTITY, scale: Vec3::ONE }
}

/// Adds a node with a mesh and its material. Returns the node's index.
pub fn add(scene: &mut Scene, rest: Transform, mesh: Mesh, material: Material) -> usize {
    scene.materials.push(material);
    scene.nodes.push(Node { name: String::new(), parent: None, rest });
    scene.meshes.push(Mesh { material: scene.materials.len() - 1, ..mesh });
    scene.instances.push(Instance { node: scene.nodes.len() - 1, mesh: scene.meshes.len() - 1 });
    scene.nodes.len() - 1
}

pub fn material(base_color: Vec3, emission: Vec3) -> Material {
    Material { base_color, emission, ..Material::default() }
}

/// Builds a parallelogram from `corner` along `a` and `b`, facing a × b.
pub fn quad(corner: Vec3, a: Vec3, b: Vec3) -> Mesh {
    Mesh {
        positions: vec![corner, corner + a, corner + a + b, corner + b],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Mesh::default()
    }
}

/// Builds the six walls of a cube of side 2 around the origin, facing inward.
pub fn room() -> Mesh {
    let mut mesh = Mesh::default();
    for axis in 0..3 {
        for sign in [-1.0f32, 1.0] {
            let mut n = Vec3::ZERO;
            n[axis] = sign;
            let a = vec3(n.y, n.z, n.x);
            let b = n.cross(a);
            // Order the vectors so that a × b faces the center.
            let (a, b) = if a.cross(b).dot(n) < 0.0 { (a, b) } else { (b, a) };
            let wall = quad(n - a - b, 2.0 * a, 2.0 * b);
            let base = mesh.positions.len() as u32;
            mesh.positions.extend(wall.positions);
            mesh.triangles.extend(wall.triangles.iter().map(|t| t.map(|v| v + base)));
        }
    }
    mesh
}
