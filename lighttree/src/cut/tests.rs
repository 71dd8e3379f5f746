use super::*;
use crate::build::{BuildParams, Builder};
use crate::lanes::{EightLanes, Kernel, Width};
use crate::light::{Emission, luminance};
use crate::receiver::{Ggx, Lambert};
use crate::testing::{self, Random, TestScene};

fn ceiling(side: u32) -> LightTree {
    let lights: Vec<Light> = (0..side * side)
        .map(|k| Light {
            position: Vec3::new((k % side) as f32, (k / side) as f32, side as f32),
            emission: Emission::Cosine(Vec3::NEG_Z),
            intensity: Vec3::ONE,
        })
        .collect();
    LightTree::build(&lights, BuildParams::bounded_by(0.3).with_seed(3))
}

/// Both refinement orders give the same lightcut wherever both are applicable.
#[test]
fn order_of_refinement_does_not_matter() {
    let tree = ceiling(40);
    let mut scratch = Scratch::default();
    for k in 0..40 {
        let position = Vec3::new(k as f32, 13.0, 0.1);
        let receiver = Lambert { position, normal: Vec3::Z, reflectance: Vec3::ONE };
        let mut visible = |_: &Light, index: usize| index & 3 != 0;
        let threshold = 0.005;
        let depth_first = tree.lightcut(&receiver, Stop::Absolute(threshold), &mut visible, &mut scratch);
        let best_first = tree.best_first::<false, Lambert>(&receiver, |_| threshold, &mut visible, &mut scratch);
        assert_eq!(depth_first.size, best_first.size);
        assert_eq!(depth_first.largest_bound, best_first.largest_bound);
        assert!(depth_first.nodes_visited.abs_diff(best_first.nodes_visited) <= 1);
        assert!(depth_first.size > 20, "{depth_first:?}");
        assert!(best_first.radiance.abs_diff_eq(depth_first.radiance, 1e-5 * depth_first.radiance.x));
    }
}

/// The kept clusters equal the lightcut in number and, up to rounding, in sum. Like the tree, they respond to new
/// intensities.
#[test]
fn clusters_sum_to_the_cut() {
    let mut tree = ceiling(30);
    let receiver = Lambert { position: Vec3::new(9.0, 13.0, 0.1), normal: Vec3::Z, reflectance: Vec3::ONE };
    let mut scratch = Scratch::default();
    for stop in [Stop::Absolute(0.005), Stop::Relative { fraction: 0.02, known_luminance: 0.0 }] {
        let visible = |_: &Light, index: usize| index & 3 != 0;
        let cut = tree.lightcut_kept(&receiver, stop, visible, &mut scratch);
        let clusters = scratch.kept().to_vec();
        assert_eq!(clusters.len(), cut.size as usize);
        let sum =
            |tree: &LightTree| clusters.iter().map(|c| c.transport * tree.cluster_intensity(c.cluster)).sum::<Vec3>();
        assert!(sum(&tree).abs_diff_eq(cut.radiance, 1e-5 * cut.radiance.x), "{} {}", sum(&tree), cut.radiance);
        let before = sum(&tree);
        let doubled: Vec<Vec3> = tree.lights().iter().map(|light| light.intensity * 2.0).collect();
        tree.update_drawn(&doubled);
        assert_eq!(sum(&tree), before * 2.0);
    }
}

/// After redraws, each light of a cluster represents it in proportion to luminance. Dark lights never represent it.
#[test]
fn lights_are_redrawn_in_proportion_to_luminance() {
    let light = |k: u32| Light {
        position: Vec3::new((k % 20) as f32, (k / 20) as f32, 20.0),
        emission: Emission::Omni,
        intensity: Vec3::splat((k % 5) as f32),
    };
    let tree = LightTree::build(&(0..400).map(light).collect::<Vec<_>>(), BuildParams::bounded_by(0.3));
    let receiver = Lambert { position: Vec3::new(9.0, 13.0, 0.1), normal: Vec3::Z, reflectance: Vec3::ONE };
    let mut scratch = Scratch::default();
    _ = tree.lightcut_kept(
        &receiver,
        Stop::Relative { fraction: 0.1, known_luminance: 0.0 },
        |_, _| true,
        &mut scratch,
    );
    let draws = 4000;
    let (mut chi2, mut freedom) = (0.0, 0.0);
    for &KeptCluster { cluster, .. } in scratch.kept() {
        let total = f64::from(luminance(tree.cluster_intensity(cluster)));
        let mut drawn = vec![0; tree.lights().len()];
        (0..draws).for_each(|seed| drawn[tree.redrawn(cluster, seed).light as usize] += 1);
        let lights = tree.cluster_lights(cluster);
        assert_eq!(
            lights.iter().map(|&light| drawn[light as usize]).sum::<u32>(),
            draws as u32,
            "lights of the cluster"
        );
        for light in lights {
            let expected = draws as f64 * f64::from(luminance(tree.lights()[light as usize].intensity)) / total;
            if expected == 0.0 {
                assert_eq!(drawn[light as usize], 0, "a dark light");
            } else {
                chi2 += (f64::from(drawn[light as usize]) - expected).powi(2) / expected;
                freedom += 1.0;
            }
        }
        freedom -= 1.0;
    }
    assert!(freedom > 100.0, "{freedom}");
    assert!((chi2 - freedom).abs() < 4.0 * (2.0 * freedom).sqrt(), "{chi2} of {freedom}");
}

/// Over many draws, the mean estimate equals the sum over all lights, including shadows. For the same clusters and
/// number of rays, the error is lower than with one representative per cluster.
#[test]
fn halves_are_right_on_average_and_nearer() {
    let lights: Vec<Light> = (0..400)
        .map(|k| Light {
            position: Vec3::new((k % 20) as f32, (k / 20) as f32, 4.0),
            emission: Emission::Cosine(Vec3::NEG_Z),
            intensity: Vec3::new(1.0, 1.0 + (k % 3) as f32, 1.0 + (k % 7) as f32),
        })
        .collect();
    let receiver = Lambert { position: Vec3::new(7.0, 9.0, 0.0), normal: Vec3::Z, reflectance: Vec3::ONE };
    // The nearer half of the lights is behind a board with holes, so that visibility and intensity correlate.
    let visible = |light: &Light, k: usize| light.position.distance(receiver.position) > 7.0 || k.is_multiple_of(4);
    let mut scratch = Scratch::default();
    let truth = f64::from(luminance(crate::exhaustive(&lights, 0.3, &receiver, visible)));
    let stop = Stop::Absolute(0.1 * truth as f32);
    let draws = 2000;
    let (mut sum, mut squares, mut of_kept, mut rays) = (0.0, 0.0, 0.0, [0; 2]);
    for seed in 0..draws {
        let tree = LightTree::build_by(Builder::TopDown, &lights, BuildParams::bounded_by(0.3).with_seed(seed));
        let cut = tree.lightcut(&receiver, stop, visible, &mut scratch);
        let kept = tree.lightcut_kept(&receiver, stop, visible, &mut scratch);
        assert_eq!((cut.size, cut.total_bound), (kept.size, kept.total_bound));
        rays = [rays[0] + cut.shadow_rays, rays[1] + kept.shadow_rays];
        let [error, error_of_kept] = [cut, kept].map(|cut| f64::from(luminance(cut.radiance)) - truth);
        (sum, squares, of_kept) = (sum + error, squares + error * error, of_kept + error_of_kept * error_of_kept);
    }
    let standard_error = squares.sqrt() / f64::from(draws as u32);
    assert!(sum.abs() / f64::from(draws as u32) < 4.0 * standard_error, "{sum} ± {standard_error}, truth {truth}");
    assert!(squares < 0.7 * of_kept, "{squares} against {of_kept}");
    assert!(rays[0] <= rays[1], "{rays:?}");
}

/// After the first lightcut in a tree, no buffer grows at any threshold.
#[test]
fn scratch_is_reused() {
    let tree = ceiling(50);
    let mut scratch = Scratch::with_max_size(200);
    let receiver = Lambert { position: Vec3::new(20.0, 20.0, 49.0), normal: Vec3::Z, reflectance: Vec3::ONE };
    let capacities = |s: &Scratch| [s.pending.capacity(), s.selected.capacity(), s.rays.capacity(), s.terms.capacity()];
    let refined = |scratch: &Scratch| scratch.refined.capacities();
    tree.lightcut(&receiver, Stop::Absolute(1.0), |_, _| true, &mut scratch);
    tree.lightcut(&receiver, Stop::Relative { fraction: 1.0, known_luminance: 0.0 }, |_, _| true, &mut scratch);
    let before = (capacities(&scratch), refined(&scratch));
    for threshold in [1e3, 1.0, 1e-3, 0.0] {
        let cut = tree.lightcut(&receiver, Stop::Absolute(threshold), |_, _| true, &mut scratch);
        assert!(cut.size <= 200);
        assert_eq!((capacities(&scratch), refined(&scratch)), before);
    }
}

/// Rounding error of cosines near 90°, relative to the light if all lights and the receiver faced each other.
const ROUNDING: f32 = 1e-4;

/// Returns the luminance at a receiver with the given largest M, if all lights and the receiver face each other.
fn face_to_face(tree: &LightTree, position: Vec3, strongest: Vec3) -> f32 {
    let arrives = |light: &Light| {
        let reflected = luminance(light.intensity * strongest);
        match light.emission {
            Emission::Directional(_) => reflected,
            _ => reflected / (light.position.distance_squared(position) + tree.geometry_term_bound),
        }
    };
    tree.lights().iter().map(arrives).sum()
}

fn build(scene: &TestScene, builder: Builder) -> LightTree {
    LightTree::build_by(
        builder,
        &scene.lights,
        BuildParams::bounded_by(scene.geometry_term_bound).with_seed(scene.seed),
    )
}

/// Tests 10⁵ lightcuts of all scales, with random thresholds, maximum sizes and shadows.
#[test]
fn cuts_keep_their_promises() {
    let mut random = Random(7);
    let mut refined = 0;
    for case in 0..100_000u64 {
        let scene = random.scene(24);
        let tree = build(&scene, if case.is_multiple_of(2) { Builder::BottomUp } else { Builder::TopDown });
        let receiver = &scene.receiver;
        let (shadows, max_size) = (random.bits(), 1 + (random.bits() % 30) as u32);
        let visible = |_: &Light, k: usize| testing::visible(shadows, k);
        let arriving = face_to_face(&tree, receiver.position, receiver.reflectance * std::f32::consts::FRAC_1_PI);
        let truth = luminance(tree.exhaustive(receiver, visible));
        let slack = ROUNDING * arriving;
        let share = 10f32.powf(random.within(-5.0, 0.0));
        let mut scratch = Scratch::with_max_size(max_size);

        let (absolute, known) = (share * arriving, 0.1 * truth);
        let relative = Stop::Relative { fraction: share, known_luminance: known };
        for stop in [Stop::Absolute(absolute), relative] {
            let cut = tree.lightcut(receiver, stop, visible, &mut scratch);
            let error = (luminance(cut.radiance) - truth).abs();
            assert!(error <= cut.total_bound * 1.0001 + slack, "error {error} of {truth}: {cut:?}");
            assert!(cut.size <= max_size.max(1 + u32::from(tree.is_joint())), "{cut:?}, at most {max_size}");
            assert!(cut.largest_bound <= cut.total_bound * 1.0001, "{cut:?}");
            let threshold = if stop == relative { share * (known + luminance(cut.radiance)) } else { absolute };
            assert!(cut.largest_bound <= threshold * 1.0001 || cut.size >= max_size, "{cut:?}, {threshold}");
            refined += u64::from(cut.size > 1);
        }
        let all = tree.lightcut(receiver, Stop::Absolute(0.0), visible, &mut Scratch::default());
        assert!((luminance(all.radiance) - truth).abs() <= slack, "{all:?}, every light {truth}");
        assert_eq!((all.largest_bound, all.total_bound), (0.0, 0.0));
    }
    assert!(refined > 50_000, "{refined} cuts of more than one cluster");
}

/// Shared lightcuts of near and distant receivers satisfy the same conditions as independent lightcuts.
#[test]
fn shared_cuts_keep_the_promises_of_each() {
    let mut random = Random(8);
    let mut saved = 0;
    for _ in 0..4000 {
        let scene = random.scene(60);
        let tree = build(&scene, Builder::BottomUp);
        let length = scene.geometry_term_bound.sqrt() * 10f32.powf(random.within(-2.0, 1.0));
        let tilt = random.within(0.0, 1.0);
        // Some bundles have more than one group.
        let count = if random.once_in(4) { 17 + random.bits() % 32 } else { 1 + random.bits() % 12 };
        let receivers: Vec<Ggx> = (0..count)
            .map(|_| Ggx {
                position: scene.receiver.position + random.vector() * length,
                normal: (scene.receiver.normal + random.vector() * tilt).try_normalize().unwrap_or(Vec3::Z),
                view: scene.direction,
                diffuse: random.vector().abs(),
                specular: Vec3::splat(0.04),
                alpha: 0.3,
            })
            .collect();
        let around = crate::Region::<f32>::new(Vec3::NEG_ONE.into(), Vec3::ONE.into());
        let arriving: Vec<f32> =
            receivers.iter().map(|r| face_to_face(&tree, r.position, r.reflect_bound(&around).into())).collect();
        let thresholds: Vec<f32> =
            arriving.iter().map(|arriving| arriving * 10f32.powf(random.within(-4.0, -1.0))).collect();
        let (shadows, max_size) = (random.bits(), 1 + (random.bits() % 100) as u32);
        let sees = |receiver: usize, light: usize| testing::visible(shadows ^ receiver as u64, light);
        let mut scratch = Scratch::with_max_size(max_size);
        let mut cuts = Vec::new();
        let visible = |_: &Light, light: usize, rays: u64| {
            let seeing = |k: &usize| rays >> k & 1 == 1 && sees(*k, light);
            (0..receivers.len()).filter(seeing).fold(0, |bits, k| bits | 1 << k)
        };
        let together = Receivers { receivers: &receivers, thresholds: &thresholds };
        tree.lightcuts(together, visible, &mut scratch, &mut cuts);
        assert_eq!(cuts.len(), receivers.len());
        let mut alone = 0;
        for (k, cut) in cuts.iter().enumerate() {
            let receiver = &receivers[k];
            let truth = luminance(tree.exhaustive(receiver, |_, light| sees(k, light)));
            let error = (luminance(cut.radiance) - truth).abs();
            assert!(error <= cut.total_bound * 1.0001 + ROUNDING * arriving[k], "error {error} of {truth}: {cut:?}");
            assert!(cut.largest_bound <= thresholds[k] || cut.size >= max_size, "{cut:?}, {}", thresholds[k]);
            assert!(cut.size <= max_size.max(1 + u32::from(tree.is_joint())), "{cut:?}, at most {max_size}");
            let stop = Stop::Absolute(thresholds[k]);
            alone += tree.lightcut(receiver, stop, |_, light| sees(k, light), &mut scratch).nodes_visited;
        }
        saved += u32::from(cuts.iter().map(|cut| cut.nodes_visited).sum::<u32>() < alone);
    }
    assert!(saved > 2000, "{saved} bundles with fewer visits");
}

/// Kernel that computes the radiance at a receiver from the halves of four clusters.
struct Arriving<'a, R>(&'a halves::Halves, &'a R, f32);

impl<R: Receiver> Kernel for Arriving<'_, R> {
    type Output = [Vec4; 6];

    #[inline(always)]
    fn run<F: EightLanes>(self) -> [Vec4; 6] {
        let arriving = self.0.arriving::<F, R>(self.1, self.2);
        let [[a, b], [c, d], [e, f]] = [arriving.x.0, arriving.y.0, arriving.z.0];
        [a, b, c, d, e, f]
    }
}

/// For lights of all types and scales and every material, eight lanes, four lanes and pairs of clusters give the same
/// bits.
#[test]
fn estimates_have_the_same_bits_however_many_at_once() {
    let mut random = Random(9);
    let mut lit = 0;
    for _ in 0..4000 {
        let scene = random.scene(24);
        let tree = build(&scene, Builder::TopDown);
        let clusters = std::array::from_fn(|_| (random.bits() % tree.nodes.len() as u64) as u32);
        let TestScene { receiver: Lambert { position, normal, .. }, direction: view, .. } = scene;
        let (diffuse, specular) = (Vec3::new(0.7, 0.5, 0.3), Vec3::splat(0.04));
        fn same<R: Receiver>(tree: &LightTree, clusters: [u32; 4], receiver: &R) -> bool {
            let halves = tree.halves(clusters);
            let arriving = |width: Width| width.run(Arriving(&halves, receiver, tree.geometry_term_bound));
            let bits = |arriving: [Vec4; 6]| arriving.map(|four| four.to_array().map(f32::to_bits));
            assert_eq!(bits(arriving(Width::best())), bits(arriving(Width::Four)));
            let estimates = halves.estimates::<Vec4, R>(receiver, tree.geometry_term_bound);
            for pair in [0, 2] {
                let of_two = tree.estimates_of_two(receiver, [clusters[pair], clusters[pair + 1]]);
                for k in 0..2 {
                    assert_eq!(of_two.lights[k], estimates.lights[pair + k]);
                    assert_eq!(of_two.radiance[k].to_array(), estimates.radiance[pair + k].to_array());
                }
            }
            estimates.lit != 0
        }
        lit += u32::from(same(&tree, clusters, &scene.receiver));
        lit += u32::from(same(&tree, clusters, &Ggx { position, normal, view, diffuse, specular, alpha: 0.2 }));
    }
    assert!(lit > 2600, "{lit}");
}

/// A cluster with a node or light index beyond the tree is rejected.
#[test]
fn clusters_from_elsewhere_are_told() {
    let tree = ceiling(6);
    let (nodes, lights) = (tree.nodes.len() as u32, tree.lights().len() as u32);
    let may_hold = |node, light| tree.may_hold(Cluster { node, light });
    assert!(may_hold(nodes - 1, lights - 1));
    for beyond in [0, 1, u32::MAX / 2] {
        assert!(!may_hold(nodes + beyond, 0) && !may_hold(0, lights + beyond));
    }
}
