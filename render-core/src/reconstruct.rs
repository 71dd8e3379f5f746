//! Several samples to the pixel, and the filter that makes a picture of them.
//!
//! Samples lie at the same places in every pixel of every frame: what stands still stays still, and an edge that
//! moves is seen by the filter, not by chance.

use crate::sampling::centered_sobol;
use glam::Vec2;
use plane::Plane;
use rayon::prelude::*;

/// Half the filter's width \[pixels\]: a Blackman–Harris window three pixels wide, whose pass band ends where the
/// pixel grid's does.
const RADIUS: f32 = 1.5;

/// Places of `count` samples in a pixel, from its upper left corner, in 0…1: one sample is the center, more are the
/// first points of a (0, 2)-sequence, each in the middle of its cell. Powers of two are centered on the pixel.
#[must_use]
pub fn sample_offsets(count: usize) -> Vec<Vec2> {
    centered_sobol(count.max(1)).collect()
}

/// Four-term Blackman–Harris window (Harris 1978, table I, 92 dB) at `x` in −1…1; 0 outside.
fn window(x: f32) -> f32 {
    if x.abs() >= 1.0 {
        return 0.0;
    }
    let angle = std::f32::consts::PI * (x + 1.0);
    0.35875 - 0.48829 * angle.cos() + 0.14128 * (2.0 * angle).cos() - 0.01168 * (3.0 * angle).cos()
}

/// A tap of the filter: which sample of which neighbor, and how much of it.
struct Tap {
    sample: usize,
    column: isize,
    row: isize,
    weight: f32,
}

/// The picture that `samples` make, each a plane of values at one of `places` in its pixel.
///
/// A single sample in the center is the picture itself. Weights sum to 1; at the border the outermost pixels repeat.
///
/// # Panics
/// If there is not one plane for each place, or they differ in size.
#[must_use]
pub fn reconstruct(samples: &[Plane<[f32; 3]>], places: &[Vec2]) -> Plane<[f32; 3]> {
    assert!(!samples.is_empty() && samples.len() == places.len(), "one plane for each place");
    let (width, height) = (samples[0].width(), samples[0].height());
    assert!(samples.iter().all(|plane| (plane.width(), plane.height()) == (width, height)), "planes of one size");
    if samples.len() == 1 {
        return samples[0].clone();
    }
    let mut taps: Vec<Tap> = Vec::new();
    for (sample, place) in places.iter().enumerate() {
        for (row, column) in (-2..=2).flat_map(|row| (-2..=2).map(move |column| (row, column))) {
            let d = (*place + Vec2::new(column as f32, row as f32) - 0.5) / RADIUS;
            let weight = window(d.x) * window(d.y);
            if weight > 0.0 {
                taps.push(Tap { sample, column, row, weight });
            }
        }
    }
    let sum: f32 = taps.iter().map(|tap| tap.weight).sum();
    taps.iter_mut().for_each(|tap| tap.weight /= sum);
    let rows: Vec<Vec<[f32; 3]>> = (0..height)
        .into_par_iter()
        .map(|y| {
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
        })
        .collect();
    Plane::from_vec(width, height, rows.concat())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A picture given by a function of the place, as the samples see it.
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
    fn places_lie_in_the_pixel_and_around_its_center() {
        for count in 1..=64 {
            let places = sample_offsets(count);
            assert_eq!(places.len(), count);
            assert!(places.iter().all(|p| p.min_element() >= 0.0 && p.max_element() <= 1.0), "{count}: {places:?}");
            let mean = places.iter().sum::<Vec2>() / count as f32;
            let off = if count.is_power_of_two() { 1e-5 } else { 0.15 };
            assert!((mean - 0.5).length() < off, "{count}: mean {mean}");
        }
    }

    /// An even picture stays even, and a ramp stays the same ramp.
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

    /// An edge that wanders through a pixel changes it by about its own way: it does not jump.
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
