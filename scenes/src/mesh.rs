//! Triangle meshes and their primitives.
//!
//! Texture coordinates are in meters. The glTF writer divides them by the size of the material's texture, so that any
//! material has the correct scale on any shape.

use glam::{Mat3, Mat4, Vec2, Vec3, vec2};

/// A corner of a triangle: position, unit normal, texture coordinate.
#[derive(Clone, Copy, Debug)]
pub struct Vertex {
    /// Position \[m\].
    pub position: Vec3,
    /// Unit normal towards the visible side.
    pub normal: Vec3,
    /// Texture coordinate \[m\].
    pub uv: Vec2,
}

/// An indexed triangle mesh.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Corners of the triangles.
    pub vertices: Vec<Vertex>,
    /// Three indices per triangle, counterclockwise seen from the visible side.
    pub indices: Vec<u32>,
}

/// Returns the texture coordinates of a flat face \[m\], along the horizontal and down the slope. Stone courses stay
/// level, and they continue across neighboring faces of one plane.
#[must_use]
pub fn planar_uv(position: Vec3, normal: Vec3) -> Vec2 {
    if normal.y.abs() > 0.75 {
        return vec2(position.x, position.z);
    }
    let right = Vec3::Y.cross(normal).normalize();
    let up = normal.cross(right);
    vec2(position.dot(right), -position.dot(up))
}

/// Sides of a box, to select omitted sides.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// Side of the box towards +x.
    Right,
    /// Side of the box towards -x.
    Left,
    /// Side of the box towards +y.
    Top,
    /// Side of the box towards -y.
    Bottom,
    /// Side of the box towards +z.
    Front,
    /// Side of the box towards -z.
    Back,
}

impl Mesh {
    /// Returns an empty mesh.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Number of triangles.
    #[must_use]
    pub fn triangles(&self) -> usize {
        self.indices.len() / 3
    }

    /// Adds a triangle from existing vertices, oriented to match their normals. Triangles without area are ignored.
    pub fn face(&mut self, a: u32, b: u32, c: u32) {
        let [p, q, r] = [a, b, c].map(|i| self.vertices[i as usize]);
        let cross = (q.position - p.position).cross(r.position - p.position);
        if cross.length_squared() < 1e-14 {
            return;
        }
        if cross.dot(p.normal + q.normal + r.normal) >= 0.0 {
            self.indices.extend([a, b, c]);
        } else {
            self.indices.extend([a, c, b]);
        }
    }

    /// Adds a vertex and returns its index.
    pub fn vertex(&mut self, position: Vec3, normal: Vec3, uv: Vec2) -> u32 {
        let normal = normal.normalize();
        self.vertices.push(Vertex { position, normal, uv });
        self.vertices.len() as u32 - 1
    }

    /// Adds a flat quad with world-scale texture coordinates. Seen from the visible side, its corners are
    /// counterclockwise.
    pub fn quad(&mut self, corners: [Vec3; 4]) {
        let normal = (corners[2] - corners[0]).cross(corners[3] - corners[1]).normalize();
        self.quad_uv(corners, corners.map(|p| planar_uv(p, normal)));
    }

    /// Adds a quad with the given texture coordinates.
    pub fn quad_uv(&mut self, corners: [Vec3; 4], uv: [Vec2; 4]) {
        let normal = (corners[2] - corners[0]).cross(corners[3] - corners[1]).normalize();
        let i = [0, 1, 2, 3].map(|k| self.vertex(corners[k], normal, uv[k]));
        self.face(i[0], i[1], i[2]);
        self.face(i[0], i[2], i[3]);
    }

    /// Adds a flat quad that is visible from the side `towards`, for any order of its corners.
    pub fn quad_facing(&mut self, corners: [Vec3; 4], towards: Vec3) {
        let [a, b, c, d] = corners;
        if (c - a).cross(d - b).dot(towards) >= 0.0 {
            self.quad([a, b, c, d]);
        } else {
            self.quad([d, c, b, a]);
        }
    }

    /// Adds an axis-aligned box.
    pub fn cuboid(&mut self, min: Vec3, max: Vec3) {
        self.cuboid_without(min, max, &[]);
    }

    /// Adds an axis-aligned box without some of its sides.
    pub fn cuboid_without(&mut self, min: Vec3, max: Vec3, without: &[Side]) {
        let corner = |x: bool, y: bool, z: bool| {
            Vec3::new(if x { max.x } else { min.x }, if y { max.y } else { min.y }, if z { max.z } else { min.z })
        };
        let (f, t) = (false, true);
        // List the corners of each side, counterclockwise from outside.
        let sides = [
            (Side::Right, Vec3::X, [(t, f, t), (t, f, f), (t, t, f), (t, t, t)]),
            (Side::Left, Vec3::NEG_X, [(f, f, f), (f, f, t), (f, t, t), (f, t, f)]),
            (Side::Top, Vec3::Y, [(f, t, t), (t, t, t), (t, t, f), (f, t, f)]),
            (Side::Bottom, Vec3::NEG_Y, [(f, f, f), (t, f, f), (t, f, t), (f, f, t)]),
            (Side::Front, Vec3::Z, [(f, f, t), (t, f, t), (t, t, t), (f, t, t)]),
            (Side::Back, Vec3::NEG_Z, [(t, f, f), (f, f, f), (f, t, f), (t, t, f)]),
        ];
        for (side, normal, corners) in sides {
            if !without.contains(&side) {
                self.quad_facing(corners.map(|(x, y, z)| corner(x, y, z)), normal);
            }
        }
    }

    /// Adds a grid of `nu` × `nv` quads with corners `f(i, j)`. The normals determine the winding.
    pub fn grid(&mut self, nu: usize, nv: usize, f: impl Fn(usize, usize) -> Vertex) {
        let first = self.vertices.len() as u32;
        for i in 0..=nu {
            for j in 0..=nv {
                let v = f(i, j);
                self.vertex(v.position, v.normal, v.uv);
            }
        }
        let at = |i: usize, j: usize| first + (i * (nv + 1) + j) as u32;
        for i in 0..nu {
            for j in 0..nv {
                self.face(at(i, j), at(i + 1, j), at(i + 1, j + 1));
                self.face(at(i, j), at(i + 1, j + 1), at(i, j + 1));
            }
        }
    }

    /// Adds a smooth surface over the unit square. Its texture is `size` meters in each direction. The cross product of
    /// the derivatives along u and v points to the visible side.
    pub fn surface(&mut self, nu: usize, nv: usize, size: Vec2, f: impl Fn(f32, f32) -> Vec3) {
        const H: f32 = 2e-3;
        self.grid(nu, nv, |i, j| {
            let (u, v) = (i as f32 / nu as f32, j as f32 / nv as f32);
            let du = f(u + H, v) - f(u - H, v);
            let dv = f(u, v + H) - f(u, v - H);
            let normal = du.cross(dv).try_normalize().unwrap_or(Vec3::Y);
            Vertex { position: f(u, v), normal, uv: vec2(u, v) * size }
        });
    }

    /// Adds another mesh with a transform.
    pub fn append(&mut self, other: &Mesh, transform: Mat4) {
        let first = self.vertices.len() as u32;
        let normals = Mat3::from_mat4(transform).inverse().transpose();
        for v in &other.vertices {
            self.vertices.push(Vertex {
                position: transform.transform_point3(v.position),
                normal: (normals * v.normal).normalize(),
                uv: v.uv,
            });
        }
        // A mirroring transform reverses the winding.
        let mirrored = Mat3::from_mat4(transform).determinant() < 0.0;
        for t in other.indices.chunks_exact(3) {
            let t = if mirrored { [t[0], t[2], t[1]] } else { [t[0], t[1], t[2]] };
            self.indices.extend(t.map(|i| first + i));
        }
    }
}
