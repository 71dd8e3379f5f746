use proptest::prelude::*;

use glam::Vec3;

use super::*;
use crate::bounds::Cone;
use crate::testing;

/// Replays the merges, cheapest first, and compares each merge with the definition: no remaining pair is cheaper at
/// that step.
///
/// The comparison is step by step, because pairs that tie up to rounding lead to different greedy trees.
fn check_greedy(leaves: &[Cluster], merges: &[[u32; 2]], metric: &Metric) -> Result<(), TestCaseError> {
    let mut alive: Vec<(Cluster, Cone)> = leaves.iter().map(|leaf| (*leaf, leaf.leaf_cone())).collect();
    let mut waiting: Vec<usize> = (0..merges.len()).collect();
    while !waiting.is_empty() {
        let place = |id: u32| alive.iter().position(|(cluster, _)| cluster.id == id);
        let possible = waiting.iter().enumerate().filter_map(|(at, &step)| {
            let [a, b] = merges[step].map(place);
            Some((alive[a?].0.cost(&alive[b?].0, metric), at, step, [a?, b?]))
        });
        let Some((cost, at, step, places)) = possible.min_by(|a, b| a.0.total_cmp(&b.0)) else {
            return Err(TestCaseError::fail("merges of clusters that do not exist"));
        };
        let pairs = (0..alive.len()).flat_map(|a| (a + 1..alive.len()).map(move |b| (a, b)));
        let cheapest = pairs.map(|(a, b)| alive[a].0.cost(&alive[b].0, metric)).fold(f32::INFINITY, f32::min);
        prop_assert!(cost <= cheapest * (1.0 + 1e-5), "step {} costs {}, the cheapest pair {}", step, cost, cheapest);
        let [(a, cone_a), (b, cone_b)] = places.map(|place| alive[place]);
        let cone = cone_a.union(cone_b);
        alive.retain(|(cluster, _)| cluster.id != a.id && cluster.id != b.id);
        alive.push((a.merged(&b, (leaves.len() + step) as u32, cone), cone));
        waiting.swap_remove(at);
    }
    prop_assert!(alive.len() <= 1);
    Ok(())
}

fn params(seed: u64) -> BuildParams {
    BuildParams::bounded_by(0.01).with_seed(seed)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn each_merge_is_the_cheapest(scene in testing::scene(0..60)) {
        let metric = Metrics::of(&scene.lights).points;
        let leaves: Vec<Cluster> =
            leaf_clusters(&scene.lights).into_iter().filter(|c| !is_directional(&scene.lights[c.id as usize])).collect();
        let leaves: Vec<Cluster> = (0u32..).zip(leaves).map(|(id, leaf)| Cluster { id, ..leaf }).collect();
        let merges = agglomerate::agglomerate(leaves.clone(), &metric, leaves.len() as u32, &on_threads);
        check_greedy(&leaves, &merges, &metric)?;
    }

    #[test]
    fn is_valid_and_deterministic(scene in testing::scene(0..200), top_down: bool) {
        let builder = if top_down { Builder::TopDown } else { Builder::BottomUp };
        let tree = LightTree::build_by(builder, &scene.lights, params(scene.seed));
        prop_assert_eq!(tree.validate(), Ok(()));
        prop_assert_eq!(tree.len(), scene.lights.len());
        let again = LightTree::build_by(builder, &scene.lights, params(scene.seed));
        let names = |tree: &LightTree| tree.nodes.iter().map(|n| (n.representative_child, n.representative)).collect::<Vec<_>>();
        prop_assert_eq!(names(&tree), names(&again));
    }
}

/// The root's representative is drawn in proportion to luminance, within four standard deviations over 20 000 seeds.
#[test]
fn representatives_are_drawn_in_proportion() {
    let weights = [1.0, 2.0, 0.0, 4.0, 8.0, 0.5];
    let lights: Vec<Light> = weights
        .iter()
        .enumerate()
        .map(|(k, &weight)| Light {
            position: Vec3::new(k as f32, (k * k) as f32, 0.0),
            emission: if k == 1 { Emission::Omni } else { Emission::Cosine(Vec3::Z) },
            intensity: Vec3::splat(weight),
        })
        .collect();
    let total: f32 = weights.iter().sum();
    let draws = 20_000;
    let mut counts = [0u32; 6];
    for seed in 0..draws {
        counts[LightTree::build(&lights, params(seed)).nodes[0].representative as usize] += 1;
    }
    for (count, weight) in counts.into_iter().zip(weights) {
        let p = f64::from(weight / total);
        let (expected, deviation) = (p * draws as f64, (p * (1.0 - p) * draws as f64).sqrt());
        assert!((f64::from(count) - expected).abs() <= 4.0 * deviation, "{counts:?}, expected {expected} for {weight}");
    }
}

#[test]
fn coincident_lights_make_a_balanced_tree() {
    let light = Light { position: Vec3::ONE, emission: Emission::Omni, intensity: Vec3::ONE };
    for builder in [Builder::BottomUp, Builder::TopDown] {
        let tree = LightTree::build_by(builder, &vec![light; 5000], params(0));
        assert_eq!(tree.validate(), Ok(()));
        assert!(tree.depth() <= 20, "depth {}", tree.depth());
    }
}

#[test]
fn dark_lights_still_find_their_neighbors() {
    let lights: Vec<Light> = (0..64)
        .map(|k| Light {
            position: Vec3::new((k % 8) as f32, (k / 8) as f32, 0.0),
            emission: Emission::Cosine(Vec3::Z),
            intensity: Vec3::ZERO,
        })
        .collect();
    let tree = LightTree::build(&lights, params(0));
    assert_eq!(tree.validate(), Ok(()));
    let pairs = tree.nodes.iter().filter(|n| !n.is_leaf() && (n.high - n.low).length() < 1.01).count();
    assert!(pairs >= 30, "{pairs} pairs of direct neighbors");
}

#[test]
fn unusable_lights_are_counted_and_dark() {
    let good = Light { position: Vec3::ZERO, emission: Emission::Omni, intensity: Vec3::ONE };
    let lights = [
        good,
        Light { position: Vec3::NAN, ..good },
        Light { intensity: Vec3::NEG_ONE, ..good },
        Light { intensity: Vec3::INFINITY, ..good },
    ];
    let mut tree = LightTree::build(&lights, params(0));
    assert_eq!((tree.rejected(), tree.validate(), tree.total_intensity()), (3, Ok(()), Vec3::ONE));
    let stats = tree.update(&[Vec3::ONE; 4]);
    assert_eq!((stats.rejected, tree.validate(), tree.total_intensity()), (1, Ok(()), Vec3::splat(3.0)));
}
