//! Tests that estimates with drawn lights are unbiased.

#[path = "../../examples/rivals/mod.rs"]
mod methods;

use crate::cut::{Scene, scene};
use glam::{DVec3, Vec3};
use lighttree::{BuildParams, Cluster, Emission, Lambert, Light, LightTree, Scratch, Stop, luminance};
use methods::{Drawn, Method, Sum, draw, illuminate};
use proptest::prelude::*;

/// Returns the exact mean of [`Sum::share`] over all numbers passed to [`draw`]. The drawn light is constant on
/// intervals of the number. Bisection finds the ends of the intervals.
fn mean_of_draws(tree: &LightTree, scene: &Scene, root: Cluster) -> DVec3 {
    let draw = |number| draw(tree, &scene.receiver, root, number);
    let is_same = |a: &Drawn, b: &Drawn| a.cluster == b.cluster;
    let mut drawn_light = Sum::new(tree, &scene.receiver, |_, k| scene.visible(k));
    let (mut sum, mut start) = (DVec3::ZERO, 0.0);
    while start < 1.0 {
        let drawn = draw(start);
        let (mut same, mut other) = (start, 1.0);
        while (same + other) / 2.0 > same && (same + other) / 2.0 < other {
            let middle = (same + other) / 2.0;
            if is_same(&draw(middle), &drawn) { same = middle } else { other = middle }
        }
        sum += (other - start) * drawn_light.share(&drawn);
        start = other;
    }
    sum
}

/// Returns a tree over rows of eight lights above a floor, with intensities within a factor of three.
fn ceiling(rows: usize) -> LightTree {
    let lights: Vec<Light> = (0..8 * rows)
        .map(|k| Light {
            position: Vec3::new((k % 8) as f32, (k / 8) as f32, 2.0),
            emission: Emission::Cosine(Vec3::NEG_Z),
            intensity: Vec3::splat(1.0 + (k % 3) as f32),
        })
        .collect();
    LightTree::build(&lights, BuildParams::bounded_by(0.1).with_seed(1))
}

const RECEIVER: Lambert = Lambert { position: Vec3::new(3.0, 1.0, 0.0), normal: Vec3::Z, reflectance: Vec3::ONE };

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    /// The mean light drawn from the roots equals the sum over all lights, even if some lights are rarely drawn.
    #[test]
    fn drawn_lights_are_right_on_average(scene in scene(1..40)) {
        let tree = scene.build(1);
        let truth = scene.truth(&tree).as_dvec3();
        let mean: DVec3 = tree.root_clusters().map(|root| mean_of_draws(&tree, &scene, root)).sum();
        prop_assert!((mean - truth).abs().cmple(1e-4 * truth).all(), "{mean}, truth {truth}");
    }
}

/// The mean over many streams equals the sum over all lights within five standard errors. Intensities differ little, so
/// that no rarely drawn light distorts the estimated standard error.
#[test]
fn streams_are_right_on_average() {
    let tree = ceiling(5);
    let visible = |_: &Light, k: usize| k % 3 != 1;
    let truth = f64::from(luminance(tree.exhaustive(&RECEIVER, visible)));
    let stop = Stop::Absolute(0.1 * truth as f32);
    type Choice = fn(u64, Stop) -> Method;
    let methods: [Choice; 2] =
        [|stream, stop| Method::Stochastic { stop, stream }, |stream, _| Method::Sampled { samples: 2, stream }];
    let mut scratch = Scratch::default();
    for method in methods {
        let streams = 40_000;
        let (mut sum, mut squares) = (0.0, 0.0);
        for stream in 0..streams {
            let lit = illuminate(&tree, &RECEIVER, method(stream, stop), visible, &mut scratch);
            let value = f64::from(luminance(lit.radiance));
            (sum, squares) = (sum + value, squares + value * value);
        }
        let mean = sum / streams as f64;
        let error = ((squares / streams as f64 - mean * mean).max(0.0) / streams as f64).sqrt();
        assert!(error < 0.01 * truth, "a standard error of {error} is too large for {truth}");
        assert!((mean - truth).abs() <= 5.0 * error, "{mean} ± {error}, truth {truth}");
    }
}

/// Equal streams give identical bits, and different streams give different draws.
#[test]
fn streams_are_stable_and_differ() {
    let tree = ceiling(25);
    let mut scratch = Scratch::default();
    let mut at = |stream| {
        let method = Method::Stochastic { stop: Stop::Absolute(0.05), stream };
        illuminate(&tree, &RECEIVER, method, |_, _| true, &mut scratch).radiance
    };
    assert_eq!(at(7), at(7));
    assert_ne!(at(7), at(8));
}
