//! Geometry of the page: vertices and triangles of all instances at time 0, in world space.
//!
//! Both sides of double-sided surfaces are separate triangles, so that the page draws only triangles that face the viewer.

use super::super::export::{SideTriangles, Split};
use super::payload::Payload;
use glam::{Affine3A, Vec2, Vec3, Vec4};
use render_core::scene::{Alpha, Material, Mesh, Pose, TextureSlot};
use render_core::{Atlas, Surfaces};
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// Maximum number of sets of texture coordinates of a material in the page.
pub(super) const MOST_SETS: usize = 3;

/// Source of the light of triangles.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum LitBy {
    /// Texels of the atlas.
    Texels,
    /// Mean light of the scene, for dynamic surfaces.
    Mean,
    /// Unlit: the base color is the radiance.
    Nothing,
}

/// Triangles drawn together. Blended surfaces are drawn last.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct BatchKey {
    is_blended: bool,
    material: usize,
    lit_by: LitBy,
}

/// Vertex lists of the page, and indices of the triangles in each batch.
#[derive(Default)]
pub(super) struct ViewGeometry {
    positions: Vec<[f32; 3]>,
    /// Unit normals times 32767; zero on flat-shaded meshes.
    normals: Vec<[i16; 3]>,
    /// Positions in the atlas \[texels\].
    places: Vec<[f32; 2]>,
    coordinates: [Vec<[f32; 2]>; MOST_SETS],
    /// Vertex colors times 65535.
    colors: Vec<[u16; 4]>,
    batches: BTreeMap<BatchKey, Vec<u32>>,
}

/// Side of an instance, with its triangles in the atlas.
struct Side {
    is_back: bool,
    triangles: SideTriangles,
}

/// Returns the distinct slots of a material that the page samples: at most three coordinate sets.
pub(super) fn slots(material: &Material) -> Vec<TextureSlot> {
    let mut sets: Vec<TextureSlot> = Vec::new();
    let Material { base_color_texture, metallic_roughness_texture, emission_texture, .. } = material;
    for slot in [base_color_texture, metallic_roughness_texture, emission_texture].into_iter().flatten() {
        if !sets.iter().any(|known| has_same_coordinates(known, slot)) {
            sets.push(*slot);
        }
    }
    sets
}

/// Returns whether two slots use equal coordinates.
pub(super) fn has_same_coordinates(one: &TextureSlot, other: &TextureSlot) -> bool {
    one.uv_set == other.uv_set && one.transform == other.transform
}

impl ViewGeometry {
    /// Collects the geometry of all instances.
    pub fn new(surfaces: &Surfaces, pose: &Pose, atlas: &Atlas) -> Self {
        let scene = surfaces.scene();
        let mut geometry = Self::default();
        for (instance, found) in scene.instances.iter().enumerate() {
            let (mesh, material) = (&scene.meshes[found.mesh], surfaces.material(instance));
            let sides = sides(instance, mesh, atlas);
            let lit_by = match (material.unlit, sides.is_empty()) {
                (true, _) => LitBy::Nothing,
                (false, true) => LitBy::Mean,
                (false, false) => LitBy::Texels,
            };
            let key = BatchKey { is_blended: material.alpha == Alpha::Blend, material: mesh.material, lit_by };
            let sides = if sides.is_empty() { sides_without_places(mesh, material) } else { sides };
            for side in &sides {
                let shape = Shape::new(surfaces, pose, instance);
                geometry.add(&shape, mesh, material, Placed { key, side });
            }
        }
        geometry
    }

    /// Adds one side of an instance.
    fn add(&mut self, shape: &Shape, mesh: &Mesh, material: &Material, placed: Placed) {
        let Placed { key, side } = placed;
        let split = Split::new(&mesh.triangles, std::slice::from_ref(&side.triangles));
        let first = self.positions.len() as u32;
        let outward = if side.is_back { -1.0 } else { 1.0 };
        for &vertex in &split.vertices {
            let vertex = vertex as usize;
            self.positions.push(shape.position(vertex).to_array());
            let normal = shape.normal(vertex) * outward * 32767.0;
            self.normals.push(normal.to_array().map(|part| part.round() as i16));
            let color = mesh.colors.get(vertex).copied().unwrap_or(Vec4::ONE).clamp(Vec4::ZERO, Vec4::ONE);
            self.colors.push((color * 65535.0).to_array().map(|part| part.round() as u16));
        }
        self.places.extend(split.places(&side.triangles).iter().map(Vec2::to_array));

        // Transform the coordinates of each set of the material.
        let slots = slots(material);
        for (set, coordinates) in self.coordinates.iter_mut().enumerate() {
            for &vertex in &split.vertices {
                let slot = slots.get(set);
                let uv = slot.and_then(|slot| Some(slot.map(*mesh.uvs[slot.uv_set].get(vertex as usize)?)));
                coordinates.push(uv.unwrap_or(Vec2::ZERO).to_array());
            }
        }

        // A mirroring transform reverses the order of corners, but keeps the front.
        let indices = split.indices(&side.triangles, side.is_back != shape.is_mirrored());
        self.batches.entry(key).or_default().extend(indices.iter().map(|index| first + index));
    }

    /// Adds the lists to the page and returns a description of the batches.
    pub fn add_to(&self, payload: &mut Payload) -> Value {
        payload.add("positions", &bytes(&self.positions, f32::to_le_bytes), 12);
        payload.add("normals", &bytes(&self.normals, i16::to_le_bytes), 6);
        payload.add("atlas", &bytes(&self.places, f32::to_le_bytes), 8);
        for (set, coordinates) in self.coordinates.iter().enumerate() {
            payload.add(&format!("uv{set}"), &bytes(coordinates, f32::to_le_bytes), 8);
        }
        payload.add("colors", &bytes(&self.colors, u16::to_le_bytes), 8);
        // Describe each batch by its range in the list of indices.
        let (mut indices, mut batches) = (Vec::new(), Vec::new());
        for (key, batch) in &self.batches {
            let lit_by = match key.lit_by {
                LitBy::Texels => 0,
                LitBy::Mean => 1,
                LitBy::Nothing => 2,
            };
            batches.push(json!({
                "material": key.material,
                "lit": lit_by,
                "blended": key.is_blended,
                "first": indices.len() / 4,
                "count": batch.len(),
            }));
            indices.extend(batch.iter().flat_map(|index| index.to_le_bytes()));
        }
        payload.add("indices", &indices, 4);
        json!(batches)
    }
}

/// Side of an instance and its batch.
struct Placed<'a> {
    key: BatchKey,
    side: &'a Side,
}

/// Vertices of an instance at time 0.
struct Shape<'a> {
    world: Affine3A,
    positions: &'a [Vec3],
    normals: &'a [Vec3],
}

impl<'a> Shape<'a> {
    fn new(surfaces: &'a Surfaces, pose: &'a Pose, instance: usize) -> Self {
        let mesh = &surfaces.scene().meshes[surfaces.scene().instances[instance].mesh];
        let world = *surfaces.world(instance);
        match pose.deformed(instance) {
            Some(bent) => Self { world, positions: &bent.positions, normals: &bent.normals },
            None => Self { world, positions: &mesh.positions, normals: &mesh.normals },
        }
    }

    fn is_mirrored(&self) -> bool {
        self.world.matrix3.determinant() < 0.0
    }

    /// Returns the position of a vertex in world space \[m\].
    fn position(&self, vertex: usize) -> Vec3 {
        self.world.transform_point3(self.positions[vertex])
    }

    /// Returns the unit normal of a vertex in world space, or zero on a flat-shaded mesh.
    fn normal(&self, vertex: usize) -> Vec3 {
        let Some(&normal) = self.normals.get(vertex) else { return Vec3::ZERO };
        // Transform normals by cofactors, which equal the inverse transpose up to scale, also of singular transforms.
        let m = self.world.matrix3;
        let cofactors = [m.y_axis.cross(m.z_axis), m.z_axis.cross(m.x_axis), m.x_axis.cross(m.y_axis)];
        let side = if self.is_mirrored() { -1.0 } else { 1.0 };
        let sum = cofactors[0] * normal.x + cofactors[1] * normal.y + cofactors[2] * normal.z;
        Vec3::from(sum * side).normalize_or_zero()
    }
}

/// Returns the sides of an instance that have charts.
fn sides(instance: usize, mesh: &Mesh, atlas: &Atlas) -> Vec<Side> {
    let mut sides = Vec::new();
    for is_back in [false, true] {
        let place = |triangle| atlas.triangle_places(instance as u32, triangle, !is_back);
        let triangles: SideTriangles = (0..mesh.triangles.len() as u32).map(place).collect();
        if triangles.iter().any(Option::is_some) {
            sides.push(Side { is_back, triangles });
        }
    }
    sides
}

/// Returns the visible sides of an instance without charts.
fn sides_without_places(mesh: &Mesh, material: &Material) -> Vec<Side> {
    let mut sides = Vec::new();
    for is_back in [false, true] {
        if !is_back || material.double_sided {
            sides.push(Side { is_back, triangles: vec![Some([Vec2::ZERO; 3]); mesh.triangles.len()] });
        }
    }
    sides
}

/// Returns the numbers of a list as bytes.
fn bytes<T: Copy, const N: usize, const B: usize>(list: &[[T; N]], convert: fn(T) -> [u8; B]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(list.len() * N * B);
    for &number in list.as_flattened() {
        bytes.extend(convert(number));
    }
    bytes
}
