//! Arches, walls with openings, and vaults.

use glam::{Vec2, Vec3, vec2};

use crate::mesh::{Mesh, Vertex};
use crate::shapes::{Frame, close_ends, sweep};

/// Returns the point and the derivative, at a fraction `share` of its angle, of half an arch with unit half span and
/// rise.
///
/// `point` is the distance of the arc's center beyond the middle: 0 for a round arch, 1 for an equilateral pointed
/// arch.
fn half_arch(point: f32, share: f32) -> (Vec2, Vec2) {
    let radius = 1.0 + point;
    let top = (point / radius).acos();
    let angle = top * (1.0 - share);
    let rise = radius * top.sin();
    (
        vec2(radius * angle.cos() - point, radius * angle.sin() / rise),
        vec2(radius * angle.sin(), -radius * angle.cos() / rise),
    )
}

/// Returns the points of an arch from its left foot over the crown to its right foot, with normals into the opening.
/// Each side has `steps` segments. A pointed crown appears twice, once per side.
#[must_use]
pub fn arch_points(half: f32, rise: f32, point: f32, steps: usize) -> Vec<(Vec2, Vec2)> {
    let side = |sign: f32, k: usize| {
        let (p, d) = half_arch(point, k as f32 / steps as f32);
        let position = vec2(sign * p.x * half, p.y * rise);
        let tangent = vec2(d.x * half, d.y * rise).normalize();
        (position, vec2(sign * tangent.y, -tangent.x))
    };
    let mut out: Vec<(Vec2, Vec2)> = (0..=steps).rev().map(|k| side(-1.0, k)).collect();
    // A round crown is smooth, so skip its second point.
    out.extend((if point > 0.0 { 0 } else { 1 }..=steps).map(|k| side(1.0, k)));
    out
}

/// Returns the rise of an arch of true circular arcs.
#[must_use]
pub fn natural_rise(half: f32, point: f32) -> f32 {
    half * (1.0 + 2.0 * point).sqrt()
}

/// Plane of a wall. Seen from the visible side, `along` points to the right.
#[derive(Clone, Copy, Debug)]
pub struct Plane {
    /// Point of the wall with position 0 and height 0 \[m\].
    pub origin: Vec3,
    /// Horizontal unit direction along the wall.
    pub along: Vec3,
    /// Unit normal of the wall on the visible side.
    pub out: Vec3,
}

impl Plane {
    /// Returns the point at a position along the wall, a height, and a distance in front of the wall \[m\].
    #[must_use]
    pub fn at(&self, s: f32, y: f32, out: f32) -> Vec3 {
        self.origin + self.along * s + Vec3::Y * y + self.out * out
    }

    /// Returns the back face of a wall of this thickness \[m\].
    #[must_use]
    pub fn behind(&self, thickness: f32) -> Plane {
        Plane { origin: self.origin - self.out * thickness, along: self.along, out: -self.out }
    }

    /// Adds a rectangle parallel to the wall at a distance `out` in front of it.
    pub fn rectangle(&self, mesh: &mut Mesh, s: [f32; 2], y: [f32; 2], out: f32) {
        let p = [(s[0], y[0]), (s[1], y[0]), (s[1], y[1]), (s[0], y[1])];
        mesh.quad_facing(p.map(|(s, y)| self.at(s, y, out)), self.out);
    }

    /// Adds a picture parallel to the wall. It shows the whole texture once and upright.
    pub fn picture(&self, mesh: &mut Mesh, s: [f32; 2], y: [f32; 2], out: f32) {
        let p = [(s[0], y[0]), (s[1], y[0]), (s[1], y[1]), (s[0], y[1])];
        let uv = [vec2(0.0, 1.0), vec2(1.0, 1.0), vec2(1.0, 0.0), vec2(0.0, 0.0)];
        mesh.quad_uv(p.map(|(s, y)| self.at(s, y, out)), uv);
    }

    /// Adds a raised panel with beveled edges at the positions `s` and heights `y`. The bevel is `inset` wide and rises
    /// from `low` to `high` in front of the wall.
    pub fn field(&self, mesh: &mut Mesh, [s, y]: [[f32; 2]; 2], inset: f32, [low, high]: [f32; 2]) {
        let outer = [(s[0], y[0]), (s[1], y[0]), (s[1], y[1]), (s[0], y[1])].map(|(s, y)| self.at(s, y, low));
        let (a, b) = ([s[0] + inset, s[1] - inset], [y[0] + inset, y[1] - inset]);
        let inner = [(a[0], b[0]), (a[1], b[0]), (a[1], b[1]), (a[0], b[1])].map(|(s, y)| self.at(s, y, high));
        for i in 0..4 {
            let k = (i + 1) % 4;
            mesh.quad_facing([outer[i], outer[k], inner[k], inner[i]], self.out);
        }
        self.rectangle(mesh, a, b, high);
    }

    /// Adds a box at the positions `s`, heights `y`, and distances `out` in front of the wall.
    pub fn block(&self, mesh: &mut Mesh, s: [f32; 2], y: [f32; 2], out: [f32; 2]) {
        let a = self.at(s[0], y[0], out[0]);
        let b = self.at(s[1], y[1], out[1]);
        mesh.cuboid(a.min(b), a.max(b));
    }
}

/// Arched opening in a wall.
#[derive(Clone, Copy, Debug)]
pub struct Opening {
    /// Position of the opening's middle along the wall \[m\].
    pub center: f32,
    /// Half the width of the opening \[m\].
    pub half: f32,
    /// Height of the lower edge \[m\].
    pub sill: f32,
    /// Height of the springing, where the arch begins \[m\].
    pub spring: f32,
    /// Pointedness of the arch, 0 for a round arch.
    pub point: f32,
}

impl Opening {
    /// Height of the arch's crown \[m\].
    #[must_use]
    pub fn crown(&self) -> f32 {
        self.spring + natural_rise(self.half, self.point)
    }

    fn curve(&self, steps: usize) -> Vec<(Vec2, Vec2)> {
        let mut points = arch_points(self.half, natural_rise(self.half, self.point), self.point, steps);
        for (p, _) in &mut points {
            *p += vec2(self.center, self.spring);
        }
        points
    }

    /// Adds the inner faces of the opening, from the wall's plane to `depth` behind it.
    pub fn reveal(&self, mesh: &mut Mesh, plane: &Plane, depth: f32, steps: usize) {
        // Sweep a profile of this depth along jambs and arch.
        let mut points = vec![(vec2(self.center - self.half, self.sill), Vec2::X)];
        if self.spring > self.sill {
            points.push((vec2(self.center - self.half, self.spring), Vec2::X));
        }
        let curve = self.curve(steps);
        let mut frames = Vec::new();
        let frame = |(p, n): &(Vec2, Vec2)| Frame {
            origin: plane.at(p.x, p.y, 0.0),
            x: plane.along * n.x + Vec3::Y * n.y,
            y: plane.out,
        };
        frames.extend(points.iter().map(frame));
        // The first arch point coincides with the end of the left jamb.
        frames.extend(curve.iter().skip(if points.len() > 1 { 1 } else { 0 }).map(frame));
        frames.push(frame(&(vec2(self.center + self.half, self.sill), Vec2::NEG_X)));
        sweep(mesh, &frames, &[vec2(0.0, -depth), vec2(0.0, 0.0)]);
        // The sill is a horizontal quad.
        if self.sill > 0.0 && self.spring > self.sill {
            let (l, r) = (self.center - self.half, self.center + self.half);
            mesh.quad_facing(
                [
                    plane.at(l, self.sill, 0.0),
                    plane.at(r, self.sill, 0.0),
                    plane.at(r, self.sill, -depth),
                    plane.at(l, self.sill, -depth),
                ],
                Vec3::Y,
            );
        }
    }

    /// Adds a band around the arch. `profile` lists the distance from the opening's edge and the distance in front of
    /// the wall, from the outer edge inwards.
    pub fn archivolt(&self, mesh: &mut Mesh, plane: &Plane, profile: &[Vec2], steps: usize) {
        let frames: Vec<Frame> = self.curve(steps).into_iter().map(|(p, n)| edge_frame(plane, p, n)).collect();
        sweep(mesh, &frames, profile);
        close_ends(mesh, &frames, profile);
    }

    /// Adds an [`archivolt`](Self::archivolt) with jambs: the band extends down to the sill on both sides.
    pub fn archivolt_with_jambs(&self, mesh: &mut Mesh, plane: &Plane, profile: &[Vec2], steps: usize) {
        let mut points = self.curve(steps);
        points.insert(0, (vec2(self.center - self.half, self.sill), Vec2::X));
        points.push((vec2(self.center + self.half, self.sill), Vec2::NEG_X));
        let frames: Vec<Frame> = points.into_iter().map(|(p, n)| edge_frame(plane, p, n)).collect();
        sweep(mesh, &frames, profile);
        close_ends(mesh, &frames, profile);
    }

    /// Fills the opening with a pane. `uv` returns the texture coordinates for a horizontal position in -1..1 and a
    /// vertical position in 0..1.
    pub fn pane(&self, mesh: &mut Mesh, plane: &Plane, pane: Pane, uv: impl Fn(f32, f32) -> Vec2) {
        let Pane { depth, steps } = pane;
        let height = self.crown() - self.sill;
        let corner = |x: f32, y: f32| Vertex {
            position: plane.at(x, y, -depth),
            normal: plane.out,
            uv: uv((x - self.center) / self.half, (y - self.sill) / height),
        };
        let curve = self.curve(steps);
        // Fill vertical strips from the sill to the arch.
        for w in curve.windows(2) {
            let (a, b) = (w[0].0, w[1].0);
            mesh.grid(1, 1, |i, j| {
                let p = if i == 0 { a } else { b };
                corner(p.x, if j == 0 { self.sill } else { p.y })
            });
        }
    }
}

/// Pane of an [`Opening`].
#[derive(Clone, Copy, Debug)]
pub struct Pane {
    /// Distance behind the plane of the wall \[m\].
    pub depth: f32,
    /// Number of segments on each side of the pane's arch.
    pub steps: usize,
}

/// Returns the frame of a profile at a point of an opening's edge, given the normal into the opening.
fn edge_frame(plane: &Plane, p: Vec2, n: Vec2) -> Frame {
    Frame { origin: plane.at(p.x, p.y, 0.0), x: -(plane.along * n.x + Vec3::Y * n.y), y: plane.out }
}

/// Adds one face of a wall with positions `s` and heights `y`. The openings are sorted along the wall.
pub fn wall(mesh: &mut Mesh, plane: &Plane, [s, y]: [[f32; 2]; 2], openings: &[Opening], steps: usize) {
    let mut face = |p: [Vec2; 4]| {
        mesh.quad_facing(p.map(|p| plane.at(p.x, p.y, 0.0)), plane.out);
    };
    let mut rectangle = |a: f32, b: f32, low: f32, high: f32| {
        if b - a > 1e-4 && high - low > 1e-4 {
            face([vec2(a, low), vec2(b, low), vec2(b, high), vec2(a, high)]);
        }
    };
    // Add the rectangles between the openings and below their sills.
    let mut from = s[0];
    for o in openings {
        rectangle(from, o.center - o.half, y[0], y[1]);
        rectangle(o.center - o.half, o.center + o.half, y[0], o.sill);
        from = o.center + o.half;
    }
    rectangle(from, s[1], y[0], y[1]);
    for o in openings {
        // Fill the wall above each arch with vertical strips.
        for w in o.curve(steps).windows(2) {
            let (a, b) = (w[0].0, w[1].0);
            if (b.x - a.x).abs() > 1e-5 {
                face([a, b, vec2(b.x, y[1]), vec2(a.x, y[1])]);
            }
        }
    }
}

/// Adds half a web of a groin vault, visible from below. Level lines extend from the groin, which connects `center` and
/// `corner`, to the wall. The middle of the wall is at `middle`. All points are in x and z.
pub fn half_web(mesh: &mut Mesh, [center, middle, corner]: [Vec2; 3], spring: f32, arch: (f32, f32), steps: usize) {
    let (rise, point) = arch;
    let (out, side) = (middle - center, corner - middle);
    let width = side.length();
    mesh.grid(steps, 1, |i, j| {
        let share = i as f32 / steps as f32;
        let (p, d) = half_arch(point, share);
        // The groin is at j = 0, the wall at j = 1.
        let along = if j == 0 { p.x } else { 1.0 };
        let flat = center + out * along + side * p.x;
        // The web is a barrel along `out`, so its normal is perpendicular to `out`.
        let tangent = vec2(d.x * width, d.y * rise).normalize();
        let across = side / width * tangent.y;
        Vertex {
            position: Vec3::new(flat.x, spring + p.y * rise, flat.y),
            normal: Vec3::new(across.x, -tangent.x, across.y),
            uv: vec2(along * out.length(), share * (width + 0.6 * rise)),
        }
    });
}

/// Adds a groin vault over the rectangle from `min` to `max` in x and z. It is visible from below.
pub fn groin_vault(mesh: &mut Mesh, [min, max]: [Vec2; 2], spring: f32, arch: (f32, f32), steps: usize) {
    let center = (min + max) / 2.0;
    let half = (max - min) / 2.0;
    for (u, v) in [(Vec2::X, Vec2::Y), (Vec2::Y, Vec2::X), (Vec2::NEG_X, Vec2::Y), (Vec2::NEG_Y, Vec2::X)] {
        let middle = center + u * half;
        for sign in [-1.0, 1.0] {
            half_web(mesh, [center, middle, middle + v * half * sign], spring, arch, steps);
        }
    }
}

/// Section of a rib.
#[derive(Clone, Copy, Debug)]
pub struct RibSection {
    /// Width of the rib \[m\].
    pub width: f32,
    /// Depth of the rib below the vault \[m\].
    pub depth: f32,
    /// Whether the rib ends at the crown instead of at the second foot.
    pub half: bool,
}

/// Adds a rib along the arch from `a` over the crown to `b`, both at springing height.
pub fn rib(mesh: &mut Mesh, [a, b]: [Vec3; 2], arch: (f32, f32), section: RibSection, steps: usize) {
    let axis = (b - a).normalize();
    let side = axis.cross(Vec3::Y);
    let mut points = arch_points(a.distance(b) / 2.0, arch.0, arch.1, steps);
    // A half rib ends at the crown.
    if section.half {
        points.truncate(steps + 1);
    }
    // Put the profile's x axis across the rib and its y axis into the opening.
    let frames: Vec<Frame> = points
        .iter()
        .map(|(p, n)| Frame {
            origin: (a + b) / 2.0 + axis * p.x + Vec3::Y * p.y,
            x: side,
            y: axis * n.x + Vec3::Y * n.y,
        })
        .collect();
    // The profile starts inside the vault, so that no gap is visible.
    let (w, d) = (section.width / 2.0, section.depth);
    let profile = [
        vec2(w, -0.3 * d),
        vec2(w, 0.45 * d),
        vec2(0.62 * w, 0.85 * d),
        vec2(0.35 * w, d),
        vec2(-0.35 * w, d),
        vec2(-0.62 * w, 0.85 * d),
        vec2(-w, 0.45 * d),
        vec2(-w, -0.3 * d),
    ];
    sweep(mesh, &frames, &profile);
}
