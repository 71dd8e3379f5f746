//! Seam optimization: texels on both sides of a seam get the same light.
//!
//! Texels of two charts are in different places on a common edge, so interpolated light jumps there. The smallest
//! corrections of texels at seams remove the jumps, in the least-squares sense [Iwanicki13]:
//!
//! ```text
//! minimize  Σ s (Σ w e − Σ w' e')² + Σ r (e − b)²
//!
//! s       strength of a seam point, proportional to the length it represents
//! w, w'   bilinear weights of the texels on the two sides of the seam
//! e, b    corrected and baked irradiance of a texel [W·m⁻²]
//! r       weight of a baked value: 1, or less for a texel filled from its neighbors
//! ```
//!
//! Edges with an angle are no seams, and a wall along an edge keeps both sides apart.

use super::inside::Places;
use glam::{DVec3, Vec3, Vec3A};
use rayon::prelude::*;
use render_core::{Accelerator, SeamPoint, ShadingPoint};

/// Strength of a seam per texel of its length.
const STRENGTH: f64 = 256.0;
/// Weight of the light of a texel that was filled from its neighbors.
const OF_FILLED: f64 = 0.05;
/// Number of conjugate gradient steps.
const STEPS: usize = 100;
/// Distance between the seam and the points that must see each other across it, along and above the surface \[texels\].
const ACROSS: f32 = 0.25;
/// Index of a texel that is at no seam.
const NONE: u32 = u32::MAX;

/// Makes the light on both sides of the seams of `places` agree. `points` has no point for filled texels.
pub(super) fn close(places: &Places, points: &[Option<ShadingPoint>], lights: [&mut [[f32; 3]]; 2]) {
    let width = ACROSS / places.atlas.texels_per_meter();
    let accelerator = &*places.frame.accelerator;
    let seams = places.atlas.seams(places.surfaces);
    let seams: Vec<SeamPoint> = seams.into_par_iter().filter(|point| is_open(accelerator, point, width)).collect();
    let system = System::new(&seams, points.len(), |texel| if points[texel].is_some() { 1.0 } else { OF_FILLED });
    for light in lights {
        system.correct(light);
    }
}

/// Returns whether nothing separates the two sides of a seam at a point. `width` is the distance from the seam \[m\].
fn is_open(accelerator: &Accelerator, point: &SeamPoint, width: f32) -> bool {
    let [from, to]: [Vec3A; 2] = [0, 1]
        .map(|k| &point.sides[k])
        .map(|side| side.site.position + (side.inward + side.site.geometric_normal) * width);
    !accelerator.occluded(from, to)
}

/// Difference of the light across a seam, as a weighted sum over unknowns.
struct Jump {
    /// Four unknowns on one side of the seam, and four on the other.
    unknowns: [u32; 8],
    /// Bilinear weights; negative on the other side.
    weights: [f64; 8],
    strength: f64,
}

impl Jump {
    fn across(&self, values: &[DVec3]) -> DVec3 {
        let terms = self.unknowns.iter().zip(&self.weights);
        terms.map(|(&unknown, &weight)| values[unknown as usize] * weight).sum()
    }
}

/// Least-squares system for the texels at seams.
struct System {
    /// Texel of each unknown.
    texels: Vec<u32>,
    /// Weights of the baked values, by unknown.
    weights: Vec<f64>,
    jumps: Vec<Jump>,
}

impl System {
    /// Builds the system for an atlas with `count` texels. `weight_of` returns the weight of a texel's baked value.
    fn new(seams: &[SeamPoint], count: usize, weight_of: impl Fn(usize) -> f64) -> Self {
        let mut system = Self { texels: Vec::new(), weights: Vec::new(), jumps: Vec::with_capacity(seams.len()) };
        let mut unknowns = vec![NONE; count];
        for SeamPoint { sides: [one, other], length } in seams {
            let mut jump = Jump { unknowns: [0; 8], weights: [0.0; 8], strength: STRENGTH * f64::from(*length) };
            let texels = one.blend.texels.into_iter().chain(other.blend.texels);
            let weights = one.blend.weights.into_iter().chain(other.blend.weights.map(|weight| -weight));
            for (k, (texel, weight)) in texels.zip(weights).enumerate() {
                // Assign unknowns in the order of seam points.
                let unknown = &mut unknowns[texel as usize];
                if *unknown == NONE {
                    *unknown = system.texels.len() as u32;
                    system.texels.push(texel);
                    system.weights.push(weight_of(texel as usize));
                }
                (jump.unknowns[k], jump.weights[k]) = (*unknown, f64::from(weight));
            }
            system.jumps.push(jump);
        }
        system
    }

    /// Corrects the light of the texels \[W·m⁻²\].
    fn correct(&self, light: &mut [[f32; 3]]) {
        let baked: Vec<DVec3> = self.texels.iter().map(|&texel| Vec3::from(light[texel as usize]).as_dvec3()).collect();
        let corrections = self.corrections(&baked);
        for ((&texel, baked), correction) in self.texels.iter().zip(&baked).zip(corrections) {
            let corrected = (*baked + correction).max(DVec3::ZERO).as_vec3();
            // Keep the baked light if it or its surroundings are not finite.
            if corrected.is_finite() {
                light[texel as usize] = corrected.to_array();
            }
        }
    }

    /// Returns the corrections by conjugate gradients, preconditioned by the diagonal, in a fixed order.
    fn corrections(&self, baked: &[DVec3]) -> Vec<DVec3> {
        let count = self.texels.len();
        let mut diagonal = self.weights.clone();
        let mut residual = vec![DVec3::ZERO; count];
        for jump in &self.jumps {
            let across = jump.across(baked);
            for (&unknown, &weight) in jump.unknowns.iter().zip(&jump.weights) {
                diagonal[unknown as usize] += jump.strength * weight * weight;
                residual[unknown as usize] -= across * (jump.strength * weight);
            }
        }

        // Solve A x = residual, where A is the matrix of the normal equations. Channels are independent.
        let mut x = vec![DVec3::ZERO; count];
        let scaled = |residual: &[DVec3]| -> Vec<DVec3> {
            residual.iter().zip(&diagonal).map(|(value, diagonal)| *value / *diagonal).collect()
        };
        let mut direction = scaled(&residual);
        let mut energy = dot(&residual, &direction);
        for _ in 0..STEPS {
            let image = self.image(&direction);
            let step = ratio(energy, dot(&direction, &image));
            for k in 0..count {
                x[k] += step * direction[k];
                residual[k] -= step * image[k];
            }
            let next = scaled(&residual);
            let next_energy = dot(&residual, &next);
            let keep = ratio(next_energy, energy);
            for (direction, next) in direction.iter_mut().zip(next) {
                *direction = next + keep * *direction;
            }
            energy = next_energy;
        }
        x
    }

    /// Returns the product of the matrix of the normal equations and a vector.
    fn image(&self, vector: &[DVec3]) -> Vec<DVec3> {
        let mut image: Vec<DVec3> = vector.iter().zip(&self.weights).map(|(value, weight)| *value * *weight).collect();
        for jump in &self.jumps {
            let across = jump.across(vector) * jump.strength;
            for (&unknown, &weight) in jump.unknowns.iter().zip(&jump.weights) {
                image[unknown as usize] += across * weight;
            }
        }
        image
    }
}

/// Returns the sums of products, by channel.
fn dot(a: &[DVec3], b: &[DVec3]) -> DVec3 {
    a.iter().zip(b).map(|(a, b)| *a * *b).sum()
}

/// Returns a / b by channel, 0 where b is 0.
fn ratio(a: DVec3, b: DVec3) -> DVec3 {
    DVec3::select(b.cmpgt(DVec3::ZERO), a / b.max(DVec3::splat(f64::MIN_POSITIVE)), DVec3::ZERO)
}

#[cfg(test)]
mod tests {
    use super::*;
    use render_core::sampling::hash_unit;
    use render_core::scene::{Instance, Material, Mesh, Node, Scene, Transform};
    use render_core::{Atlas, Geometry, Surfaces};

    /// Returns a scene of rectangles, each a mesh of its own with a corner and two sides.
    fn rectangles(rectangles: &[[Vec3; 3]]) -> Scene {
        let mut scene = Scene { materials: vec![Material::default()], ..Scene::default() };
        for &[corner, x, y] in rectangles {
            scene.meshes.push(Mesh {
                positions: vec![corner, corner + x, corner + x + y, corner + y],
                triangles: vec![[0, 1, 2], [0, 2, 3]],
                ..Mesh::default()
            });
            scene.nodes.push(Node { name: String::new(), parent: None, rest: Transform::default() });
            scene.instances.push(Instance { node: scene.nodes.len() - 1, mesh: scene.meshes.len() - 1 });
        }
        scene
    }

    /// Returns the seams of a scene with about 400 texels, and smooth light with noise of ±30 %.
    fn noisy(scene: &Scene) -> (Atlas, Vec<SeamPoint>, Vec<[f32; 3]>) {
        let surfaces = Surfaces::new(scene, &scene.pose(0.0));
        let atlas = Atlas::new(&surfaces, 400).expect("surfaces");
        let mut light = Vec::new();
        for texel in 0..atlas.len() {
            let noise = |channel| 1.0 + 0.6 * (hash_unit(7, texel as u64, channel) - 0.5);
            light.push([noise(0), 2.0 * noise(1), 0.5 * noise(2)]);
        }
        let seams = atlas.seams(&surfaces);
        (atlas, seams, light)
    }

    /// Returns the light on one side of a seam.
    fn sampled(light: &[[f32; 3]], side: &render_core::SeamSide) -> Vec3 {
        let terms = side.blend.texels.into_iter().zip(side.blend.weights);
        terms.map(|(texel, weight)| Vec3::from(light[texel as usize]) * weight).sum()
    }

    /// Two rectangles of one plane have charts of their own. Their light agrees on both sides of the common edge, keeps
    /// its mean, and is unchanged at texels away from the edge.
    #[test]
    fn light_agrees_on_both_sides_of_a_seam() {
        let scene = rectangles(&[[Vec3::ZERO, Vec3::X, Vec3::Y], [Vec3::X, Vec3::X * 1.3, Vec3::Y]]);
        let (atlas, seams, baked) = noisy(&scene);
        assert_eq!(atlas.charts(), 2);
        let length: f32 = seams.iter().map(|point| point.length).sum();
        assert!((length / atlas.texels_per_meter() - 1.0).abs() < 1e-3, "a meter of seam: {length} texels");

        let mut light = baked.clone();
        System::new(&seams, atlas.len(), |_| 1.0).correct(&mut light);
        let jump = |light: &[[f32; 3]], point: &SeamPoint| {
            let [one, other] = point.sides.each_ref().map(|side| sampled(light, side));
            ((one - other) / one).abs().max_element()
        };
        let worst = |light: &[[f32; 3]]| seams.iter().map(|point| jump(light, point)).fold(0.0, f32::max);
        assert!(worst(&baked) > 0.1 && worst(&light) < 0.01, "{} and {}", worst(&baked), worst(&light));

        let mut at_seam = vec![false; atlas.len()];
        for side in seams.iter().flat_map(|point| &point.sides) {
            side.blend.texels.iter().for_each(|&texel| at_seam[texel as usize] = true);
        }
        for texel in (0..atlas.len()).filter(|&texel| !at_seam[texel]) {
            assert_eq!(light[texel], baked[texel]);
        }
        let mean = |light: &[[f32; 3]]| light.iter().map(|&light| Vec3::from(light)).sum::<Vec3>();
        assert!((mean(&light) / mean(&baked) - 1.0).abs().max_element() < 0.005);
    }

    /// Conjugate gradients find the solution of the normal equations, compared with Gaussian elimination.
    #[test]
    fn corrections_solve_the_normal_equations() {
        let scene = rectangles(&[[Vec3::ZERO, Vec3::X, Vec3::Y], [Vec3::X, Vec3::X * 1.3, Vec3::Y]]);
        let (atlas, seams, light) = noisy(&scene);
        let system = System::new(&seams, atlas.len(), |texel| 0.5 + (texel % 2) as f64);
        let baked: Vec<DVec3> =
            system.texels.iter().map(|&texel| Vec3::from(light[texel as usize]).as_dvec3()).collect();
        let found = system.corrections(&baked);

        // Build the matrix by columns, and the right side: the weights times the baked light, for corrected light.
        let count = baked.len();
        let mut rows = vec![vec![0.0; count + 1]; count];
        for column in 0..count {
            let mut unit = vec![DVec3::ZERO; count];
            unit[column] = DVec3::ONE;
            for (row, value) in rows.iter_mut().zip(system.image(&unit)) {
                row[column] = value.x;
            }
            rows[column][count] = system.weights[column] * baked[column].x;
        }
        for pivot in 0..count {
            let (above, below) = rows.split_at_mut(pivot + 1);
            let above = &above[pivot];
            for row in below {
                let factor = row[pivot] / above[pivot];
                row.iter_mut().zip(above).for_each(|(value, above)| *value -= factor * above);
            }
        }
        let mut wanted = vec![0.0; count];
        for row in (0..count).rev() {
            let known: f64 = (row + 1..count).map(|column| rows[row][column] * wanted[column]).sum();
            wanted[row] = (rows[row][count] - known) / rows[row][row];
        }
        for ((correction, baked), wanted) in found.iter().zip(&baked).zip(wanted) {
            assert!((baked.x + correction.x - wanted).abs() < 1e-3, "{} for {wanted}", baked.x + correction.x);
        }
    }

    /// An edge of 90°, a surface that faces the other way, and surfaces apart have no seam.
    #[test]
    fn creases_are_no_seams() {
        let other = [
            [Vec3::X, -Vec3::Z, Vec3::Y],
            [Vec3::X, Vec3::Z, Vec3::Y],
            [Vec3::X * 2.0, -Vec3::X, Vec3::Y],
            [Vec3::X * 1.1, Vec3::X, Vec3::Y],
        ];
        for other in other {
            let (_, seams, _) = noisy(&rectangles(&[[Vec3::ZERO, Vec3::X, Vec3::Y], other]));
            assert!(seams.is_empty(), "{other}: {} points", seams.len(), other = other[0]);
        }
    }

    /// A wall on the seam keeps the sides apart.
    #[test]
    fn a_wall_closes_a_seam() {
        let floor = [[Vec3::ZERO, Vec3::X, -Vec3::Z], [Vec3::X, Vec3::X, -Vec3::Z]];
        let wall = [Vec3::X, Vec3::Z * -0.5, Vec3::Y];
        for (parts, open) in [(floor.to_vec(), 1.0), ([&floor[..], &[wall]].concat(), 0.5)] {
            let scene = rectangles(&parts);
            let accelerator = Geometry::new(&scene).place(&scene.pose(0.0));
            let (atlas, seams, _) = noisy(&scene);
            let width = ACROSS / atlas.texels_per_meter();
            let kept: f32 =
                seams.iter().filter(|point| is_open(&accelerator, point, width)).map(|point| point.length).sum();
            assert!((kept / atlas.texels_per_meter() - open).abs() < 0.05, "{kept} texels");
        }
    }
}
