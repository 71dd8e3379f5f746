//! Tests of equations (1) to (3), which are compared with a transcription in `f64`, and of their guarantees.

use perceptual::{DEFAULT_INTRA_MATRIX, MaskingModel, mean_dc};
use plane::{Plane, dct_definition, idct_definition};
use proptest::prelude::*;

/// Evaluates eq. (1) in `f64`.
fn equation_1(q: f64, c_00: f64, mean: f64) -> f64 {
    q * (c_00 / mean).powf(0.649 * 2.0)
}

/// Evaluates eq. (2) in `f64`.
fn equation_2(t: f64, c: f64, ij: usize) -> f64 {
    if ij == 0 { t } else { t * (c.abs() / t).max(1.0).powf(0.7) }
}

/// Evaluates eq. (3) in `f64`.
fn equation_3(c: f64, m: f64, q: f64, s: f64) -> f64 {
    let sign = if c < 0.0 { -1.0 } else { 1.0 };
    if c.abs() < 0.5 * q * s { 0.5 * sign * s * 16.0 } else { c + 0.5 * sign * s * m }
}

fn coefficients() -> impl Strategy<Value = Vec<f32>> {
    (prop::collection::vec(-1.0f32..1.0, 64), 0.1f32..500.0, 100.0f32..1700.0).prop_map(|(mut c, spread, dc)| {
        c.iter_mut().for_each(|c| *c *= spread);
        c[0] = dc;
        c
    })
}

fn luma_plane() -> impl Strategy<Value = Plane<f32>> {
    (prop::collection::vec(-1.0f32..1.0, 24 * 16), 0.0f32..60.0, 70.0f32..150.0).prop_map(|(noise, spread, mean)| {
        Plane::from_fn(24, 16, |x, y| mean + 0.5 * x as f32 + spread * noise[24 * y + x])
    })
}

fn array(c: &[f32]) -> [f32; 64] {
    c.try_into().unwrap()
}

proptest! {
    #[test]
    fn blocks_follow_the_equations(c in coefficients(), mean in 200.0f32..1500.0, quantiser_scale in 1u8..=112) {
        let (c, model) = (array(&c), MaskingModel::default());
        let s = f64::from(quantiser_scale) / 16.0;
        let t = model.luminance_thresholds(c[0], mean);
        let m = MaskingModel::contrast_thresholds(&t, &c);
        let distorted = model.worst_case(&c, &m, f32::from(quantiser_scale));
        for ij in 0..64 {
            let (q, coefficient) = (f64::from(DEFAULT_INTRA_MATRIX[ij]), f64::from(c[ij]));
            let exact_t = equation_1(q, f64::from(c[0]), f64::from(mean));
            prop_assert!((f64::from(t[ij]) / exact_t - 1.0).abs() < 1e-5);
            let exact_m = equation_2(exact_t, coefficient, ij);
            prop_assert!((f64::from(m[ij]) / exact_m - 1.0).abs() < 1e-5);
            prop_assert!(m[ij] >= t[ij], "masking never lowers a threshold");
            // Rounding does not change the case of eq. (3), because its condition is exact in `f32`.
            let exact = equation_3(coefficient, exact_m, q, s);
            prop_assert!((f64::from(distorted[ij]) - exact).abs() <= 1e-5 * exact.abs(), "{} {exact}", distorted[ij]);
        }
    }

    #[test]
    fn planes_follow_the_equations(luma in luma_plane(), quantiser_scale in 1u8..=112) {
        let (columns, rows) = luma.block_counts();
        let s = f64::from(quantiser_scale) / 16.0;
        let blocks: Vec<[f64; 64]> = (0..columns * rows)
            .map(|i| dct_definition(&luma.block(i % columns, i / columns).map(f64::from)))
            .collect();
        let mean = blocks.iter().map(|c| c[0]).sum::<f64>() / blocks.len() as f64;
        prop_assert!((f64::from(mean_dc(&luma)) / mean - 1.0).abs() < 1e-5);
        // At the border between the two cases of eq. (3), rounding may select either case.
        let at_the_edge = |c: &[f64; 64]| (0..64).any(|ij| {
            (c[ij].abs() - 0.5 * f64::from(DEFAULT_INTRA_MATRIX[ij]) * s).abs() < 1e-3
                || c[ij].abs() < 1e-3
        });
        prop_assume!(!blocks.iter().any(at_the_edge));
        let distorted = MaskingModel::default().worst_case_luma(&luma, f32::from(quantiser_scale));
        for (i, c) in blocks.iter().enumerate() {
            let exact: [f64; 64] = std::array::from_fn(|ij| {
                let q = f64::from(DEFAULT_INTRA_MATRIX[ij]);
                let m = equation_2(equation_1(q, c[0], mean), c[ij], ij);
                equation_3(c[ij], m, q, s)
            });
            let exact = idct_definition(&exact);
            for (fast, exact) in distorted.block(i % columns, i / columns).iter().zip(exact) {
                prop_assert!((f64::from(*fast) - exact).abs() < 0.02, "{fast} {exact}");
            }
        }
    }

    #[test]
    fn surviving_coefficients_move_further_at_coarser_steps(c in coefficients(), quantiser_scale in 1u8..=56) {
        let (c, model) = (array(&c), MaskingModel::default());
        let m = MaskingModel::contrast_thresholds(&model.luminance_thresholds(c[0], 800.0), &c);
        let scale = f32::from(quantiser_scale);
        let (fine, coarse) = (model.worst_case(&c, &m, scale), model.worst_case(&c, &m, 2.0 * scale));
        for ij in 0..64 {
            if c[ij].abs() >= 0.5 * f32::from(DEFAULT_INTRA_MATRIX[ij]) * 2.0 * scale / 16.0 {
                prop_assert!((coarse[ij] - c[ij]).abs() > (fine[ij] - c[ij]).abs());
            }
        }
    }
}

#[test]
fn a_blank_block_keeps_the_luminance_adjusted_base() {
    let mut c = [0.0; 64];
    c[0] = 1000.0;
    let t = MaskingModel::default().luminance_thresholds(1000.0, 500.0);
    assert_eq!(MaskingModel::contrast_thresholds(&t, &c), t);
    let brighter = 2f32.powf(0.649 * 2.0);
    assert!((t[1] / (16.0 * brighter) - 1.0).abs() < 1e-5);
}

#[test]
fn a_blank_block_has_the_root_mean_square_of_the_smallest_step() {
    let flat = Plane::filled(16, 8, 100.0f32);
    for quantiser_scale in [2.0, 16.0, 40.0] {
        let s = quantiser_scale / 16.0;
        let distorted = MaskingModel::default().worst_case_luma(&flat, quantiser_scale);
        let block = distorted.block(1, 0);
        let square: f32 = block.iter().map(|v| (v - 100.0).powi(2)).sum::<f32>() / 64.0;
        // The distortion has 63 waves of ½ s · 16, and ½ s · 8 in the DC.
        let wanted = (63.0 * (8.0f32 * s).powi(2) + (4.0f32 * s).powi(2)) / 64.0;
        assert!((square / wanted - 1.0).abs() < 1e-4, "{square} {wanted}");
    }
}

#[test]
fn a_black_picture_has_ratio_one() {
    let model = MaskingModel::default();
    assert_eq!(model.luminance_thresholds(0.0, 0.0), DEFAULT_INTRA_MATRIX.map(f32::from));
    assert_eq!(model.luminance_thresholds(f32::NAN, f32::NAN), DEFAULT_INTRA_MATRIX.map(f32::from));
    let black = Plane::filled(20, 11, 0.0f32);
    assert_eq!(mean_dc(&black), 0.0);
    for quantiser_scale in [1.0, 112.0] {
        let distorted = model.worst_case_luma(&black, quantiser_scale);
        assert!(distorted.samples().iter().all(|v| v.is_finite()));
        // The DC vanishes and is replaced, so the mean changes by s · 16 / 2 / 8.
        let mean = distorted.block(0, 0).iter().sum::<f32>() / 64.0;
        assert!((mean - quantiser_scale / 16.0).abs() < 1e-3, "{mean}");
    }
}

#[test]
fn a_white_block_in_black_stays_within_the_bound() {
    let lone = Plane::from_fn(512, 512, |x, y| if x / 8 == 20 && y / 8 == 30 { 219.0f32 } else { 0.0 });
    let model = MaskingModel::default();
    let t = model.luminance_thresholds(1752.0, mean_dc(&lone));
    assert!((t[0] / (8.0 * 16f32.powf(1.298)) - 1.0).abs() < 1e-5, "{}", t[0]);
    for quantiser_scale in [1.0, 112.0] {
        let distorted = model.worst_case_luma(&lone, quantiser_scale);
        assert!(distorted.samples().iter().all(|v| v.is_finite() && v.abs() < 1e4));
    }
}

#[test]
fn broken_input_does_not_spread() {
    let model = MaskingModel::default();
    let clean = Plane::from_fn(24, 24, |x, y| (3 * x + 5 * y) as f32);
    let mut broken = clean.clone();
    let mut replaced = clean.clone();
    for (x, value) in [(1, f32::NAN), (2, f32::INFINITY), (3, f32::NEG_INFINITY)] {
        broken.set(x, 2, value);
        replaced.set(x, 2, 0.0);
    }
    assert_eq!(model.worst_case_luma(&broken, 8.0), model.worst_case_luma(&replaced, 8.0));
    broken.set(9, 9, f32::MAX);
    assert!(model.worst_case_luma(&broken, 8.0).samples().iter().all(|v| v.is_finite()));
    for odd in [f32::NAN, f32::INFINITY, -1.0, 0.0] {
        let model = MaskingModel { display_gamma: odd, max_luminance_ratio: odd, intra_matrix: [0; 64] };
        assert!(model.worst_case_luma(&clean, odd).samples().iter().all(|v| v.is_finite()), "{odd}");
    }
    assert!(model.worst_case_luma(&Plane::filled(0, 0, 0.0), 8.0).samples().is_empty());
}

#[test]
fn the_default_matrix_rises_along_rows_and_columns() {
    assert_eq!(DEFAULT_INTRA_MATRIX[0], 8);
    assert_eq!(DEFAULT_INTRA_MATRIX[1..].iter().min(), Some(&16));
    for (i, &q) in DEFAULT_INTRA_MATRIX.iter().enumerate() {
        assert!(i % 8 == 7 || q <= DEFAULT_INTRA_MATRIX[i + 1], "{i}");
        assert!(i / 8 == 7 || q <= DEFAULT_INTRA_MATRIX[i + 8], "{i}");
    }
}

#[cfg(feature = "serde")]
#[test]
fn settings_file() {
    let model: MaskingModel = toml::from_str("display_gamma = 2.2").unwrap();
    assert_eq!(model, MaskingModel { display_gamma: 2.2, ..MaskingModel::default() });
    assert_eq!(toml::from_str::<MaskingModel>(&toml::to_string(&model).unwrap()).unwrap(), model);
    assert!(toml::from_str::<MaskingModel>("intra_matrix = [8, 16]").is_err());
}
