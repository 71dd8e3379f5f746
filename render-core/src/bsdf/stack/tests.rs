//! Tests of all lobes and stacks: energy, reciprocity, and densities.

use crate::bsdf::{Bsdf, BsdfSample, GlassLobe, SurfaceLobes};
use crate::sampling::{hash_unit, owen_sobol_point, uniform_sphere};
use glam::{Vec2, Vec3};
use std::f32::consts::TAU;

const ROUGHNESSES: [f32; 6] = [0.0, 0.1, 0.25, 0.5, 0.75, 1.0];
const COSINES: [f32; 6] = [0.02, 0.1, 0.3, 0.6, 0.9, 1.0];

/// Returns a white dielectric with a coat of 4 %, without further lobes.
pub(super) fn plain(roughness: f32) -> SurfaceLobes {
    SurfaceLobes {
        base: Vec3::ONE,
        specular: Vec3::splat(0.04),
        roughness,
        grazing: 1.0,
        anisotropy: 0.0,
        tangent: Vec3::X,
        clearcoat: 0.0,
        clearcoat_roughness: 0.0,
        clearcoat_normal: Vec3::Z,
        sheen: Vec3::ZERO,
        sheen_roughness: 0.5,
        film: 0.0,
        film_ior: 1.3,
        film_thickness: 400.0,
        glass: GlassLobe { factor: 0.0, is_thin: true, ..GlassLobe::of_ior(1.5) },
        diffuse_transmission: 0.0,
        diffuse_color: Vec3::ONE,
    }
}

/// Returns glass of an index of refraction, as a thin wall or as the interface of a volume.
fn glass(roughness: f32, ior: f32, is_thin: bool) -> SurfaceLobes {
    SurfaceLobes { glass: GlassLobe { is_thin, ..GlassLobe::of_ior(ior) }, ..plain(roughness) }
}

fn bsdf(lobes: &SurfaceLobes, eta: f32) -> Bsdf {
    Bsdf::layered(lobes, [Vec3::X, Vec3::Y, Vec3::Z], eta)
}

/// Returns white stacks by name, each with its index of refraction below the surface.
fn stacks(roughness: f32) -> Vec<(&'static str, SurfaceLobes, f32)> {
    let metal = |anisotropy| SurfaceLobes { base: Vec3::ZERO, specular: Vec3::ONE, anisotropy, ..plain(roughness) };
    let coated = |lobes: SurfaceLobes| SurfaceLobes { clearcoat: 1.0, clearcoat_roughness: 0.2, ..lobes };
    let fibers = |lobes: SurfaceLobes| SurfaceLobes { sheen: Vec3::splat(0.8), sheen_roughness: 0.4, ..lobes };
    let film = |lobes: SurfaceLobes| SurfaceLobes { film: 1.0, ..lobes };
    let leaf = |lobes: SurfaceLobes| SurfaceLobes { diffuse_transmission: 0.6, ..lobes };
    let half = |lobes: SurfaceLobes| SurfaceLobes { glass: GlassLobe { factor: 0.5, ..lobes.glass }, ..lobes };
    vec![
        ("dielectric", plain(roughness), 1.5),
        ("metal", metal(0.0), 1.5),
        ("grooved metal", metal(0.7), 1.5),
        ("clearcoat", coated(plain(roughness)), 1.5),
        ("sheen", fibers(plain(roughness)), 1.5),
        ("clearcoat over sheen", coated(fibers(plain(roughness))), 1.5),
        ("clearcoat on metal", coated(metal(0.0)), 1.5),
        ("film", film(plain(roughness)), 1.5),
        ("leaf", leaf(plain(roughness)), 1.5),
        ("thin glass", glass(roughness, 1.5, true), 1.5),
        ("glass from outside", glass(roughness, 1.5, false), 1.5),
        ("glass from inside", glass(roughness, 1.5, false), 1.0 / 1.5),
        ("water", glass(roughness, 1.33, false), 1.33),
        ("diamond", glass(roughness, 2.4, false), 2.4),
        ("heaviest glass from inside", glass(roughness, 3.0, false), 1.0 / 3.0),
        ("half glass", half(glass(roughness, 1.5, true)), 1.5),
        ("clearcoat over glass", coated(glass(roughness, 1.5, false)), 1.5),
        ("everything", coated(fibers(film(leaf(half(glass(roughness, 1.5, true)))))), 1.5),
    ]
}

/// Number of choices of a lobe for each point of the furnace.
const CHOICES: u32 = 8;

fn towards(cos: f32) -> Vec3 {
    Vec3::new((1.0 - cos * cos).sqrt() * 0.6, (1.0 - cos * cos).sqrt() * 0.8, cos)
}

/// Returns the radiance towards `wo` in equilibrium: uniform light of radiance 1 above the surface, and of radiance n²
/// below it.
fn furnace(bsdf: &Bsdf, below: f32, wo: Vec3, count: u32) -> Vec3 {
    let sample = |i: u32| {
        let light = |s: BsdfSample| if s.direction.z < 0.0 { s.weight * below } else { s.weight };
        // Spread the choices of lobes evenly for each point.
        let (point, k) = (i / CHOICES, i % CHOICES);
        let choice = (k as f32 + hash_unit(1, point.into(), 0)) / CHOICES as f32;
        bsdf.sample(wo, choice, owen_sobol_point(point, 2)).map_or(Vec3::ZERO, light)
    };
    (0..count).map(sample).sum::<Vec3>() / count as f32 + bsdf.straight(wo.z)
}

/// Returns the radiance below the surface in equilibrium.
fn light_below(lobes: &SurfaceLobes, eta: f32) -> f32 {
    if lobes.glass.factor > 0.0 && !lobes.glass.is_thin { eta * eta } else { 1.0 }
}

/// Returns the least reflection of a white stack. Narrow lobes of metals below other layers, and grooves, lose more.
fn least(name: &str) -> f32 {
    match name {
        "grooved metal" => 0.88,
        "clearcoat on metal" => 0.95,
        // A film is approximated by the reflectance at one cosine; its base receives 2 % less for that.
        "film" | "everything" => 0.92,
        "clearcoat over sheen" => 0.97,
        _ => 0.98,
    }
}

/// No stack gains energy, and white stacks of dielectrics lose at most 2 %. Interpolation in tables has an error of
/// 0.5 %.
#[test]
fn a_white_furnace_stays_white() {
    let mut extremes: std::collections::BTreeMap<&str, [f32; 2]> = std::collections::BTreeMap::new();
    for roughness in ROUGHNESSES {
        for (name, lobes, eta) in stacks(roughness) {
            for cos in COSINES {
                let sent = furnace(&bsdf(&lobes, eta), light_below(&lobes, eta), towards(cos), 40_000);
                let [least, most] = extremes.entry(name).or_insert([f32::INFINITY, 0.0]);
                (*least, *most) = (least.min(sent.min_element()), most.max(sent.max_element()));
            }
        }
    }
    println!("{extremes:#?}");
    for (name, [least, most]) in extremes {
        assert!(most <= 1.01 && least >= self::least(name), "{name}: {least} to {most}");
    }
}

fn random(key: u64) -> [f32; 4] {
    std::array::from_fn(|i| hash_unit(9, key, i as u64))
}

/// f/n² is symmetric: n is the index on the side of the first direction.
#[test]
fn light_may_travel_either_way() {
    for (kind, roughness) in [0.1, 0.4, 0.9].into_iter().enumerate() {
        for (name, lobes, eta) in stacks(roughness) {
            // Coatings of a volume are on its outside only.
            if name == "clearcoat over glass" {
                continue;
            }
            let is_volume = light_below(&lobes, eta) != 1.0;
            let (there, back) = (bsdf(&lobes, eta), bsdf(&lobes, if is_volume { 1.0 / eta } else { eta }));
            for key in 0..400 {
                let [u, v, s, t] = random(1000 * kind as u64 + key);
                let (wo, wi) = (uniform_sphere(Vec2::new(u, v)), uniform_sphere(Vec2::new(s, t)));
                let wo = Vec3::new(wo.x, wo.y, wo.z.abs().max(0.01)).normalize();
                let forward = there.evaluate(wo, wi);
                // In reverse, the surface is seen from the side of ω_i.
                let backward = if wi.z > 0.0 {
                    there.evaluate(wi, wo)
                } else {
                    let flip = Vec3::new(1.0, 1.0, -1.0);
                    back.evaluate(wi * flip, wo * flip) / if is_volume { eta * eta } else { 1.0 }
                };
                let scale = forward.max_element().max(backward.max_element()).max(1e-3);
                assert!((forward - backward).abs().max_element() <= 2e-3 * scale, "{name}: {forward} and {backward}");
            }
        }
    }
}

/// Directions fall into cells of equal solid angle on the sphere as often as the density predicts (χ²).
#[test]
fn densities_are_frequencies() {
    const ROWS: usize = 16;
    const COLUMNS: usize = 16;
    const FINE: usize = 16;
    const SAMPLES: u64 = 40_000;
    for (name, lobes, eta) in stacks(0.5) {
        let (bsdf, wo) = (bsdf(&lobes, eta), towards(0.6));
        let mut expected = [0.0f64; ROWS * COLUMNS];
        let fine = 2.0 * std::f64::consts::TAU / (ROWS * COLUMNS * FINE * FINE) as f64;
        for row in 0..ROWS * FINE {
            for column in 0..COLUMNS * FINE {
                let z = 2.0 * (row as f32 + 0.5) / (ROWS * FINE) as f32 - 1.0;
                let angle = TAU * (column as f32 + 0.5) / (COLUMNS * FINE) as f32;
                let sine = (1.0 - z * z).sqrt();
                let pdf = bsdf.pdf(wo, Vec3::new(sine * angle.cos(), sine * angle.sin(), z));
                expected[row / FINE * COLUMNS + column / FINE] += f64::from(pdf) * fine;
            }
        }
        let mut counts = [0u32; ROWS * COLUMNS];
        for i in 0..SAMPLES {
            let [choice, u, v, _] = random(1_000_000 + i);
            let Some(BsdfSample { direction, .. }) = bsdf.sample(wo, choice, Vec2::new(u, v)) else { continue };
            let angle = direction.y.atan2(direction.x).rem_euclid(TAU);
            let column = ((angle / TAU * COLUMNS as f32) as usize).min(COLUMNS - 1);
            let row = (((direction.z + 1.0) / 2.0 * ROWS as f32) as usize).min(ROWS - 1);
            counts[row * COLUMNS + column] += 1;
        }
        let (mut chi2, mut cells) = (0.0f64, 0.0f64);
        for (p, n) in expected.into_iter().zip(counts) {
            let expected = p * SAMPLES as f64;
            if expected > 20.0 {
                chi2 += (f64::from(n) - expected).powi(2) / expected;
                cells += 1.0;
            }
        }
        assert!(cells > 10.0 && chi2 < cells + 5.0 * (2.0 * cells).sqrt(), "{name}: χ² {chi2} of {cells}");
    }
}
