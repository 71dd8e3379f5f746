//! Estimated number of texels, without flattening surfaces.
//!
//! ```text
//! N = A d² + b L d        A  area      L  length of the edges of charts      d  texels per meter
//! ```
//! Charts end at open edges and at creases.

use super::density::{ALONG_DIAGONAL, AUTOMATIC};
use super::flatten::standing_instances;
use crate::Surfaces;
use glam::Vec3A;
use std::collections::HashMap;

/// Number b of texels per texel width along the edge of a chart, fitted to the shipped scenes.
const BORDER: f64 = 1.0;
/// Cosine of the smallest angle between the normals at a crease.
const CREASE: f32 = 0.9;

/// Estimated texels of an atlas.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TexelEstimate {
    /// Number of texels at the automatic density.
    pub texels: usize,
    /// Fraction of the texels on the counted instances.
    pub counted: f64,
}

/// Area and borders of surfaces.
#[derive(Clone, Copy, Default)]
struct Extent {
    /// Area \[m²\].
    area: f64,
    /// Length of the edges of charts \[m\].
    border: f64,
}

impl Extent {
    fn add(&mut self, other: Self, sides: f64) {
        self.area += sides * other.area;
        self.border += sides * other.border;
    }

    /// Returns the number of texels at a density \[1/m\].
    fn texels(self, density: f64) -> f64 {
        self.area * density * density + BORDER * self.border * density
    }
}

/// Estimates the texels at the automatic density. `counts` returns whether an instance is counted.
pub(super) fn estimated(surfaces: &Surfaces, counts: &dyn Fn(usize) -> bool) -> TexelEstimate {
    let (mut all, mut counted) = (Extent::default(), Extent::default());
    let (mut least, mut most) = (Vec3A::INFINITY, Vec3A::NEG_INFINITY);
    for instance in standing_instances(surfaces) {
        let triangles = (0..surfaces.triangle_count(instance)).map(|triangle| surfaces.corners(instance, triangle));
        let triangles: Vec<[Vec3A; 3]> = triangles.collect();
        for [a, b, c] in &triangles {
            (least, most) = (least.min(a.min(*b).min(*c)), most.max(a.max(*b).max(*c)));
        }
        let sides = if surfaces.material(instance).double_sided { 2.0 } else { 1.0 };
        let extent = extent(&triangles);
        all.add(extent, sides);
        if counts(instance) {
            counted.add(extent, sides);
        }
    }
    let density = ALONG_DIAGONAL / f64::from((most - least).length()).max(1e-30);
    let wish = all.texels(density);
    let texels = (wish as usize).clamp(AUTOMATIC[0], AUTOMATIC[1]);
    TexelEstimate { texels, counted: counted.texels(density) / wish.max(f64::MIN_POSITIVE) }
}

/// Returns the area of triangles, and the length of the edges of their charts.
fn extent(triangles: &[[Vec3A; 3]]) -> Extent {
    let mut extent = Extent::default();
    // Match each edge with the first triangle at the same edge.
    let mut open: HashMap<[[u32; 3]; 2], Vec3A> = HashMap::new();
    for &[a, b, c] in triangles {
        let normal = (b - a).cross(c - a);
        extent.area += f64::from(normal.length()) / 2.0;
        let normal = normal.normalize_or_zero();
        for (from, to) in [(a, b), (b, c), (c, a)] {
            let length = f64::from(from.distance(to));
            let mut ends = [from, to].map(|end| end.to_array().map(f32::to_bits));
            ends.sort_unstable();
            match open.remove(&ends) {
                // Both triangles are in one chart.
                Some(other) if other.dot(normal) >= CREASE => extent.border -= length,
                Some(_) => extent.border += length,
                None => {
                    open.insert(ends, normal);
                    extent.border += length;
                }
            }
        }
    }
    extent
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::vec3a;

    /// Two triangles of a square with sides of 1 m have four borders; a folded square has two more.
    #[test]
    fn borders_are_open_edges_and_creases() {
        let [a, b, c, d] = [vec3a(0.0, 0.0, 0.0), vec3a(1.0, 0.0, 0.0), vec3a(1.0, 1.0, 0.0), vec3a(0.0, 1.0, 0.0)];
        let flat = extent(&[[a, b, c], [a, c, d]]);
        assert!((flat.area - 1.0).abs() < 1e-6 && (flat.border - 4.0).abs() < 1e-6, "{}", flat.border);
        let up = vec3a(0.5, 0.5, 0.7);
        let folded = extent(&[[a, b, c], [a, c, up]]);
        let whole = 2.0 + 2.0 * 2.0f64.sqrt() + 2.0 * f64::from(up.distance(a));
        assert!((folded.border - whole).abs() < 1e-5, "{} for {whole}", folded.border);
    }
}
