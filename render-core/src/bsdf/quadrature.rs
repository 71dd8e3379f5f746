//! Means over the hemisphere.

use glam::Vec3;

/// Abscissas of the Gauss–Legendre rule with eight points on −1…1, the positive half (Abramowitz and Stegun, 25.4).
const ABSCISSAS: [f32; 4] = [0.183_434_64, 0.525_532_4, 0.796_666_5, 0.960_289_86];
/// Weights of [`ABSCISSAS`].
const WEIGHTS: [f32; 4] = [0.362_683_78, 0.313_706_65, 0.222_381_03, 0.101_228_54];

/// Returns the cosine-weighted mean of a function of the cosine over the hemisphere, 2 ∫ f(μ) μ dμ over 0…1.
pub(super) fn cosine_mean(f: impl Fn(f32) -> Vec3) -> Vec3 {
    let mut sum = Vec3::ZERO;
    for (x, weight) in ABSCISSAS.into_iter().zip(WEIGHTS) {
        // Both points ±x, moved to 0…1. The rule integrates 2 μ over 0…1 with half of its weights.
        for cos in [0.5 - x / 2.0, 0.5 + x / 2.0] {
            sum += f(cos) * (weight * cos);
        }
    }
    sum
}

/// Returns 2 ∫ f(μ) μ dμ over 0…1, exactly, for a function that is linear between the entries of a table. The entries
/// are spaced evenly in s = √μ.
///
/// ```text
/// μ = s²:  4 ∫ f s³ ds, linear in s from p at a to q at b:  4 (p (b m₃ − m₄) + q (m₄ − a m₃)) / (b − a)
///   m₃ = (b⁴ − a⁴)/4     m₄ = (b⁵ − a⁵)/5
/// ```
pub(super) fn tabulated_mean(row: &[f32]) -> f32 {
    let place = |i: usize| i as f64 / (row.len() - 1) as f64;
    let mut sum = 0.0f64;
    for (i, pair) in row.windows(2).enumerate() {
        let (a, b) = (place(i), place(i + 1));
        let (m3, m4) = ((b.powi(4) - a.powi(4)) / 4.0, (b.powi(5) - a.powi(5)) / 5.0);
        let [p, q] = [pair[0], pair[1]].map(f64::from);
        sum += 4.0 * (p * (b * m3 - m4) + q * (m4 - a * m3)) / (b - a);
    }
    sum as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 2 ∫ μⁿ μ dμ = 2 / (n + 2).
    #[test]
    fn powers_have_their_closed_form() {
        for n in 0..=6 {
            let mean = cosine_mean(|cos| Vec3::splat(cos.powi(n))).x;
            assert!((mean - 2.0 / (n as f32 + 2.0)).abs() < 1e-5, "{mean} for exponent {n}");
        }
    }
}
