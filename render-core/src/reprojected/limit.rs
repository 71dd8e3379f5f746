//! Pictures with a limited number of lit pixels: the choice of these pixels, and the light of all others.
//!
//! | pixel | order of lighting | light until then |
//! |---|---|---|
//! | with reprojected light | by its error in tolerances, largest first | the reprojected light |
//! | without | first on a lattice of every fourth pixel, then of every second | the weighted mean of lit pixels around it |

use super::trust::LARGEST;
use crate::gbuffer::{GBuffer, PixelSurface};
use crate::{Busy, Timed};
use glam::{Vec3, Vec3A};
use plane::Plane;
use rayon::prelude::*;

/// Steps of the lattices of pixels without light, with the order of their pixels as an error in tolerances.
const LATTICES: [(usize, f32); 3] = [(4, f32::INFINITY), (2, 2.0 * LARGEST), (1, LARGEST)];
/// Maximum horizontal and vertical distance of pixels whose light a pixel shares \[pixels\].
const REACH: usize = 4;
/// Weight of another surface, relative to the weight of the same one. Its light is better than none.
const OTHER_SURFACE: f32 = 1e-3;
/// Minimum cosine between the normals of one surface.
const ALIKE_COSINE: f32 = 0.9;
/// Maximum distance of a point off the plane of the same surface, as a fraction of its depth.
const OFF_PLANE: f32 = 0.01;
/// Maximum number of rounds in which light spreads by [`REACH`]. Farther pixels have the mean light of the picture.
const ROUNDS: usize = 8;
/// Number of pixels per thread task.
const CHUNK: usize = 256;

/// Pixel that should be lit.
#[derive(Clone, Copy, Debug)]
pub(super) struct OpenPixel {
    /// Index in raster order.
    pub index: u32,
    /// Error of its light, in tolerances.
    pub error: f32,
    /// Whether no light was reprojected.
    pub is_bare: bool,
    /// Whether later pictures may reuse light that is computed for this pixel.
    pub is_kept: bool,
}

impl OpenPixel {
    /// Returns a pixel with reprojected light.
    pub fn coarse(index: u32, error: f32) -> Self {
        // NaN is 0/0, which is no error.
        Self { index, error: if error.is_nan() { 0.0 } else { error }, is_bare: false, is_kept: true }
    }

    /// Returns a pixel without light, in a picture of this `width`.
    pub fn bare(x: usize, y: usize, width: usize) -> Self {
        let is_on = |&(step, _): &(usize, f32)| x % step == step / 2 && y % step == step / 2;
        let (_, error) = LATTICES.into_iter().find(is_on).expect("the last lattice has all pixels");
        Self { index: (y * width + x) as u32, error, is_bare: true, is_kept: true }
    }

    /// Returns the order of pixels with equal errors, which scatters them over the picture.
    fn turn(&self) -> u32 {
        self.index.wrapping_mul(0x9e37_79b1).reverse_bits()
    }
}

/// Keeps at most `most` of the open `pixels` as `missing`: those with the largest errors. Returns the number of other
/// pixels whose light would be kept, and the indices of all those without light, ascending.
pub(super) fn choose(mut pixels: Vec<OpenPixel>, most: usize, missing: &mut Plane<bool>) -> (usize, Vec<u32>) {
    if pixels.len() <= most {
        return (0, Vec::new());
    }
    let by_error = |a: &OpenPixel, b: &OpenPixel| b.error.total_cmp(&a.error).then(a.turn().cmp(&b.turn()));
    pixels.select_nth_unstable_by(most, by_error);
    let open = &pixels[most..];
    let (mut bare, mut kept) = (Vec::new(), 0);
    for pixel in open {
        missing.samples_mut()[pixel.index as usize] = false;
        kept += usize::from(pixel.is_kept);
        if pixel.is_bare {
            bare.push(pixel.index);
        }
    }
    bare.sort_unstable();
    (kept, bare)
}

/// Sets the light of the `bare` pixels to the weighted mean of the lit pixels around them. Other pixels with indices for
/// which `has_light` is true are lit. Surfaces are `seen`.
pub fn spread(
    light: &mut Plane<[f32; 3]>,
    bare: &[u32],
    seen: &GBuffer,
    has_light: impl Fn(usize) -> bool,
) -> Timed<()> {
    Timed::of(|busy| {
        if !bare.is_empty() {
            spread_measured(light, bare, seen, has_light, busy);
        }
    })
}

fn spread_measured(
    light: &mut Plane<[f32; 3]>,
    bare: &[u32],
    seen: &GBuffer,
    has_light: impl Fn(usize) -> bool,
    busy: &Busy,
) {
    let mut is_lit: Vec<bool> = (0..light.samples().len()).map(has_light).collect();
    for &index in bare {
        is_lit[index as usize] = false;
    }
    let (mut mean, mut count, mut lit) = (Vec3::ZERO, 0, LitPixels::none(light.width(), light.height()));
    for (index, (&light, _)) in light.samples().iter().zip(&is_lit).enumerate().filter(|(_, (_, is_lit))| **is_lit) {
        mean += Vec3::from(light);
        count += 1;
        lit.insert(index);
    }
    mean /= count.max(1) as f32;

    // Each round reads the light of earlier rounds only, so the order of pixels does not matter.
    let mut left = bare.to_vec();
    for _ in 0..ROUNDS {
        let around = |pixels: &[u32]| {
            let of_pixel = |&index: &u32| around(light, seen, &lit, index as usize);
            busy.measure(|| pixels.iter().map(of_pixel).collect::<Vec<_>>())
        };
        let found: Vec<Option<Vec3>> = left.par_chunks(CHUNK).flat_map_iter(around).collect();
        let mut without = Vec::new();
        for (&index, found) in left.iter().zip(found) {
            match found {
                Some(found) => {
                    light.samples_mut()[index as usize] = found.to_array();
                    lit.insert(index as usize);
                }
                None => without.push(index),
            }
        }
        left = without;
        if left.is_empty() {
            break;
        }
    }
    for index in left {
        light.samples_mut()[index as usize] = mean.to_array();
    }
}

/// Returns the weighted mean light of the lit pixels around the pixel `index`; `None` without such pixels.
fn around(light: &Plane<[f32; 3]>, seen: &GBuffer, lit: &LitPixels, index: usize) -> Option<Vec3> {
    let (width, height) = (light.width(), light.height());
    let (x, y) = (index % width, index / width);
    let pixel = seen.pixels.samples()[index];
    let (mut sum, mut weights) = (Vec3::ZERO, 0.0);
    for v in y.saturating_sub(REACH)..(y + REACH + 1).min(height) {
        let mut columns = lit.around(x, v);
        while columns != 0 {
            let u = x + columns.trailing_zeros() as usize - REACH;
            columns &= columns - 1;
            let other = v * width + u;
            let distance2 = (u.abs_diff(x).pow(2) + v.abs_diff(y).pow(2)) as f32;
            let is_same = is_same_surface(&pixel, &seen.pixels.samples()[other]);
            let weight = if is_same { 1.0 } else { OTHER_SURFACE } / distance2;
            sum += Vec3::from(light.samples()[other]) * weight;
            weights += weight;
        }
    }
    (weights > 0.0).then(|| sum / weights)
}

/// Set of the lit pixels, with one bit per pixel: few of the pixels around a pixel are lit.
struct LitPixels {
    width: usize,
    /// Rows of bits. Each row begins with [`REACH`] zeros, and ends with at least as many.
    words: Vec<u64>,
    words_per_row: usize,
}

impl LitPixels {
    fn none(width: usize, height: usize) -> Self {
        // The last word is read together with the next one.
        let words_per_row = (width + 2 * REACH).div_ceil(64) + 1;
        Self { width, words: vec![0; words_per_row * height], words_per_row }
    }

    /// Adds the pixel `index` (raster order).
    fn insert(&mut self, index: usize) {
        let (bit, row) = (index % self.width + REACH, index / self.width);
        self.words[row * self.words_per_row + bit / 64] |= 1 << (bit % 64);
    }

    /// Returns the mask of the lit pixels in the columns from `x` − [`REACH`] to `x` + [`REACH`] of `row`.
    #[inline]
    fn around(&self, x: usize, row: usize) -> u64 {
        let word = row * self.words_per_row + x / 64;
        let two = u128::from(self.words[word + 1]) << 64 | u128::from(self.words[word]);
        (two >> (x % 64)) as u64 & ((1 << (2 * REACH + 1)) - 1)
    }
}

fn is_same_surface(a: &PixelSurface, b: &PixelSurface) -> bool {
    let normal = Vec3A::from(a.shading_normal);
    let way = Vec3A::from(b.position) - Vec3A::from(a.position);
    a.instance == b.instance
        && normal.dot(b.shading_normal.into()) >= ALIKE_COSINE
        && way.dot(normal).abs() <= OFF_PLANE * a.depth
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::hash;

    #[test]
    fn lit_pixels_around_a_pixel_are_those_in_reach() {
        let (width, height) = (131, 3);
        let is_lit = |x: usize, y: usize| hash(5, x as u64, y as u64).is_multiple_of(3);
        let mut lit = LitPixels::none(width, height);
        (0..width * height).filter(|k| is_lit(k % width, k / width)).for_each(|k| lit.insert(k));
        for (x, y) in (0..width * height).map(|k| (k % width, k / width)) {
            let bits = lit.around(x, y);
            for column in 0..=2 * REACH {
                let expected = (x + column).checked_sub(REACH).is_some_and(|u| u < width && is_lit(u, y));
                assert_eq!(bits >> column & 1 == 1, expected, "{x} {y} {column}");
            }
        }
    }

    #[test]
    fn the_largest_errors_come_first_and_lattices_before_them() {
        let mut missing = Plane::filled(8, 8, true);
        let mut pixels: Vec<OpenPixel> = (0..64).map(|k| OpenPixel::coarse(k, k as f32 / 16.0)).collect();
        for (x, y) in [(2, 2), (6, 2), (1, 3), (0, 1)] {
            pixels[y * 8 + x] = OpenPixel::bare(x, y, 8);
        }
        let (open, bare) = choose(pixels, 10, &mut missing);
        assert_eq!((open, bare), (54, vec![]), "pixels without light are chosen first");
        let chosen: Vec<usize> = (0..64).filter(|&k| missing.samples()[k]).collect();
        assert_eq!(chosen, [8, 18, 22, 25, 58, 59, 60, 61, 62, 63]);

        // Without a limit, all pixels are chosen; none are with a limit of zero.
        let all = || (0..64).map(|k| OpenPixel::bare(k % 8, k / 8, 8)).collect::<Vec<_>>();
        assert_eq!(choose(all(), 64, &mut Plane::filled(8, 8, true)), (0, vec![]));
        let (open, bare) = choose(all(), 4, &mut missing);
        assert_eq!((open, bare.len()), (60, 60));
        assert!([18, 22, 50, 54].iter().all(|index| !bare.contains(index)), "{bare:?}");
    }
}
