//! Validation of a whole tree. It checks each invariant that lightcuts and updates require.
//!
//! Deserialized trees pass [`LightTree::validate`] before any other code reads them. A forged tree gives an error, but
//! never a panic or an endless loop.

use std::fmt;

use crate::build::SMALLEST_BOUND;
use crate::light::{Emission, Fitness, StoredSite};
use crate::node::Node;
use crate::sites::Sites;
use crate::tree::LightTree;

/// Tolerance for the length of unit axes, and for sine and cosine of one angle, which are rounded to `f32`.
const ROUNDING: f32 = 1e-3;
/// Maximum angle by which a child's cone may exceed its parent's cone \[rad\]. Axes and angles are rounded to `f32`.
const ANGLE_ROUNDING: f64 = 1e-3;

/// Error for a broken invariant of a [`LightTree`]. The message names the first failing node or light and the reason.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct InvalidTree {
    what: String,
}

impl InvalidTree {
    fn new(what: impl Into<String>) -> Self {
        Self { what: what.into() }
    }
}

impl fmt::Display for InvalidTree {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.what)
    }
}

impl std::error::Error for InvalidTree {}

/// Returns `Ok` if the condition is true, otherwise an error with the text from `what`.
fn ensure(holds: bool, what: impl FnOnce() -> String) -> Result<(), InvalidTree> {
    if holds { Ok(()) } else { Err(InvalidTree::new(what())) }
}

impl LightTree {
    /// Checks the invariants of the whole tree. Each light is in one leaf. The box, cone and sum of a node include its
    /// children's. The representative of a node is the chosen child's representative. Deserialized trees have passed
    /// this check.
    ///
    /// # Errors
    ///
    /// If an invariant is broken. The error describes the first one.
    pub fn validate(&self) -> Result<(), InvalidTree> {
        self.validate_lengths()?;
        self.validate_lights()?;
        // Visit the tree from the root and mark each node and light.
        let mut reached = vec![false; self.nodes.len()];
        let mut found = vec![false; self.lights.len()];
        let mut stack = if self.nodes.is_empty() { Vec::new() } else { vec![(0, 1)] };
        let mut depth = 0;
        while let Some((index, level)) = stack.pop() {
            depth = depth.max(level);
            ensure(!std::mem::replace(&mut reached[index], true), || format!("node {index} has two parents"))?;
            if self.nodes[index].is_leaf() {
                self.validate_leaf(index, &mut found)?;
            } else {
                self.validate_inner(index)?;
                let first = self.nodes[index].children();
                stack.extend([(first, level + 1), (first + 1, level + 1)]);
            }
        }
        // Every node must be reachable.
        if let Some(index) = reached.iter().position(|reached| !reached) {
            return Err(InvalidTree::new(format!("node {index} has no parent")));
        }
        ensure(depth == self.depth, || format!("depth is {depth}, stored {}", self.depth))
    }

    /// Checks array lengths, costs and global values.
    fn validate_lengths(&self) -> Result<(), InvalidTree> {
        let (lights, nodes) = (self.lights.len(), self.nodes.len());
        // A binary tree with n leaves has 2n − 1 nodes.
        let expected = (2 * lights).saturating_sub(1);
        ensure(nodes == expected, || format!("{nodes} nodes for {lights} lights, expected {expected}"))?;
        ensure(self.extents.len() == nodes, || format!("{} extents for {nodes} nodes", self.extents.len()))?;
        // Extents are sums of squares, so negative values are errors.
        if let Some(index) = self.extents.iter().position(|&extent| !(extent >= 0.0 && extent.is_finite())) {
            return Err(InvalidTree::new(format!("node {index} has the extent {}", self.extents[index])));
        }
        let bound = self.geometry_term_bound;
        ensure(bound >= SMALLEST_BOUND, || {
            format!("the geometry-term bound is {bound}, expected {SMALLEST_BOUND} or more")
        })?;
        let cost = self.cost_at_build;
        ensure(cost >= 0.0 && cost.is_finite(), || format!("the cost at build is {cost}"))?;
        ensure(self.rejected <= lights, || format!("{} of {lights} lights were rejected", self.rejected))
    }

    /// Checks each light, and the list of misplaced lights.
    fn validate_lights(&self) -> Result<(), InvalidTree> {
        if let Some(k) = self.lights.iter().position(|&light| light.accepted() != (light, Fitness::Good)) {
            return Err(InvalidTree::new(format!("light {k} is unusable: {:?}", self.lights[k])));
        }
        let ascends = self.misplaced.is_sorted_by(|a, b| a < b);
        ensure(ascends, || "the misplaced lights are not in ascending order".into())?;
        for &k in &self.misplaced {
            let light = self.lights.get(k as usize);
            ensure(light.is_some_and(|light| light.intensity == glam::Vec3::ZERO), || {
                format!("light {k} is misplaced, but not a dark one of {}", self.lights.len())
            })?;
        }
        Ok(())
    }

    fn validate_leaf(&self, index: usize, found: &mut [bool]) -> Result<(), InvalidTree> {
        let node = &self.nodes[index];
        let Some(light) = self.lights.get(node.representative as usize) else {
            return Err(InvalidTree::new(format!("leaf {index} has no light")));
        };
        // Each light belongs to exactly one leaf.
        let in_two = std::mem::replace(&mut found[node.representative as usize], true);
        ensure(!in_two, || format!("light {} is in two leaves", node.representative))?;
        // The leaf's box, cone and intensity must equal the light's.
        let site = StoredSite::new(light);
        let cone_fits = match light.emission {
            Emission::Omni => node.cone_cosine == -1.0,
            Emission::Cosine(axis) => node.axis.dot(axis) > 1.0 - 1e-6 && node.cone_cosine == 1.0,
            Emission::Directional(_) => node.is_directional(),
        };
        let box_fits = node.low == site.position && node.high == site.position;
        ensure(box_fits && node.intensity == light.intensity && cone_fits && has_cone(node), || {
            format!("leaf {index} is {node:?}, its light {light:?}")
        })?;
        // Estimates read the site instead of the light.
        ensure(*self.sites.of(index) == Sites::of_leaf(node, &self.lights, self.seed), || {
            format!("leaf {index} has the site {:?}", self.sites.of(index))
        })
    }

    /// Checks a node and its two children, which must exist.
    fn validate_inner(&self, index: usize) -> Result<(), InvalidTree> {
        let node = &self.nodes[index];
        // Children follow their parent, which rules out cycles.
        let (first, chosen) = (node.children(), node.representative_child as usize);
        ensure(first > index && first + 1 < self.nodes.len(), || format!("node {index} has children at {first}"))?;
        // Representative and site come from the chosen child.
        let representative = self.nodes[chosen].representative;
        ensure(node.representative == representative, || {
            format!("node {index} has representative {}, its child {representative}", node.representative)
        })?;
        ensure(self.sites.of(index) == self.sites.of(chosen), || {
            format!("node {index} has the site {:?}, not its child's", self.sites.of(index))
        })?;
        // Sum, cone and box must include both children.
        let sum = self.nodes[first].intensity + self.nodes[first + 1].intensity;
        ensure(node.intensity == sum, || format!("node {index} has intensity {}, its children {sum}", node.intensity))?;
        ensure(has_cone(node), || format!("node {index} has no cone: {node:?}"))?;
        // The root that joins points and directions has no common cone.
        let is_joint = index == 0 && self.is_joint();
        for child in [first, first + 1] {
            let inside = check_box(node, &self.nodes[child]);
            let inside = inside.and_then(|()| if is_joint { Ok(()) } else { check_cone(node, &self.nodes[child]) });
            inside.map_err(|e| InvalidTree::new(format!("node {index}, child {child}: {e}")))?;
        }
        Ok(())
    }
}

/// Returns whether axis, cosine and sine of a node are a valid cone, or mark a directional cluster.
fn has_cone(node: &Node) -> bool {
    let (cosine, sine) = (node.cone_cosine, node.cone_sine);
    let is_unit = |length2: f32| (length2 - 1.0).abs() < ROUNDING;
    let is_angle = (-1.0..=1.0).contains(&cosine) && sine >= 0.0 && is_unit(cosine * cosine + sine * sine);
    is_unit(node.axis.length_squared()) && (node.is_directional() || is_angle)
}

/// Checks that the child's box is inside the parent's box.
fn check_box(parent: &Node, child: &Node) -> Result<(), InvalidTree> {
    let inside = parent.low.cmple(child.low).all() && parent.high.cmpge(child.high).all();
    ensure(inside, || format!("box {}…{} in {}…{}", child.low, child.high, parent.low, parent.high))
}

/// Checks that the child's cone is inside the parent's cone.
fn check_cone(parent: &Node, child: &Node) -> Result<(), InvalidTree> {
    if parent.is_directional() || child.is_directional() {
        let both = parent.is_directional() && child.is_directional();
        return ensure(both, || "a directional cluster and one of other lights".into());
    }
    let angle = |node: &Node| f64::from(node.cone_sine).atan2(f64::from(node.cone_cosine));
    let between = parent.axis.as_dvec3().angle_between(child.axis.as_dvec3());
    let inside = parent.cone_cosine <= -1.0 || between + angle(child) <= angle(parent) + ANGLE_ROUNDING;
    ensure(inside, || format!("cone {} ± {} in {} ± {}", child.axis, angle(child), parent.axis, angle(parent)))
}
