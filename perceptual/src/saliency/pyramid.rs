//! Dyadic Gaussian pyramids, and interpolation back to finer levels.
//!
//! ```text
//! F_(k+1)(x, y) = Σ_ij b_i b_j F_k(2x − 2 + i, 2y − 2 + j)         b = [1 5 10 10 5 1] / 32,  i, j = 0 … 5
//! ```
//!
//! The kernel is from the SaliencyToolbox \[Walther06\]. Its length is even, so each sample is in the middle of the 2×2
//! samples that it represents. Mirrored pictures therefore have mirrored pyramids. With a kernel of five samples, the
//! single level-8 sample of a 256×256 picture would be centered on the picture's corner.
//!
//! Borders are reflected: … 1 0 | 0 1 … .

use plane::Plane;

/// Number of the coarsest level \[Itti98\].
const DEEPEST: usize = 8;
/// Level of the smallest center c \[Itti98\]. It is the finest stored level.
const FINEST: usize = 2;
/// Levels c of centers \[Itti98\].
pub const CENTERS: [usize; 3] = [FINEST, 3, 4];
/// Level differences s − c from centers to surrounds \[Itti98\].
pub const DELTAS: [usize; 2] = [3, 4];
/// Level at which maps are added \[Itti98\]. It is the level of the largest center.
pub const MAP_LEVEL: usize = CENTERS[2];

/// Half of the symmetric kernel: b_2 = b_3, b_1 = b_4 and b_0 = b_5.
const KERNEL: [f32; 3] = [10.0 / 32.0, 5.0 / 32.0, 1.0 / 32.0];

/// Levels of a feature, starting with the level of the smallest center.
pub struct Pyramid {
    levels: Vec<Plane<f32>>,
}

impl Pyramid {
    /// Returns whether pyramids of pictures of this size have at least one center with a surround.
    pub fn has_pairs(width: usize, height: usize) -> bool {
        width > 0 && height > 0 && deepest(width, height) >= CENTERS[0] + DELTAS[0]
    }

    /// Builds the levels of a feature. `finest` is level 0.
    pub fn new(finest: Plane<f32>) -> Self {
        let deepest = deepest(finest.width(), finest.height());
        let mut levels = vec![halved(&halved(&finest))];
        for _ in FINEST..deepest {
            levels.extend(levels.last().map(halved));
        }
        Self { levels }
    }

    /// Returns level `k` ≥ 2, or `None` if the level is beyond the coarsest level.
    pub fn level(&self, k: usize) -> Option<&Plane<f32>> {
        self.levels.get(k - FINEST)
    }

    /// Computes `N` features from each level and returns their pyramids.
    pub fn map<const N: usize>(&self, feature: impl Fn(&Plane<f32>) -> [Plane<f32>; N]) -> [Self; N] {
        let mut pyramids = std::array::from_fn(|_| Self { levels: Vec::new() });
        for level in &self.levels {
            for (pyramid, plane) in pyramids.iter_mut().zip(feature(level)) {
                pyramid.levels.push(plane);
            }
        }
        pyramids
    }
}

/// Returns the coarsest level of a picture of this size: 8, or the first level with a single sample.
fn deepest(width: usize, height: usize) -> usize {
    (0..DEEPEST).find(|&k| width.max(height) <= 1 << k).unwrap_or(DEEPEST)
}

/// Returns the next coarser level of `plane`.
pub fn halved(plane: &Plane<f32>) -> Plane<f32> {
    let (width, height) = (plane.width(), plane.height());
    let mut out = Plane::filled(width.div_ceil(2), height.div_ceil(2), 0.0);
    let mut padded = vec![0.0; width + 6];
    for y in 0..out.height() {
        // Filter down the columns. The left border needs two samples of padding.
        let row = |j: usize| &plane.row(reflected((2 * y + j) as isize - 2, height))[..width];
        let [b0, b1, b2, b3, b4, b5] = std::array::from_fn(row);
        for (x, sum) in padded[2..2 + width].iter_mut().enumerate() {
            *sum = KERNEL[0] * (b2[x] + b3[x]) + KERNEL[1] * (b1[x] + b4[x]) + KERNEL[2] * (b0[x] + b5[x]);
        }
        reflect_borders(&mut padded, 2, width);

        // Filter along the row.
        for (x, out) in out.row_mut(y).iter_mut().enumerate() {
            let b = &padded[2 * x..2 * x + 6];
            *out = KERNEL[0] * (b[2] + b[3]) + KERNEL[1] * (b[1] + b[4]) + KERNEL[2] * (b[0] + b[5]);
        }
    }
    out
}

/// Reflects an index `i` beyond the borders into 0 … `count` − 1.
pub fn reflected(i: isize, count: usize) -> usize {
    let period = 2 * count;
    let i = i.rem_euclid(period as isize) as usize;
    i.min(period - 1 - i)
}

/// Pads a row of `count` samples on both sides by reflection. The first sample is at index `before`.
pub fn reflect_borders(padded: &mut [f32], before: usize, count: usize) {
    for i in (0..before).chain(before + count..padded.len()) {
        padded[i] = padded[before + reflected(i as isize - before as isize, count)];
    }
}

/// A position between two samples of a row or column.
#[derive(Clone, Copy)]
struct Between {
    low: usize,
    high: usize,
    /// Interpolation weight of `high`, 0 … 1.
    fraction: f32,
}

/// Returns the positions of `wanted` samples in a row of `count` samples, which is coarser by `levels` levels.
fn places(count: usize, wanted: usize, levels: usize) -> Vec<Between> {
    let step = 0.5f32.powi(levels as i32);
    let place = |i: usize| {
        let at = ((i as f32 + 0.5) * step - 0.5).clamp(0.0, (count - 1) as f32);
        let low = at as usize;
        Between { low, high: (low + 1).min(count - 1), fraction: at - low as f32 }
    };
    (0..wanted).map(place).collect()
}

/// Enlarges `plane` by `levels` levels to `width` × `height` samples. Interpolates linearly between sample centers.
pub fn enlarged(plane: &Plane<f32>, levels: usize, width: usize, height: usize) -> Plane<f32> {
    let (columns, rows) = (places(plane.width(), width, levels), places(plane.height(), height, levels));
    let between = |low: f32, high: f32, fraction: f32| low + fraction * (high - low);

    // Interpolate along the rows first, while the plane still has few of them.
    let mut wide = Plane::filled(width, plane.height(), 0.0);
    for (wide, row) in wide.samples_mut().chunks_exact_mut(width).zip(plane.rows()) {
        for (wide, at) in wide.iter_mut().zip(&columns) {
            *wide = between(row[at.low], row[at.high], at.fraction);
        }
    }

    // Interpolate down the columns.
    let mut out = Plane::filled(width, height, 0.0);
    for (out, at) in out.samples_mut().chunks_exact_mut(width).zip(&rows) {
        for ((out, &low), &high) in out.iter_mut().zip(wide.row(at.low)).zip(wide.row(at.high)) {
            *out = between(low, high, at.fraction);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn saliency_levels_halve_until_one_sample_is_left() {
        let sizes = |width, height| {
            let pyramid = Pyramid::new(Plane::filled(width, height, 0.7));
            pyramid.levels.iter().map(|level| (level.width(), level.height())).collect::<Vec<_>>()
        };
        assert_eq!(sizes(70, 40), [(18, 10), (9, 5), (5, 3), (3, 2), (2, 1), (1, 1)]);
        assert_eq!(sizes(1024, 16).last(), Some(&(4, 1)), "level 8");
        assert!(Pyramid::has_pairs(17, 1) && !Pyramid::has_pairs(16, 16) && !Pyramid::has_pairs(0, 99));
    }

    #[test]
    fn saliency_levels_keep_what_is_flat_and_mirror_what_is_mirrored() {
        let flat = halved(&Plane::filled(7, 5, 0.7));
        assert!(flat.samples().iter().all(|&v| (v - 0.7f32).abs() < 1e-6));
        let plane = Plane::from_fn(12, 10, |x, y| ((5 * x + 3 * y) % 7) as f32);
        let mirrored = Plane::from_fn(12, 10, |x, y| plane.get(11 - x, y));
        let (a, b) = (halved(&plane), halved(&mirrored));
        let same = |x, y| (a.get(x, y) - b.get(5 - x, y)).abs() < 1e-6;
        assert!((0..5).all(|y| (0..6).all(|x| same(x, y))));
    }

    #[test]
    fn saliency_borders_are_reflected_beyond_the_whole_row() {
        let indices = |count| (-5..6).map(|i| reflected(i, count)).collect::<Vec<_>>();
        assert_eq!(indices(3), [1, 2, 2, 1, 0, 0, 1, 2, 2, 1, 0]);
        assert_eq!(indices(1), [0; 11]);
    }

    #[test]
    fn saliency_enlarges_ramps_to_ramps() {
        // Sample i of a level represents the samples 4i … 4i + 3 of the level two levels finer. Its center is at 4i +
        // 1.5.
        let coarse = Plane::from_fn(8, 6, |x, y| (4 * x + 8 * y) as f32 + 4.5);
        let fine = enlarged(&coarse, 2, 32, 24);
        let exact = |x: usize, y: usize| x as f32 + 2.0 * y as f32;
        assert!((2..22).all(|y| (2..30).all(|x| (fine.get(x, y) - exact(x, y)).abs() < 1e-4)));
    }
}
