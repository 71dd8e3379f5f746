//! Meshes: vertices, triangles, and what deforms them.

use super::accessor::Buffers;
use super::nodes::NodeOf;
use super::{LoadError, Loader};
use crate::scene::{Instance, Mesh, MorphTarget, MorphedNode, Scene, Skinning};
use glam::{Vec2, Vec3, Vec4};
use gltf::{Semantic, mesh::Mode};
use std::collections::{HashMap, hash_map::Entry};

impl Loader<'_> {
    /// Reads the meshes that nodes of the scene show, each once for each skin that bends it.
    pub(super) fn meshes(
        &self,
        document: &gltf::Document,
        buffers: &Buffers,
        node_of: &NodeOf,
        scene: &mut Scene,
    ) -> Result<(), LoadError> {
        let mut read: HashMap<(usize, Option<usize>), std::ops::Range<usize>> = HashMap::new();
        let mut skin_of: HashMap<usize, usize> = HashMap::new();
        let mut points_or_lines = false;
        for node in document.nodes() {
            let (Some(&index), Some(mesh)) = (node_of.get(&node.index()), node.mesh()) else { continue };
            let skin = node.skin();
            let key = (mesh.index(), skin.as_ref().map(gltf::Skin::index));
            if let Entry::Vacant(entry) = read.entry(key) {
                let first = scene.meshes.len();
                let mut shown = Vec::new();
                for primitive in mesh.primitives() {
                    match self.primitive(&mesh, &primitive, buffers, scene)? {
                        Some(triangles) => {
                            scene.meshes.push(triangles);
                            shown.push(primitive);
                        }
                        None => points_or_lines = true,
                    }
                }
                if let Some(skin) = skin {
                    let place = match skin_of.get(&skin.index()) {
                        Some(&place) => place,
                        None => {
                            scene.skins.push(self.skin(&skin, buffers, node_of)?);
                            skin_of.insert(skin.index(), scene.skins.len() - 1);
                            scene.skins.len() - 1
                        }
                    };
                    let joints = scene.skins[place].joints.len();
                    for (mesh_of_skin, primitive) in scene.meshes[first..].iter_mut().zip(shown) {
                        let place_in_file = format!("mesh {} primitive {}", mesh.index(), primitive.index());
                        let vertices = mesh_of_skin.positions.len();
                        let sets = self.influence_sets(&place_in_file, &primitive, buffers, vertices)?;
                        let influences = self.influences(&place_in_file, &sets, joints)?;
                        let per_vertex = 4 * sets.len();
                        mesh_of_skin.skinning = Some(Skinning { skin: place, per_vertex, influences });
                    }
                }
                entry.insert(first..scene.meshes.len());
            }
            let meshes = read[&key].clone();
            let targets = meshes.clone().map(|mesh| scene.meshes[mesh].morph_targets.len()).max().unwrap_or(0);
            if targets > 0 {
                buffers.charge(targets.saturating_mul(size_of::<f32>()));
                if buffers.is_exhausted() {
                    return Ok(());
                }
                let mut weights = node.weights().or(mesh.weights()).unwrap_or_default().to_vec();
                weights.resize(targets, 0.0);
                scene.morphed_nodes.push(MorphedNode { node: index, weights });
            }
            scene.instances.extend(meshes.map(|mesh| Instance { node: index, mesh }));
        }
        if points_or_lines {
            scene.warnings.push("points and lines are left out".into());
        }
        Ok(())
    }

    fn primitive(
        &self,
        mesh: &gltf::Mesh,
        primitive: &gltf::Primitive,
        buffers: &Buffers,
        scene: &Scene,
    ) -> Result<Option<Mesh>, LoadError> {
        let place = format!("mesh {} primitive {}", mesh.index(), primitive.index());
        let get = |semantic: Semantic| primitive.get(&semantic);
        let Some(positions) = get(Semantic::Positions).and_then(|accessor| buffers.floats::<3>(&accessor)) else {
            return self.bad(format!("{place} has no positions that can be read"));
        };
        let positions: Vec<Vec3> = positions.into_iter().map(Vec3::from).collect();
        if let Some(vertex) = positions.iter().position(|p| !p.is_finite()) {
            return self.bad(format!("{place}: the position of vertex {vertex} is not finite"));
        }
        let indices: Vec<u32> = match primitive.indices() {
            None => (0..positions.len() as u32).collect(),
            Some(accessor) => match buffers.integers::<1>(&accessor) {
                Some(indices) => indices.into_iter().flatten().collect(),
                None => return self.bad(format!("{place}: its indices lie outside of their buffer")),
            },
        };
        if let Some(index) = indices.iter().find(|&&index| index as usize >= positions.len()) {
            return self.bad(format!("{place}: index {index}, but there are {} vertices", positions.len()));
        }
        let Some(triangles) = triangles(primitive.mode(), &indices) else { return Ok(None) };

        let count = positions.len();
        let material = primitive.material().index().unwrap_or(scene.materials.len() - 1);
        let Some(look) = scene.materials.get(material) else {
            return self.bad(format!("{place}: there is no material {material}"));
        };
        let normals: Vec<Vec3> = attribute(get(Semantic::Normals), buffers, count, |n: [f32; 3]| {
            Vec3::from(n).try_normalize().unwrap_or(Vec3::Y)
        });
        // Without normals, given tangents are to be ignored (glTF 2.0, 3.7.2.1); without a normal map they are not needed.
        let wants_tangents = look.normal_texture.is_some() && !normals.is_empty();
        let tangents = attribute(get(Semantic::Tangents).filter(|_| wants_tangents), buffers, count, Vec4::from_array);
        let uses = |set: usize| look.slots().any(|slot| slot.uv_set == set);
        let uvs = std::array::from_fn(|set| {
            let accessor = get(Semantic::TexCoords(set as u32)).filter(|_| uses(set));
            attribute(accessor, buffers, count, Vec2::from_array)
        });
        let mut colors = attribute(get(Semantic::Colors(0)), buffers, count, Vec4::from_array);
        if colors.is_empty() {
            colors = attribute(get(Semantic::Colors(0)), buffers, count, |[r, g, b]: [f32; 3]| Vec4::new(r, g, b, 1.0));
        }
        if !colors.iter().all(|c| c.is_finite()) {
            colors.clear();
        }
        let mut morph_targets = Vec::new();
        for target in primitive.morph_targets() {
            let displacement = |accessor| attribute(accessor, buffers, count, |d: [f32; 3]| Vec3::from(d));
            let target = MorphTarget {
                positions: displacement(target.positions()),
                normals: displacement(target.normals().filter(|_| !normals.is_empty())),
                tangents: displacement(target.tangents().filter(|_| !tangents.is_empty())),
            };
            if !target.positions.iter().chain(&target.normals).chain(&target.tangents).all(|d| d.is_finite()) {
                return self.bad(format!("{place}: a morph target is not finite"));
            }
            morph_targets.push(target);
        }
        let name = mesh.name().unwrap_or_default().to_owned();
        Ok(Some(Mesh {
            name,
            positions,
            normals,
            tangents,
            uvs,
            colors,
            triangles,
            material,
            morph_targets,
            skinning: None,
        }))
    }
}

/// One value per vertex; empty if there are none, or not as many.
fn attribute<const N: usize, T>(
    accessor: Option<gltf::Accessor>,
    buffers: &Buffers,
    count: usize,
    convert: impl Fn([f32; N]) -> T,
) -> Vec<T> {
    let list = accessor.and_then(|accessor| buffers.floats::<N>(&accessor));
    list.filter(|list| list.len() == count).map_or_else(Vec::new, |list| list.into_iter().map(convert).collect())
}

/// Splits strips and fans; `None` for points and lines.
fn triangles(mode: Mode, indices: &[u32]) -> Option<Vec<[u32; 3]>> {
    Some(match mode {
        Mode::Triangles => indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect(),
        // Every other triangle of a strip is turned round, or it would face backwards.
        Mode::TriangleStrip => indices
            .windows(3)
            .enumerate()
            .map(|(i, t)| if i % 2 == 0 { [t[0], t[1], t[2]] } else { [t[1], t[0], t[2]] })
            .collect(),
        Mode::TriangleFan => indices.windows(2).skip(1).map(|t| [indices[0], t[0], t[1]]).collect(),
        _ => return None,
    })
}
