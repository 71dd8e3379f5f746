//! Deterministic low-discrepancy samples, and warps to shapes.

use glam::{Vec2, Vec3};

/// Bases of the Halton sequence. A photon path uses one base per dimension.
///
/// Additional bases would be correlated: for the first 36 000 points, bases 83 and 167 form stripes.
const PRIMES: [u32; 26] =
    [2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37, 41, 43, 47, 53, 59, 61, 67, 71, 73, 79, 83, 89, 97, 101];

/// Returns the radical inverse of `index` in `base`: the digits of `index` mirrored at the radix point, 0 ≤ value < 1.
#[must_use]
pub fn radical_inverse(base: u32, mut index: u64) -> f32 {
    let inverse = 1.0 / f64::from(base);
    // Accumulate digits in f64. Rounding to f32 may reach 1, which is excluded.
    let (mut value, mut scale) = (0.0f64, inverse);
    while index > 0 {
        value += (index % u64::from(base)) as f64 * scale;
        index /= u64::from(base);
        scale *= inverse;
    }
    (value as f32).min(ONE_MINUS_EPSILON)
}

/// Returns point `index` of a set of `count` points that covers the unit square evenly.
pub(crate) fn hammersley(index: usize, count: usize) -> Vec2 {
    Vec2::new((index as f32 + 0.5) / count as f32, radical_inverse(2, index as u64))
}

/// Returns point `index` of Sobol's (0, 2)-sequence in the unit square. Each elementary interval of area 2⁻ᵏ contains
/// one of the first 2ᵏ points (Kollig & Keller 2002).
#[must_use]
pub fn sobol_point(index: u64) -> Vec2 {
    Vec2::new(radical_inverse(2, index), unit(sobol_second(index as u32)))
}

/// Returns the first `count` points of Sobol's (0, 2)-sequence, each in the middle of its cell. A set of 2ᵏ points is
/// centered on the unit square.
///
/// Corners of cells would be as even but off-center: one point would be on the rim of a hemisphere, and lamps would be
/// slightly displaced.
pub fn centered_sobol(count: usize) -> impl Iterator<Item = Vec2> {
    let half_cell = 0.5 / count.next_power_of_two() as f32;
    (0..count as u64).map(move |index| sobol_point(index) + half_cell)
}

/// Returns point `index` of Sobol's (0, 2)-sequence, shuffled and scrambled with `seed`. Each elementary interval still
/// contains one of the first 2ᵏ points (Owen 1995, implemented after Burley 2020).
///
/// Points with different seeds are independent: use one seed per pixel and pair of dimensions.
#[must_use]
pub fn owen_sobol_point(index: u32, seed: u64) -> Vec2 {
    let key = |k: u64| hash(seed, k, 0) as u32;
    let index = nested_scramble(index, key(0));
    Vec2::new(unit(nested_scramble(index.reverse_bits(), key(1))), unit(nested_scramble(sobol_second(index), key(2))))
}

/// Returns the second dimension of the sequence. The first dimension is the index with its bits reversed.
fn sobol_second(index: u32) -> u32 {
    // Combine the columns of the generator matrix for the set bits. Each column follows from the previous one.
    let (mut rest, mut column, mut y) = (index, 1u32 << 31, 0u32);
    while rest > 0 {
        if rest & 1 == 1 {
            y ^= column;
        }
        column ^= column >> 1;
        rest >>= 1;
    }
    y
}

/// Flips each bit depending on the higher bits and the seed: \[Burley20\], listing 1, with the constants of Vegdahl
/// 2021.
fn nested_scramble(bits: u32, seed: u32) -> u32 {
    let mut x = bits.reverse_bits();
    x ^= x.wrapping_mul(0x3d20_adea);
    x = x.wrapping_add(seed);
    x = x.wrapping_mul((seed >> 16) | 1);
    x ^= x.wrapping_mul(0x0552_6c56);
    x ^= x.wrapping_mul(0x53a2_2864);
    x.reverse_bits()
}

/// Returns the upper 24 of 32 bits as a number in 0…1 (1 excluded). Lower bits are truncated, since rounding up could
/// return 1.
fn unit(bits: u32) -> f32 {
    (bits >> 8) as f32 / (1u32 << 24) as f32
}

/// Largest `f32` below 1.
pub const ONE_MINUS_EPSILON: f32 = 1.0 - f32::EPSILON / 2.0;

/// Returns point `index` of the Halton sequence in dimension `dimension`, or hashed numbers from dimension 26 on.
///
/// Each dimension is shifted by a number that depends on `seed`, modulo 1 (Cranley & Patterson 1976).
#[must_use]
pub fn halton(seed: u64, index: u64, dimension: usize) -> f32 {
    match PRIMES.get(dimension) {
        Some(&base) => {
            // Keep the sum below 1, also after rounding.
            let value = radical_inverse(base, index) + hash_unit(seed, dimension as u64, 0);
            if value < 1.0 { value } else { (value - 1.0).min(ONE_MINUS_EPSILON) }
        }
        None => hash_unit(seed, index, dimension as u64),
    }
}

/// Returns a hash of three keys in 0…1 (1 excluded).
#[must_use]
pub fn hash_unit(seed: u64, a: u64, b: u64) -> f32 {
    (hash(seed, a, b) >> 40) as f32 / (1u64 << 24) as f32
}

/// Returns a 64-bit hash of three keys (the finalizer of SplitMix64, Steele et al. 2014, applied to each key in
/// sequence).
#[must_use]
pub fn hash(seed: u64, a: u64, b: u64) -> u64 {
    // Mix the keys one after another, so that their order has an effect.
    let mix = |mut z: u64| {
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    };
    let golden = 0x9e37_79b9_7f4a_7c15u64;
    mix(mix(mix(seed.wrapping_add(golden)).wrapping_add(a.wrapping_mul(golden)).wrapping_add(golden))
        ^ b.wrapping_mul(golden))
}

/// Returns two unit vectors that complete the unit vector `n` to a right-handed frame (Duff et al. 2017).
#[must_use]
pub fn frame(n: Vec3) -> (Vec3, Vec3) {
    let sign = 1.0f32.copysign(n.z);
    let a = -1.0 / (sign + n.z);
    let b = n.x * n.y * a;
    (Vec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x), Vec3::new(b, sign + n.y * n.y * a, -n.y))
}

/// Returns a direction around `n` with density cos θ / π.
#[must_use]
pub fn cosine_hemisphere(n: Vec3, u: Vec2) -> Vec3 {
    // Project a uniform point of the disc up to the hemisphere (Malley's method).
    let (x, y) = frame(n);
    let (radius, angle) = (u.x.sqrt(), std::f32::consts::TAU * u.y);
    (x * (radius * angle.cos()) + y * (radius * angle.sin()) + n * (1.0 - u.x).max(0.0).sqrt()).normalize()
}

/// Returns a direction on the whole sphere with density 1 / (4π).
#[must_use]
pub fn uniform_sphere(u: Vec2) -> Vec3 {
    // The height of a uniform point on a sphere is uniform (Archimedes).
    let z = 1.0 - 2.0 * u.x;
    let (radius, angle) = ((1.0 - z * z).max(0.0).sqrt(), std::f32::consts::TAU * u.y);
    Vec3::new(radius * angle.cos(), radius * angle.sin(), z)
}

/// Returns a point of the unit disc. The mapping preserves areas and neighborhoods (Shirley & Chiu 1997).
#[must_use]
pub fn concentric_disc(u: Vec2) -> Vec2 {
    let p = u * 2.0 - 1.0;
    if p == Vec2::ZERO {
        return Vec2::ZERO;
    }
    // Map concentric squares to circles, by the quarter of the square that contains the point.
    let quarter = std::f32::consts::FRAC_PI_4;
    let (radius, angle) =
        if p.x.abs() > p.y.abs() { (p.x, quarter * p.y / p.x) } else { (p.y, quarter * (2.0 - p.x / p.y)) };
    Vec2::new(radius * angle.cos(), radius * angle.sin())
}

/// Returns the inverse of [`concentric_disc`].
#[must_use]
pub fn disc_to_square(p: Vec2) -> Vec2 {
    // Find the quarter of the square that contains the point, counted from +x, and the angle within that quarter in −1…1.
    let eighth = std::f32::consts::FRAC_PI_4;
    let quarter = (p.y.atan2(p.x) / (2.0 * eighth)).round();
    let across = p.y.atan2(p.x) / eighth - 2.0 * quarter;
    let radius = p.length();
    let on_square = match quarter as i32 {
        0 => Vec2::new(radius, across * radius),
        1 => Vec2::new(-across * radius, radius),
        -1 => Vec2::new(across * radius, -radius),
        _ => Vec2::new(-radius, -across * radius),
    };
    (on_square + 1.0) / 2.0
}

/// Returns barycentric `(u, v)`, uniformly distributed over a triangle.
#[must_use]
pub fn triangle(u: Vec2) -> (f32, f32) {
    let root = u.x.sqrt();
    (root * (1.0 - u.y), root * u.y)
}

/// Index drawn from a [`Distribution`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pick {
    /// Index that was drawn.
    pub index: usize,
    /// Probability of the index.
    pub probability: f64,
    /// Position of the random number within the index's interval, 0…1, usable as a new random number.
    pub rest: f64,
}

/// Discrete distribution with probabilities proportional to weights.
#[derive(Clone, Debug)]
pub struct Distribution {
    cumulative: Vec<f64>,
}

impl Distribution {
    /// Builds the distribution. Negative and non-finite weights count as 0. Returns `None` if no weight is positive.
    pub fn new(weights: impl IntoIterator<Item = f64>) -> Option<Self> {
        let mut sum = 0.0;
        let mut cumulative: Vec<f64> = Vec::new();
        for weight in weights {
            sum += if weight.is_finite() { weight.max(0.0) } else { 0.0 };
            cumulative.push(sum);
        }
        (sum > 0.0).then_some(Self { cumulative })
    }

    /// Returns the sum of the weights.
    #[must_use]
    pub fn total(&self) -> f64 {
        *self.cumulative.last().expect("a distribution has weights")
    }

    /// Draws an index with the random number `u` (0…1).
    #[must_use]
    pub fn pick(&self, u: f64) -> Pick {
        // Invert the cumulative distribution.
        let target = u * self.total();
        let mut index = self.cumulative.partition_point(|&c| c <= target).min(self.cumulative.len() - 1);
        // Rounding must not select an entry of weight 0.
        while index > 0 && self.share(index) <= 0.0 {
            index -= 1;
        }
        while self.share(index) <= 0.0 {
            index += 1;
        }

        // Rescale the random number within the interval of the index, for reuse.
        let before = if index == 0 { 0.0 } else { self.cumulative[index - 1] };
        let share = self.share(index);
        let rest = ((target - before) / share).clamp(0.0, 1.0);
        Pick { index, probability: share / self.total(), rest }
    }

    /// Returns the probability of an index.
    #[must_use]
    pub fn probability(&self, index: usize) -> f64 {
        self.share(index) / self.total()
    }

    fn share(&self, index: usize) -> f64 {
        self.cumulative[index] - if index == 0 { 0.0 } else { self.cumulative[index - 1] }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_disc_is_mapped_back() {
        for k in 0..1000 {
            let u = Vec2::new(hash_unit(1, k, 0), hash_unit(1, k, 1));
            assert!(disc_to_square(concentric_disc(u)).abs_diff_eq(u, 1e-5), "{u}");
        }
        assert_eq!(disc_to_square(Vec2::ZERO), Vec2::splat(0.5));
    }

    #[test]
    fn radical_inverses_mirror_the_digits() {
        assert_eq!(radical_inverse(2, 6), 0.375); // 110 -> 0.011
        assert!((radical_inverse(3, 5) - 7.0 / 9.0).abs() < 1e-7); // 12 -> 0.21
        assert!((0..10_000).all(|i| halton(7, i, 3) < 1.0));
    }

    #[test]
    fn sobol_points_fill_every_elementary_interval() {
        fill_every_elementary_interval(sobol_point);
        for seed in 0..50 {
            fill_every_elementary_interval(|i| owen_sobol_point(i as u32, seed));
        }
    }

    #[test]
    fn centered_points_have_the_middle_as_their_mean() {
        for count in [1, 2, 4, 8, 64, 256] {
            let mean = centered_sobol(count).sum::<Vec2>() / count as f32;
            assert!((mean - 0.5).abs().max_element() < 1e-6, "{count} points: {mean}");
            assert!(centered_sobol(count).all(|p| p.min_element() > 0.0 && p.max_element() < 1.0));
        }
    }

    fn fill_every_elementary_interval(point: impl Fn(u64) -> Vec2) {
        for across in 0..=6u32 {
            let down = 6 - across;
            let mut seen = [false; 64];
            for i in 0..64 {
                let p = point(i);
                let cell =
                    (p.x * (1 << across) as f32) as usize + ((p.y * (1 << down) as f32) as usize * (1 << across));
                assert!(!std::mem::replace(&mut seen[cell], true), "two points in a cell of {across} by {down} bits");
            }
        }
    }

    /// Over seeds, each point of a scrambled sequence is uniformly distributed, and two dimensions are independent.
    #[test]
    fn scrambled_points_are_even_over_seeds() {
        for index in [0, 1, 7] {
            let (mut cells, seeds) = ([0u32; 16], 16_000);
            for seed in 0..seeds {
                let p = owen_sobol_point(index, seed);
                cells[(p.x * 4.0) as usize + 4 * (p.y * 4.0) as usize] += 1;
            }
            // Each cell has 1000 points, with a standard deviation of 32. The tolerance is five standard deviations.
            assert!(cells.iter().all(|&n| n.abs_diff(1000) < 160), "{cells:?}");
        }
    }

    /// Numbers that are used together are independent. For each pair of dimensions, points are distributed over the
    /// cells of an 8×8 table at least as evenly as random points. χ² has a mean of 63 and a standard deviation of 11.
    #[test]
    fn dimensions_that_are_used_together_are_independent() {
        // A box has 36 000 photons. Each uses five numbers, and three more per reflection.
        let photons: Vec<Vec<f32>> = (0..44).map(|d| (0..36_000).map(|i| halton(1, i, d)).collect()).collect();
        check_pairs("photons", &photons);
        // Paths: 512 pixels, 64 samples each, one pair of numbers for each of eight reflections.
        let of_path = |d: u64| {
            let points = (0..512u64).flat_map(move |key| (0..64).map(move |i| owen_sobol_point(i, hash(key, d, 0))));
            points.collect::<Vec<Vec2>>()
        };
        let pairs: Vec<Vec<Vec2>> = (1..9).map(of_path).collect();
        let paths: Vec<Vec<f32>> =
            pairs.iter().flat_map(|p| [p.iter().map(|p| p.x).collect(), p.iter().map(|p| p.y).collect()]).collect();
        check_pairs("paths", &paths);
        // Anchors use the index of a patch with three anchors, and the position of each anchor on the patch.
        let mut anchors = vec![Vec::new(); 3];
        for patch in 0..12_000u64 {
            for k in 0..3 {
                let place = owen_sobol_point(k, hash(36_000, patch, 0));
                anchors[0].push((patch % 8) as f32 / 8.0);
                anchors[1].push(place.x);
                anchors[2].push(place.y);
            }
        }
        check_pairs("anchors", &anchors);
        // Gather rays use the rotation of a receiver, and the numbers that continue the receiver's rays.
        let gather: Vec<Vec<f32>> = (0..6)
            .map(|d| {
                (0..20_000)
                    .map(|key| if d == 0 { hash_unit(key, 0, 0) } else { hash_unit(key, 1 + d % 2, d) })
                    .collect()
            })
            .collect();
        check_pairs("gather rays", &gather);
    }

    fn check_pairs(what: &str, dimensions: &[Vec<f32>]) {
        let expected = dimensions[0].len() as f64 / 64.0;
        for (b, second) in dimensions.iter().enumerate() {
            for (a, first) in dimensions[..b].iter().enumerate() {
                let mut cells = [0.0f64; 64];
                for (&x, &y) in first.iter().zip(second) {
                    cells[(x * 8.0) as usize + 8 * (y * 8.0) as usize] += 1.0;
                }
                let chi2: f64 = cells.iter().map(|n| (n - expected).powi(2) / expected).sum();
                // The tolerance is six standard deviations, for some two thousand pairs.
                assert!(chi2 < 130.0, "{what}: dimensions {a} and {b}, χ² {chi2:.0}");
            }
        }
    }

    #[test]
    fn frequencies_are_probabilities() {
        let d = Distribution::new([1.0, 0.0, 3.0, f64::NAN, 4.0]).unwrap();
        let mut count = [0u32; 5];
        for i in 0..8000 {
            let Pick { index, probability, .. } = d.pick((f64::from(i) + 0.5) / 8000.0);
            count[index] += 1;
            assert!((probability - [1.0, 0.0, 3.0, 0.0, 4.0][index] / 8.0).abs() < 1e-12);
        }
        assert_eq!(count, [1000, 0, 3000, 0, 4000]);
        assert!(Distribution::new([0.0, -1.0]).is_none());
        assert_eq!(d.pick(1.0).index, 4);
    }

    #[test]
    fn warps_have_their_moments() {
        let n = Vec3::new(1.0, -2.0, 0.5).normalize();
        let count = 20_000u64;
        let mean = |f: &dyn Fn(Vec2) -> f32| {
            (0..count).map(|i| f(Vec2::new(radical_inverse(2, i), radical_inverse(3, i))) as f64).sum::<f64>()
                / count as f64
        };
        // ∫ cos θ · cos θ / π dω = 2/3. ∫ z² / 4π = 1/3. The mean squared radius of a disc is 1/2.
        assert!((mean(&|u| cosine_hemisphere(n, u).dot(n)) - 2.0 / 3.0).abs() < 1e-3);
        assert!((mean(&|u| uniform_sphere(u).z.powi(2)) - 1.0 / 3.0).abs() < 1e-3);
        assert!((mean(&|u| concentric_disc(u).length_squared()) - 0.5).abs() < 1e-3);
        assert!((mean(&|u| triangle(u).0) - 1.0 / 3.0).abs() < 1e-3);
        let (x, y) = frame(n);
        assert!(x.dot(n).abs() < 1e-6 && y.dot(n).abs() < 1e-6 && x.cross(y).dot(n) > 0.999);
    }
}
