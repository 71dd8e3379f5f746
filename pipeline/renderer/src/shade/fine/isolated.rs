//! Indirect light of isolated points: pixels much darker or brighter than all similar pixels around them.
//!
//! Indirect light varies slowly along a surface. Where surfaces cross, a pixel's center may be in a crack that is narrower
//! than the pixel. Such a pixel is an isolated point of wrong brightness, and its further samples would reuse its light.
//!
//! ```text
//! E(p) = mean of E(q)     if E(p) < min E(q) / FACTOR or E(p) > max E(q) · FACTOR
//!
//!   E = L / ρ  irradiance, up to π       q  at least LEAST pixels around p with a similar surface
//! ```
//! Pixels in lines have neighbors in the same line, so creases and edges are unchanged.

use glam::{Vec3, Vec3A};
use plane::Plane;
use rayon::prelude::*;
use render_core::{GBuffer, PixelSurface, luminance};

/// Ratio of irradiance beyond which a point is isolated.
const FACTOR: f32 = 1.6;
/// Minimum number of similar pixels around a point.
const LEAST: usize = 5;
/// Minimum cosine of the angle between the normals of similar pixels.
const ALIKE_COSINE: f32 = 0.8;
/// Maximum ratio of the depths of similar pixels, above 1.
const ALIKE_DEPTH: f32 = 0.02;
/// Minimum albedo from which irradiance is derived.
const LEAST_ALBEDO: f32 = 0.02;

/// Gives isolated points in the `indirect` light of `matte` surfaces the mean irradiance of the pixels around them.
pub(in crate::shade) fn even_out_points(indirect: &mut Plane<Vec3>, matte: &GBuffer) {
    let (width, pixels) = (indirect.width(), matte.pixels.samples());
    let found: Vec<(usize, Vec3)> = (0..pixels.len())
        .into_par_iter()
        .filter(|&index| has_albedo(&pixels[index]))
        .filter_map(|index| Some((index, replacement(indirect, matte, index % width, index / width)?)))
        .collect();
    for (index, light) in found {
        indirect.samples_mut()[index] = light;
    }
}

/// Returns the light of the pixel (x, y) by the irradiance around it if the pixel is an isolated point.
fn replacement(indirect: &Plane<Vec3>, matte: &GBuffer, x: usize, y: usize) -> Option<Vec3> {
    let irradiance =
        |x, y| indirect.get(x, y) / Vec3::from(matte.pixels.get(x, y).albedo).max(Vec3::splat(LEAST_ALBEDO));
    let own = matte.pixels.get(x, y);
    // Compare with the similar pixels around.
    let (mut sum, mut count) = (Vec3::ZERO, 0);
    let (mut least, mut most) = (f32::INFINITY, 0.0f32);
    for row in y.saturating_sub(1)..(y + 2).min(indirect.height()) {
        for column in x.saturating_sub(1)..(x + 2).min(indirect.width()) {
            let other = matte.pixels.get(column, row);
            if (column, row) != (x, y) && has_albedo(&other) && is_alike(&own, &other) {
                let around = irradiance(column, row);
                (sum, count) = (sum + around, count + 1);
                (least, most) = (least.min(luminance(around)), most.max(luminance(around)));
            }
        }
    }
    let here = luminance(irradiance(x, y));
    let is_isolated = count >= LEAST && (here < least / FACTOR || here > most * FACTOR);
    is_isolated.then(|| sum / count as f32 * Vec3::from(own.albedo))
}

fn has_albedo(pixel: &PixelSurface) -> bool {
    pixel.reflects() && luminance(pixel.albedo.into()) >= LEAST_ALBEDO
}

fn is_alike(a: &PixelSurface, b: &PixelSurface) -> bool {
    let cosine = Vec3A::from(a.shading_normal).dot(b.shading_normal.into());
    let (near, far) = (a.depth.min(b.depth), a.depth.max(b.depth));
    cosine >= ALIKE_COSINE && far <= near * (1.0 + ALIKE_DEPTH)
}

#[cfg(test)]
mod tests {
    use super::*;
    use render_core::scene::{Projection, View};

    /// Builds a wall of gray pixels, and one of each `color` at its index.
    fn wall(side: usize, colors: &[(usize, [f32; 3])]) -> GBuffer {
        let gray = PixelSurface {
            shading_normal: [0.0, 0.0, 1.0],
            albedo: [0.5; 3],
            depth: 1.0,
            instance: 0,
            ..PixelSurface::EMPTY
        };
        let mut pixels = Plane::filled(side, side, gray);
        for &(index, albedo) in colors {
            pixels.samples_mut()[index].albedo = albedo;
        }
        let view = View::new(glam::Affine3A::IDENTITY, Projection::Perspective { yfov: 1.0 }, side, side);
        let nothing = || std::sync::Arc::from(Vec::new());
        GBuffer {
            pixels,
            view,
            world: Vec::new(),
            deformed: Vec::new(),
            layered: nothing(),
            through: std::sync::Arc::from(Vec::new()),
        }
    }

    /// A dark point and a bright point get the light of the wall, in their own colors. Lines, smooth gradients and pairs
    /// of points are unchanged.
    #[test]
    fn isolated_points_get_the_light_around_them() {
        let side = 16;
        let (dark, bright, line) = (3 * side + 4, 8 * side + 9, 12);
        let color = [0.25, 0.5, 0.1];
        let seen = wall(side, &[(bright, color)]);
        // The gradient is 10 % a pixel.
        let smooth = |index: usize| Vec3::splat(0.5 * 1.1f32.powi((index % side) as i32));
        let mut light = Plane::from_fn(side, side, |x, y| smooth(y * side + x));
        for x in 0..side {
            *light.row_mut(line).get_mut(x).unwrap() = Vec3::splat(1e-3);
        }
        let pair = [5 * side + 12, 5 * side + 13];
        let lines = light.clone();
        for (index, value) in [(dark, Vec3::splat(1e-3)), (bright, Vec3::splat(30.0))] {
            light.samples_mut()[index] = value;
        }
        pair.iter().for_each(|&index| light.samples_mut()[index] = Vec3::splat(1e-3));

        even_out_points(&mut light, &seen);
        for index in 0..side * side {
            let (got, expected) = (light.samples()[index], lines.samples()[index]);
            match index {
                _ if pair.contains(&index) => assert_eq!(got, Vec3::splat(1e-3)),
                _ if index == dark => assert!((got / expected - 1.0).abs().max_element() < 0.02, "{got} {expected}"),
                _ if index == bright => {
                    let expected = expected * 2.0 * Vec3::from(color);
                    assert!((got / expected - 1.0).abs().max_element() < 0.02, "{got} {expected}");
                }
                _ => assert_eq!(got, expected, "pixel {index}"),
            }
        }
    }
}
