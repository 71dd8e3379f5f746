//! Tests of the guarantees of a lightcut, which is compared with the sum over all lights.

use glam::Vec3;
use lighttree::{
    BuildParams, Emission, Lambert, Light, LightTree, Lightcut, Real, Receiver, Region, Scratch, Stop, Vector3,
    luminance,
};
use proptest::prelude::*;

/// Rounding error of cosines near 90°, relative to the light if all lights and the receiver faced each other.
const ROUNDING: f32 = 2e-5;

fn vector(range: f32) -> impl Strategy<Value = Vec3> {
    (-range..range, -range..range, -range..range).prop_map(|(x, y, z)| Vec3::new(x, y, z))
}

fn light() -> impl Strategy<Value = Light> {
    let emission = prop_oneof![
        1 => Just(Emission::Omni),
        3 => vector(1.0).prop_map(|v| Emission::Cosine(v.try_normalize().unwrap_or(Vec3::X))),
    ];
    let position = prop_oneof![
        6 => vector(1.0),
        2 => vector(3.0).prop_map(Vec3::round),
        1 => vector(1.0).prop_map(|v| v.normalize_or(Vec3::Y) * 100.0),
    ];
    let intensity = prop_oneof![1 => Just(Vec3::ZERO), 6 => vector(1.0).prop_map(Vec3::abs)];
    (position, emission, intensity).prop_map(|(position, emission, intensity)| Light { position, emission, intensity })
}

/// Lights and a receiver. Some of the lights are occluded.
#[derive(Clone, Debug)]
pub struct Scene {
    lights: Vec<Light>,
    pub receiver: Lambert,
    geometry_term_bound: f32,
    shadow_seed: u64,
}

impl Scene {
    pub fn build(&self, seed: u64) -> LightTree {
        LightTree::build(&self.lights, BuildParams::bounded_by(self.geometry_term_bound).with_seed(seed))
    }

    pub fn visible(&self, index: usize) -> bool {
        (self.shadow_seed ^ (index as u64 + 1)).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 62 != 0
    }

    fn cut(&self, tree: &LightTree, stop: Stop, max_size: u32) -> Lightcut {
        tree.lightcut(&self.receiver, stop, |_, k| self.visible(k), &mut Scratch::with_max_size(max_size))
    }

    pub fn truth(&self, tree: &LightTree) -> Vec3 {
        tree.exhaustive(&self.receiver, |_, k| self.visible(k))
    }

    /// Returns the luminance at the receiver if it and all lights face each other.
    fn face_to_face(&self) -> f32 {
        let arrives = |light: &Light| {
            let r2 = light.position.distance_squared(self.receiver.position);
            luminance(light.intensity * self.receiver.reflectance) / (r2 + self.geometry_term_bound)
        };
        self.lights.iter().map(arrives).sum::<f32>() / std::f32::consts::PI
    }

    /// Returns a typical threshold: `share` times the face-to-face luminance.
    fn threshold(&self, share: f32) -> Stop {
        Stop::Absolute(share * self.face_to_face())
    }
}

pub fn scene(count: std::ops::Range<usize>) -> impl Strategy<Value = Scene> {
    let on_light = prop::option::weighted(0.2, any::<prop::sample::Index>());
    let free = (vector(1.0), vector(1.0), on_light, any::<u64>());
    (prop::collection::vec(light(), count), free, -3.0..3.0f32, -3.0..3.0f32, -4.0..0.0f32).prop_map(
        |(mut lights, (position, normal, on_light, shadow_seed), length, power, softening)| {
            let (length, power) = (10f32.powf(length), 10f32.powf(power));
            for light in &mut lights {
                light.position *= length;
                light.intensity *= power;
            }
            let position = match on_light {
                Some(index) if !lights.is_empty() => index.get(&lights).position,
                _ => position * length,
            };
            let normal = normal.try_normalize().unwrap_or(Vec3::Z);
            let receiver = Lambert { position, normal, reflectance: Vec3::new(0.9, 0.5, 0.1) };
            Scene { lights, receiver, geometry_term_bound: length * length * 10f32.powf(softening), shadow_seed }
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(500))]

    /// The error is within the total bound. This is the central guarantee.
    #[test]
    fn cut_is_within_its_bound(scene in scene(0..200), seed: u64, share in -5.0..0.0f32, max_size in 1..300u32) {
        let tree = scene.build(seed);
        let truth = luminance(scene.truth(&tree));
        let slack = ROUNDING * scene.face_to_face();
        let share = 10f32.powf(share);
        for stop in [scene.threshold(share), Stop::Relative { fraction: share, known_luminance: 0.1 * truth }] {
            let cut = scene.cut(&tree, stop, max_size);
            let error = (luminance(cut.radiance) - truth).abs();
            prop_assert!(error <= cut.total_bound * 1.0001 + slack, "error {error} of {truth}: {cut:?}");
            prop_assert!(cut.size <= max_size);
            prop_assert!(cut.largest_bound <= cut.total_bound * 1.0001);
            let threshold = stop.threshold_at(luminance(cut.radiance));
            prop_assert!(cut.largest_bound <= threshold * 1.0001 || cut.size == max_size, "{cut:?} {threshold}");
        }
    }

    #[test]
    fn threshold_zero_is_every_light(scene in scene(0..200), seed: u64) {
        let tree = scene.build(seed);
        let truth = scene.truth(&tree);
        for stop in [Stop::Absolute(0.0), Stop::Relative { fraction: 0.0, known_luminance: 1.0 }] {
            let cut = scene.cut(&tree, stop, 1000);
            prop_assert!((luminance(cut.radiance) - luminance(truth)).abs() <= ROUNDING * scene.face_to_face());
            prop_assert_eq!((cut.largest_bound, cut.total_bound), (0.0, 0.0));
        }
    }

    /// Lengths are scaled by 2 and intensities by 4. These are powers of two, so all bits agree.
    #[test]
    fn scale_changes_nothing(scene in scene(0..200), seed: u64, share in 0.001..0.1f32) {
        let mut larger = scene.clone();
        for light in &mut larger.lights {
            light.position *= 2.0;
            light.intensity *= 4.0;
        }
        larger.receiver.position *= 2.0;
        larger.geometry_term_bound *= 4.0;
        let (small, large) = (scene.build(seed), larger.build(seed));
        let stop = scene.threshold(share);
        prop_assert_eq!(scene.cut(&small, stop, 1000), larger.cut(&large, stop, 1000));
        prop_assert_eq!(scene.truth(&small), larger.truth(&large));
    }

    #[test]
    fn update_sums_like_a_new_tree(scene in scene(1..200), seed: u64, factor in prop::collection::vec(0.0..2.0f32, 200)) {
        let mut tree = scene.build(seed);
        let mut later = scene.clone();
        for (light, factor) in later.lights.iter_mut().zip(factor) {
            light.intensity *= factor;
        }
        let intensities: Vec<Vec3> = later.lights.iter().map(|light| light.intensity).collect();
        let stats = tree.update(&intensities);
        prop_assert_eq!(tree.validate(), Ok(()));
        prop_assert_eq!(stats.rejected, 0);
        // A tree of n lights has n − 1 inner nodes.
        let inner = scene.lights.len().saturating_sub(1).max(1);
        prop_assert_eq!(stats.swapped_share, stats.swapped as f64 / inner as f64);
        let rebuilt = later.build(seed);
        prop_assert!(tree.total_intensity().abs_diff_eq(
            rebuilt.total_intensity(), 1e-5 * rebuilt.total_intensity().max_element()));
        prop_assert_eq!(later.truth(&tree), later.truth(&rebuilt));
        let cut = later.cut(&tree, later.threshold(0.01), 1000);
        let error = luminance(cut.radiance - later.truth(&rebuilt)).abs();
        prop_assert!(error <= cut.total_bound * 1.0001 + ROUNDING * later.face_to_face());
        // A second update with the same intensities swaps nothing.
        prop_assert_eq!(tree.update(&intensities).swapped, 0);
    }

    #[test]
    fn stored_tree_cuts_the_same(scene in scene(0..100), seed: u64) {
        let tree = scene.build(seed);
        let config = bincode::config::standard();
        let bytes = bincode::serde::encode_to_vec(&tree, config).unwrap();
        let (restored, read): (LightTree, usize) = bincode::serde::decode_from_slice(&bytes, config).unwrap();
        prop_assert_eq!(read, bytes.len());
        prop_assert_eq!(restored.validate(), Ok(()));
        let stop = scene.threshold(0.01);
        prop_assert_eq!(scene.cut(&tree, stop, 1000), scene.cut(&restored, stop, 1000));
        prop_assert_eq!(bincode::serde::encode_to_vec(&restored, config).unwrap(), bytes);
    }
}

fn lamp(x: f32, intensity: f32) -> Light {
    Light {
        position: Vec3::new(x, 0.0, 2.0),
        emission: Emission::Cosine(Vec3::NEG_Z),
        intensity: Vec3::splat(intensity),
    }
}

const FLOOR: Lambert = Lambert { position: Vec3::ZERO, normal: Vec3::Z, reflectance: Vec3::ONE };
const PARAMS: BuildParams = BuildParams::bounded_by(0.01).with_seed(7);

#[test]
fn few_lights() {
    let mut scratch = Scratch::default();
    let stop = Stop::Absolute(0.0);
    let none = LightTree::build(&[], PARAMS);
    assert_eq!((none.len(), none.is_empty(), none.depth(), none.validate()), (0, true, 0, Ok(())));
    assert_eq!(none.lightcut(&FLOOR, stop, |_, _| true, &mut scratch), Lightcut::default());
    assert_eq!(none.clone().update(&[]).swapped, 0);

    let one = LightTree::build(&[lamp(0.0, 3.0)], PARAMS);
    let cut = one.lightcut(&FLOOR, stop, |_, _| true, &mut scratch);
    assert_eq!((cut.size, cut.shadow_rays, one.depth()), (1, 1, 1));
    assert_eq!(cut.radiance, one.exhaustive(&FLOOR, |_, _| true));
    assert_eq!(one.lightcut(&FLOOR, stop, |_, _| false, &mut scratch).radiance, Vec3::ZERO);
}

/// Black receivers, dark lights and lights behind the receiver need no estimate and no shadow ray.
#[test]
fn nothing_is_cheap() {
    let lights: Vec<Light> = (0..100).map(|k| lamp(k as f32, 1.0)).collect();
    let mut tree = LightTree::build(&lights, PARAMS);
    let mut scratch = Scratch::default();
    let mut cut = |tree: &LightTree, receiver: Lambert| {
        let no_ray = |_: &Light, _| unreachable!("a shadow ray for nothing");
        tree.lightcut(&receiver, Stop::Absolute(0.0), no_ray, &mut scratch)
    };
    let mut nothing = Lightcut::default();
    nothing.nodes_visited = 1;
    assert_eq!(cut(&tree, Lambert { reflectance: Vec3::ZERO, ..FLOOR }), nothing);
    assert_eq!(cut(&tree, Lambert { normal: Vec3::NEG_Z, ..FLOOR }), nothing);
    assert_eq!(cut(&tree, Lambert { position: Vec3::Z * 3.0, ..FLOOR }), nothing);
    tree.update(&[Vec3::ZERO; 100]);
    assert_eq!(cut(&tree, FLOOR), nothing);
}

/// If a child has the same representative as its parent, it reuses the value and the shadow ray of that representative.
#[test]
fn no_light_gets_two_shadow_rays() {
    let lights: Vec<Light> = (0..500).map(|k| lamp((k % 25) as f32 - 12.0, 1.0 + (k / 25) as f32)).collect();
    let tree = LightTree::build(&lights, PARAMS);
    let truth = luminance(tree.exhaustive(&FLOOR, |_, _| true));
    let mut scratch = Scratch::with_max_size(100);
    // The last stopping rule reaches the maximum size.
    for stop in [
        Stop::Absolute(0.02 * truth),
        Stop::Relative { fraction: 0.02, known_luminance: 0.0 },
        Stop::Absolute(1e-5 * truth),
    ] {
        for kept in [true, false] {
            let mut rays = vec![0; lights.len()];
            let visible = |_: &Light, k: usize| {
                rays[k] += 1;
                true
            };
            let cut = if kept {
                tree.lightcut_kept(&FLOOR, stop, visible, &mut scratch)
            } else {
                tree.lightcut(&FLOOR, stop, visible, &mut scratch)
            };
            assert!(rays.iter().all(|&count| count <= 1), "{stop:?}");
            assert_eq!(rays.iter().sum::<u32>(), cut.shadow_rays);
            // If rays depend on previous rays, some rays are traced to halves that are not in the final lightcut.
            let allowed = if kept || stop == Stop::Absolute(0.02 * truth) { 0 } else { cut.size / 2 };
            assert!((cut.size..=cut.size + allowed).contains(&cut.shadow_rays), "{stop:?}: {cut:?}");
            assert!(cut.size > 10, "{cut:?}");
        }
    }
}

/// A receiver that checks that every direction is a unit vector.
struct Probe;

impl Receiver for Probe {
    fn position(&self) -> Vec3 {
        Vec3::new(3.0, 0.0, 2.0)
    }
    fn reflect<F: Real>(&self, direction: Vector3<F>) -> Vector3<F> {
        F::map3(direction, |direction| {
            // If a light is at the receiver's position, the direction is undefined and the value is ignored.
            assert!((direction.length() - 1.0).abs() < 1e-5 || direction == Vec3::ZERO, "{direction}");
            Vec3::ONE
        })
    }
    fn reflect_bound<F: Real>(&self, _: &Region<F>) -> Vector3<F> {
        Vector3::splat(Vec3::ONE)
    }
}

#[test]
fn receiver_on_a_light_sees_the_others() {
    let lights: Vec<Light> = (0..6).map(|k| Light { emission: Emission::Omni, ..lamp(k as f32, 1.0) }).collect();
    let tree = LightTree::build(&lights, PARAMS);
    let cut = tree.lightcut(&Probe, Stop::Absolute(0.0), |_, _| true, &mut Scratch::default());
    let expected: f32 = [9.0, 4.0, 1.0, 1.0, 4.0].iter().map(|r2| 1.0 / (r2 + 0.01)).sum();
    assert!((cut.radiance.x - expected).abs() < 1e-5, "{cut:?}");
}

/// A fading lamp is no longer the representative once its intensity falls below 0.7 times the other lamp's.
#[test]
fn faded_representative_is_swapped() {
    let mut tree = LightTree::build(&[lamp(0.0, 1.0), lamp(1.0, 1.0)], PARAMS);
    let representatives = |tree: &LightTree| {
        let mut lights = Vec::new();
        let visible = |_: &Light, k| {
            lights.push(k);
            true
        };
        // The shadow ray of a kept cluster is traced to its representative.
        tree.lightcut_kept(&FLOOR, Stop::Absolute(f32::INFINITY), visible, &mut Scratch::default());
        lights
    };
    let [first] = representatives(&tree)[..] else { panic!("one representative") };
    let intensities = |of_first: f32| {
        let mut intensities = [Vec3::ONE; 2];
        intensities[first] = Vec3::splat(of_first);
        intensities
    };
    let stats = tree.update(&intensities(0.71));
    assert_eq!((stats.swapped, representatives(&tree)), (0, vec![first]));
    let stats = tree.update(&intensities(0.69));
    assert_eq!((stats.swapped, stats.swapped_share, stats.representatives_changed), (1, 1.0, 1));
    assert_eq!(representatives(&tree), [1 - first]);
    // At equal intensity, the new representative is kept.
    assert_eq!(tree.update(&intensities(1.0)).swapped, 0);
}

/// If the light moves from two tight groups to their far ends, the old clusters are worse than new clusters.
#[test]
fn cost_grows_when_clusters_no_longer_fit() {
    let lights: Vec<Light> =
        (0..50).map(|k| lamp(k as f32 * 0.01, 1.0)).chain((0..2).map(|k| lamp(10.0 + 5.0 * k as f32, 1e-3))).collect();
    let mut tree = LightTree::build(&lights, PARAMS);
    let same: Vec<Vec3> = lights.iter().map(|light| light.intensity).collect();
    assert!((tree.update(&same).cost_growth - 1.0).abs() < 1e-6);
    let mut moved = same.clone();
    moved[50..].fill(Vec3::splat(50.0));
    assert!(tree.update(&moved).cost_growth > 1.5);
}

#[test]
#[should_panic(expected = "one intensity per light")]
fn update_wants_every_light() {
    LightTree::build(&[lamp(0.0, 1.0)], PARAMS).update(&[]);
}
