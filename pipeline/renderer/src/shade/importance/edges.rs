//! Edge map: pixels at outlines, creases and borders of textures, where samples differ most.
//!
//! ```text
//! E(x) = max over the 4 neighbors x' of
//!        1                                another instance, n · n' < 0.9, or |(p' − p) · n| > |p' − p| / 2
//!        max |Y − Y'| / (Y + Y')          otherwise, over reflectance and emission
//!
//! Y  luminance of the reflectance (base and coat) or of the emission      n  normal      p  position
//! ```

use glam::Vec3;
use plane::Plane;
use render_core::{GBuffer, NOTHING, PixelSurface, luminance};

/// Cosine of the smallest angle between the normals at a crease, 26°. Adjacent pixels of curved objects that are wider
/// than ten pixels differ less.
const CREASE: f32 = 0.9;
/// Sine of the smallest angle between a surface and the line to the adjacent surface at a step, 30°.
const STEP: f32 = 0.5;

/// Returns E of every pixel, 0…1.
pub(super) fn edge_map(seen: &GBuffer) -> Plane<f32> {
    let pixels = &seen.pixels;
    let (width, height) = (pixels.width(), pixels.height());
    let mut edges = Plane::filled(width, height, 0.0f32);
    for y in 0..height {
        for x in 0..width {
            // Compare each pair of neighbors once, and mark both pixels.
            for (u, v) in [(x + 1, y), (x, y + 1)] {
                if u >= width || v >= height {
                    continue;
                }
                let edge = edge_between(&pixels.get(x, y), &pixels.get(u, v));
                for (x, y) in [(x, y), (u, v)] {
                    edges.set(x, y, edges.get(x, y).max(edge));
                }
            }
        }
    }
    edges
}

/// Returns the strength of the edge between the surfaces of adjacent pixels, 0…1.
fn edge_between(one: &PixelSurface, other: &PixelSurface) -> f32 {
    if one.instance != other.instance {
        return 1.0;
    }
    // Find creases and steps; the background has neither.
    let [n, m] = [one, other].map(|pixel| Vec3::from(pixel.shading_normal));
    let across = Vec3::from(other.position) - Vec3::from(one.position);
    let is_crease = n.dot(m) < CREASE || across.dot(n).abs() > STEP * across.length();
    if one.instance != NOTHING && is_crease {
        return 1.0;
    }
    // Compare textures, and patterns of lamps or of the sky.
    let reflectance = |pixel: &PixelSurface| Vec3::from(pixel.albedo) + Vec3::from(pixel.specular);
    let emission = |pixel: &PixelSurface| Vec3::from(pixel.emission);
    contrast(reflectance(one), reflectance(other)).max(contrast(emission(one), emission(other)))
}

/// Returns the contrast of two colors' luminances, 0…1.
fn contrast(one: Vec3, other: Vec3) -> f32 {
    let [a, b] = [one, other].map(luminance);
    let sum = a + b;
    if sum > 0.0 { ((a - b).abs() / sum).min(1.0) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A floor in steps of 1 m in x, at z = `height`.
    fn floor(x: f32, height: f32) -> PixelSurface {
        let normal = [0.0, 0.0, 1.0];
        let [position, albedo] = [[x, 0.0, height], [0.5; 3]];
        PixelSurface {
            position,
            geometric_normal: normal,
            shading_normal: normal,
            albedo,
            instance: 3,
            ..PixelSurface::EMPTY
        }
    }

    #[test]
    fn edges_are_outlines_creases_steps_and_textures() {
        let first = floor(0.0, 0.0);
        let wall = PixelSurface { shading_normal: [1.0, 0.0, 0.0], ..floor(1.0, 0.0) };
        let black = PixelSurface { albedo: [0.25; 3], ..floor(1.0, 0.0) };
        for (name, other, edge) in [
            ("the same floor", floor(1.0, 0.0), 0.0),
            ("a ramp of 14°", floor(1.0, 0.25), 0.0),
            ("a step of 45°", floor(1.0, 1.0), 1.0),
            ("a wall", wall, 1.0),
            ("the background", PixelSurface::EMPTY, 1.0),
            ("half of the albedo", black, 1.0 / 3.0),
        ] {
            for (one, other) in [(&first, &other), (&other, &first)] {
                assert!((edge_between(one, other) - edge).abs() < 1e-6, "{name}");
            }
        }
        let sky = |y: f32| PixelSurface { emission: [y; 3], ..PixelSurface::EMPTY };
        assert_eq!(edge_between(&sky(1.0), &sky(3.0)), 0.5);
        assert_eq!(edge_between(&PixelSurface::EMPTY, &PixelSurface::EMPTY), 0.0);
    }
}
