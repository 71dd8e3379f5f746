//! Change of the light on visible static surfaces by dynamic objects.
//!
//! The change is smooth except near contacts. It is computed at every 16th pixel and row, and interpolated where the
//! values around a pixel agree. Elsewhere, the distance is halved until it is a single pixel.

use super::movers::Directions;
use super::texel_light::{MOST_FOLLOWED, TexelLight};
use crate::shade::layer::Visible;
use crate::shade::macroblock::{by_macroblock, places};
use crate::shade::visibility::receiver;
use glam::{Vec2, Vec3, Vec3A};
use plane::Plane;
use render_core::{PixelSurface, Timed, luminance};
use std::f32::consts::PI;

/// Directions per pixel.
const DIRECTIONS: Directions = Directions { around: 32, hemisphere: 32, follows: MOST_FOLLOWED, shift: Vec2::ZERO };
/// Maximum distance between pixels with computed values \[pixels\]; a power of two.
const COARSEST: usize = 16;
/// Maximum difference between interpolated values at the largest step, as a fraction of the pixel's light.
const AGREE: f32 = 0.02;
/// Minimum reflectance in conversions of radiance to irradiance.
const LEAST_REFLECTANCE: f32 = 0.05;
/// Minimum cosine between the normals of pixels that share values.
const ALIKE_COSINE: f32 = 0.95;

/// Change of the irradiance at a pixel \[W·m⁻²\]; `None` where it is not computed.
type Change = Option<[f32; 3]>;

/// Change between computed values.
struct Interpolated {
    /// Interpolated change \[W·m⁻²\].
    change: Vec3,
    /// Largest difference in luminance between the values \[W·m⁻²\].
    spread: f32,
}

/// Changes of a frame's irradiance by dynamic objects.
pub(super) struct MoverChange<'a> {
    pub light: &'a TexelLight<'a>,
    pub visible: &'a Visible<'a>,
}

impl MoverChange<'_> {
    /// Returns the change at each pixel on a static surface \[W·m⁻²\]; zero elsewhere. `still` contains the irradiance of
    /// these surfaces without the change.
    pub fn all(&self, still: &Plane<Option<[f32; 3]>>) -> Timed<Plane<[f32; 3]>> {
        let Visible { matte, radiance, ranks, .. } = *self.visible;
        let pixels = &matte.pixels;
        let (width, height) = (pixels.width(), pixels.height());
        let is_static = |x, y| still.get(x, y).is_some() && !self.light.moves(pixels.get(x, y).instance);
        // Compare changes with all light that arrives at a pixel: direct light is known already.
        let arriving = |x, y| {
            let albedo = luminance(pixels.get(x, y).albedo.into()).max(LEAST_REFLECTANCE);
            let direct = PI / albedo * luminance(radiance.get(x, y));
            direct + still.get(x, y).map_or(0.0, |light| luminance(light.into()))
        };

        // Refine the lattice: interpolate the values of each step from the step before, or compute them.
        let mut known = Timed { value: Plane::filled(width, height, None), seconds: 0.0 };
        let mut step = COARSEST;
        while step >= 1 {
            // Errors at smaller steps concern fewer pixels.
            let agree = AGREE * (COARSEST as f32 / step as f32).sqrt();
            let before: &Plane<Change> = &known.value;
            let of_pixel = |(x, y): (usize, usize)| -> Change {
                if before.get(x, y).is_some() || x % step != 0 || y % step != 0 || !is_static(x, y) {
                    return before.get(x, y);
                }
                let is_coarsest = step == COARSEST;
                let between = (!is_coarsest).then(|| {
                    self.between(before, [x, y], 2 * step).filter(|change| change.spread <= agree * arriving(x, y))
                });
                Some(between.flatten().map_or_else(|| self.at(&pixels.get(x, y)), |found| found.change).to_array())
            };
            let block = |(): &mut (), columns, rows| places(columns, rows).map(of_pixel).collect();
            let finer: Timed<Plane<Change>> = by_macroblock(ranks, width, height, || (), block);
            known = Timed { seconds: known.seconds + finer.seconds, ..finer };
            step /= 2;
        }
        known.map(|changes| changes.map(Option::unwrap_or_default))
    }

    /// Interpolates a pixel's change between the computed values around it. Returns `None` if their surfaces differ.
    fn between(&self, lattice: &Plane<Change>, [x, y]: [usize; 2], step: usize) -> Option<Interpolated> {
        let pixels = &self.visible.matte.pixels;
        let own = pixels.get(x, y);
        let normal = Vec3A::from(own.shading_normal);
        let reach = step as f32 * self.visible.matte.view.pixel_width(own.depth);

        let (left, top) = (x - x % step, y - y % step);
        let (fx, fy) = ((x % step) as f32 / step as f32, (y % step) as f32 / step as f32);
        let (mut sum, mut low, mut high) = (Vec3::ZERO, f32::INFINITY, f32::NEG_INFINITY);
        for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            let weight = (if dx == 1 { fx } else { 1.0 - fx }) * (if dy == 1 { fy } else { 1.0 - fy });
            if weight == 0.0 {
                continue;
            }
            let (column, row) = (left + step * dx, top + step * dy);
            if column >= pixels.width() || row >= pixels.height() {
                return None;
            }
            // Require a surface with the same normal in about the same plane.
            let change = Vec3::from(lattice.get(column, row)?);
            let other = pixels.get(column, row);
            let way = Vec3A::from(other.position) - Vec3A::from(own.position);
            if normal.dot(other.shading_normal.into()) < ALIKE_COSINE || way.dot(normal).abs() > reach {
                return None;
            }
            sum += weight * change;
            (low, high) = (low.min(luminance(change)), high.max(luminance(change)));
        }
        Some(Interpolated { change: sum, spread: high - low })
    }

    /// Computes the change at the surface of a pixel \[W·m⁻²\].
    fn at(&self, pixel: &PixelSurface) -> Vec3 {
        let receiver = receiver(pixel, self.light.frame.epsilon);
        // A visible point is outside of objects, except for rounding errors at a contact.
        if self.light.is_within(&receiver) {
            return Vec3::ZERO;
        }
        self.light.change_at(&receiver, DIRECTIONS)
    }
}
