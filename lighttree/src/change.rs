//! Lights that come and go between two builds.
//!
//! A new light goes down the tree, at each node to the child whose cost it adds least to, and shares its leaf's place.
//! A removed light stays where it is and is dark: cuts drop it by its bound. Either makes the tree worse than a new one
//! would be, which [`UpdateStats::cost_growth`](crate::UpdateStats) tells.

use std::ops::Range;

use glam::Vec3;

use crate::bounds::Cone;
use crate::build::{BuildParams, Builder, Metrics};
use crate::light::{Fitness, Light, luminance};
use crate::node::Node;
use crate::tree::LightTree;

/// Ours: a tree this much deeper than log₂ of its lights is built anew instead of grown further \[levels\].
const DEEPEST: usize = 64;

impl LightTree {
    /// Adds lights and gives their indices, which follow those of the lights there are. Representatives are what they
    /// would be in any tree of these lights; where a cluster gets a brighter light, that may change. Clusters that cuts
    /// handed out before ([`Cluster`](crate::Cluster)) may stand for more lights afterwards.
    ///
    /// The first directional light of a tree, the first of another kind, and a tree that has grown too deep make it
    /// build itself anew, top-down.
    ///
    /// # Panics
    ///
    /// If there would be 2³¹ lights or more.
    pub fn insert(&mut self, lights: &[Light]) -> Range<usize> {
        let first = self.len();
        assert!(first + lights.len() < 1 << 31, "{} lights, expected fewer than 2^31", first + lights.len());
        let mut fits = first > 0;
        for light in lights {
            let (light, fitness) = light.accepted();
            let index = self.lights.len() as u32;
            self.rejected += usize::from(fitness != Fitness::Good);
            if fitness == Fitness::Misplaced {
                self.misplaced.push(index);
            }
            self.lights.push(light);
            fits = fits && self.grow(index);
        }
        if fits {
            self.fill(&Metrics::of(&self.lights));
        } else if !lights.is_empty() {
            self.rebuild(Builder::TopDown);
        }
        first..self.len()
    }

    /// Makes lights dark for ever; their indices stay taken. Lights that are already removed may be named again.
    ///
    /// # Panics
    ///
    /// If there is no such light.
    pub fn remove(&mut self, lights: &[usize]) {
        for &light in lights {
            self.lights[light].intensity = Vec3::ZERO;
        }
        self.misplaced.extend(lights.iter().map(|&light| light as u32));
        self.misplaced.sort_unstable();
        self.misplaced.dedup();
        self.sum_upward_drawn();
    }

    /// Clusters all lights anew, at once and in place. Where a frame cannot wait for that, see
    /// [`Rebuild`](crate::Rebuild).
    pub fn rebuild(&mut self, builder: Builder) {
        let misplaced = std::mem::take(&mut self.misplaced);
        let rejected = self.rejected;
        let params = BuildParams::bounded_by(self.geometry_term_bound).with_seed(self.seed);
        *self = Self::build_by(builder, &self.lights, params);
        (self.misplaced, self.rejected) = (misplaced, rejected);
    }

    /// Puts light `index` into the tree; false if it has no place there. Bounds on its way grow, sums do not yet.
    fn grow(&mut self, index: u32) -> bool {
        let light = self.lights[index as usize];
        let mut leaf = Node::BLANK;
        leaf.set_light(&light);
        leaf.representative = index;
        let Some(mut at) = self.roots().find(|&root| self.nodes[root].is_directional() == leaf.is_directional()) else {
            return false;
        };
        let orientation2 = self.orientation2();
        let mut level = 1 + usize::from(self.is_joint());
        while !self.nodes[at].is_leaf() {
            let first = self.nodes[at].children();
            let added = [first, first + 1].map(|child| {
                let (before, after) = (&self.nodes[child], self.nodes[child].joined(&leaf));
                luminance(after.intensity) * after.extent(orientation2)
                    - luminance(before.intensity) * before.extent(orientation2)
            });
            self.nodes[at] = self.nodes[at].joined(&leaf);
            at = if added[1] < added[0] { first + 1 } else { first };
            level += 1;
        }
        // The leaf becomes a pair at the end of the nodes: still after its parent.
        let pair = self.nodes.len() as u32;
        let old = self.nodes[at];
        self.nodes.extend([old, leaf]);
        self.nodes[at] = Node { representative_child: pair, ..old.joined(&leaf) };
        self.depth = self.depth.max(level + 1);
        self.depth <= DEEPEST + self.lights.len().ilog2() as usize
    }

    /// c² of the oriented lights' box, near enough for choosing a place.
    fn orientation2(&self) -> f32 {
        self.nodes.first().map_or(0.0, |root| (root.high - root.low).length_squared())
    }
}

impl Node {
    /// Bounds and sum of a node with one more leaf below; representative and children as they are.
    fn joined(&self, leaf: &Self) -> Self {
        let mut node = *self;
        node.low = node.low.min(leaf.low);
        node.high = node.high.max(leaf.high);
        node.intensity += leaf.intensity;
        if !node.is_directional() {
            node.set_cone(self.cone().union(leaf.cone()));
        }
        node
    }

    fn cone(&self) -> Cone {
        if self.cone_cosine <= -1.0 {
            return Cone::SPHERE;
        }
        let half_angle = f64::from(self.cone_sine).atan2(f64::from(self.cone_cosine));
        Cone { half_angle, ..Cone::ray(self.axis) }
    }

    /// α² + c² (1 − cos β)², zero spread where all lights shine everywhere.
    fn extent(&self, orientation2: f32) -> f32 {
        let spread = if self.cone_cosine <= -1.0 { 0.0 } else { 1.0 - self.cone_cosine };
        (self.high - self.low).length_squared() + orientation2 * spread * spread
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::light::Emission;
    use crate::testing;
    use crate::{Cluster, Scratch, Stop};

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(300))]

        /// Clusters with a node or a light beyond the tree are none of its own; all others may be.
        #[test]
        fn clusters_from_elsewhere_are_told(scene in testing::scene(1..40), beyond in 0..100u32) {
            let params = BuildParams::bounded_by(scene.geometry_term_bound).with_seed(scene.seed);
            let tree = LightTree::build(&scene.lights, params);
            let (nodes, lights) = (tree.nodes.len() as u32, tree.lights().len() as u32);
            let may_hold = |node, light| tree.may_hold(Cluster { node, light });
            prop_assert!(may_hold(nodes - 1, lights - 1));
            prop_assert!(!may_hold(nodes + beyond, 0) && !may_hold(0, lights + beyond));
        }

        /// Grown by some lights and freed of others, a tree holds what a new one holds, and its cuts keep their bound.
        #[test]
        fn a_grown_tree_is_a_tree_of_its_lights(
            scene in testing::scene(0..80), kept in 0..80usize, gone in prop::collection::vec(any::<bool>(), 80),
        ) {
            let params = BuildParams::bounded_by(scene.geometry_term_bound).with_seed(scene.seed);
            let kept = kept.min(scene.lights.len());
            let mut tree = LightTree::build(&scene.lights[..kept], params);
            prop_assert_eq!(tree.insert(&scene.lights[kept..]), kept..scene.lights.len());
            prop_assert_eq!(tree.validate(), Ok(()));
            let gone: Vec<usize> = (0..scene.lights.len()).filter(|&k| gone[k]).collect();
            tree.remove(&gone);
            prop_assert_eq!(tree.validate(), Ok(()));

            let mut rest = scene.lights.clone();
            gone.iter().for_each(|&k| rest[k].intensity = Vec3::ZERO);
            let fresh = LightTree::build(&rest, params);
            prop_assert_eq!(tree.lights(), fresh.lights());
            // The race is the same in every tree.
            let representatives = |tree: &LightTree| tree.roots().map(|k| tree.nodes[k].representative).collect::<Vec<_>>();
            let mut of_both = [representatives(&tree), representatives(&fresh)];
            of_both.iter_mut().for_each(|of| of.sort_unstable());
            prop_assert_eq!(&of_both[0], &of_both[1]);

            let truth = luminance(fresh.exhaustive(&scene.receiver, |_, _| true));
            let stop = Stop::Absolute(0.02 * truth);
            let cut = tree.lightcut(&scene.receiver, stop, |_, _| true, &mut Scratch::default());
            let error = (luminance(cut.radiance) - truth).abs();
            prop_assert!(error <= cut.total_bound * 1.0001 + 1e-3 * truth, "error {} of {}: {:?}", error, truth, cut);

            // What is removed stays dark whatever an update says.
            tree.update_drawn(&vec![Vec3::ONE; tree.len()]);
            prop_assert!(gone.iter().all(|&k| tree.lights()[k].intensity == Vec3::ZERO));
            tree.rebuild(Builder::TopDown);
            prop_assert_eq!(tree.validate(), Ok(()));
            tree.update_drawn(&vec![Vec3::ONE; tree.len()]);
            prop_assert!(gone.iter().all(|&k| tree.lights()[k].intensity == Vec3::ZERO));
        }
    }

    /// Equal lights in one place would make a chain; the tree notices.
    #[test]
    fn coincident_newcomers_do_not_make_a_chain() {
        let light = Light { position: Vec3::ONE, emission: Emission::Omni, intensity: Vec3::ONE };
        let mut tree = LightTree::build(&[light; 3], BuildParams::bounded_by(0.1).with_seed(1));
        tree.insert(&[light; 2000]);
        assert_eq!((tree.validate(), tree.len()), (Ok(()), 2003));
        assert!(tree.depth() <= DEEPEST + 12, "depth {}", tree.depth());
    }
}
