//! Reconstruction of a picture from several samples per pixel.
//!
//! Samples have the same positions in every pixel of every frame. Static objects therefore stay unchanged, and moving
//! edges are resolved by the filter instead of by chance. Sample sets are nested and start at the center, so that
//! pixels may have different sample counts.

use crate::sampling::sobol_point;
use glam::Vec2;
use plane::Plane;
use rayon::prelude::*;

/// Half the filter's width \[pixels\]. The filter is a Blackman–Harris window three pixels wide. Its pass band ends at
/// the Nyquist frequency of the pixel grid.
const RADIUS: f32 = 1.5;

/// Returns the positions of `count` samples in a pixel, from the pixel's upper left corner, in 0…1. They are the first
/// points of a (0, 2)-sequence, shifted cyclically by half a pixel. The first position is the center. A smaller set is
/// a prefix of a larger one.
#[must_use]
pub fn sample_offsets(count: usize) -> Vec<Vec2> {
    (0..count.max(1) as u64).map(|index| (sobol_point(index) + 0.5).fract()).collect()
}

/// Returns the four-term Blackman–Harris window (Harris 1978, table I, 92 dB) at `x` in −1…1, and 0 outside this range.
fn window(x: f32) -> f32 {
    if x.abs() >= 1.0 {
        return 0.0;
    }
    let angle = std::f32::consts::PI * (x + 1.0);
    0.35875 - 0.48829 * angle.cos() + 0.14128 * (2.0 * angle).cos() - 0.01168 * (3.0 * angle).cos()
}

/// Tap of the filter: a sample of a neighboring pixel, with its weight.
struct Tap {
    sample: usize,
    column: isize,
    row: isize,
    weight: f32,
}

/// Returns the taps of a pixel, for samples at `places` in the pixel and in its neighbors.
fn taps(places: &[Vec2]) -> Vec<Tap> {
    let mut taps: Vec<Tap> = Vec::new();
    for (sample, place) in places.iter().enumerate() {
        // The filter has a radius of 1.5 pixels: all samples within it are in these 5×5 pixels.
        for (row, column) in (-2..=2).flat_map(|row| (-2..=2).map(move |column| (row, column))) {
            let d = (*place + Vec2::new(column as f32, row as f32) - 0.5) / RADIUS;
            let weight = window(d.x) * window(d.y);
            if weight > 0.0 {
                taps.push(Tap { sample, column, row, weight });
            }
        }
    }
    taps
}

/// Reconstructs a picture from `samples`, one plane per position in `places`.
///
/// A single sample at the center is the picture itself. Weights sum to 1. Border pixels repeat beyond the border.
///
/// # Panics
/// If the numbers of planes and positions differ, or if planes differ in size.
#[must_use]
pub fn reconstruct(samples: &[Plane<[f32; 3]>], places: &[Vec2]) -> Plane<[f32; 3]> {
    let (width, height) = size_of(samples, places);
    if samples.len() == 1 {
        return samples[0].clone();
    }
    // Normalize the filter.
    let mut taps = taps(places);
    let sum: f32 = taps.iter().map(|tap| tap.weight).sum();
    taps.iter_mut().for_each(|tap| tap.weight /= sum);

    // Apply the taps one by one to a whole row, so that the inner loop reads memory in order.
    let row = |y: usize| {
        let mut out = vec![[0.0f32; 3]; width];
        for Tap { sample, column, row, weight } in &taps {
            let from = samples[*sample].row(y.saturating_add_signed(*row).min(height - 1));
            for (x, pixel) in out.iter_mut().enumerate() {
                let value = from[x.saturating_add_signed(*column).min(width - 1)];
                for c in 0..3 {
                    pixel[c] += weight * value[c];
                }
            }
        }
        out
    };
    let rows: Vec<Vec<[f32; 3]>> = (0..height).into_par_iter().map(row).collect();
    Plane::from_vec(width, height, rows.concat())
}

/// Reconstructs a picture from `samples`. Each pixel has only the first `counts` of the samples, at least one. A pixel
/// with one sample has the value of `alone`, which may represent more of the pixel's area:
///
/// ```text
/// L(p) = Σ_q Σ_i w_i(q) S_i(q) / Σ_q Σ_i w_i(q)        n_p > 1
/// L(p) = A(p)                                          n_p = 1
///
///   S_i(q) = L_i(q),  w_i(q) = h(q + s_i − p)    i < n_q     sample i of pixel q, at position s_i
///   S_i(q) = A(q),    w_i(q) = h(q + ½ − p)      i ≥ n_q     its deputy in the center
///   q  pixels around p        n  count        h  the filter        A  `alone`
/// ```
/// Without deputies, pixels with more samples than their neighbors would shift the picture towards themselves.
///
/// # Panics
/// If the numbers of planes and positions differ, or if planes differ in size.
#[must_use]
pub fn reconstruct_counted(
    alone: &Plane<[f32; 3]>,
    samples: &[Plane<[f32; 3]>],
    places: &[Vec2],
    counts: &Plane<u8>,
) -> Plane<[f32; 3]> {
    let (width, height) = size_of(samples, places);
    let sizes = [(alone.width(), alone.height()), (counts.width(), counts.height())];
    assert_eq!(sizes, [(width, height); 2], "a lone sample and a count for each pixel");

    // Compute the taps of samples and of deputies, by neighboring pixel.
    let (taps, deputies) = (taps(places), taps(&vec![Vec2::splat(0.5); places.len()]));
    let of_pixel = |x: usize, y: usize| {
        if counts.get(x, y) <= 1 {
            return alone.get(x, y);
        }

        // Sum samples and deputies with their weights, over all pixels within the filter.
        let (mut sum, mut weights) = ([0.0f32; 3], 0.0);
        let mut add = |&Tap { sample, column, row, weight }: &Tap, is_deputy: bool| {
            let (u, v) = (x.saturating_add_signed(column).min(width - 1), y.saturating_add_signed(row).min(height - 1));
            // A single sample is its own deputy.
            let count = counts.get(u, v);
            let is_there = count > 1 && sample < usize::from(count);
            if is_there != is_deputy {
                let value = if is_deputy { alone.get(u, v) } else { samples[sample].get(u, v) };
                (0..3).for_each(|c| sum[c] += weight * value[c]);
                weights += weight;
            }
        };

        // Normalize per pixel, because the neighbors' counts select the taps.
        taps.iter().for_each(|tap| add(tap, false));
        deputies.iter().for_each(|tap| add(tap, true));
        sum.map(|value| value / weights)
    };
    let row = |y: usize| (0..width).map(|x| of_pixel(x, y)).collect();
    let rows: Vec<Vec<[f32; 3]>> = (0..height).into_par_iter().map(row).collect();
    Plane::from_vec(width, height, rows.concat())
}

/// Returns the width and height of the samples.
fn size_of(samples: &[Plane<[f32; 3]>], places: &[Vec2]) -> (usize, usize) {
    assert!(!samples.is_empty() && samples.len() == places.len(), "one plane for each place");
    let (width, height) = (samples[0].width(), samples[0].height());
    assert!(samples.iter().all(|plane| (plane.width(), plane.height()) == (width, height)), "planes of one size");
    (width, height)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Samples a picture defined by a function of position.
    fn sampled(size: usize, count: usize, f: impl Fn(Vec2) -> f32) -> Plane<[f32; 3]> {
        let places = sample_offsets(count);
        let planes: Vec<_> = places
            .iter()
            .map(|&place| Plane::from_fn(size, size, |x, y| [f(Vec2::new(x as f32, y as f32) + place); 3]))
            .collect();
        reconstruct(&planes, &places)
    }

    #[test]
    fn one_sample_is_the_center_and_the_picture() {
        assert_eq!(sample_offsets(1), [Vec2::splat(0.5)]);
        let picture = Plane::from_fn(5, 4, |x, y| [x as f32, y as f32, 1.0]);
        assert_eq!(reconstruct(std::slice::from_ref(&picture), &sample_offsets(1)), picture);
    }

    #[test]
    fn places_are_nested_and_even_from_the_center_on() {
        let all = sample_offsets(64);
        assert_eq!(all[0], Vec2::splat(0.5));
        assert!(all.iter().all(|place| place.min_element() >= 0.0 && place.max_element() < 1.0), "{all:?}");
        for count in 1..=64 {
            assert_eq!(sample_offsets(count), all[..count]);
        }
        // Each column, row and 4×4 cell contains one of sixteen samples, since the pixel grid repeats them.
        for (across, down) in [(16.0, 1.0), (4.0, 4.0), (1.0, 16.0)] {
            let mut cells: Vec<i32> = Vec::new();
            for place in &all[..16] {
                cells.push((place.x * across) as i32 + across as i32 * (place.y * down) as i32);
            }
            cells.sort_unstable();
            assert_eq!(cells, Vec::from_iter(0..16), "{across} by {down}");
        }
    }

    /// With equal counts the filter is the same. Single samples stay unchanged next to pixels with more samples.
    #[test]
    fn counted_samples_make_the_same_picture_where_counts_are_even() {
        let places = sample_offsets(5);
        let value = |x: usize, y: usize, k: usize| ((3 * x + 7 * y + 11 * k) % 13) as f32;
        let planes: Vec<Plane<[f32; 3]>> =
            (0..5).map(|k| Plane::from_fn(19, 12, |x, y| [value(x, y, k), value(y, x, k), 1.0])).collect();
        let alone = Plane::from_fn(19, 12, |x, y| [(x + y) as f32; 3]);
        let whole = reconstruct(&planes, &places);
        let counted = reconstruct_counted(&alone, &planes, &places, &Plane::filled(19, 12, 5));
        for (a, b) in whole.samples().iter().zip(counted.samples()) {
            assert!((0..3).all(|c| (a[c] - b[c]).abs() < 1e-5 * 13.0), "{a:?} {b:?}");
        }

        // Pixels have five samples on the right and one on the left. Far from the boundary, each side equals a picture
        // with uniform counts.
        let counts = Plane::from_fn(19, 12, |x, _| if x < 9 { 1 } else { 5 });
        let mixed = reconstruct_counted(&alone, &planes, &places, &counts);
        for y in 0..12 {
            assert!((0..9).all(|x| mixed.get(x, y) == alone.get(x, y)));
            assert!((11..19).all(|x| mixed.get(x, y) == counted.get(x, y)));
        }
    }

    /// A ramp stays unchanged across different counts. Without deputies it would shift by up to a third of a pixel.
    #[test]
    fn differing_counts_do_not_shift_a_picture() {
        let places = sample_offsets(5);
        let of = |place: Vec2| Plane::from_fn(24, 9, |x, y| [x as f32 + place.x + 0.5 * (y as f32 + place.y); 3]);
        let planes: Vec<Plane<[f32; 3]>> = places.iter().map(|&place| of(place)).collect();
        let alone = of(Vec2::splat(0.5));
        for left in 1..=5 {
            let counts = Plane::from_fn(24, 9, |x, _| if x < 12 { left } else { 5 });
            let picture = reconstruct_counted(&alone, &planes, &places, &counts);
            for x in 3..21 {
                let off = picture.get(x, 4)[0] - alone.get(x, 4)[0];
                assert!(off.abs() < 0.03, "{left} samples on the left, column {x}: off by {off} pixels");
            }
        }
    }

    /// Samples beyond the count are never read.
    #[test]
    fn samples_beyond_the_count_do_not_matter() {
        let places = sample_offsets(4);
        let counts = Plane::from_fn(16, 9, |x, y| 1 + ((x / 3 + y) % 4) as u8);
        let planes = |absent: f32| -> Vec<Plane<[f32; 3]>> {
            let of = |k: usize| {
                let there = |x, y| k == 0 || usize::from(counts.get(x, y)) > k;
                Plane::from_fn(16, 9, |x, y| [if there(x, y) { (x * y + k) as f32 } else { absent }; 3])
            };
            (0..4).map(of).collect()
        };
        let alone = Plane::filled(16, 9, [0.5; 3]);
        let [dark, bright] = [0.0, 1e6].map(|absent| reconstruct_counted(&alone, &planes(absent), &places, &counts));
        assert_eq!(dark, bright);
    }

    /// A constant picture stays constant, and a ramp stays unchanged.
    #[test]
    fn constants_and_ramps_pass() {
        for count in [2, 4, 9, 16] {
            let flat = sampled(12, count, |_| 3.0);
            assert!(flat.samples().iter().all(|p| (p[0] - 3.0).abs() < 1e-5));
            let ramp = sampled(12, count, |p| 2.0 * p.x - p.y);
            for (x, y) in [(5, 5), (6, 4), (3, 8)] {
                let center = 2.0 * (x as f32 + 0.5) - (y as f32 + 0.5);
                assert!(
                    (ramp.get(x, y)[0] - center).abs() < 0.03,
                    "{count} samples: {} for {center}",
                    ramp.get(x, y)[0]
                );
            }
        }
    }

    /// An edge that moves through a pixel changes it in proportion to its motion, without jumps.
    #[test]
    fn a_moving_edge_does_not_crawl() {
        let value = |shift: f32, count| {
            let edge = |p: Vec2| if p.x + 0.3 * p.y < 6.0 + shift { 1.0 } else { 0.0 };
            sampled(12, count, edge).get(5, 1)[0]
        };
        let largest_step = |count| {
            let values: Vec<f32> = (0..=64).map(|k| value(k as f32 / 32.0 - 1.0, count)).collect();
            values.windows(2).map(|pair| (pair[1] - pair[0]).abs()).fold(0.0f32, f32::max)
        };
        assert_eq!(largest_step(1), 1.0);
        assert!(largest_step(4) < 0.25, "{}", largest_step(4));
        assert!(largest_step(16) < 0.12, "{}", largest_step(16));
    }
}
