//! Balance of a light's sample points: a factor that corrects their intensity to the whole light's, in every direction.
//!
//! From far away, an emissive mesh is a point light of the intensity
//!
//! ```text
//! I(ω) = Σ_p Lₚ Aₚ max(nₚ · ω, 0)          p  pieces of the mesh
//! ```
//!
//! The light's few sample points sum to Iₛ(ω) instead: with 64 points on a sphere, chance decides how many points face
//! ω. The light of the points is therefore multiplied by I(ω) / Iₛ(ω). Near the light, each point has its own direction
//! to a receiver, and the factor tends to 1:
//!
//! ```text
//! 1 + (I/Iₛ − 1) · d² / (d² + R²)          d  distance to the light's center          R  its radius
//! ```

use super::AreaSample;
use crate::luminance;
use crate::polygon::Polygon;
use glam::{Vec2, Vec3A};

/// Number of cells along a side of the octahedral map of directions.
const CELLS: usize = 32;
/// Maximum factor. A factor above it, or below its inverse, means a direction with almost no light.
const MOST: f32 = 2.0;

/// Factors for the light of sample points, by emission direction.
#[derive(Debug)]
pub(super) struct Balance {
    middle: Vec3A,
    /// Square of the light's radius, R² \[m²\].
    radius2: f32,
    /// Ratios I / Iₛ at the corners of the cells, row by row.
    ratios: Vec<f32>,
}

impl Balance {
    /// Builds the balance of a light that consists of `pieces` and is represented by the points `samples`.
    pub fn new(pieces: &[Polygon], samples: &[AreaSample]) -> Self {
        // I(ω) = Σ max(n · ω, 0) over vectors n of length L A, for the whole light and for its samples.
        let whole = by_direction(pieces);
        let sampled: Vec<Vec3A> = samples.iter().map(|s| s.normal * luminance(s.intensity)).collect();

        // Compute the ratio at the corners of all cells. If the samples emit no light, the factor has no effect.
        let mut ratios = Vec::with_capacity((CELLS + 1) * (CELLS + 1));
        for row in 0..=CELLS {
            for column in 0..=CELLS {
                let towards = unfolded(Vec2::new(column as f32, row as f32) / CELLS as f32);
                let (whole, sampled) = (intensity(&whole, towards), intensity(&sampled, towards));
                ratios.push(if sampled > 0.0 { (whole / sampled).clamp(MOST.recip(), MOST) } else { 1.0 });
            }
        }

        // Build a bounding sphere of the light, around the mean of its corners.
        let corners = || pieces.iter().flat_map(|piece| piece.corners);
        let middle = corners().sum::<Vec3A>() / corners().count().max(1) as f32;
        let radius2 = corners().map(|corner| corner.distance_squared(middle)).fold(0.0, f32::max);
        Self { middle, radius2, ratios }
    }

    /// Returns the factor for light that arrives at `position`.
    pub fn at(&self, position: Vec3A) -> f32 {
        let way = position - self.middle;
        let d2 = way.length_squared();
        if d2 == 0.0 || !d2.is_finite() {
            return 1.0;
        }

        // Interpolate the ratio I / Iₛ bilinearly between the corners of the direction's cell.
        let place = folded(way / d2.sqrt()) * CELLS as f32;
        let cell = place.floor().clamp(Vec2::ZERO, Vec2::splat(CELLS as f32 - 1.0));
        let (u, first) = (place - cell, cell.y as usize * (CELLS + 1) + cell.x as usize);
        let row = |first: usize| self.ratios[first] * (1.0 - u.x) + self.ratios[first + 1] * u.x;
        let ratio = row(first) * (1.0 - u.y) + row(first + CELLS + 1) * u.y;

        // 1 + (I/Iₛ − 1) · d² / (d² + R²)
        1.0 + (ratio - 1.0) * d2 / (d2 + self.radius2)
    }
}

/// Returns I(ω) of faces with normals n of length L A.
fn intensity(sides: &[Vec3A], towards: Vec3A) -> f32 {
    sides.iter().map(|side| side.dot(towards).max(0.0)).sum()
}

/// Returns sums Σ Lₚ Aₚ nₚ over faces with similar normals, as luminance \[W·sr⁻¹\], one sum per cell of the map. A
/// light of many triangles then costs no more than a light of few.
fn by_direction(pieces: &[Polygon]) -> Vec<Vec3A> {
    // Assign each face to the cell of its normal. A double-sided piece has two faces.
    let mut sums = vec![Vec3A::ZERO; CELLS * CELLS];
    let mut add = |side: Vec3A| {
        if let Some(normal) = side.try_normalize() {
            let cell = (folded(normal) * CELLS as f32).clamp(Vec2::ZERO, Vec2::splat(CELLS as f32 - 1.0));
            sums[cell.y as usize * CELLS + cell.x as usize] += side;
        }
    };
    for piece in pieces {
        let side = piece.normal * (piece.area() * luminance(piece.radiance));
        add(side);
        if piece.double_sided {
            add(-side);
        }
    }

    // Drop empty cells, which are most cells for a flat light.
    sums.retain(|&sum| sum != Vec3A::ZERO);
    sums
}

/// Maps a unit vector to the unit square: projects it onto the octahedron |x| + |y| + |z| = 1 and folds the lower half
/// out to the corners.
fn folded(direction: Vec3A) -> Vec2 {
    // Project onto the octahedron. Seen from above, the upper half is a diamond with half the area of the square −1…1.
    let d = direction / (direction.x.abs() + direction.y.abs() + direction.z.abs());
    let upper = Vec2::new(d.x, d.y);

    // Mirror the lower half at the sides of the diamond, into the corners.
    let place =
        if d.z >= 0.0 { upper } else { (Vec2::ONE - Vec2::new(d.y.abs(), d.x.abs())) * Vec2::ONE.copysign(upper) };
    place * 0.5 + 0.5
}

/// Returns the inverse of [`folded`].
fn unfolded(place: Vec2) -> Vec3A {
    let p = place * 2.0 - 1.0;
    let z = 1.0 - p.x.abs() - p.y.abs();
    let upper = if z >= 0.0 { p } else { (Vec2::ONE - Vec2::new(p.y.abs(), p.x.abs())) * Vec2::ONE.copysign(p) };
    upper.extend(z).to_vec3a().normalize()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::{sobol_point, uniform_sphere};
    use glam::Vec3;

    #[test]
    fn the_octahedron_folds_and_unfolds() {
        for k in 0..500 {
            let direction = Vec3A::from(uniform_sphere(sobol_point(k)));
            assert!(unfolded(folded(direction)).distance(direction) < 1e-5, "{direction}");
        }
    }

    /// A few points on a finely tessellated sphere emit as evenly as the sphere: E = π L R² / d² at a distant receiver
    /// that faces the light.
    #[test]
    fn few_points_of_a_sphere_shine_like_the_sphere() {
        let (radius, pieces_count, samples_count) = (0.5, 4000, 64);
        let area = 4.0 * std::f32::consts::PI * radius * radius;
        let pieces: Vec<Polygon> = (0..pieces_count).map(|k| piece(k, radius, area / pieces_count as f32)).collect();
        let samples: Vec<AreaSample> = (0..samples_count)
            .map(|k| {
                let normal = Vec3A::from(uniform_sphere(sobol_point(7 * k + 1)));
                let share = area / samples_count as f32;
                AreaSample {
                    position: normal * radius,
                    offset: 0.0,
                    normal,
                    intensity: Vec3::splat(share),
                    area: share,
                }
            })
            .collect();
        let balance = Balance::new(&pieces, &samples);
        let (mut worst, mut worst_alone) = (0.0f32, 0.0f32);
        for k in 0..200 {
            let direction = Vec3A::from(uniform_sphere(sobol_point(1000 + k)));
            let sum: f32 = samples.iter().map(|s| s.intensity.x * s.normal.dot(direction).max(0.0)).sum();
            let expected = std::f32::consts::PI * radius * radius;
            worst_alone = worst_alone.max((sum / expected - 1.0).abs());
            worst = worst.max((sum * balance.at(direction * 1000.0) / expected - 1.0).abs());
        }
        assert!(worst < 0.01 && worst_alone > 0.02, "{worst} with balance, {worst_alone} without");
    }

    /// Returns a small square on a sphere.
    fn piece(k: u64, radius: f32, area: f32) -> Polygon {
        let normal = Vec3A::from(uniform_sphere(sobol_point(k)));
        let (x, y) = crate::sampling::frame(normal.into());
        let half = area.sqrt() / 2.0;
        let corner = |sx: f32, sy: f32| normal * radius + Vec3A::from(x * (sx * half) + y * (sy * half));
        Polygon {
            corners: [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)],
            normal,
            double_sided: false,
            radiance: Vec3::ONE,
        }
    }
}
