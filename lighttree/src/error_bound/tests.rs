use std::f32::consts::FRAC_1_PI;

use super::*;
use crate::build::BuildParams;
use crate::light::{Light, luminance, unshadowed_by};
use crate::receiver::{Bundled, Ggx, Lambert};
use crate::testing::{self, Random, TestScene};
use crate::tree::LightTree;

/// Number of random trees for the diffuse receiver, 10⁵. Each cluster is compared with all lights below it.
const TREES: u64 = 100_000;

/// Rounding error of cosines, relative to the cluster's contribution face to face. Narrow lobes multiply it.
const ROUNDING: f32 = 1e-4;

fn build(scene: &TestScene) -> LightTree {
    LightTree::build(&scene.lights, BuildParams::bounded_by(scene.geometry_term_bound).with_seed(scene.seed))
}

fn lights_below(tree: &LightTree, index: usize) -> Vec<usize> {
    let node = &tree.nodes[index];
    if node.is_leaf() {
        return vec![node.representative as usize];
    }
    let first = node.children();
    [lights_below(tree, first), lights_below(tree, first + 1)].concat()
}

/// Returns the largest luminance from the cluster if all lights and the receiver face each other. `strongest` is the
/// material's largest M.
fn face_to_face(tree: &LightTree, node: &Node, from: Vec3, strongest: Vec3) -> f32 {
    let reflected = luminance(strongest * node.intensity);
    if node.is_directional() {
        return reflected;
    }
    let nearest = (node.low - from).max(from - node.high).max(Vec3::ZERO);
    reflected / (nearest.length_squared() + tree.geometry_term_bound)
}

/// Checks that the estimate, the true value with random shadows, the unoccluded true value, and their differences stay
/// below the bound. Returns the number of clusters checked.
fn check<R: Receiver>(tree: &LightTree, receiver: &R, strongest: Vec3, shadows: u64) -> usize {
    let position = receiver.position();
    let clusters = tree.nodes.iter().enumerate().filter(|(index, _)| *index > 0 || !tree.is_joint());
    let mut checked = 0;
    for (index, node) in clusters {
        let bound = error_bound(receiver, position.into(), &ClusterBounds::one(node), tree.geometry_term_bound);
        let limit = bound * 1.0001 + ROUNDING * face_to_face(tree, node, position, strongest);
        let unit = |k: usize| unshadowed_by(receiver, &tree.lights[k], tree.geometry_term_bound);
        let below = lights_below(tree, index);
        let lit = |k: usize| luminance(unit(k) * tree.lights[k].intensity);
        let all: f32 = below.iter().map(|&k| lit(k)).sum();
        let truth: f32 = below.iter().filter(|&&k| testing::visible(shadows, k)).map(|&k| lit(k)).sum();
        let representative = node.representative as usize;
        let estimate = luminance(unit(representative) * node.intensity);
        assert!(bound >= 0.0 && bound.is_finite(), "bound {bound} of {node:?}");
        assert!(estimate <= limit, "estimate {estimate} above {bound}: {node:?}");
        assert!(all <= limit, "all of it {all} above {bound}: {node:?}");
        let seen = if testing::visible(shadows, representative) { estimate } else { 0.0 };
        assert!((seen - truth).abs() <= limit, "wrong by {} above {bound}: {node:?}", (seen - truth).abs());
        checked += 1;
    }
    checked
}

#[test]
fn no_cluster_is_wrong_by_more_than_its_bound() {
    let mut random = Random(1);
    let mut checked = 0;
    for _ in 0..TREES {
        let scene = random.scene(8);
        checked += check(&build(&scene), &scene.receiver, scene.receiver.reflectance * FRAC_1_PI, random.bits());
    }
    assert!(checked as u64 > 4 * TREES, "{checked} clusters");
}

#[test]
fn nor_for_a_rough_metal() {
    let mut random = Random(3);
    for _ in 0..TREES / 5 {
        let scene = random.scene(8);
        let ggx = rough(&mut random, &scene);
        check(&build(&scene), &ggx, ggx.reflect_bound(&around()).into(), random.bits());
    }
}

/// Returns a box around the receiver, which contains all directions.
fn around() -> Region {
    Region::new(Vec3::NEG_ONE.into(), Vec3::ONE.into())
}

fn rough(random: &mut Random, scene: &TestScene) -> Ggx {
    let Lambert { position, normal, reflectance } = scene.receiver;
    let alpha = random.within(0.05, 1.0);
    Ggx { position, normal, view: scene.direction, diffuse: reflectance, specular: Vec3::new(0.04, 0.5, 1.0), alpha }
}

/// The reflection bound alone is compared with directions over small and large boxes.
#[test]
fn a_rough_metal_reflects_no_more_than_its_bound() {
    let mut random = Random(4);
    let mut closest = 0.0f32;
    for _ in 0..20_000 {
        let scene = random.scene(1);
        let ggx = Ggx { position: Vec3::ZERO, ..rough(&mut random, &scene) };
        let low = random.vector();
        let high = low + random.vector().abs() * 10f32.powf(random.within(-3.0, 1.0));
        let bound: Vec3 = ggx.reflect_bound(&Region::<f32>::new(low.into(), high.into())).into();
        let strongest: Vec3 = ggx.reflect_bound(&around()).into();
        for _ in 0..8 {
            let share = random.vector() * 0.5 + 0.5;
            let Some(direction) = (low + (high - low) * share).try_normalize() else { continue };
            let reflected: Vec3 = ggx.reflect(direction.into()).into();
            let limit = bound * 1.0001 + strongest * ROUNDING;
            assert!(reflected.cmple(limit).all(), "{reflected} above {bound}: {ggx:?}, {direction}");
            closest = closest.max(reflected.z / bound.z);
        }
    }
    assert!(closest > 0.9, "a bound that is nowhere near: {closest}");
}

/// The bound of a single light is its contribution. Four lanes are bit-identical to one.
#[test]
fn four_at_a_time_are_the_bits_of_one() {
    let mut random = Random(5);
    for _ in 0..2000 {
        let scene = random.scene(12);
        let tree = build(&scene);
        let ggx = rough(&mut random, &scene);
        compare(&tree, &scene.receiver);
        compare(&tree, &ggx);
    }
}

fn compare<R: Receiver>(tree: &LightTree, receiver: &R) {
    let position = receiver.position();
    for four in tree.nodes.chunks_exact(4) {
        let together = error_bound(
            receiver,
            Vector3::splat(position),
            &ClusterBounds::four([&four[0], &four[1], &four[2], &four[3]]),
            Vec4::splat(tree.geometry_term_bound),
        );
        for (k, node) in four.iter().enumerate() {
            let alone = error_bound(receiver, position.into(), &ClusterBounds::one(node), tree.geometry_term_bound);
            assert_eq!(together[k].to_bits(), alone.to_bits(), "{} {alone}: {node:?}", together[k]);
            if node.is_leaf() {
                let light: &Light = &tree.lights[node.representative as usize];
                let value = luminance(unshadowed_by(receiver, light, tree.geometry_term_bound) * light.intensity);
                let strongest: Vec3 = receiver.reflect_bound(&around()).into();
                let rounding = 1e-4 * alone + ROUNDING * face_to_face(tree, node, position, strongest);
                assert!(value <= alone + rounding, "{value} {alone}");
            }
        }
    }
}

/// The bound of a bundle holds for each of its receivers.
#[test]
fn bundles_are_bounded_together() {
    let mut random = Random(6);
    for _ in 0..3000 {
        let scene = random.scene(8);
        let tree = build(&scene);
        let (apart, tilt) = (random.within(0.0, 0.3), random.within(0.0, 1.5));
        let length = scene.geometry_term_bound.sqrt();
        let spread: Vec<Lambert> = (0..6)
            .map(|_| Lambert {
                position: scene.receiver.position + random.vector() * length * apart,
                normal: (scene.receiver.normal + random.vector() * tilt).try_normalize().unwrap_or(Vec3::Z),
                reflectance: random.vector().abs(),
            })
            .collect();
        together(&tree, &spread, |r| r.reflectance * FRAC_1_PI);
        let metals: Vec<Ggx> = spread
            .iter()
            .map(|r| Ggx { position: r.position, normal: r.normal, ..rough(&mut random, &scene) })
            .collect();
        together(&tree, &metals, |r| r.reflect_bound(&around()).into());
    }
}

fn together<R: Bundled>(tree: &LightTree, receivers: &[R], strongest: impl Fn(&R) -> Vec3) {
    let positions = || receivers.iter().map(|r| r.position());
    let corners = [
        positions().reduce(Vec3::min).expect("receivers").into(),
        positions().reduce(Vec3::max).expect("receivers").into(),
    ];
    let bundle = R::bundle(receivers);
    for (index, node) in tree.nodes.iter().enumerate().skip(usize::from(tree.is_joint())) {
        let of_all = error_bound_of_bundle(&bundle, corners, &ClusterBounds::one(node), tree.geometry_term_bound);
        let below = lights_below(tree, index);
        for receiver in receivers {
            let unit = |k: usize| unshadowed_by(receiver, &tree.lights[k], tree.geometry_term_bound);
            let all: f32 = below.iter().map(|&k| luminance(unit(k) * tree.lights[k].intensity)).sum();
            let estimate = luminance(unit(node.representative as usize) * node.intensity);
            let rounding = ROUNDING * face_to_face(tree, node, receiver.position(), strongest(receiver));
            let limit = of_all * 1.0001 + rounding;
            assert!(all <= limit && estimate <= limit, "{all} or {estimate} above {of_all}: {node:?}");
        }
    }
}
