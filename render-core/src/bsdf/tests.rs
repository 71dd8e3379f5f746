//! Unit tests of the BSDF: properties that hold for any material, and comparisons with histograms.

use super::*;
use crate::sampling::hammersley;
use crate::sampling::{hash_unit, uniform_sphere};
use std::f32::consts::PI;

const ROUGHNESSES: [f32; 7] = [0.0, 0.1, 0.2, 0.4, 0.6, 0.8, 1.0];
const COSINES: [f32; 6] = [0.02, 0.1, 0.3, 0.6, 0.9, 1.0];

fn towards(cos: f32) -> Vec3 {
    Vec3::new((1.0 - cos * cos).sqrt() * 0.6, (1.0 - cos * cos).sqrt() * 0.8, cos)
}

fn random(key: u64) -> [f32; 4] {
    std::array::from_fn(|i| hash_unit(5, key, i as u64))
}

/// Returns the mean weight of samples: radiance towards `wo` in a furnace of radiance 1.
fn furnace(bsdf: &Bsdf, wo: Vec3, count: usize) -> Vec3 {
    let sample = |i: usize| {
        let u = hammersley(i, count);
        bsdf.sample(wo, ((i as f32 + 0.5) * 0.618_034).fract(), u).map_or(Vec3::ZERO, |s| s.weight)
    };
    (0..count).map(sample).sum::<Vec3>() / count as f32
}

#[test]
fn without_a_coat_it_is_lambert_to_the_last_digit() {
    let albedo = Vec3::new(0.2, 0.5, 0.8);
    let bsdf = Bsdf::new(albedo, Vec3::ZERO, 0.3);
    let (wo, wi) = (towards(0.3), towards(0.7));
    assert_eq!(bsdf.evaluate(wo, wi), albedo * FRAC_1_PI);
    assert_eq!(bsdf.pdf(wo, wi), wi.z * FRAC_1_PI);
    assert_eq!(bsdf.sample(wo, 0.5, Vec2::new(0.2, 0.7)).unwrap().weight, albedo);
    assert_eq!(bsdf.evaluate(wo, -wi), Vec3::ZERO);
    assert!(Bsdf::new(Vec3::ZERO, Vec3::ZERO, 0.3).is_black());
}

#[test]
fn a_white_furnace_stays_white() {
    let mut worst = 0.0f32;
    for roughness in ROUGHNESSES {
        for cos in COSINES {
            // A white metal, and a white base under a dielectric coat, neither lose nor gain energy.
            for (albedo, f0) in [(0.0, 1.0), (1.0, 0.04), (1.0, 0.5)] {
                let bsdf = Bsdf::new(Vec3::splat(albedo), Vec3::splat(f0), roughness);
                let sent = furnace(&bsdf, towards(cos), 20_000).x;
                worst = worst.max((sent - 1.0).abs());
                assert!((sent - 1.0).abs() < 0.01, "roughness {roughness}, cosine {cos}, F0 {f0}: {sent}");
            }
        }
    }
    println!("furthest from 1: {worst}");
}

#[test]
fn albedos_are_what_samples_sum_up_to_and_never_above_one() {
    for (key, roughness) in ROUGHNESSES.into_iter().enumerate() {
        for cos in COSINES {
            let [r, g, b, _] = random(key as u64);
            let bsdf = Bsdf::new(Vec3::new(r, g, b), Vec3::new(b, 0.04, r), roughness);
            let (told, found) = (bsdf.directional_albedo(cos), furnace(&bsdf, towards(cos), 20_000));
            assert!((told - found).abs().max_element() < 0.01, "roughness {roughness}, cosine {cos}: {told}, {found}");
            assert!(told.max_element() <= 1.0 + 1e-4);
        }
    }
}

#[test]
fn light_may_travel_either_way() {
    for key in 0..2000 {
        let ([a, b, c, d], [e, f, g, h]) = (random(key), random(key + 10_000));
        let bsdf = Bsdf::new(Vec3::new(a, b, c), Vec3::new(d, e, 0.04), f);
        let up = |u, v| {
            let w = uniform_sphere(Vec2::new(u, v));
            Vec3::new(w.x, w.y, w.z.abs().max(1e-3)).normalize()
        };
        let (wo, wi) = (up(g, h), up(a, h));
        let (there, back) = (bsdf.evaluate(wo, wi), bsdf.evaluate(wi, wo));
        assert!((there - back).abs().max_element() <= 1e-4 * there.max_element(), "{there} and {back}");
    }
}

/// Directions fall into cells of equal solid angle as often as the density predicts, by Pearson's χ² over the cells
/// with enough expected samples.
#[test]
fn densities_are_frequencies() {
    const ROWS: usize = 12;
    const COLUMNS: usize = 24;
    const FINE: usize = 24;
    let samples = 100_000;
    for (key, roughness) in [0.35, 0.5, 0.7, 1.0].into_iter().enumerate() {
        for cos in [0.1, 0.5, 0.95] {
            let bsdf = Bsdf::new(Vec3::splat(0.4), Vec3::new(0.9, 0.5, 0.2), roughness);
            let wo = towards(cos);
            // Integrate the density over each cell at the midpoints of a finer grid.
            let mut expected = [0.0f64; ROWS * COLUMNS];
            let fine = std::f64::consts::TAU / (ROWS * COLUMNS * FINE * FINE) as f64;
            for row in 0..ROWS * FINE {
                for column in 0..COLUMNS * FINE {
                    let z = (row as f32 + 0.5) / (ROWS * FINE) as f32;
                    let angle = std::f32::consts::TAU * (column as f32 + 0.5) / (COLUMNS * FINE) as f32;
                    let sin = (1.0 - z * z).sqrt();
                    let pdf = bsdf.pdf(wo, Vec3::new(sin * angle.cos(), sin * angle.sin(), z));
                    expected[row / FINE * COLUMNS + column / FINE] += f64::from(pdf) * fine;
                }
            }
            let (mut counts, mut below) = ([0u32; ROWS * COLUMNS], 0u32);
            for i in 0..samples {
                let [choice, x, y, _] = random(1_000_000 * key as u64 + i);
                let Some(BsdfSample { direction, pdf, weight }) = bsdf.sample(wo, choice, Vec2::new(x, y)) else {
                    below += 1;
                    continue;
                };
                let again = bsdf.evaluate(wo, direction) * (direction.z / pdf);
                assert!((weight - again).abs().max_element() <= 1e-3 * again.max_element());
                let angle = direction.y.atan2(direction.x).rem_euclid(std::f32::consts::TAU);
                let column = ((angle / std::f32::consts::TAU * COLUMNS as f32) as usize).min(COLUMNS - 1);
                let row = ((direction.z * ROWS as f32) as usize).min(ROWS - 1);
                counts[row * COLUMNS + column] += 1;
            }
            let total: f64 = expected.iter().sum();
            let above = 1.0 - f64::from(below) / samples as f64;
            assert!((total - above).abs() < 0.01, "roughness {roughness}, cosine {cos}: {total} for {above}");
            // Compare only cells with enough expected samples for the χ² approximation.
            let mut cells: Vec<(f64, f64)> = Vec::new();
            for (&p, n) in expected.iter().zip(counts) {
                let (expected, count) = (p * samples as f64, f64::from(n));
                if expected > 20.0 {
                    cells.push((expected, count));
                }
            }
            let chi2: f64 = cells.iter().map(|(e, n)| (n - e).powi(2) / e).sum();
            // χ² has mean k and standard deviation √(2k). A deviation of five standard deviations occurs once in a million.
            let k = cells.len() as f64;
            assert!(
                k > 10.0 && chi2 < k + 5.0 * (2.0 * k).sqrt(),
                "roughness {roughness}, cosine {cos}: χ² {chi2} of {k}"
            );
        }
    }
}

#[test]
fn the_smoothest_coat_is_a_finite_mirror() {
    let bsdf = Bsdf::new(Vec3::ZERO, Vec3::splat(0.8), 0.0);
    let wo = towards(0.7);
    let mirrored = Vec3::new(-wo.x, -wo.y, wo.z);
    assert!(bsdf.evaluate(wo, mirrored).is_finite() && bsdf.pdf(wo, mirrored).is_finite());
    for key in 0..1000 {
        let [_, x, y, _] = random(key);
        let sample = bsdf.sample(wo, 0.5, Vec2::new(x, y)).expect("far from grazing, all samples are above");
        // The density has long tails: one sample in a thousand deviates by more than 30 α.
        assert!(sample.direction.dot(mirrored) > 0.99, "{}", sample.direction);
        assert!((sample.weight.x - 0.8).abs() < 0.01, "{}", sample.weight);
    }
}

/// The terms of the BSDF sum to the complete BSDF.
#[test]
fn coat_and_the_rest_make_the_whole() {
    let albedo = Vec3::new(0.2, 0.5, 0.8);
    for (roughness, cos) in ROUGHNESSES.into_iter().flat_map(|r| COSINES.map(|cos| (r, cos))) {
        let bsdf = Bsdf::new(albedo, Vec3::new(0.9, 0.5, 0.04), roughness);
        let parts = bsdf.coat_albedo(cos) + bsdf.diffuse_albedo(cos);
        assert!((parts - bsdf.directional_albedo(cos)).abs().max_element() < 1e-6);
        // Sample the coat only: the weights are BRDF · cosine / density, and their mean is the coat's albedo.
        let (wo, count) = (towards(cos), 4096);
        let drawn = |i| bsdf.sample_coat(wo, hammersley(i, count)).map_or(Vec3::ZERO, |wi| bsdf.coat_weight(wo, wi));
        let sum = (0..count).map(drawn).sum::<Vec3>() / count as f32;
        assert!((sum - bsdf.coat_albedo(cos)).abs().max_element() < 0.01, "{sum} for roughness {roughness}, {cos}");
    }
    let bare = Bsdf::new(albedo, Vec3::ZERO, 0.3);
    assert_eq!((bare.diffuse_albedo(0.3), bare.coat_albedo(0.3)), (albedo, Vec3::ZERO));
    assert_eq!(bare.sample_coat(Vec3::Z, Vec2::splat(0.5)), None);
}

/// For light from a disc, the widened lobe equals the mean over the disc, tested for one of the narrowest lobes.
#[test]
fn a_disc_is_seen_as_a_wider_lobe() {
    let (bsdf, half_angle) = (Bsdf::new(Vec3::ZERO, Vec3::ONE, 0.4), 0.2f32);
    let wo = towards(0.8);
    let mirrored = Vec3::new(-wo.x, -wo.y, wo.z);
    let (x, y) = crate::sampling::frame(mirrored);
    let mean = (0..1024)
        .map(|i| {
            let p = crate::sampling::concentric_disc(hammersley(i, 1024)) * half_angle.sin();
            bsdf.evaluate_coat(wo, (mirrored + x * p.x + y * p.y).normalize(), 0.0).x
        })
        .sum::<f32>()
        / 1024.0;
    let wide = bsdf.evaluate_coat(wo, mirrored, half_angle).x;
    assert!((wide / mean - 1.0).abs() < 0.05, "{wide} in place of {mean}");
    assert!(bsdf.evaluate_coat(wo, mirrored, 0.0).x > 1.1 * mean, "a point is brighter");
}

/// The BRDF is the sum of the coat, the response of the base to uniform light, and an excess. The excess averages to
/// zero in uniform light.
#[test]
fn the_excess_of_the_base_is_nothing_in_even_light() {
    const COUNT: usize = 20_000;
    for roughness in ROUGHNESSES {
        for cos in COSINES {
            let bsdf = Bsdf::new(Vec3::new(0.8, 0.5, 0.1), Vec3::splat(0.04), roughness);
            let wo = towards(cos);
            let mut sum = Vec3::ZERO;
            for i in 0..COUNT {
                let wi = cosine_hemisphere(Vec3::Z, hammersley(i, COUNT));
                let excess = bsdf.diffuse_excess(wo, wi);
                sum += excess * PI / COUNT as f32;
                let parts = bsdf.evaluate_coat(wo, wi, 0.0) + bsdf.diffuse_albedo(wo.z) * FRAC_1_PI + excess;
                let whole = bsdf.evaluate(wo, wi);
                assert!((parts - whole).abs().max_element() <= 1e-5 * whole.max_element(), "{parts} is not {whole}");
            }
            assert!(sum.abs().max_element() < 2e-3, "roughness {roughness}, cosine {cos}: {sum}");
        }
    }
}
