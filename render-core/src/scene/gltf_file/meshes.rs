//! Loader of meshes: vertices, triangles, morph targets and influences.

use super::accessor::Buffers;
use super::nodes::NodeOf;
use super::strokes::{BYTES_PER_STROKE, Strokes, spread};
use super::variants::material_of;
use super::{DocumentSource, LoadError, Loader};
use crate::scene::{Instance, Material, Mesh, MorphTarget, MorphedNode, Scene, Skinning};
use glam::{Vec2, Vec3, Vec4};
use gltf::{Semantic, mesh::Mode};
use std::collections::{HashMap, hash_map::Entry};

impl Loader<'_> {
    /// Reads the meshes that visible nodes use, once per skin.
    pub(super) fn meshes(
        &self,
        source: DocumentSource,
        node_of: &mut NodeOf,
        scene: &mut Scene,
    ) -> Result<(), LoadError> {
        let DocumentSource { document, buffers, .. } = source;
        let mut read: HashMap<(usize, Option<usize>), std::ops::Range<usize>> = HashMap::new();
        let mut skin_of: HashMap<usize, usize> = HashMap::new();
        let mut has_strokes = false;
        for node in document.nodes() {
            // Skip nodes outside the scene and hidden nodes.
            let (Some(&index), Some(mesh)) = (node_of.get(&node.index()), node.mesh()) else { continue };
            if !node_of.shows(index) {
                continue;
            }

            // Read each pair of mesh and skin once.
            let skin = node.skin();
            let key = (mesh.index(), skin.as_ref().map(gltf::Skin::index));
            if let Entry::Vacant(entry) = read.entry(key) {
                let first = scene.meshes.len();
                let mut shown = Vec::new();
                // Draw points and lines without normals unlit, as glTF prescribes.
                for primitive in mesh.primitives() {
                    let DrawnPrimitive { mut mesh, sources } = self.primitive(&mesh, &primitive, source, scene)?;
                    if sources.is_some() && primitive.get(&Semantic::Normals).is_none() {
                        mesh.material = unlit(mesh.material, node_of, &mut scene.materials);
                    }
                    has_strokes |= sources.is_some();
                    scene.meshes.push(mesh);
                    shown.push((primitive, sources));
                }
                // Read each skin once, and assign the influences to its meshes.
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
                    for (mesh_of_skin, (primitive, sources)) in scene.meshes[first..].iter_mut().zip(shown) {
                        let place_in_file = format!("mesh {} primitive {}", mesh.index(), primitive.index());
                        let positions = primitive.get(&Semantic::Positions);
                        let vertices = positions.map_or(0, |positions| positions.count());
                        // Copy the influences of points and lines to the corners of their bodies.
                        let mut sets = self.influence_sets(&place_in_file, &primitive, buffers, vertices)?;
                        for (joints, weights) in &mut sets {
                            *joints = spread(std::mem::take(joints), sources.as_deref());
                            *weights = spread(std::mem::take(weights), sources.as_deref());
                        }
                        let influences = self.influences(&place_in_file, &sets, joints)?;
                        let per_vertex = 4 * sets.len();
                        mesh_of_skin.skinning = Some(Skinning { skin: place, per_vertex, influences });
                    }
                }
                entry.insert(first..scene.meshes.len());
            }

            // Copies, and nodes that animate visibility, replace the node itself.
            let meshes = read[&key].clone();
            let copies = self.copies(&node, index, source, scene)?;
            let is_skinned = meshes.clone().any(|mesh| scene.meshes[mesh].skinning.is_some());
            let places = node_of.hide(index, copies.unwrap_or(index..index + 1).collect(), is_skinned, scene);

            // All primitives share one list of weights, with the maximum number of targets among the primitives.
            let targets = meshes.clone().map(|mesh| scene.meshes[mesh].morph_targets.len()).max().unwrap_or(0);
            if targets > 0 {
                buffers.charge(targets.saturating_mul(size_of::<f32>()));
                if buffers.is_exhausted() {
                    return Ok(());
                }
                let mut weights = node.weights().or(mesh.weights()).unwrap_or_default().to_vec();
                weights.resize(targets, 0.0);
                for &node in &places {
                    scene.morphed_nodes.push(MorphedNode { node, weights: weights.clone() });
                }
            }
            // Show every primitive at every node.
            for &node in &places {
                scene.instances.extend(meshes.clone().map(|mesh| Instance { node, mesh }));
            }
        }
        if has_strokes {
            scene
                .warnings
                .push("points and lines are drawn as thin bodies: --point-size METERS sets their width".into());
        }
        Ok(())
    }

    fn primitive(
        &self,
        mesh: &gltf::Mesh,
        primitive: &gltf::Primitive,
        DocumentSource { document, buffers, variant, point_size, .. }: DocumentSource,
        scene: &Scene,
    ) -> Result<DrawnPrimitive, LoadError> {
        // Read the positions, the only required attribute.
        let place = format!("mesh {} primitive {}", mesh.index(), primitive.index());
        let get = |semantic: Semantic| primitive.get(&semantic);
        let Some(positions) = get(Semantic::Positions).and_then(|accessor| buffers.floats::<3>(&accessor)) else {
            return self.bad(format!("{place} has no readable positions"));
        };
        let positions: Vec<Vec3> = positions.into_iter().map(Vec3::from).collect();
        if let Some(vertex) = positions.iter().position(|p| !p.is_finite()) {
            return self.bad(format!("{place}: the position of vertex {vertex} is not finite"));
        }

        // Read the indices and check them against the number of vertices.
        let indices: Vec<u32> = match primitive.indices() {
            None => (0..positions.len() as u32).collect(),
            Some(accessor) => match buffers.integers::<1>(&accessor) {
                Some(indices) => indices.into_iter().flatten().collect(),
                None => return self.bad(format!("{place}: its indices are outside their buffer")),
            },
        };
        if let Some(index) = indices.iter().find(|&&index| index as usize >= positions.len()) {
            return self.bad(format!("{place}: index {index}, but there are {} vertices", positions.len()));
        }

        // Points and lines become closed bodies. `sources` maps their corners to vertices.
        let count = positions.len();
        let (positions, triangles, sources) = match triangles(primitive.mode(), &indices) {
            Some(triangles) => (positions, triangles, None),
            None => {
                // If this exceeds the allowance, loading ends with an error.
                let mut indices = indices;
                if buffers.charge(indices.len().saturating_mul(BYTES_PER_STROKE)).is_none() {
                    indices.clear();
                }
                let strokes = Strokes::of(primitive.mode(), &indices, &positions, point_size);
                let Some(Strokes { positions, triangles, sources }) = strokes else {
                    return self.bad(format!("{place} has an unknown mode"));
                };
                (positions, triangles, Some(sources))
            }
        };
        let sources_of = sources.as_deref();

        // The default material follows the file's materials.
        let own = || primitive.material().index().unwrap_or(document.materials().len());
        let material = material_of(primitive, variant).unwrap_or_else(own);
        let Some(look) = scene.materials.get(material) else {
            return self.bad(format!("{place}: there is no material {material}"));
        };

        // Bodies of points and lines use their face normals.
        let normals = get(Semantic::Normals).filter(|_| sources.is_none());
        let mut normals: Vec<Vec3> =
            attribute(normals, buffers, count, |n: [f32; 3]| Vec3::from(n).normalize_or_zero());
        fill_normals(&mut normals, &positions, &triangles);
        // Without normals, tangents are ignored (glTF 2.0, 3.7.2.1). Few materials use them.
        let wants_tangents = look.needs_tangents() && !normals.is_empty();
        let tangents = attribute(get(Semantic::Tangents).filter(|_| wants_tangents), buffers, count, Vec4::from_array);
        let uses = |set: usize| look.slots().any(|slot| slot.uv_set == set);
        let uvs = std::array::from_fn(|set| {
            let accessor = get(Semantic::TexCoords(set as u32)).filter(|_| uses(set));
            spread(attribute(accessor, buffers, count, Vec2::from_array), sources_of)
        });
        let colors = spread(colors(primitive, buffers, count), sources_of);

        // Morph targets displace only the attributes that the mesh has.
        let mut morph_targets = Vec::new();
        for target in primitive.morph_targets() {
            let displacement =
                |accessor| spread(attribute(accessor, buffers, count, |d: [f32; 3]| Vec3::from(d)), sources_of);
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
        let mesh = Mesh {
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
        };
        Ok(DrawnPrimitive { mesh, sources })
    }
}

/// Returns the vertex colors with opacity, or an empty list if any color is not finite.
fn colors(primitive: &gltf::Primitive, buffers: &Buffers, count: usize) -> Vec<Vec4> {
    // Read colors with opacity. If the file has none, read colors without opacity.
    let accessor = || primitive.get(&Semantic::Colors(0));
    let mut colors = attribute(accessor(), buffers, count, Vec4::from_array);
    if colors.is_empty() {
        colors = attribute(accessor(), buffers, count, |[r, g, b]: [f32; 3]| Vec4::new(r, g, b, 1.0));
    }
    if !colors.iter().all(|c| c.is_finite()) {
        colors.clear();
    }
    colors
}

/// Primitive as it is drawn.
struct DrawnPrimitive {
    mesh: Mesh,
    /// Index of the file's vertex for each corner of points and lines; `None` for triangles.
    sources: Option<Vec<u32>>,
}

/// Returns an unlit copy of a material, for points and lines without normals (glTF 2.0, 3.9.5: "the sum of the base
/// color value and the emissive value").
fn unlit(material: usize, node_of: &mut NodeOf, materials: &mut Vec<Material>) -> usize {
    *node_of.unlit.entry(material).or_insert_with(|| {
        let lit = &materials[material];
        let base_color = (lit.base_color + lit.emission).min(Vec3::ONE);
        materials.push(Material { base_color, unlit: true, emission: Vec3::ZERO, ..lit.clone() });
        materials.len() - 1
    })
}

/// Returns one value per vertex, or an empty list if the accessor is missing or has a different count.
fn attribute<const N: usize, T>(
    accessor: Option<gltf::Accessor>,
    buffers: &Buffers,
    count: usize,
    convert: impl Fn([f32; N]) -> T,
) -> Vec<T> {
    let list = accessor.and_then(|accessor| buffers.floats::<N>(&accessor));
    list.filter(|list| list.len() == count).map_or_else(Vec::new, |list| list.into_iter().map(convert).collect())
}

/// Sets missing normals of vertices to the area-weighted mean of their triangles' normals. A mesh without any normals
/// stays without them and is flat shaded (glTF 2.0, 3.7.2.1: "client implementations MUST calculate flat normals").
fn fill_normals(normals: &mut Vec<Vec3>, positions: &[Vec3], triangles: &[[u32; 3]]) {
    // A mesh without any normals is flat shaded.
    if normals.iter().all(|&normal| normal == Vec3::ZERO) {
        normals.clear();
    }
    if !normals.contains(&Vec3::ZERO) {
        return;
    }
    // Cross products weight each normal by the triangle's area.
    let mut sums = vec![Vec3::ZERO; positions.len()];
    for triangle in triangles {
        let [a, b, c] = triangle.map(|vertex| positions[vertex as usize]);
        let normal = (b - a).cross(c - a);
        for &vertex in triangle {
            sums[vertex as usize] += normal;
        }
    }
    for (normal, sum) in normals.iter_mut().zip(sums) {
        if *normal == Vec3::ZERO {
            *normal = sum.try_normalize().unwrap_or(Vec3::Y);
        }
    }
}

/// Splits strips and fans into triangles. Returns `None` for points and lines.
fn triangles(mode: Mode, indices: &[u32]) -> Option<Vec<[u32; 3]>> {
    let mut triangles = Vec::new();
    match mode {
        Mode::Triangles => triangles.extend(indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]])),
        Mode::TriangleStrip => {
            // Reverse every other triangle, so that all triangles face the same side.
            for (i, t) in indices.windows(3).enumerate() {
                triangles.push(if i % 2 == 0 { [t[0], t[1], t[2]] } else { [t[1], t[0], t[2]] });
            }
        }
        Mode::TriangleFan => {
            // All triangles share the first vertex.
            for t in indices.windows(2).skip(1) {
                triangles.push([indices[0], t[0], t[1]]);
            }
        }
        _ => return None,
    }
    Some(triangles)
}
