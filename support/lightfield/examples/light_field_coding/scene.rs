//! Scenes like the scenes in chapter 8 of the thesis: surfaces laid out in pictures of texels, and occluders.

use glam::{Vec2, Vec3};

/// A point of a surface. θ is measured from `normal`, φ about `normal` from `tangent`.
#[derive(Clone, Copy)]
pub struct Point {
    pub position: Vec3,
    pub normal: Vec3,
    pub tangent: Vec3,
}

/// Diffuse reflectance, and a Phong lobe with a reflectance and the exponent 2^`shine`.
#[derive(Clone, Copy)]
pub struct Surface {
    pub diffuse: Vec3,
    pub specular: f32,
    pub shine: u32,
}

/// A parallelogram, or a trapezoid with a far side `tip` times as long as the near side. It is a triangle if `tip` is
/// 0.
#[derive(Clone, Copy)]
struct Face {
    origin: Vec3,
    across: Vec3,
    up: Vec3,
    tip: f32,
}

/// Shape of a surface with a picture of texels.
enum Shape {
    /// A row of faces, each as high as the picture.
    Faces(Vec<Face>),
    /// A sphere, mapped by longitude and latitude.
    Sphere { center: Vec3, radius: f32 },
}

/// An object of a scene.
pub struct Object {
    pub name: &'static str,
    pub width: usize,
    pub height: usize,
    pub surface: Surface,
    shape: Shape,
    /// Sizes that the thesis prints for T = 0, 6, 9 \[1024 bytes\].
    pub printed: Option<[u32; 3]>,
}

/// An object that can block light.
pub enum Occluder {
    /// Convex body: the points x with n · x ≤ d for all (n, d).
    Convex(Vec<(Vec3, f32)>),
    /// A ball.
    Ball { center: Vec3, radius: f32 },
}

/// Objects, occluders, and emissive triangles, each as three corners. The normals of the triangles are −y.
pub struct Scene {
    pub name: &'static str,
    pub objects: Vec<Object>,
    pub occluders: Vec<Occluder>,
    pub lights: Vec<[Vec3; 3]>,
}

impl Object {
    /// Returns the surface point of the texel (x, y).
    pub fn point(&self, x: usize, y: usize) -> Point {
        let place = Vec2::new(x as f32 + 0.5, y as f32 + 0.5) / Vec2::new(self.width as f32, self.height as f32);
        match &self.shape {
            Shape::Faces(faces) => {
                let along = place.x * faces.len() as f32;
                let face = faces[(along as usize).min(faces.len() - 1)];
                let u = along.fract() * (1.0 + (face.tip - 1.0) * place.y);
                let position = face.origin + face.across * u + face.up * place.y;
                Point { position, normal: face.across.cross(face.up).normalize(), tangent: face.across.normalize() }
            }
            Shape::Sphere { center, radius } => {
                let (sin, cos) = (place.x * std::f32::consts::TAU).sin_cos();
                let (ring, height) = (place.y * std::f32::consts::PI).sin_cos();
                let normal = Vec3::new(ring * cos, height, ring * sin);
                Point { position: *center + normal * *radius, normal, tangent: Vec3::new(-sin, 0.0, cos) }
            }
        }
    }
}

impl Occluder {
    /// Returns whether the occluder blocks the segment from `from` to `to`.
    pub fn hides(&self, from: Vec3, to: Vec3) -> bool {
        let way = to - from;
        match self {
            Self::Convex(planes) => {
                // The segment is inside all planes between the parameters `enter` and `leave`.
                let (mut enter, mut leave) = (1e-4f32, 1.0f32);
                for (normal, offset) in planes {
                    let (slope, height) = (normal.dot(way), offset - normal.dot(from));
                    if slope.abs() < 1e-9 {
                        leave = if height < 0.0 { 0.0 } else { leave };
                    } else if slope > 0.0 {
                        leave = leave.min(height / slope);
                    } else {
                        enter = enter.max(height / slope);
                    }
                }
                enter + 1e-4 < leave
            }
            Self::Ball { center, radius } => {
                let nearest = ((*center - from).dot(way) / way.length_squared()).clamp(0.0, 1.0);
                nearest > 1e-4 && (from + way * nearest).distance(*center) < radius * 0.9999
            }
        }
    }
}

/// Returns the rectangle with the corner `origin` and the sides `across` and `up`. Its normal is across × up.
fn rectangle(origin: Vec3, across: Vec3, up: Vec3) -> Face {
    Face { origin, across, up, tip: 1.0 }
}

/// Returns the faces of a prism over the polygon `base`, from y = 0 to `height`, and its occluder. The faces are the
/// sides, the top and the dark bottom on the floor. `base` is counterclockwise seen from above. The top is a triangle,
/// or a rectangle over four corners.
fn solid(base: &[Vec3], height: f32) -> (Vec<Face>, Occluder) {
    let up = Vec3::Y * height;
    let mut faces = Vec::new();
    let mut planes = vec![(Vec3::Y, height), (Vec3::NEG_Y, 0.0)];
    for (k, &corner) in base.iter().enumerate() {
        let next = base[(k + 1) % base.len()];
        let face = rectangle(corner, next - corner, up);
        let normal = face.across.cross(face.up).normalize();
        faces.push(face);
        planes.push((normal, normal.dot(corner)));
    }
    let tip = if base.len() == 4 { 1.0 } else { 0.0 };
    let side = *base.last().expect("corners") - base[0];
    for (origin, turn) in [(base[0] + up, 1.0), (base[0], -1.0)] {
        let (a, b) = (base[1] - base[0], side);
        faces.push(if turn > 0.0 {
            Face { origin, across: a, up: b, tip }
        } else {
            Face { origin, across: b, up: a, tip }
        });
    }
    (faces, Occluder::Convex(planes))
}

/// Returns the corners of a regular polygon about `center`, counterclockwise seen from above.
fn polygon(center: Vec3, radius: f32, corners: usize, turn: f32) -> Vec<Vec3> {
    let corner = |k: usize| {
        let (sin, cos) = (turn - k as f32 / corners as f32 * std::f32::consts::TAU).sin_cos();
        center + Vec3::new(cos, 0.0, sin) * radius
    };
    (0..corners).map(corner).collect()
}

/// Returns the side of a picture after its number of texels is multiplied by `scale`.
fn scaled(side: usize, scale: f32) -> usize {
    (side as f32 * scale.sqrt()).round().max(1.0) as usize
}

/// Returns the floor and two walls of a room of 4 × 3 × 4.
fn room() -> [Shape; 3] {
    let (x, y, z) = (Vec3::X * 4.0, Vec3::Y * 3.0, Vec3::Z * 4.0);
    let faces = [rectangle(Vec3::ZERO, y, z), rectangle(Vec3::ZERO, x, y), rectangle(Vec3::ZERO, z, x)];
    faces.map(|face| Shape::Faces(vec![face]))
}

/// Builds the first scene: two walls and a floor with lobes, two boxes, a prism, and an emissive triangle.
pub fn simple(scale: f32) -> Scene {
    let [wall_side, wall_front, floor] = room();
    let (front, hides_front) = solid(&polygon(Vec3::new(2.7, 0.0, 2.6), 0.6, 4, 0.5), 0.8);
    let (back, hides_back) = solid(&polygon(Vec3::new(1.2, 0.0, 1.2), 0.6, 4, 1.1), 1.6);
    let (prism, hides_prism) = solid(&polygon(Vec3::new(1.3, 0.0, 2.9), 0.5, 3, 0.2), 0.9);
    let object = |name, size: [usize; 2], (diffuse, specular, shine), shape, printed| Object {
        name,
        width: scaled(size[0], scale),
        height: scaled(size[1], scale),
        surface: Surface { diffuse: Vec3::from_array(diffuse), specular, shine },
        shape,
        printed: Some(printed),
    };
    let glossy = |diffuse| (diffuse, 0.35, 5);
    let dull = |diffuse| (diffuse, 0.15, 3);
    Scene {
        name: "first scene: six objects, one light",
        objects: vec![
            object("wall_side", [200, 100], glossy([0.55, 0.2, 0.15]), wall_side, [19_474, 13_457, 12_223]),
            object("wall_front", [200, 100], glossy([0.2, 0.45, 0.2]), wall_front, [19_258, 13_252, 11_963]),
            object("floor", [200, 200], glossy([0.5, 0.5, 0.45]), floor, [34_510, 26_505, 24_329]),
            object("box_front", [300, 300], dull([0.6, 0.5, 0.2]), Shape::Faces(front), [11_273, 7_413, 6_597]),
            object("box_back", [300, 300], ([0.6, 0.6, 0.6], 0.0, 0), Shape::Faces(back), [12_751, 9_903, 9_351]),
            object("prism", [500, 500], dull([0.25, 0.35, 0.6]), Shape::Faces(prism), [18_443, 14_215, 13_463]),
        ],
        occluders: vec![hides_front, hides_back, hides_prism],
        lights: vec![[Vec3::new(1.4, 2.9, 1.4), Vec3::new(2.8, 2.9, 1.6), Vec3::new(1.9, 2.9, 2.8)]],
    }
}

/// Builds the second scene: a room, two lights, and a ball that represents 900 triangles (30 around, 16 from pole to
/// pole). All objects have lobes.
pub fn complex(scale: f32) -> Scene {
    let (center, radius) = (Vec3::new(2.0, 1.0, 2.0), 0.8);
    let [wall_side, wall_front, floor] = room();
    let object = |name, size: [usize; 2], diffuse, (specular, shine), shape| Object {
        name,
        width: scaled(size[0], scale),
        height: scaled(size[1], scale),
        surface: Surface { diffuse: Vec3::from_array(diffuse), specular, shine },
        shape,
        printed: None,
    };
    Scene {
        name: "second scene: 906 triangles, two lights",
        objects: vec![
            object("wall_side", [200, 200], [0.55, 0.2, 0.15], (0.35, 5), wall_side),
            object("wall_front", [200, 200], [0.2, 0.45, 0.2], (0.35, 5), wall_front),
            object("floor", [200, 200], [0.5, 0.5, 0.45], (0.35, 5), floor),
            object("ball", [1000, 590], [0.3, 0.35, 0.6], (0.25, 4), Shape::Sphere { center, radius }),
        ],
        occluders: vec![Occluder::Ball { center, radius }],
        lights: vec![
            [Vec3::new(0.8, 2.9, 0.9), Vec3::new(2.0, 2.9, 0.8), Vec3::new(1.3, 2.9, 2.0)],
            [Vec3::new(2.9, 2.9, 2.4), Vec3::new(3.6, 2.9, 2.9), Vec3::new(2.6, 2.9, 3.4)],
        ],
    }
}
