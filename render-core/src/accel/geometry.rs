//! Bottom-level trees. Static geometry has one tree, and each moving mesh has a separate tree. These trees are built
//! once. Trees of deforming instances are rebuilt each frame.
//!
//! Surfaces with holes have separate trees, so that rays need not test other surfaces for holes. Instances of one mesh
//! share a tree if they move, or if they are static and have many triangles in total.

use super::cut_outs::CutOuts;
use super::group::Group;
use super::panes::Panes;
use super::sharing::Sharing;
use super::ties::AllSides;
use super::triangles::Owner;
use super::{Accelerator, PlacedGroup};
use crate::scene::{Instance, Mesh, Pose, Scene};
use crate::steps;
use glam::{Affine3A, Vec3};
use obvhs::{BvhBuildParams, triangle::Triangle};
use std::collections::HashMap;
use std::sync::Arc;

/// Build settings for trees that are built once. On Sponza, splitting large triangles reduces the number of visited
/// leaves by a quarter and the number of visited nodes by a tenth. A reinsertion ratio of 0.15 instead of 0.05 traces
/// single rays 1 to 8 % faster in Sponza, `conference` and `atrium`, and 0.4 no faster than that.
const QUALITY: BvhBuildParams =
    BvhBuildParams { pre_split: true, reinsertion_batch_ratio: 0.15, ..BvhBuildParams::medium_build() };

/// Trees and holes of a scene that stay constant during rendering.
pub struct Geometry {
    subsets: Vec<Subset>,
    /// Opacity of all instances with holes.
    cut_outs: Option<Arc<CutOuts>>,
    /// Transmittance of all transparent instances.
    panes: Option<Arc<Panes>>,
    sides: Arc<AllSides>,
    scale: f32,
}

impl std::fmt::Debug for Geometry {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.debug_struct("Geometry").field("trees", &self.subsets.len()).finish_non_exhaustive()
    }
}

/// Triangles with a common transform or deformation.
enum Subset {
    /// Static geometry, in the scaled world.
    Fixed(PlacedGroup),
    /// Tree of a mesh in its local space, and the node that moves the mesh. The node is `None` for a skin that keeps
    /// its shape.
    Attached { group: Arc<Group>, instance: usize, node: Option<usize> },
    /// Instance with a tree that is rebuilt for each pose. `node` is the parent node, or `None` if a skin positions the
    /// instance.
    Deforming { instance: usize, node: Option<usize> },
}

/// Ways of rays through the triangles of a tree.
#[derive(Clone, Default)]
struct Openings {
    cut_outs: Option<Arc<CutOuts>>,
    panes: Option<Arc<Panes>>,
}

/// Triangles that are collected for a tree.
#[derive(Default)]
struct Soup {
    triangles: Vec<Triangle>,
    owners: Vec<Owner>,
}

impl Soup {
    fn add(&mut self, instance: usize, to_tree: &Affine3A, corners: impl Iterator<Item = [Vec3; 3]>) {
        for (t, corners) in corners.enumerate() {
            let [v0, v1, v2] = corners.map(|corner| to_tree.transform_point3a(corner.into()));
            // Skip triangles without area: no ray hits them, and they degrade the tree. Skip infinite triangles, which
            // the tree cannot contain.
            let area = (v1 - v0).cross(v2 - v0).length_squared();
            if area > 0.0 && area.is_finite() {
                self.triangles.push(Triangle { v0, v1, v2 });
                self.owners.push(Owner { instance: instance as u32, triangle: t as u32 });
            }
        }
    }

    /// Builds the tree, or returns `None` if there are no triangles. Drops triangles that duplicate an earlier
    /// triangle: rays would test the duplicate but never hit it. Keeps duplicates if `cut_outs` exist, because the
    /// earlier triangle may have a hole. Also keeps duplicates with different `sides`.
    fn group(mut self, params: BvhBuildParams, openings: Openings, sides: &AllSides) -> Option<Arc<Group>> {
        let Openings { cut_outs, panes } = openings;
        if cut_outs.is_none() {
            let is_copy = copies(&self.triangles, |index| sides.code(self.owners[index].instance));
            let mut place = is_copy.iter();
            self.triangles.retain(|_| place.next() == Some(&false));
            let mut place = is_copy.iter();
            self.owners.retain(|_| place.next() == Some(&false));
        }
        let build = || Group::new(&self.triangles, self.owners, params, cut_outs).with_panes(panes);
        (!self.triangles.is_empty()).then(|| Arc::new(build()))
    }
}

/// Returns, for each triangle, whether it duplicates an earlier triangle, with equal corners in the same order and with
/// an equal code of its sides.
fn copies(triangles: &[Triangle], sides: impl Fn(usize) -> u32) -> Vec<bool> {
    let bits = |index: u32| {
        let Triangle { v0, v1, v2 } = &triangles[index as usize];
        let corners = [v0, v1, v2].map(|corner| corner.to_array().map(f32::to_bits));
        (corners, sides(index as usize))
    };
    // Compare a short key first, so that few triangles are compared in full.
    let mut order: Vec<(u32, u32)> = Vec::with_capacity(triangles.len());
    for index in 0..triangles.len() as u32 {
        let key = bits(index).0.into_iter().flatten().fold(0u32, |key, bits| key.rotate_left(5).wrapping_add(bits));
        order.push((key, index));
    }
    order.sort_unstable_by(|a, b| {
        steps::count(1);
        a.0.cmp(&b.0).then_with(|| bits(a.1).cmp(&bits(b.1))).then(a.1.cmp(&b.1))
    });

    // Mark every triangle that equals its predecessor in the sorted order.
    let mut is_copy = vec![false; triangles.len()];
    for pair in order.windows(2) {
        is_copy[pair[1].1 as usize] = pair[0].0 == pair[1].0 && bits(pair[0].1) == bits(pair[1].1);
    }
    is_copy
}

/// Returns the corners of all triangles of an instance, deformed if `pose` deforms it.
fn corners<'a>(mesh: &'a Mesh, pose: &'a Pose, instance: usize) -> impl Iterator<Item = [Vec3; 3]> + 'a {
    let positions = pose.deformed(instance).map_or(&mesh.positions, |bent| &bent.positions);
    mesh.triangles.iter().map(|triangle| triangle.map(|vertex| positions[vertex as usize]))
}

/// Returns the ways of rays through an instance.
fn openings(cut_outs: &Option<Arc<CutOuts>>, panes: &Option<Arc<Panes>>, instance: usize) -> Openings {
    Openings {
        cut_outs: cut_outs.clone().filter(|cut_outs| cut_outs.has_holes(instance)),
        panes: panes.clone().filter(|panes| panes.has_pane(instance)),
    }
}

impl Geometry {
    /// Builds the trees of all rigid geometry in `scene`. Each instance under a moving node has a separate placement.
    pub fn new(scene: &Scene) -> Self {
        let pose = scene.pose(0.0);
        let (moving, deforming) = (scene.moving_instances(), scene.deforming_instances());
        // Scale lengths by a power of two, so that the scene spans 64…128 units.
        let extent = scene.bounds(&pose).map_or(1.0, |(min, max)| (max - min).max_element());
        let extent = if extent > 0.0 && extent.is_finite() { extent } else { 64.0 };
        let scale = (64.0 / extent).log2().ceil().exp2();
        let cut_outs = CutOuts::new(scene, &pose, extent).map(Arc::new);
        let panes = Panes::new(scene).map(Arc::new);
        let openings_of = |instance| openings(&cut_outs, &panes, instance);
        let (sharing, sides) = (Sharing::of(scene, &pose), AllSides::new(scene, &pose));
        // Cache the tree of each mesh in its local space, or `None` for a mesh without triangles.
        let mut of_mesh: HashMap<usize, Option<Arc<Group>>> = HashMap::new();
        let mut own_tree = |index: usize, mesh: usize| {
            let build = || {
                let mut own = Soup::default();
                own.add(index, &Affine3A::IDENTITY, corners(&scene.meshes[mesh], &pose, index));
                own.group(QUALITY, openings_of(index), &sides)
            };
            // Build a tree per deformed instance, because a skin or morph weights deform each instance differently.
            if pose.deformed(index).is_some() { build() } else { of_mesh.entry(mesh).or_insert_with(build).clone() }
        };

        // Collect static triangles in four common trees: opaque surfaces, glass, masks and blended surfaces.
        let [mut whole, mut glass, mut masked, mut blended] = [(); 4].map(|()| Soup::default());
        let mut subsets = Vec::new();
        for (index, &Instance { mesh, .. }) in scene.instances.iter().enumerate() {
            // Assign each instance to a separate tree, a shared tree or a common tree.
            let to_tree = Affine3A::from_scale(Vec3::splat(scale)) * scene.instance_world(&pose, index);
            if deforming[index] {
                subsets.push(Subset::Deforming { instance: index, node: scene.carrier(index) });
            } else if moving[index] {
                let group = own_tree(index, mesh);
                let node = scene.carrier(index);
                subsets.extend(group.map(|group| Subset::Attached { group, instance: index, node }));
            } else if sharing.shares(scene, &pose, index) {
                let placed = own_tree(index, mesh).and_then(|group| PlacedGroup::attached(group, index, to_tree));
                subsets.extend(placed.map(Subset::Fixed));
            } else {
                let own = openings_of(index);
                let soup = match own.cut_outs {
                    None if own.panes.is_some() => &mut glass,
                    None => &mut whole,
                    Some(holes) if holes.is_blended(index) => &mut blended,
                    Some(_) => &mut masked,
                };
                soup.add(index, &to_tree, corners(&scene.meshes[mesh], &pose, index));
            }
        }
        // Build the common trees from the collected triangles.
        let holes = || Openings { cut_outs: cut_outs.clone(), panes: None };
        let transparent = Openings { cut_outs: None, panes: panes.clone() };
        let fixed = [(whole, Openings::default()), (glass, transparent), (masked, holes()), (blended, holes())];
        let fixed = fixed.into_iter().filter_map(|(soup, openings)| soup.group(QUALITY, openings, &sides));
        subsets.extend(fixed.map(|group| Subset::Fixed(PlacedGroup::in_world(group))));
        Self { subsets, cut_outs, panes, sides: Arc::new(sides), scale }
    }

    /// Returns the number of triangles in the trees of `scene` at the first frame, without building them. A mesh shared
    /// by several instances counts once.
    #[must_use]
    pub fn triangles_to_hold(scene: &Scene) -> usize {
        let pose = scene.pose(0.0);
        let (moving, sharing) = (scene.moving_instances(), Sharing::of(scene, &pose));
        // Count a mesh once if its instances share a tree.
        let mut has_tree = vec![false; scene.meshes.len()];
        let mut triangles = 0;
        for (index, instance) in scene.instances.iter().enumerate() {
            let has_own = pose.deformed(index).is_none() && (moving[index] || sharing.shares(scene, &pose, index));
            let is_held = has_own && std::mem::replace(&mut has_tree[instance.mesh], true);
            triangles += if is_held { 0 } else { scene.meshes[instance.mesh].triangles.len() };
        }
        triangles
    }

    /// Returns an accelerator of the static geometry only.
    pub(crate) fn place_still(&self) -> Accelerator {
        let still = self.subsets.iter().filter_map(|subset| match subset {
            Subset::Fixed(placed) => Some(placed.clone()),
            Subset::Attached { .. } | Subset::Deforming { .. } => None,
        });
        Accelerator::new(still.collect(), self.sides.clone(), self.scale)
    }

    /// Places the trees for `pose`, builds the trees of deforming instances and builds the top-level tree.
    #[must_use]
    pub fn place(&self, pose: &Pose) -> Accelerator {
        let scaling = Affine3A::from_scale(Vec3::splat(self.scale));
        // Update the holes of animated materials, which depend on the pose.
        let changed = self.cut_outs.as_ref().and_then(|cut_outs| cut_outs.at(pose.animated_materials()).map(Arc::new));
        let cut_outs = changed.clone().or(self.cut_outs.clone());
        let with_holes = |group: &Arc<Group>, instance: usize| match &changed {
            Some(changed) if changed.has_changing_holes(instance) => Arc::new(group.with_cut_outs(changed.clone())),
            _ => group.clone(),
        };
        let placed = |subset: &Subset| match subset {
            Subset::Fixed(placed) => Some(placed.clone()),
            Subset::Attached { group, instance, node } => {
                // Transform the tree of a rigid mesh; the triangles stay in local space.
                let to_tree = node.map_or(scaling, |node| scaling * pose.world[node]);
                PlacedGroup::attached(with_holes(group, *instance), *instance, to_tree)
            }
            Subset::Deforming { instance, node } => {
                // Rebuild the tree of a deforming mesh in the scaled world.
                let bent = pose.deformed(*instance)?;
                let to_tree = node.map_or(scaling, |node| scaling * pose.world[node]);
                let mut own = Soup::default();
                own.add(*instance, &to_tree, (0..bent.triangles.len()).map(|t| bent.corners(t)));
                let openings = openings(&cut_outs, &self.panes, *instance);
                own.group(BvhBuildParams::fast_build(), openings, &self.sides).map(PlacedGroup::in_world)
            }
        };
        let groups: Vec<PlacedGroup> = self.subsets.iter().filter_map(placed).collect();
        Accelerator::new(groups, self.sides.clone(), self.scale)
    }

    /// Returns the total number of triangles in the trees that are built once.
    #[cfg(test)]
    pub(super) fn triangles_held(&self) -> usize {
        let mut groups = HashMap::new();
        for subset in &self.subsets {
            if let Subset::Fixed(PlacedGroup { group, .. }) | Subset::Attached { group, .. } = subset {
                groups.insert(Arc::as_ptr(group), group.owners.len());
            }
        }
        groups.into_values().sum()
    }
}
