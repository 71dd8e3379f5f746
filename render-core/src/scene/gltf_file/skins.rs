//! Loader of skins: joints and their weights on vertices.

use super::accessor::Buffers;
use super::nodes::NodeOf;
use super::{LoadError, Loader};
use crate::scene::{Influence, Skin};
use glam::{Affine3A, Mat4};
use gltf::Semantic;

/// One set of the attributes JOINTS_n and WEIGHTS_n, with four of each per vertex.
pub(super) type InfluenceSet = (Vec<[u32; 4]>, Vec<[f32; 4]>);

impl Loader<'_> {
    /// Reads joints and their inverse bind matrices.
    pub(super) fn skin(&self, skin: &gltf::Skin, buffers: &Buffers, node_of: &NodeOf) -> Result<Skin, LoadError> {
        let place = format!("skin {}", skin.index());
        // Map the joints to scene nodes.
        let mut joints = Vec::new();
        for joint in skin.joints() {
            match node_of.get(&joint.index()) {
                Some(&node) => joints.push(node),
                None => return self.bad(format!("{place}: joint {} is not part of the scene", joint.index())),
            }
        }
        // Read the matrices, which default to the identity.
        let inverse_bind: Vec<Affine3A> = match skin.inverse_bind_matrices() {
            None => vec![Affine3A::IDENTITY; joints.len()],
            Some(accessor) => match buffers.floats::<16>(&accessor) {
                Some(list) => list.iter().map(|m| Affine3A::from_mat4(Mat4::from_cols_array(m))).collect(),
                None => return self.bad(format!("{place}: its matrices are outside their buffer")),
            },
        };
        if joints.is_empty() || inverse_bind.len() < joints.len() || !inverse_bind.iter().all(Affine3A::is_finite) {
            return self.bad(format!("{place}: each joint needs an inverse bind matrix of finite numbers"));
        }
        Ok(Skin { joints, inverse_bind })
    }

    /// Reads joints and weights of a primitive with `vertices` vertices. Returns at least one set.
    pub(super) fn influence_sets(
        &self,
        place: &str,
        primitive: &gltf::Primitive,
        buffers: &Buffers,
        vertices: usize,
    ) -> Result<Vec<InfluenceSet>, LoadError> {
        let mut sets: Vec<InfluenceSet> = Vec::new();
        // Read numbered sets until one is missing. Each must have one entry per vertex.
        for set in 0.. {
            let (Some(joints), Some(weights)) =
                (primitive.get(&Semantic::Joints(set)), primitive.get(&Semantic::Weights(set)))
            else {
                break;
            };
            match (buffers.integers(&joints), buffers.floats(&weights)) {
                (Some(joints), Some(weights)) if joints.len() == vertices && weights.len() == vertices => {
                    sets.push((joints, weights));
                }
                _ => return self.bad(format!("{place}: its joints and weights cannot be read")),
            }
        }
        if sets.is_empty() {
            return self.bad(format!("{place}: it has a skin, but no joints and weights"));
        }
        Ok(sets)
    }

    /// Returns the influences of each vertex, with weights that sum to 1. The list contains four influences per set for
    /// the first vertex, then for the second, and so on.
    pub(super) fn influences(
        &self,
        place: &str,
        sets: &[InfluenceSet],
        joints: usize,
    ) -> Result<Vec<Influence>, LoadError> {
        let vertices = sets.first().map_or(0, |(joints, _)| joints.len());
        let mut influences = Vec::with_capacity(vertices * 4 * sets.len());
        for vertex in 0..vertices {
            let first = influences.len();
            for (joint_set, weight_set) in sets {
                for (&joint, &weight) in joint_set[vertex].iter().zip(&weight_set[vertex]) {
                    // An influence with weight 0 may name any joint.
                    let joint = if weight == 0.0 { 0 } else { joint };
                    if joint as usize >= joints || !weight.is_finite() {
                        return self.bad(format!("{place}: vertex {vertex} uses joint {joint} of {joints}"));
                    }
                    influences.push(Influence { joint, weight });
                }
            }

            // Normalize the weights. If all weights are 0, use the first influence.
            let own = &mut influences[first..];
            let sum: f32 = own.iter().map(|influence| influence.weight).sum();
            if sum > 0.0 {
                own.iter_mut().for_each(|influence| influence.weight /= sum);
            } else {
                own[0].weight = 1.0;
            }
        }
        Ok(influences)
    }
}
