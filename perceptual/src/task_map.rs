//! Task map: the importance of each pixel for a viewer with a task.
//!
//! ```text
//! T(e) = 1                                e ≤ 2°
//!        cos²(π/2 · (e − 2°) / 6°)        2° < e < 8°          e  angle to the nearest watched pixel
//!        0                                e ≥ 8°
//! ```
//!
//! The fovea sees sharply within about 2° of the fixation point. From there, importance decays smoothly to avoid a
//! visible edge between pixels with many and with few rays \[Debattista05, 4.1\]. Angles are valid in the middle of the
//! screen.

use plane::Plane;
use std::f32::consts::FRAC_PI_2;

/// Largest angle of full acuity \[°\].
const FOVEA: f32 = 2.0;
/// Angle from which importance is zero \[°\].
const PERIPHERY: f32 = 8.0;

/// Returns T of every pixel: 1 within 2° of the `watched` pixels, and 0 from 8° on. Without watched pixels, T is 0
/// everywhere.
///
/// # Panics
/// If `pixels_per_degree` is not positive.
#[must_use]
pub fn task_map(watched: &Plane<bool>, pixels_per_degree: f32) -> Plane<f32> {
    assert!(pixels_per_degree > 0.0, "{pixels_per_degree} pixels to a degree");
    squared_distances(watched).map(|squared| {
        let angle = squared.sqrt() / pixels_per_degree;
        let beyond = ((angle - FOVEA) / (PERIPHERY - FOVEA)).clamp(0.0, 1.0);
        if beyond < 1.0 { (FRAC_PI_2 * beyond).cos().powi(2) } else { 0.0 }
    })
}

/// Returns the squared distance from each pixel to the nearest set pixel \[pixels²\]. It is infinite if no pixel is
/// set.
///
/// Columns are processed first, then rows: D(x, y) = min_u ((x − u)² + C(u, y)) is the lower envelope of parabolas
/// \[Felzenszwalb12\].
fn squared_distances(set: &Plane<bool>) -> Plane<f32> {
    let (width, height) = (set.width(), set.height());
    let mut distances = Plane::filled(width, height, f32::INFINITY);

    // Compute C(x, y), the squared distance within the column, downwards and then upwards.
    for x in 0..width {
        let mut away = f32::INFINITY;
        for y in (0..height).chain((0..height).rev()) {
            away = if set.get(x, y) { 0.0 } else { away + 1.0 };
            let nearest = distances.get(x, y).min(away * away);
            distances.set(x, y, nearest);
        }
    }
    // Combine the columns along each row.
    for y in 0..height {
        lower_envelope(distances.row_mut(y));
    }
    distances
}

/// Replaces each C(x) of a row by min_u ((x − u)² + C(u)).
fn lower_envelope(row: &mut [f32]) {
    // List the parabolas of the envelope from left to right: position, height, and start of the interval where the
    // parabola is the lowest.
    let mut envelope: Vec<(f32, f32, f32)> = Vec::new();
    for (u, &height) in row.iter().enumerate().filter(|(_, height)| height.is_finite()) {
        let u = u as f32;
        let from = loop {
            let Some(&(v, other, from)) = envelope.last() else { break f32::NEG_INFINITY };
            let meet = ((height + u * u) - (other + v * v)) / (2.0 * (u - v));
            if meet > from {
                break meet;
            }
            envelope.pop();
        };
        envelope.push((u, height, from));
    }

    // Evaluate the lowest parabola at each pixel.
    let mut lowest = 0;
    for (x, value) in row.iter_mut().enumerate() {
        let x = x as f32;
        while envelope.get(lowest + 1).is_some_and(|&(_, _, from)| from <= x) {
            lowest += 1;
        }
        if let Some(&(u, height, _)) = envelope.get(lowest) {
            *value = (x - u) * (x - u) + height;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The distances are compared with an exhaustive search.
    #[test]
    fn distances_are_those_of_an_exhaustive_search() {
        let (width, height) = (37, 23);
        for seed in 0..40u32 {
            let is_set = |x: usize, y: usize| {
                let mixed = (x as u32 * 73 + y as u32 * 179 + seed * 283).wrapping_mul(2_654_435_761) >> 16;
                mixed % 97 < seed / 4
            };
            let set = Plane::from_fn(width, height, is_set);
            let found = squared_distances(&set);
            for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
                let mut nearest = f32::INFINITY;
                for (u, v) in (0..height).flat_map(|v| (0..width).map(move |u| (u, v))) {
                    if set.get(u, v) {
                        nearest = nearest.min((u as f32 - x as f32).powi(2) + (v as f32 - y as f32).powi(2));
                    }
                }
                assert_eq!(found.get(x, y), nearest, "seed {seed}, pixel {x}, {y}");
            }
        }
    }

    #[test]
    fn it_is_full_at_the_fovea_and_nothing_in_the_periphery() {
        let watched = Plane::from_fn(120, 9, |x, y| (x, y) == (10, 4));
        let map = task_map(&watched, 10.0);
        assert_eq!((map.get(10, 4), map.get(30, 4), map.get(90, 4)), (1.0, 1.0, 0.0));
        // cos² is ½ at 5°, midway between 2° and 8°, and point-symmetric about 5°.
        assert!((map.get(60, 4) - 0.5).abs() < 1e-6);
        assert!((map.get(45, 4) + map.get(75, 4) - 1.0).abs() < 1e-6);
        let nothing = task_map(&Plane::filled(8, 8, false), 10.0);
        assert!(nothing.samples().iter().all(|&value| value == 0.0));
    }
}
