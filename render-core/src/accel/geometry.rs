//! The trees that rays walk: everything that never moves is one, every moving instance has its own, built once; what changes
//! its shape is built anew for each frame. Surfaces with holes stand in trees of their own, so that rays need not test all others for holes.

use super::cut_outs::CutOuts;
use super::group::Group;
use super::triangles::Owner;
use super::{Accelerator, Placed};
use crate::scene::{Mesh, Pose, Scene};
use glam::{Affine3A, Vec3, Vec3A};
use obvhs::{BvhBuildParams, aabb::Aabb, triangle::Triangle};
use std::sync::Arc;

/// How trees are built that last. Splitting large triangles saves Sponza's rays a quarter of the leaves they visit and a
/// tenth of the nodes.
const QUALITY: BvhBuildParams = BvhBuildParams { pre_split: true, ..BvhBuildParams::medium_build() };

/// The parts that never change while a scene is rendered.
pub struct Geometry {
    parts: Vec<Part>,
    /// Holes of all parts that have some.
    cut_outs: Option<Arc<CutOuts>>,
    scale: f32,
}

impl std::fmt::Debug for Geometry {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.debug_struct("Geometry").field("trees", &self.parts.len()).finish_non_exhaustive()
    }
}

/// Triangles that stand, move or bend together.
enum Part {
    /// In the scaled world.
    Fixed(Arc<Group>),
    /// In the space of a node.
    Carried { group: Arc<Group>, node: usize },
    /// Built when it is placed: the instance, and the node it hangs from unless a skin places it.
    Deforming { instance: usize, node: Option<usize> },
}

/// Triangles on their way into a tree.
#[derive(Default)]
struct Soup {
    triangles: Vec<Triangle>,
    owners: Vec<Owner>,
}

impl Soup {
    fn add(&mut self, instance: usize, to_tree: &Affine3A, corners: impl Iterator<Item = [Vec3; 3]>) {
        for (t, corners) in corners.enumerate() {
            let [v0, v1, v2] = corners.map(|corner| to_tree.transform_point3a(corner.into()));
            // Triangles without area can never be hit, and only spoil the tree; nor can those that reach to infinity.
            let area = (v1 - v0).cross(v2 - v0).length_squared();
            if area > 0.0 && area.is_finite() {
                self.triangles.push(Triangle { v0, v1, v2 });
                self.owners.push(Owner { instance: instance as u32, triangle: t as u32 });
            }
        }
    }

    fn group(self, params: BvhBuildParams, cut_outs: Option<Arc<CutOuts>>) -> Option<Arc<Group>> {
        (!self.triangles.is_empty()).then(|| Arc::new(Group::new(&self.triangles, self.owners, params, cut_outs)))
    }
}

/// Corners of all triangles of an instance, as its mesh has them or as they are bent.
fn corners<'a>(mesh: &'a Mesh, pose: &'a Pose, instance: usize) -> impl Iterator<Item = [Vec3; 3]> + 'a {
    let positions = pose.deformed(instance).map_or(&mesh.positions, |bent| &bent.positions);
    mesh.triangles.iter().map(|triangle| triangle.map(|vertex| positions[vertex as usize]))
}

impl Geometry {
    /// Builds the trees of everything in `scene` that keeps its shape; instances under a moving node get one each.
    pub fn new(scene: &Scene) -> Self {
        let pose = scene.pose(0.0);
        let (moving, deforming) = (scene.moving_instances(), scene.deforming_instances());
        let extent = scene.bounds(&pose).map_or(1.0, |(min, max)| (max - min).max_element());
        let extent = if extent > 0.0 && extent.is_finite() { extent } else { 64.0 };
        let scale = (64.0 / extent).log2().ceil().exp2();
        let cut_outs = CutOuts::new(scene, &pose, extent).map(Arc::new);
        let holes_of = |instance| cut_outs.clone().filter(|cut_outs| cut_outs.has_holes(instance));
        let (mut whole, mut with_holes) = (Soup::default(), Soup::default());
        let mut parts = Vec::new();
        for (index, instance) in scene.instances.iter().enumerate() {
            let mesh = &scene.meshes[instance.mesh];
            if deforming[index] {
                let node = mesh.skinning.is_none().then_some(instance.node);
                parts.push(Part::Deforming { instance: index, node });
            } else if moving[index] {
                let mut own = Soup::default();
                own.add(index, &Affine3A::IDENTITY, corners(mesh, &pose, index));
                let group = own.group(QUALITY, holes_of(index));
                parts.extend(group.map(|group| Part::Carried { group, node: instance.node }));
            } else {
                let to_tree = Affine3A::from_scale(Vec3::splat(scale)) * scene.instance_world(&pose, index);
                let soup = if holes_of(index).is_some() { &mut with_holes } else { &mut whole };
                soup.add(index, &to_tree, corners(mesh, &pose, index));
            }
        }
        let fixed = [(whole, None), (with_holes, cut_outs.clone())];
        let fixed = fixed.into_iter().filter_map(|(soup, holes)| soup.group(QUALITY, holes));
        parts.extend(fixed.map(Part::Fixed));
        Self { parts, cut_outs, scale }
    }

    /// Places what stands still, and nothing else.
    pub(crate) fn place_still(&self) -> Accelerator {
        let still = self.parts.iter().filter_map(|part| match part {
            Part::Fixed(group) => Some(Placed { bounds: group.bounds, to_local: None, group: group.clone() }),
            Part::Carried { .. } | Part::Deforming { .. } => None,
        });
        Accelerator::new(still.collect(), self.scale)
    }

    /// Places the trees as `pose` says, builds those of what bends, and the top level over all.
    #[must_use]
    pub fn place(&self, pose: &Pose) -> Accelerator {
        let scaling = Affine3A::from_scale(Vec3::splat(self.scale));
        let in_world = |group: Arc<Group>| Placed { bounds: group.bounds, to_local: None, group };
        let placed = |part: &Part| match part {
            Part::Fixed(group) => Some(in_world(group.clone())),
            Part::Carried { group, node } => {
                let to_world = scaling * pose.world[*node];
                // An object squeezed flat by its animation has no inside to shoot at.
                if to_world.matrix3.determinant() == 0.0 || !to_world.is_finite() {
                    return None;
                }
                let (min, max) = (group.bounds.min, group.bounds.max);
                let corners: Vec<Vec3A> = (0..8)
                    .map(|i| Vec3A::select(glam::BVec3A::new(i & 1 == 0, i & 2 == 0, i & 4 == 0), min, max))
                    .map(|corner| to_world.transform_point3a(corner))
                    .collect();
                let bounds = Aabb::from_points(&corners);
                Some(Placed { group: group.clone(), to_local: Some(to_world.inverse()), bounds })
            }
            Part::Deforming { instance, node } => {
                let bent = pose.deformed(*instance)?;
                let to_tree = node.map_or(scaling, |node| scaling * pose.world[node]);
                let mut own = Soup::default();
                own.add(*instance, &to_tree, (0..bent.triangles.len()).map(|t| bent.corners(t)));
                let holes = self.cut_outs.clone().filter(|cut_outs| cut_outs.has_holes(*instance));
                own.group(BvhBuildParams::fast_build(), holes).map(in_world)
            }
        };
        let groups: Vec<Placed> = self.parts.iter().filter_map(placed).collect();
        Accelerator::new(groups, self.scale)
    }
}
