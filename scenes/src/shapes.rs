//! Shapes swept from a profile: turned on a lathe, extruded along a path, or mitered around corners.
//!
//! A profile is a chain of points in its own plane. The visible side is on the right of the chain's direction, so a
//! profile that rises along +y is visible from +x.

use std::f32::consts::{PI, TAU};

use glam::{Vec2, Vec3, vec2, vec3};

use crate::mesh::{Mesh, Vertex};

/// Minimum cosine between neighboring segments of a profile that are shaded as one curve.
const SMOOTH: f32 = 0.75;

/// Returns the normals at both ends of every segment of a profile.
fn profile_normals(profile: &[Vec2]) -> Vec<[Vec2; 2]> {
    let mut flat: Vec<Vec2> = Vec::new();
    for w in profile.windows(2) {
        let d = (w[1] - w[0]).normalize_or_zero();
        flat.push(vec2(d.y, -d.x));
    }
    // Average the normals at smooth joints, and keep both at sharp edges.
    let joined = |a: Vec2, b: Vec2| if a.dot(b) > SMOOTH { (a + b).normalize() } else { a };
    (0..flat.len())
        .map(|i| {
            let before = if i > 0 { joined(flat[i], flat[i - 1]) } else { flat[i] };
            let after = if i + 1 < flat.len() { joined(flat[i], flat[i + 1]) } else { flat[i] };
            [before, after]
        })
        .collect()
}

/// Returns the points of an arc in a profile, including both ends. Angles are in degrees.
#[must_use]
pub fn arc(center: Vec2, radius: f32, from: f32, to: f32, steps: usize) -> Vec<Vec2> {
    (0..=steps)
        .map(|i| {
            let a = (from + (to - from) * i as f32 / steps as f32).to_radians();
            center + radius * vec2(a.cos(), a.sin())
        })
        .collect()
}

/// Joins pieces to a profile without duplicate points.
#[must_use]
pub fn chain(pieces: &[&[Vec2]]) -> Vec<Vec2> {
    let mut out: Vec<Vec2> = Vec::new();
    for p in pieces.iter().flat_map(|p| p.iter()) {
        if out.last().is_none_or(|q| q.distance(*p) > 1e-5) {
            out.push(*p);
        }
    }
    out
}

/// Adds a body of revolution about the vertical axis through `center`. The profile lists (radius, height), upwards. The
/// texture extends over `around` meters per revolution. Choose a whole number of repeats to avoid a seam.
pub fn lathe(mesh: &mut Mesh, center: Vec3, profile: &[Vec2], segments: usize, around: f32) {
    let normals = profile_normals(profile);
    let mut length = 0.0;
    // Add one strip per profile segment, with its own normals.
    for (w, n) in profile.windows(2).zip(&normals) {
        let step = w[0].distance(w[1]);
        mesh.grid(segments, 1, |i, j| {
            let (sin, cos) = (TAU * (i % segments) as f32 / segments as f32).sin_cos();
            let (p, m) = (w[j], n[j]);
            Vertex {
                position: center + vec3(p.x * cos, p.y, p.x * sin),
                normal: vec3(m.x * cos, m.y, m.x * sin),
                uv: vec2(around * i as f32 / segments as f32, -(length + step * j as f32)),
            }
        });
        length += step;
    }
}

/// A position on a path: the profile's origin, and the directions of the profile's axes.
#[derive(Clone, Copy, Debug)]
pub struct Frame {
    /// Position of the profile's origin \[m\].
    pub origin: Vec3,
    /// Direction of the profile's x axis.
    pub x: Vec3,
    /// Direction of the profile's y axis.
    pub y: Vec3,
}

impl Frame {
    fn point(&self, p: Vec2) -> Vec3 {
        self.origin + self.x * p.x + self.y * p.y
    }
}

/// Sweeps a profile along a curve. Shading is smooth along the curve.
pub fn sweep(mesh: &mut Mesh, frames: &[Frame], profile: &[Vec2]) {
    let normals = profile_normals(profile);
    let mut lengths = vec![0.0];
    for w in frames.windows(2) {
        lengths.push(lengths[lengths.len() - 1] + w[0].origin.distance(w[1].origin));
    }
    let mut across = 0.0;
    // Add one strip per profile segment along the whole curve.
    for (w, n) in profile.windows(2).zip(&normals) {
        let step = w[0].distance(w[1]);
        mesh.grid(frames.len() - 1, 1, |i, j| Vertex {
            position: frames[i].point(w[j]),
            normal: frames[i].x * n[j].x + frames[i].y * n[j].y,
            uv: vec2(lengths[i], -(across + step * j as f32)),
        });
        across += step;
    }
}

/// Closes both ends of a swept profile, from the profile down to the surface at y = 0 of its plane.
pub fn close_ends(mesh: &mut Mesh, frames: &[Frame], profile: &[Vec2]) {
    let [first, second, .., before, last] = frames else { return };
    for (end, inner) in [(first, second), (last, before)] {
        for w in profile.windows(2).filter(|w| w[0].x != w[1].x && w[0].y.max(w[1].y) > 0.0) {
            let ground = |p: Vec2| end.point(vec2(p.x, 0.0));
            let corners = [end.point(w[0]), end.point(w[1]), ground(w[1]), ground(w[0])];
            mesh.quad_facing(corners, end.origin - inner.origin);
        }
    }
}

/// Adds a molding along horizontal straight segments with mitered corners. The profile's x axis points to the right of
/// the direction from corner to corner. Its y axis points up.
pub fn molding(mesh: &mut Mesh, corners: &[Vec3], closed: bool, profile: &[Vec2]) {
    let n = corners.len();
    let right = |i: usize| (corners[(i + 1) % n] - corners[i % n]).normalize().cross(Vec3::Y);
    let normals = profile_normals(profile);
    let stretches = if closed { n } else { n - 1 };
    // Compute offset directions at the corners. Open ends are not mitered.
    let miter = |i: usize| {
        let after = right(i.min(stretches - 1));
        let before = if i > 0 {
            right(i - 1)
        } else if closed {
            right(n - 1)
        } else {
            after
        };
        let after = if !closed && i == n - 1 {
            before
        } else if closed {
            right(i % n)
        } else {
            after
        };
        (before + after) / (1.0 + before.dot(after))
    };
    for s in 0..stretches {
        // Both ends of a stretch lie on the miters, so that adjacent stretches meet.
        let (a, b) = (corners[s], corners[(s + 1) % n]);
        let (ma, mb) = (miter(s), miter((s + 1) % n.max(1)));
        let (ma, mb) = if closed { (ma, mb) } else { (ma, miter(s + 1)) };
        let (forward, side) = ((b - a).normalize(), right(s));
        // Add one strip per profile segment, with the miters at both ends.
        let mut across = 0.0;
        for (w, m) in profile.windows(2).zip(&normals) {
            let step = w[0].distance(w[1]);
            mesh.grid(1, 1, |i, j| {
                let (end, miter) = if i == 0 { (a, ma) } else { (b, mb) };
                let position = end + miter * w[j].x + Vec3::Y * w[j].y;
                let uv = vec2(position.dot(forward), -(across + step * j as f32));
                Vertex { position, normal: side * m[j].x + Vec3::Y * m[j].y, uv }
            });
            across += step;
        }
    }
}

/// Adds a body with a horizontal outline, scaled by a profile of (scale, height), upwards. It suits bases, shafts and
/// capitals of compound piers. The outline may have either orientation.
pub fn loft(mesh: &mut Mesh, center: Vec3, outline: &[Vec2], profile: &[Vec2]) {
    let n = outline.len();
    // Compute outward edge normals, for either orientation of the outline.
    let edges: Vec<Vec2> = (0..n)
        .map(|i| {
            let d = outline[(i + 1) % n] - outline[i];
            let m = vec2(d.y, -d.x).normalize();
            m * (outline[i] + outline[(i + 1) % n]).dot(m).signum()
        })
        .collect();
    let heights = profile_normals(profile);
    let (mut around, mut up) = (0.0, 0.0);
    for i in 0..n {
        let (before, here, after) = (edges[(i + n - 1) % n], edges[i], edges[(i + 1) % n]);
        // Average the normals with smooth neighbors.
        let joined = |other: Vec2| if here.dot(other) > SMOOTH { (here + other).normalize() } else { here };
        let (p, q) = (outline[i], outline[(i + 1) % n]);
        let width = p.distance(q);
        for (w, m) in profile.windows(2).zip(&heights) {
            let step = w[0].distance(w[1]);
            mesh.grid(1, 1, |a, b| {
                let (corner, normal) = if a == 0 { (p, joined(before)) } else { (q, joined(after)) };
                // Combine the outline's normal with the profile's slope.
                let corner = corner * w[b].x;
                let level = m[b].x.max(0.05);
                Vertex {
                    position: center + vec3(corner.x, w[b].y, corner.y),
                    normal: vec3(normal.x * level, m[b].y, normal.y * level),
                    uv: vec2(around + width * a as f32, -(up + step * b as f32)),
                }
            });
            up += step;
        }
        up = 0.0;
        around += width;
    }
}

/// Adds a ball.
pub fn ball(mesh: &mut Mesh, center: Vec3, radius: f32, segments: usize) {
    let profile: Vec<Vec2> = (0..=segments / 2)
        .map(|i| {
            let a = PI * (i as f32 / (segments / 2) as f32 - 0.5);
            radius * vec2(a.cos().max(0.0), a.sin())
        })
        .collect();
    lathe(mesh, center, &profile, segments, TAU * radius);
}

/// Adds a round bar from `a` to `b`, without end caps.
pub fn bar(mesh: &mut Mesh, a: Vec3, b: Vec3, radius: f32, segments: usize) {
    let axis = (b - a).normalize();
    let x = axis.any_orthonormal_vector();
    let y = axis.cross(x);
    let circle = arc(Vec2::ZERO, radius, 0.0, 360.0, segments);
    sweep(mesh, &[Frame { origin: a, x, y }, Frame { origin: b, x, y }], &circle);
}

/// Adds a ring about `axis` with a round section. `radius` is its radius and `thickness` the radius of the section
/// \[m\].
pub fn ring(mesh: &mut Mesh, center: Vec3, axis: Vec3, [radius, thickness]: [f32; 2], segments: usize) {
    let x = axis.normalize().any_orthonormal_vector();
    let y = axis.normalize().cross(x);
    // The last frame repeats the first, which closes the ring.
    let frames: Vec<Frame> = (0..=segments)
        .map(|i| {
            let (sin, cos) = (TAU * (i % segments) as f32 / segments as f32).sin_cos();
            let out = x * cos + y * sin;
            Frame { origin: center + out * radius, x: out, y: axis.normalize() }
        })
        .collect();
    sweep(mesh, &frames, &arc(Vec2::ZERO, thickness, 0.0, 360.0, 8));
}
