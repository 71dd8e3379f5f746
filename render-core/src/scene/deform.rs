//! Deformed meshes: morph targets are added first, then the joints of a skin transform the vertices (glTF 2.0, 3.7.2.2
//! and 3.7.3).

use super::{Influence, Mesh, MorphTarget, Scene, Skinning, Track, normal_matrix};
use crate::steps;
use glam::{Affine3A, Vec3, Vec3A, Vec4};
use rayon::prelude::*;
use std::collections::HashMap;
use std::sync::Arc;

/// Node with a mesh that has morph targets.
#[derive(Clone, Debug)]
pub struct MorphedNode {
    /// Index of the node in [`Scene::nodes`].
    pub node: usize,
    /// Weights of the targets if they are not animated.
    pub weights: Vec<f32>,
}

/// Skeleton that deforms meshes.
#[derive(Clone, Debug)]
pub struct Skin {
    /// Joints, as indices into [`Scene::nodes`].
    pub joints: Vec<usize>,
    /// Joint-from-mesh transforms of the bind pose, at least one per joint.
    pub inverse_bind: Vec<Affine3A>,
}

/// Vertices of a mesh at one time, in world space for a skinned mesh, otherwise in local space.
#[derive(Clone, Debug, PartialEq)]
pub struct DeformedMesh {
    /// Positions of the vertices \[m\].
    pub positions: Vec<Vec3>,
    /// Unit normals of the vertices. Empty if the mesh has no normals.
    pub normals: Vec<Vec3>,
    /// Unit tangents of the vertices, with their sign in w. Empty if the mesh has no tangents.
    pub tangents: Vec<Vec4>,
    /// Copy of the mesh's triangles, so that two poses can be compared without the scene.
    pub triangles: Vec<[u32; 3]>,
}

impl DeformedMesh {
    /// Returns the three corners of triangle `index`.
    #[inline]
    #[must_use]
    pub fn corners(&self, index: usize) -> [Vec3; 3] {
        self.triangles[index].map(|vertex| self.positions[vertex as usize])
    }
}

impl Mesh {
    /// Returns the shape with these `weights` of the morph targets. For a skinned mesh, `joints` are the
    /// world-from-mesh matrices of the joints.
    fn deformed(&self, weights: &[f32], joints: &[Affine3A]) -> DeformedMesh {
        // Add the displacements with nonzero weight.
        let mixed = |vertex: usize, rest: Vec3, list: fn(&MorphTarget) -> &[Vec3]| {
            let targets = self.morph_targets.iter().zip(weights).filter(|(_, weight)| **weight != 0.0);
            targets.fold(rest, |sum, (target, &weight)| {
                list(target).get(vertex).map_or(sum, |&displacement| sum + displacement * weight)
            })
        };
        let bone = |vertex: usize| self.skinning.as_ref().map(|skinning| skinning.matrix(vertex, joints));
        let unit = |v: Vec3A, otherwise: Vec3| v.try_normalize().map_or(otherwise, Vec3::from);

        // Apply morph targets first, then the skin.
        let positions = (0..self.positions.len()).into_par_iter().map(|vertex| {
            let position = mixed(vertex, self.positions[vertex], |target| &target.positions);
            bone(vertex).map_or(position, |bone| bone.transform_point3(position))
        });
        let normals = (0..self.normals.len()).into_par_iter().map(|vertex| {
            let normal = Vec3A::from(mixed(vertex, self.normals[vertex], |target| &target.normals));
            let turned = bone(vertex).map_or(normal, |bone| normal_matrix(&bone) * normal);
            unit(turned, self.normals[vertex])
        });
        let tangents = (0..self.tangents.len()).into_par_iter().map(|vertex| {
            let rest = self.tangents[vertex];
            let tangent = Vec3A::from(mixed(vertex, rest.truncate(), |target| &target.tangents));
            let turned = bone(vertex).map_or(tangent, |bone| bone.transform_vector3a(tangent));
            unit(turned, rest.truncate()).extend(rest.w)
        });
        DeformedMesh {
            positions: positions.collect(),
            normals: normals.collect(),
            tangents: tangents.collect(),
            triangles: self.triangles.clone(),
        }
    }
}

impl Skinning {
    /// Returns the world-from-mesh matrix of one vertex: the weighted mean of its joints' matrices.
    fn matrix(&self, vertex: usize, joints: &[Affine3A]) -> Affine3A {
        let own = &self.influences[vertex * self.per_vertex..][..self.per_vertex];
        let mut sum = Affine3A::ZERO;
        for &Influence { joint, weight } in own {
            let matrix = &joints[joint as usize];
            sum.matrix3 += matrix.matrix3 * weight;
            sum.translation += matrix.translation * weight;
        }
        sum
    }
}

impl Scene {
    /// Returns the shapes of all instances with a skin or morph targets, or an empty list if there are none. Instances
    /// of one mesh with the same weights share one shape.
    pub(super) fn deformed_meshes(&self, world: &[Affine3A], time: f32) -> Vec<Option<Arc<DeformedMesh>>> {
        if self.skins.is_empty() && self.morphed_nodes.is_empty() {
            return Vec::new();
        }

        // Compute the world-from-mesh matrices of all joints.
        let (place_of, weights) = (self.morphed_places(), self.weights_at(time));
        let mut joints: Vec<Vec<Affine3A>> = Vec::with_capacity(self.skins.len());
        for skin in &self.skins {
            let bound = skin.joints.iter().zip(&skin.inverse_bind);
            joints.push(bound.map(|(&node, bind)| world[node] * *bind).collect());
        }

        // A shape depends only on its mesh (including the mesh's skin) and on the weights.
        let mut shapes: HashMap<(usize, Vec<u32>), Arc<DeformedMesh>> = HashMap::new();
        let deformed = self.instances.iter().map(|instance| {
            let mesh = &self.meshes[instance.mesh];
            if mesh.skinning.is_none() && mesh.morph_targets.is_empty() {
                return None;
            }
            // Share one shape between instances of a mesh with equal weights.
            let weights: &[f32] = place_of.get(&instance.node).map_or(&[], |&place| &weights[place]);
            let weights = &weights[..weights.len().min(mesh.morph_targets.len())];
            let joints: &[Affine3A] = mesh.skinning.as_ref().map_or(&[], |skinning| &joints[skinning.skin]);
            let key = (instance.mesh, weights.iter().map(|weight| weight.to_bits()).collect());
            let shape = shapes.entry(key).or_insert_with(|| {
                steps::count(mesh.positions.len());
                Arc::new(mesh.deformed(weights, joints))
            });
            Some(shape.clone())
        });
        deformed.collect()
    }

    /// Returns the index in [`Scene::morphed_nodes`] of each node with morph targets.
    pub(super) fn morphed_places(&self) -> HashMap<usize, usize> {
        // If a node has several entries, the first entry applies.
        let mut place_of = HashMap::with_capacity(self.morphed_nodes.len());
        for (place, morphed) in self.morphed_nodes.iter().enumerate() {
            place_of.entry(morphed.node).or_insert(place);
        }
        place_of
    }

    /// Returns the weights of all morphed nodes at `time` seconds.
    fn weights_at(&self, time: f32) -> Vec<Vec<f32>> {
        // Start with the weights of the file, and overwrite animated ones.
        let place_of = self.morphed_places();
        let mut weights: Vec<Vec<f32>> = self.morphed_nodes.iter().map(|morphed| morphed.weights.clone()).collect();
        for channel in &self.channels {
            if let Some(&place) = place_of.get(&channel.node) {
                channel.apply_weights(time, &mut weights[place]);
            }
        }
        weights
    }

    /// Returns, for each instance, whether its shape changes over time.
    #[must_use]
    pub fn deforming_instances(&self) -> Vec<bool> {
        // Find nodes with changing weights, and skins with a moving joint.
        let moving = self.moving_nodes();
        let mut morphing = vec![false; self.nodes.len()];
        for channel in &self.channels {
            morphing[channel.node] |= matches!(channel.track, Track::Weights(_)) && channel.changes();
        }
        let mut bending = Vec::with_capacity(self.skins.len());
        for skin in &self.skins {
            steps::count(skin.joints.len());
            bending.push(skin.joints.iter().any(|&joint| moving[joint]));
        }

        // An instance deforms with its skin or with its node's weights.
        let deforms = |instance: &super::Instance| {
            let mesh = &self.meshes[instance.mesh];
            mesh.skinning.as_ref().is_some_and(|skinning| bending[skinning.skin])
                || (!mesh.morph_targets.is_empty() && morphing[instance.node])
        };
        self.instances.iter().map(deforms).collect()
    }
}
