//! Meshes of baked surfaces: vertices split along charts, with coordinates in the baked texture for each node.

use super::apart;
use super::document::{ARRAY_BUFFER, Document, ELEMENT_ARRAY_BUFFER, number};
use super::materials::Materials;
use super::places::{PrimitiveSlot, primitives};
use super::split::{SideTriangles, Split};
use glam::Vec2;
use pipeline::error::Result;
use render_core::{Atlas, FineTexels, Surfaces};
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;

/// Sides of an instance that have charts in the atlas.
struct Baked {
    instance: usize,
    /// Front (false) or back (true), each with the texture coordinates of its triangles.
    sides: Vec<(bool, SideTriangles)>,
}

/// A primitive with split vertices: its accessors except coordinates in the baked texture.
struct Geometry {
    split: Split,
    attributes: Map<String, Value>,
    targets: Option<Value>,
    /// Accessor of the positions for backs.
    behind: Option<usize>,
    /// Accessors of existing index lists.
    indices: BTreeMap<Vec<u32>, usize>,
}

/// Writer of new meshes for baked surfaces.
pub(super) struct Meshes<'a> {
    pub document: &'a mut Document,
    pub places: &'a [PrimitiveSlot],
    pub surfaces: &'a Surfaces<'a>,
    pub atlas: &'a Atlas,
    pub texels: &'a FineTexels<'a>,
    pub materials: Materials,
}

impl Meshes<'_> {
    /// Creates a separate mesh for each node with a baked surface. Other primitives of the node are unchanged.
    pub fn write(mut self) -> Result<()> {
        // Write the primitives mesh by mesh: instances of a mesh share vertices.
        let mut new: BTreeMap<usize, BTreeMap<usize, Vec<Value>>> = BTreeMap::new();
        for (_, instances) in self.instances_by_mesh() {
            let mut geometry = self.geometry(&instances)?;
            for baked in &instances {
                let place = self.places[baked.instance];
                let written = self.primitives(baked, place, &mut geometry)?;
                new.entry(place.node).or_default().insert(place.primitive, written);
            }
        }
        // Give each node a copy of its mesh with the new primitives.
        for (node, mut written) in new {
            let Some(mesh) = number(&self.document.list("nodes")[node]["mesh"]) else { continue };
            let mut list = Vec::new();
            for (primitive, found) in primitives(self.document, mesh).iter().enumerate() {
                match written.remove(&primitive) {
                    Some(written) => list.extend(written),
                    None => list.push(found.clone()),
                }
            }
            let mut mesh = self.document.list("meshes")[mesh].clone();
            mesh["primitives"] = json!(list);
            let mesh = self.document.push("meshes", mesh);
            self.document.json["nodes"][node]["mesh"] = json!(mesh);
        }
        Ok(())
    }

    /// Returns the instances that have charts, grouped by their mesh.
    fn instances_by_mesh(&self) -> BTreeMap<usize, Vec<Baked>> {
        let scene = self.surfaces.scene();
        let mut by_mesh: BTreeMap<usize, Vec<Baked>> = BTreeMap::new();
        for (instance, found) in scene.instances.iter().enumerate() {
            let triangles = scene.meshes[found.mesh].triangles.len() as u32;
            let mut sides = Vec::new();
            // Query both sides: double-sided surfaces have charts for each.
            for back in [false, true] {
                let place = |triangle| self.atlas.triangle_places(instance as u32, triangle, !back);
                let side: SideTriangles = (0..triangles).map(place).collect();
                if side.iter().any(Option::is_some) {
                    sides.push((back, side));
                }
            }
            if !sides.is_empty() {
                by_mesh.entry(found.mesh).or_default().push(Baked { instance, sides });
            }
        }
        by_mesh
    }

    /// Creates the geometry that instances of a mesh share.
    fn geometry(&mut self, instances: &[Baked]) -> Result<Geometry> {
        // Use one set of vertices for all sides of all instances.
        let scene = self.surfaces.scene();
        let Baked { instance, .. } = instances[0];
        let (mesh, place) = (&scene.meshes[scene.instances[instance].mesh], self.places[instance]);
        let mut sides = Vec::new();
        for baked in instances {
            sides.extend(baked.sides.iter().map(|(_, side)| side.clone()));
        }
        let split = Split::new(&mesh.triangles, &sides);

        // Omit vertex colors, which the baked texture replaces, and tangents, which are unused without a normal map.
        // Keep only the first set of texture coordinates, since set numbers must start at 0.
        let found = primitives(self.document, place.mesh)[place.primitive].clone();
        let count = mesh.positions.len();
        let mut attributes = Map::new();
        for (name, accessor) in found["attributes"].as_object().into_iter().flatten() {
            let is_left_out = name.starts_with("COLOR_") || name == "TANGENT" || name.starts_with("TEXCOORD_");
            if is_left_out && name != "TEXCOORD_0" {
                continue;
            }
            let bounded = name == "POSITION";
            let gathered =
                number(accessor).and_then(|index| self.document.gather(index, count, &split.vertices, bounded));
            match gathered {
                Some(accessor) => drop(attributes.insert(name.clone(), json!(accessor))),
                None if bounded => return Err(self.document.damaged("a list of positions")),
                None => {}
            }
        }
        let targets = self.targets(&found, count, &split.vertices)?;
        // Add positions for backs, slightly behind the fronts, if any instance has a back.
        let has_backs = instances.iter().any(|baked| baked.sides.iter().any(|(back, _)| *back));
        let behind = has_backs.then(|| {
            let instances: Vec<usize> = instances.iter().map(|baked| baked.instance).collect();
            let positions = apart::behind(mesh, &split, apart::gap(self.surfaces, &instances));
            self.document.add_positions(&positions)
        });
        Ok(Geometry { split, attributes, targets, behind, indices: BTreeMap::new() })
    }

    /// Copies the morph targets of a primitive to the new vertices: a static shape may blend several targets.
    fn targets(&mut self, primitive: &Value, count: usize, vertices: &[u32]) -> Result<Option<Value>> {
        let Some(old) = primitive["targets"].as_array() else { return Ok(None) };
        let mut targets = Vec::new();
        for target in old {
            let mut new = Map::new();
            for (name, accessor) in target.as_object().into_iter().flatten() {
                // Omit tangents: the new mesh has none.
                if !["POSITION", "NORMAL"].contains(&name.as_str()) {
                    continue;
                }
                let accessor = number(accessor)
                    .and_then(|index| self.document.gather(index, count, vertices, name == "POSITION"))
                    .ok_or_else(|| self.document.damaged("a morph target"))?;
                new.insert(name.clone(), json!(accessor));
            }
            targets.push(Value::Object(new));
        }
        Ok(Some(json!(targets)))
    }

    /// Creates the primitives of an instance: its front, and its back if the back has charts.
    fn primitives(&mut self, baked: &Baked, place: PrimitiveSlot, geometry: &mut Geometry) -> Result<Vec<Value>> {
        let found = primitives(self.document, place.mesh)[place.primitive].clone();
        let material = self.materials.baked(self.document, number(&found["material"]));
        let mut written = Vec::new();
        // Make each side a primitive with its own texture coordinates.
        for (back, side) in &baked.sides {
            let mut attributes = geometry.attributes.clone();
            if let Some(behind) = geometry.behind.filter(|_| *back) {
                attributes.insert("POSITION".into(), json!(behind));
            }
            let coordinates = self.coordinates(&geometry.split.places(side));
            attributes.insert("TEXCOORD_1".into(), json!(coordinates));
            // Use the coordinates also as the first set if there is none: set numbers must have no gaps.
            attributes.entry("TEXCOORD_0").or_insert(json!(coordinates));

            // Share the indices between sides with equal triangles.
            let indices = geometry.split.indices(side, *back);
            let indices = match geometry.indices.get(&indices) {
                Some(&known) => known,
                None => {
                    let accessor = self.indices(&indices);
                    geometry.indices.insert(indices, accessor);
                    accessor
                }
            };
            let mut primitive = json!({ "attributes": attributes, "indices": indices, "material": material });
            if let Some(targets) = &geometry.targets {
                primitive["targets"] = targets.clone();
            }
            if !found["extras"].is_null() {
                primitive["extras"] = found["extras"].clone();
            }
            written.push(primitive);
        }
        Ok(written)
    }

    /// Adds an accessor of coordinates in the baked texture, and returns its index.
    fn coordinates(&mut self, places: &[Vec2]) -> usize {
        let mut bytes = Vec::with_capacity(8 * places.len());
        for &place in places {
            self.texels.uv(place).to_array().iter().for_each(|number| bytes.extend(number.to_le_bytes()));
        }
        let accessor = json!({ "componentType": 5126, "type": "VEC2", "count": places.len() });
        self.document.add_accessor(bytes, ARRAY_BUFFER, accessor)
    }

    /// Adds an accessor of indices, of two bytes each if possible, and returns its index.
    fn indices(&mut self, indices: &[u32]) -> usize {
        // Exclude the maximum value of a type: it is not a valid index (glTF 2.0, 3.7.2.1).
        let is_short = indices.iter().all(|&index| index < u32::from(u16::MAX));
        let mut bytes = Vec::with_capacity(4 * indices.len());
        for &index in indices {
            match is_short {
                true => bytes.extend((index as u16).to_le_bytes()),
                false => bytes.extend(index.to_le_bytes()),
            }
        }
        let component = if is_short { 5123 } else { 5125 };
        let accessor = json!({ "componentType": component, "type": "SCALAR", "count": indices.len() });
        self.document.add_accessor(bytes, ELEMENT_ARRAY_BUFFER, accessor)
    }
}
