//! Tests of picture metrics, which are compared with closed forms and identities.

use perceptual::{flicker, mse, psnr, relative_mse, rmse, ssim};
use plane::{Correspondence, NO_MATCH, Plane};
use proptest::prelude::*;

fn noise(width: usize, height: usize, seed: u32) -> Plane<u8> {
    let mut state = seed;
    Plane::from_fn(width, height, |_, _| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 24) as u8
    })
}

#[test]
fn squared_errors_of_constants() {
    let (a, b) = (Plane::filled(7, 5, 10u8), Plane::filled(7, 5, 13u8));
    assert_eq!(mse(&a, &b), 9.0);
    assert!((psnr(&a, &b) - 10.0 * (255.0f64 * 255.0 / 9.0).log10()).abs() < 1e-12);
    assert_eq!(psnr(&a, &a), f64::INFINITY);
    assert_eq!(psnr(&Plane::filled(4, 4, 0u8), &Plane::filled(4, 4, 255u8)), 0.0);
    let (a, b) = (Plane::filled(3, 3, 1.5f32), Plane::filled(3, 3, 1.0f32));
    assert_eq!(rmse(&a, &b), 0.5);
    assert!((relative_mse(&a, &b) - 0.25 / 1.01).abs() < 1e-12);
    let (a, b) = (Plane::filled(3, 3, [1.0f32, 2.0, 3.0]), Plane::filled(3, 3, [1.0f32, 2.0, 0.0]));
    assert!((rmse(&a, &b) - 3f64.sqrt()).abs() < 1e-12, "nine over three components");
    assert!((relative_mse(&a, &b) - 9.0 / 0.01 / 3.0).abs() < 1e-9);
    assert_eq!(rmse::<f32>(&Plane::default(), &Plane::default()), 0.0);
}

#[test]
fn structural_similarity_of_constants() {
    for size in [1, 4, 11, 16] {
        let (a, b) = (Plane::filled(size, size, 100u8), Plane::filled(size, size, 120u8));
        let c1 = (0.01f64 * 255.0).powi(2);
        let wanted = (2.0 * 100.0 * 120.0 + c1) / (100.0 * 100.0 + 120.0 * 120.0 + c1);
        assert!((ssim(&a, &b) - wanted).abs() < 1e-9, "{size}");
    }
}

/// SSIM is compared with its definition with a two-dimensional window, at the only window position of an 11×11 picture.
#[test]
fn structural_similarity_of_one_window() {
    let (a, b) = (noise(11, 11, 1), noise(11, 11, 2));
    let bell = |i: usize| (-((i % 11) as f64 - 5.0).powi(2) / 4.5 - ((i / 11) as f64 - 5.0).powi(2) / 4.5).exp();
    let total: f64 = (0..121).map(bell).sum();
    let expectation = |f: &dyn Fn(f64, f64) -> f64| -> f64 {
        (0..121).map(|i| bell(i) / total * f(f64::from(a.samples()[i]), f64::from(b.samples()[i]))).sum()
    };
    let (mean_a, mean_b) = (expectation(&|a, _| a), expectation(&|_, b| b));
    let variance_a = expectation(&|a, _| (a - mean_a).powi(2));
    let variance_b = expectation(&|_, b| (b - mean_b).powi(2));
    let covariance = expectation(&|a, b| (a - mean_a) * (b - mean_b));
    let (c1, c2) = ((0.01f64 * 255.0).powi(2), (0.03f64 * 255.0).powi(2));
    let wanted = (2.0 * mean_a * mean_b + c1) * (2.0 * covariance + c2)
        / ((mean_a.powi(2) + mean_b.powi(2) + c1) * (variance_a + variance_b + c2));
    assert!((ssim(&a, &b) - wanted).abs() < 1e-9);
}

#[test]
fn noise_lowers_similarity() {
    let wave = Plane::from_fn(40, 30, |x, y| (128.0 + 60.0 * (0.3 * x as f32).sin() * (0.2 * y as f32).cos()) as u8);
    let disturbed = |amount: u8| {
        let noise = noise(40, 30, 9);
        Plane::from_fn(40, 30, |x, y| wave.get(x, y).saturating_add(noise.get(x, y) % amount))
    };
    let (little, much) = (ssim(&disturbed(8), &wave), ssim(&disturbed(80), &wave));
    assert!(1.0 > little && little > much && much > 0.0, "{little} {much}");
}

#[test]
#[should_panic(expected = "same size")]
fn pictures_of_different_size_cannot_be_compared() {
    let _ = psnr(&noise(4, 4, 1), &noise(4, 5, 1));
}

proptest! {
    #[test]
    fn identities(width in 1usize..24, height in 1usize..24, seed in any::<u32>()) {
        let (a, b) = (noise(width, height, seed), noise(width, height, seed ^ 0x5555));
        prop_assert!((ssim(&a, &a) - 1.0).abs() < 1e-9);
        prop_assert!((ssim(&a, &b) - ssim(&b, &a)).abs() < 1e-12);
        prop_assert!(ssim(&a, &b).abs() <= 1.0 + 1e-9);
        prop_assert_eq!(mse(&a, &b), mse(&b, &a));
        let (float_a, float_b) = (a.map(f32::from), b.map(f32::from));
        prop_assert!((rmse(&float_a, &float_b).powi(2) - mse(&a, &b)).abs() < 1e-6);
    }
}

#[test]
fn only_errors_that_change_flicker() {
    let (reference, before) = (noise(16, 8, 3).map(|v| v / 2), noise(16, 8, 4).map(|v| v / 2));
    let still = Correspondence::still(16, 8);
    let off_by = |plane: &Plane<u8>, error: u8| plane.map(|v| v + error);
    let of = |now: u8, then: u8, known: &Correspondence| {
        flicker([&off_by(&reference, now), &off_by(&before, then)], [&reference, &before], known)
    };
    assert_eq!(of(0, 0, &still), 0.0);
    assert_eq!(of(7, 7, &still), 0.0, "an error that stays");
    assert_eq!(of(7, 5, &still), 4.0);
    assert_eq!(of(0, 3, &still), 9.0);
    assert_eq!(of(0, 3, &Correspondence::from_matches(Plane::filled(16, 8, NO_MATCH))), 0.0, "nothing to compare with");
    // The error moves with its surface, one pixel to the right per frame.
    let error = Plane::from_fn(16, 8, |x, y| ((3 * x + 5 * y) % 11) as u8);
    let moved = Plane::from_fn(16, 8, |x, y| error.get_clamped(x as isize - 1, y as isize));
    let plus = |a: &Plane<u8>, b: &Plane<u8>| Plane::from_fn(16, 8, |x, y| a.get(x, y) + b.get(x, y));
    let (now, then) = (plus(&reference, &moved), plus(&before, &error));
    let one_to_the_left = |x, y| if x > 0 { (16 * y + x - 1) as u32 } else { NO_MATCH };
    let along = Correspondence::from_matches(Plane::from_fn(16, 8, one_to_the_left));
    assert_eq!(flicker([&now, &then], [&reference, &before], &along), 0.0);
    assert!(flicker([&now, &then], [&reference, &before], &still) > 5.0);
}
