//! Textures, filtered to avoid both shimmer and blur.

use super::encoding::{Encoding, unit_normal};
use crate::sampling::centered_sobol;
use glam::{Vec2, Vec3};
use rayon::prelude::*;
use std::sync::Arc;

/// Addressing of coordinates outside 0…1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Wrap {
    /// The image is tiled.
    Repeat,
    /// The image is tiled, with every other tile mirrored.
    Mirror,
    /// The border texel is repeated.
    Clamp,
}

/// Image with its mip levels, each half the size of the previous level. Copies share the texels.
#[derive(Clone, Debug)]
pub struct Texture {
    levels: Arc<[Level]>,
    wrap: [Wrap; 2],
    encoding: Encoding,
    /// Whether magnified texels have sharp borders.
    is_blocky: bool,
}

#[derive(Clone, Debug)]
struct Level {
    width: usize,
    height: usize,
    texels: Vec<[u8; 4]>,
}

/// Color and opacity of a filtered texture sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Filtered {
    /// Linear RGB color of the sample.
    pub color: Vec3,
    /// Opacity of the sample, 0…1.
    pub opacity: f32,
}

impl Texture {
    /// Builds a color texture with [`Texture::with_encoding`], in sRGB.
    ///
    /// # Panics
    /// If the size is zero or the number of texels is not `width * height`.
    #[must_use]
    pub fn new(width: usize, height: usize, texels: Vec<[u8; 4]>, wrap: [Wrap; 2]) -> Self {
        Self::with_encoding(width, height, texels, wrap, Encoding::Srgb)
    }

    /// Takes ownership of `width × height` RGBA texels and builds the mip levels. Normals get unit length first, so
    /// that only the mean of different normals is short.
    ///
    /// # Panics
    /// If the size is zero or the number of texels is not `width * height`.
    #[must_use]
    pub fn with_encoding(
        width: usize,
        height: usize,
        mut texels: Vec<[u8; 4]>,
        wrap: [Wrap; 2],
        encoding: Encoding,
    ) -> Self {
        assert!(width > 0 && height > 0 && texels.len() == width * height, "{width}x{height} texels expected");
        if encoding == Encoding::Normal {
            texels.par_iter_mut().with_min_len(1 << 14).for_each(|texel| *texel = unit_normal(*texel));
        }
        // Halve the image until one texel remains.
        let mut levels = vec![Level { width, height, texels }];
        while let Some(last) = levels.last().filter(|level| level.width > 1 || level.height > 1) {
            let half = last.half(encoding);
            levels.push(half);
        }
        Self { levels: levels.into(), wrap, encoding, is_blocky: false }
    }

    /// Returns the texture with sharp texel borders under magnification (glTF 2.0, 5.26.1: `NEAREST`), smoothed only
    /// over the footprint.
    #[must_use]
    pub fn blocky(self) -> Self {
        Self { is_blocky: true, ..self }
    }

    /// Returns a mask for distant views: a texture about half as wide and high (powers of two). The mask's opacity is
    /// the fraction of a texel's area in which this texture's opacity is at least `least`, counted at 16 points.
    #[must_use]
    pub(crate) fn coverage(&self, least: f32) -> Self {
        let Level { width, height, .. } = self.levels[0];
        // Use powers of two, so that no mip level drops a row or a column.
        let (width, height) = (width.div_ceil(2).next_power_of_two(), height.div_ceil(2).next_power_of_two());
        let step = Vec2::new(width as f32, height as f32).recip();
        let points: Vec<Vec2> = centered_sobol(16).collect();
        let mut texels = vec![[0; 4]; width * height];
        texels.par_chunks_mut(width).enumerate().for_each(|(y, row)| {
            for (x, texel) in row.iter_mut().enumerate() {
                let mut count = 0;
                for &within in &points {
                    let uv = (Vec2::new(x as f32, y as f32) + within) * step;
                    count += u32::from(self.sample(uv, 0.0).opacity >= least);
                }
                texel[3] = ((count * 255 + 8) / 16) as u8;
            }
        });
        Self::with_encoding(width, height, texels, self.wrap, Encoding::Linear)
    }

    /// Returns the size of the finest level \[texels\].
    #[must_use]
    pub fn size(&self) -> Vec2 {
        Vec2::new(self.levels[0].width as f32, self.levels[0].height as f32)
    }

    /// Returns the addressing of coordinates along both axes.
    #[must_use]
    pub fn wrap(&self) -> [Wrap; 2] {
        self.wrap
    }

    /// Returns whether magnified texels have sharp borders.
    #[must_use]
    pub fn is_blocky(&self) -> bool {
        self.is_blocky
    }

    /// Returns the texels of the finest level, as RGBA code values in rows from the top.
    #[must_use]
    pub fn texels(&self) -> &[[u8; 4]] {
        &self.levels[0].texels
    }

    /// Returns the opacity of the most transparent texel.
    pub fn least_opacity(&self) -> f32 {
        self.levels[0].texels.iter().map(|texel| f32::from(texel[3]) / 255.0).fold(1.0, f32::min)
    }

    /// Samples trilinearly. Returns linear RGB and opacity at `uv`, blurred to `footprint` texels of the finest level.
    /// Footprint 0 is a point.
    #[must_use]
    pub fn sample(&self, uv: Vec2, footprint: f32) -> Filtered {
        // Sharp texel borders apply only under magnification.
        if self.is_blocky && footprint < 1.0 {
            return self.bilinear(0, uv, footprint);
        }
        // Interpolate between the two mip levels around the footprint.
        let lod = footprint.max(1.0).log2().min((self.levels.len() - 1) as f32);
        let (fine, blend) = (lod as usize, lod.fract());
        let near = self.bilinear(fine, uv, 1.0);
        if blend == 0.0 || fine + 1 >= self.levels.len() {
            return near;
        }
        let coarse = self.bilinear(fine + 1, uv, 1.0);
        Filtered {
            color: near.color.lerp(coarse.color, blend),
            opacity: near.opacity + (coarse.opacity - near.opacity) * blend,
        }
    }

    /// Samples anisotropically. Returns linear RGB and opacity at `uv`, blurred over the ellipse with the conjugate
    /// `diameters` \[texels of the finest level\].
    ///
    /// Averages at most twelve trilinear samples along the ellipse's long axis, each blurred to the ellipse's width
    /// \[McCormack99\]. Longer ellipses are widened.
    pub fn sample_ellipse(&self, uv: Vec2, diameters: [Vec2; 2]) -> Filtered {
        let (long, narrow) = principal_axes(diameters);
        let length = long.length();
        // The negated condition is also true for NaN.
        if !(length > 1.0 && length.is_finite()) {
            return self.sample(uv, if length <= 1.0 { length } else { 1.0 });
        }
        // Widen long ellipses, so that the samples cover their length.
        let narrow = narrow.max(length / (SPACING * MOST_LOOK_UPS as f32)).max(1.0);
        let count = (length / (SPACING * narrow) - 0.25).ceil().max(1.0) as usize;
        if count == 1 {
            return self.sample(uv, narrow);
        }
        // Distribute the samples symmetrically around the center.
        let step = long / (self.size() * count as f32);
        let first = uv - step * (0.5 * (count - 1) as f32);
        let (mut color, mut opacity) = (Vec3::ZERO, 0.0);
        for k in 0..count {
            let one = self.sample(first + step * k as f32, narrow);
            color += one.color;
            opacity += one.opacity;
        }
        Filtered { color: color / count as f32, opacity: opacity / count as f32 }
    }

    /// Returns the size of the texels of all levels \[bytes\].
    #[must_use]
    pub fn byte_count(&self) -> usize {
        self.levels.iter().map(|level| size_of_val(&level.texels[..])).sum()
    }

    /// Passes all bytes on which samples depend to `visitor`, in a fixed order. Coarser levels follow from the finest
    /// level.
    pub fn visit_bytes(&self, visitor: &mut impl FnMut(&[u8])) {
        // Encode the parameters as stable numbers.
        let Level { width, height, texels } = &self.levels[0];
        let wrap = self.wrap.map(|wrap| match wrap {
            Wrap::Repeat => 0,
            Wrap::Mirror => 1,
            Wrap::Clamp => 2,
        });
        let encoding = match self.encoding {
            Encoding::Srgb => 0,
            Encoding::Linear => 1,
            Encoding::Normal => 2,
        };
        [*width, *height].iter().for_each(|&side| visitor(&(side as u64).to_le_bytes()));
        visitor(&[wrap[0], wrap[1], encoding]);
        if self.is_blocky {
            visitor(&[1]);
        }
        visitor(texels.as_flattened());
    }

    /// Returns the mean linear color.
    #[must_use]
    pub fn mean(&self) -> Vec3 {
        self.sample(Vec2::ZERO, f32::MAX).color
    }

    /// Returns the mean of a level's texels over a square of `width` texels, at most 1. Width 1 is bilinear
    /// interpolation. Width 0 returns the texel at `uv`.
    ///
    /// ```text
    /// f ← (f − ½) / width + ½,  within 0…1        f  fraction of the way from one texel center to the next
    /// ```
    fn bilinear(&self, level: usize, uv: Vec2, width: f32) -> Filtered {
        let level = &self.levels[level];
        // Find the four texels around the coordinate.
        let clamp = |c: f32, wrap: Wrap| if wrap == Wrap::Clamp { c.clamp(0.0, 1.0 - f32::EPSILON) } else { c };
        let (columns, fx) = neighbors(clamp(uv.x, self.wrap[0]), level.width, self.wrap[0]);
        let (rows, fy) = neighbors(clamp(uv.y, self.wrap[1]), level.height, self.wrap[1]);
        // Move the fraction towards the nearest texel for narrow footprints.
        let narrowed = |f: f32| ((f - 0.5) / width.max(1e-6) + 0.5).clamp(0.0, 1.0);
        let (fx, fy) = if width < 1.0 { (narrowed(fx), narrowed(fy)) } else { (fx, fy) };
        // Interpolate in linear light; opacity is linear already.
        let to_linear = self.encoding.to_linear();
        let mut color = Vec3::ZERO;
        let mut opacity = 0.0;
        for (dx, dy, weight) in
            [(0, 0, (1.0 - fx) * (1.0 - fy)), (1, 0, fx * (1.0 - fy)), (0, 1, (1.0 - fx) * fy), (1, 1, fx * fy)]
        {
            let [r, g, b, a] = level.texels[rows[dy] * level.width + columns[dx]];
            let linear = |code: u8| to_linear[code as usize];
            color += Vec3::new(linear(r), linear(g), linear(b)) * weight;
            opacity += f32::from(a) / 255.0 * weight;
        }
        Filtered { color, opacity }
    }
}

/// Maximum number of samples along the long axis of an ellipse.
const MOST_LOOK_UPS: usize = 12;
/// Distance between two samples, relative to the width of a sample. A bilinear sample is a tent two texels wide.
const SPACING: f32 = 1.5;

/// Returns the long principal diameter of the ellipse with these conjugate `diameters`, and the length of the short
/// one.
///
/// ```text
/// M Mᵀ = | p  r |    λ = (p + q ± √((p − q)² + 4 r²)) / 2 are the squares of the lengths     M  the diameters as columns
///        | r  q |
/// ```
fn principal_axes([a, b]: [Vec2; 2]) -> (Vec2, f32) {
    // Compute the eigenvalues of M Mᵀ in closed form.
    let (p, q, r) = (a.x * a.x + b.x * b.x, a.y * a.y + b.y * b.y, a.x * a.y + b.x * b.y);
    let root = ((p - q) * (p - q) + 4.0 * r * r).sqrt();
    let (most, least) = (0.5 * (p + q + root), 0.5 * (p + q - root));
    // The larger row of M Mᵀ − λ determines the direction.
    let along = if p >= q { Vec2::new(most - q, r) } else { Vec2::new(r, most - p) };
    (along.normalize_or(Vec2::X) * most.sqrt(), least.max(0.0).sqrt())
}

/// Returns the two neighbors of coordinate `c` among `n` texels in a row, and the fraction of the way from the first to
/// the second.
///
/// Uses neither division nor a call, since this function runs for every texture of every hit.
#[inline]
fn neighbors(c: f32, n: usize, wrap: Wrap) -> ([usize; 2], f32) {
    // NaN and infinity become 0: an invalid coordinate returns a texel instead of a panic.
    let c = if c.is_finite() { c } else { 0.0 };
    // Reduce to two periods, after which a mirrored texture repeats. From 2³¹ on, all `f32` coordinates are even.
    let period = if c.abs() < 2.0f32.powi(31) { c - 2.0 * floor(c * 0.5) as f32 } else { 0.0 };
    let p = period * n as f32 - 0.5;
    let first = floor(p);
    let size = n as i64;
    // The index `i` is in −1…2 n.
    let within = |i: i64| match wrap {
        Wrap::Clamp => i.clamp(0, size - 1),
        Wrap::Repeat if i < 0 => i + size,
        Wrap::Repeat if i >= 2 * size => i - 2 * size,
        Wrap::Repeat if i >= size => i - size,
        Wrap::Repeat => i,
        Wrap::Mirror if i < 0 || i >= 2 * size => 0,
        Wrap::Mirror => i.min(2 * size - 1 - i),
    };
    ([first, first + 1].map(|i| within(i) as usize), p - first as f32)
}

/// Returns the largest integer not above `x`, within the range of `i64`. `f32::floor` is a call if the target processor
/// is unspecified.
#[inline]
fn floor(x: f32) -> i64 {
    let towards_zero = x as i64;
    towards_zero - i64::from(x < towards_zero as f32)
}

impl Level {
    /// Applies a box filter in linear light. Drops the last row or column of an odd size above 1.
    fn half(&self, encoding: Encoding) -> Level {
        let to_linear = encoding.to_linear();
        let (width, height) = ((self.width / 2).max(1), (self.height / 2).max(1));
        let mut texels = Vec::with_capacity(width * height);
        for y in 0..height {
            for x in 0..width {
                let mut sum = [0.0f32; 4];
                // Average four texels in linear light; opacity is linear already.
                for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                    let column = (2 * x + dx).min(self.width - 1);
                    let row = (2 * y + dy).min(self.height - 1);
                    let texel = self.texels[row * self.width + column];
                    for c in 0..3 {
                        sum[c] += to_linear[texel[c] as usize];
                    }
                    sum[3] += f32::from(texel[3]);
                }
                texels.push([
                    encoding.code(sum[0] / 4.0),
                    encoding.code(sum[1] / 4.0),
                    encoding.code(sum[2] / 4.0),
                    (sum[3] / 4.0 + 0.5) as u8,
                ]);
            }
        }
        Level { width, height, texels }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn checker() -> Texture {
        let texels = (0..16).map(|i| if (i % 4 + i / 4) % 2 == 0 { [255; 4] } else { [0, 0, 0, 255] }).collect();
        Texture::new(4, 4, texels, [Wrap::Repeat; 2])
    }

    #[test]
    fn texel_centers_are_exact_and_tile() {
        let texture = checker();
        let Filtered { color, opacity: alpha } = texture.sample(Vec2::new(0.125, 0.125), 1.0);
        assert_eq!((color, alpha), (Vec3::ONE, 1.0));
        assert_eq!(texture.sample(Vec2::new(0.375, 0.125), 1.0).color, Vec3::ZERO);
        assert_eq!(texture.sample(Vec2::new(-0.875, 3.125), 1.0).color, Vec3::ONE);
    }

    #[test]
    fn far_away_a_checker_is_gray_in_linear_light() {
        let mean = checker().mean();
        assert!((mean.x - 0.5).abs() < 0.01, "{mean}");
    }

    /// The principal axes match the longest and shortest diameter found by rotation through all directions.
    #[test]
    fn principal_axes_are_the_longest_and_the_shortest_diameter() {
        for k in 0..200u32 {
            let of = |i: u32| ((k * 4 + i) as f32 * 0.618_034).fract() * 4.0 - 2.0;
            let (a, b) = (Vec2::new(of(0), of(1)), Vec2::new(of(2), of(3)) * if k % 3 == 0 { 0.01 } else { 1.0 });
            let (long, narrow) = principal_axes([a, b]);
            let diameters = (0..36_000).map(|i| {
                let (sin, cos) = (i as f32 / 36_000.0 * std::f32::consts::PI).sin_cos();
                a * cos + b * sin
            });
            let longest = diameters.clone().max_by(|x, y| x.length().total_cmp(&y.length())).unwrap();
            let shortest = diameters.map(Vec2::length).min_by(f32::total_cmp).unwrap();
            assert!((long.length() - longest.length()).abs() < 1e-3, "{a} {b}: {long} for {longest}");
            assert!((narrow - shortest).abs() < 2e-3, "{a} {b}: {narrow} for {shortest}");
            if longest.length() > 1.1 * shortest {
                assert!(
                    long.perp_dot(longest).abs() < 0.01 * longest.length_squared(),
                    "{a} {b}: {long} for {longest}"
                );
            }
        }
        assert_eq!(principal_axes([Vec2::ZERO; 2]), (Vec2::ZERO, 0.0));
    }

    /// Stripes across the short side of the footprint keep their contrast. Stripes across the long side are averaged.
    #[test]
    fn a_narrow_footprint_blurs_along_itself_alone() {
        let size = 64;
        let stripes = |of: fn(usize, usize) -> usize| {
            let texel =
                |i: usize| if (of(i % size, i / size) / 4).is_multiple_of(2) { [255; 4] } else { [0, 0, 0, 255] };
            Texture::new(size, size, (0..size * size).map(texel).collect(), [Wrap::Repeat; 2])
        };
        let across = stripes(|x, _| x);
        let along = stripes(|_, y| y);
        let footprint = [Vec2::new(0.0, 16.0), Vec2::new(1.0, 0.0)];
        let uv = Vec2::splat((8.0 + 2.0) / size as f32);
        assert_eq!(across.sample_ellipse(uv, footprint).color, Vec3::ONE);
        assert!((along.sample_ellipse(uv, footprint).color.x - 0.5).abs() < 0.02);
        // One trilinear sample over the long side loses the contrast of both.
        assert!((across.sample(uv, 16.0).color.x - 0.5).abs() < 0.1);
    }

    /// An ellipse matches the mean over the footprint's own texels, summed one by one, for ellipses of all directions.
    #[test]
    fn an_ellipse_shows_the_mean_of_its_texels() {
        let size = 128;
        let wave = |x: f32, y: f32| 0.5 + 0.25 * (x * 0.11).sin() + 0.25 * (y * 0.17).cos();
        let texel = |i: usize| [(wave((i % size) as f32, (i / size) as f32) * 255.0 + 0.5) as u8; 4];
        let texture = Texture::with_encoding(
            size,
            size,
            (0..size * size).map(texel).collect(),
            [Wrap::Clamp; 2],
            Encoding::Linear,
        );
        for k in 0..64 {
            let (sin, cos) = (k as f32 * 0.4).sin_cos();
            let (long, narrow) = (Vec2::new(cos, sin) * (2.0 + k as f32 * 0.3), Vec2::new(-sin, cos) * 2.0);
            let middle = Vec2::new(50.0 + (k % 7) as f32 * 4.0, 60.0);
            let found = texture.sample_ellipse(middle / size as f32, [long, narrow]).color.x;
            let (mut sum, steps) = (0.0, 40);
            for (i, j) in (0..steps * steps).map(|n| (n % steps, n / steps)) {
                let of = |i: usize| (i as f32 + 0.5) / steps as f32 - 0.5;
                let at = middle + long * of(i) + narrow * of(j) - 0.5;
                sum += wave(at.x, at.y);
            }
            let mean = sum / (steps * steps) as f32;
            assert!((found - mean).abs() < 0.02, "{k}: {found} for {mean}");
        }
    }

    /// Builds an image of random opacities.
    fn opacities(width: usize, height: usize) -> Texture {
        let random = |i: usize| (crate::sampling::hash_unit(7, i as u64, 0) * 255.99) as u8;
        let texels = (0..width * height).map(|i| [0, 0, 0, random(i)]).collect();
        Texture::new(width, height, texels, [Wrap::Repeat; 2])
    }

    /// The mask matches the fraction of points that have an opacity of at least the cutoff, counted one by one. The
    /// test checks the whole image and a width of two texels, also for odd sizes.
    #[test]
    fn coverage_is_the_share_of_points_that_are_no_holes() {
        for (width, height) in [(16, 16), (13, 7), (1, 5)] {
            for least in [0.2, 0.5, 0.8] {
                let image = opacities(width, height);
                let far = image.coverage(least);
                let share = |low: Vec2, size: Vec2| {
                    let within = |i: usize| Vec2::new((i % 64) as f32 + 0.5, (i / 64) as f32 + 0.5) / 64.0;
                    let is_there = |i: &usize| image.sample(low + within(*i) * size, 0.0).opacity >= least;
                    (0..64 * 64).filter(is_there).count() as f32 / (64.0 * 64.0)
                };
                let (whole, expected) = (far.sample(Vec2::ZERO, f32::MAX).opacity, share(Vec2::ZERO, Vec2::ONE));
                // Along a line of points, each border of a hole may be off by half a point. With 64 points, a few
                // borders are 5 %.
                let slack = if width == 1 { 0.05 } else { 0.02 };
                assert!((whole - expected).abs() < slack, "{whole} for {expected} of {width}x{height} above {least}");
                let step = far.size().recip();
                for (x, y) in [(0, 0), (far.levels[0].width - 1, far.levels[0].height / 2)] {
                    let low = Vec2::new(x as f32, y as f32) * step;
                    let found = far.sample(low + 0.5 * step, 0.0).opacity;
                    // With 16 points, each of the two values may be off by 1/16.
                    assert!((found - share(low, step)).abs() < 0.13, "{found} for {} at {x} {y}", share(low, step));
                }
            }
        }
    }

    /// The result matches the mean of square texels over a square footprint, summed point by point. For footprint 0, it
    /// matches the texel.
    #[test]
    fn blocky_texels_are_smoothed_over_the_footprint_alone() {
        let image = opacities(8, 8).blocky();
        let texel = |p: Vec2| {
            let [x, y] = (p * 8.0).floor().to_array().map(|i| (i as i64).rem_euclid(8) as usize);
            f32::from(image.levels[0].texels[y * 8 + x][3]) / 255.0
        };
        for k in 0..200 {
            let of = |dimension| crate::sampling::hash_unit(9, k, dimension);
            let (uv, footprint) = (Vec2::new(of(0), of(1)) * 3.0 - 1.0, of(2));
            assert_eq!(image.sample(uv, 0.0).opacity, texel(uv), "at {uv}");
            let steps = 40;
            let mut sum = 0.0;
            for i in 0..steps * steps {
                let within = Vec2::new((i % steps) as f32 + 0.5, (i / steps) as f32 + 0.5) / steps as f32 - 0.5;
                sum += texel(uv + within * footprint / 8.0);
            }
            let (found, mean) = (image.sample(uv, footprint).opacity, sum / (steps * steps) as f32);
            assert!((found - mean).abs() < 0.04, "{found} for {mean} at {uv} over {footprint}");
        }
        // For footprints of one texel or more, samples are bilinear as in all other textures.
        let smooth = opacities(8, 8);
        assert_eq!(image.sample(Vec2::new(0.3, 0.7), 1.0), smooth.sample(Vec2::new(0.3, 0.7), 1.0));
    }

    #[test]
    fn numbers_are_averaged_as_numbers() {
        let texels = vec![[0, 100, 255, 255], [255, 200, 255, 51]];
        let texture = Texture::with_encoding(2, 1, texels, [Wrap::Repeat; 2], Encoding::Linear);
        let mean = texture.mean();
        assert!((mean - Vec3::new(0.5, 150.0 / 255.0, 1.0)).length() < 0.005, "{mean}");
        assert_eq!(texture.least_opacity(), 0.2);
    }

    #[test]
    fn neighbors_are_those_of_the_definition() {
        let definition = |i: i64, n: i64, wrap: Wrap| match wrap {
            Wrap::Clamp => i.clamp(0, n - 1),
            Wrap::Repeat => i.rem_euclid(n),
            Wrap::Mirror => i.rem_euclid(2 * n).min(2 * n - 1 - i.rem_euclid(2 * n)),
        };
        let coordinates = (-4000..4000).map(|k| k as f32 / 512.0).chain([-1e-9, 1e-9, 12_345.678, -9e8, 3e9, 1e30]);
        for c in coordinates {
            for n in [1, 2, 3, 4, 37] {
                for wrap in [Wrap::Clamp, Wrap::Repeat, Wrap::Mirror] {
                    let p = c.rem_euclid(2.0) * n as f32 - 0.5;
                    let first = p.floor();
                    let expected = [0, 1].map(|k| definition(first as i64 + k, n, wrap) as usize);
                    assert_eq!(neighbors(c, n as usize, wrap), (expected, p - first), "{c} of {n}, {wrap:?}");
                }
            }
        }
    }

    #[test]
    fn broken_coordinates_show_a_texel() {
        for bad in [f32::NAN, f32::INFINITY, 1e30, -1e30] {
            let color = checker().sample(Vec2::splat(bad), f32::NAN).color;
            assert!(color.is_finite());
            for diameters in [[Vec2::splat(bad); 2], [Vec2::splat(bad), Vec2::ZERO], [Vec2::X * 9.0, Vec2::ZERO]] {
                assert!(checker().sample_ellipse(Vec2::splat(bad), diameters).color.is_finite());
            }
        }
    }
}
