//! Holes: where a triangle is there, and where rays pass through.
//!
//! Every ray sees the same holes, so that pictures, shadows and photons agree. A mask's holes are where its opacity is below
//! the cutoff. A blended surface is there for a share of its points: a point is part of it if its opacity exceeds a threshold
//! that is drawn once for each small cell of the object's own space \[Wyman17\], anchored to the object at rest, so that the
//! grain moves with the surface and stands still with it.
//!
//! # Differs from the paper
//! * The size of the cells is a fixed share of the scene's, not a pixel's: a shadow ray knows of no pixel.

use super::triangles::Owner;
use crate::sampling::hash_unit;
use crate::scene::{Alpha, Material, Mesh, Pose, Scene, Texture, TextureSlot};
use glam::{Vec2, Vec3, Vec3A};
use std::collections::HashMap;
use std::sync::Arc;

/// Cells across the scene: as fine as the pixels of a picture that shows it whole.
const CELLS: f32 = 2048.0;
/// Flat surfaces often lie at round coordinates: there no border of a cell may be.
const OFF_ROUND: f32 = 0.381_966;

/// The opacity of all instances that have holes.
pub(crate) struct CutOuts {
    /// One per instance: its sheet, and cells per unit of its mesh.
    sheets: Vec<Option<(Arc<Sheet>, f32)>>,
}

/// The opacity of a mesh. Lists are per triangle, and empty where they are not needed.
#[derive(Clone)]
struct Sheet {
    /// Index of its material where that changes, and the coordinates of its texture before their transform.
    changing: Option<(usize, Vec<[Vec2; 3]>)>,
    alpha: Alpha,
    opacity: f32,
    texture: Option<Texture>,
    coordinates: Vec<[Vec2; 3]>,
    vertex_opacity: Vec<[f32; 3]>,
    /// Corners at rest in the mesh's own space, for the cells.
    places: Vec<[Vec3; 3]>,
}

impl CutOuts {
    /// Finds the holes in all instances of `scene`; `None` if there is not one. `pose` tells how large things are.
    pub(super) fn new(scene: &Scene, pose: &Pose, extent: f32) -> Option<Self> {
        let changing = scene.changing_materials();
        let mut of_mesh: HashMap<usize, Option<Arc<Sheet>>> = HashMap::new();
        let sheets: Vec<Option<(Arc<Sheet>, f32)>> = (0..scene.instances.len())
            .map(|instance| {
                let index = scene.instances[instance].mesh;
                let mesh = &scene.meshes[index];
                let new = || Sheet::new(scene, mesh, changing[mesh.material]).map(Arc::new);
                let sheet = of_mesh.entry(index).or_insert_with(new).clone()?;
                // As large as its shape is in the world, compared with its mesh: skins often change the scale.
                let world = scene.instance_world(pose, instance);
                let shape = pose.deformed(instance).map_or(&mesh.positions, |bent| &bent.positions);
                let placed = diagonal(shape.iter().map(|&p| world.transform_point3a(p.into())));
                let own = diagonal(mesh.positions.iter().map(|&p| p.into()));
                let scale = if own > 0.0 { placed / own } else { 1.0 };
                Some((sheet, scale * CELLS / extent))
            })
            .collect();
        sheets.iter().any(Option::is_some).then_some(Self { sheets })
    }

    /// The holes with these `materials`; `None` where they are the same.
    pub(super) fn at(&self, materials: &[Material]) -> Option<Self> {
        let changes = |(sheet, _): &(Arc<Sheet>, f32)| sheet.changing.is_some();
        if materials.is_empty() || !self.sheets.iter().flatten().any(changes) {
            return None;
        }
        let sheets = self.sheets.iter().map(|sheet| {
            let (sheet, cells) = sheet.as_ref()?;
            let changed = sheet.changing.as_ref().map(|(material, _)| Arc::new(sheet.with(&materials[*material])));
            Some((changed.unwrap_or_else(|| sheet.clone()), *cells))
        });
        Some(Self { sheets: sheets.collect() })
    }

    /// Whether the holes of `instance` change.
    pub(super) fn has_changing_holes(&self, instance: usize) -> bool {
        self.sheets[instance].as_ref().is_some_and(|(sheet, _)| sheet.changing.is_some())
    }

    /// Whether rays may pass through parts of `instance`.
    pub(super) fn has_holes(&self, instance: usize) -> bool {
        self.sheets[instance].is_some()
    }

    /// Whether the point of a triangle with barycentric weights `u` of the second and `v` of the third corner is there.
    pub(super) fn opaque_at(&self, owner: Owner, u: f32, v: f32) -> bool {
        let Some((sheet, cells)) = &self.sheets[owner.instance as usize] else { return true };
        sheet.opaque_at(owner.triangle as usize, u, v, *cells)
    }
}

fn diagonal(points: impl Iterator<Item = Vec3A>) -> f32 {
    let start = (Vec3A::INFINITY, Vec3A::NEG_INFINITY);
    let (min, max) = points.fold(start, |(min, max), p| (min.min(p), max.max(p)));
    if min.cmple(max).all() { (max - min).length() } else { 0.0 }
}

impl Sheet {
    /// `None` for a mesh without holes.
    fn new(scene: &Scene, mesh: &Mesh, changes: bool) -> Option<Self> {
        let material = &scene.materials[mesh.material];
        let needed = match material.alpha {
            Alpha::Opaque => return None,
            Alpha::Mask { cutoff } => cutoff,
            Alpha::Blend => 1.0,
        };
        let has_coordinates = |slot: &TextureSlot| !mesh.uvs[slot.uv_set].is_empty();
        let textured = material.base_color_texture.filter(has_coordinates).and_then(|slot| {
            let texture = &scene.textures[slot.texture];
            (texture.least_opacity() < 1.0).then_some((slot, texture.clone()))
        });
        let by_vertex = mesh.colors.iter().map(|color| color.w).fold(1.0, f32::min);
        let least = material.opacity * by_vertex * textured.as_ref().map_or(1.0, |(_, t)| t.least_opacity());
        if least >= needed && !changes {
            return None;
        }
        let triangles = || mesh.triangles.iter();
        let coordinates = textured.as_ref().map_or_else(Vec::new, |(slot, _)| {
            triangles().map(|t| t.map(|vertex| slot.map(mesh.uvs[slot.uv_set][vertex as usize]))).collect()
        });
        let of_file = |(slot, _): &(TextureSlot, Texture)| {
            triangles().map(|t| t.map(|vertex| mesh.uvs[slot.uv_set][vertex as usize])).collect()
        };
        let changing = changes.then(|| (mesh.material, textured.as_ref().map_or_else(Vec::new, of_file)));
        let vertex_opacity = if by_vertex < 1.0 {
            triangles().map(|t| t.map(|vertex| mesh.colors[vertex as usize].w)).collect()
        } else {
            Vec::new()
        };
        let places = if material.alpha == Alpha::Blend {
            triangles().map(|t| t.map(|vertex| mesh.positions[vertex as usize])).collect()
        } else {
            Vec::new()
        };
        Some(Self {
            changing,
            alpha: material.alpha,
            opacity: material.opacity,
            texture: textured.map(|(_, texture)| texture),
            coordinates,
            vertex_opacity,
            places,
        })
    }

    /// The same mesh with another material.
    fn with(&self, material: &Material) -> Self {
        let mut sheet = Self { alpha: material.alpha, opacity: material.opacity, ..self.clone() };
        if let (Some(slot), Some((_, of_file))) = (&material.base_color_texture, &self.changing)
            && self.texture.is_some()
        {
            sheet.coordinates = of_file.iter().map(|corners| corners.map(|uv| slot.map(uv))).collect();
        }
        sheet
    }

    fn opaque_at(&self, triangle: usize, u: f32, v: f32, cells: f32) -> bool {
        let w = 1.0 - u - v;
        let mut opacity = self.opacity;
        if let Some([a, b, c]) = self.vertex_opacity.get(triangle) {
            opacity *= a * w + b * u + c * v;
        }
        if let Some((texture, [a, b, c])) = self.texture.as_ref().zip(self.coordinates.get(triangle)) {
            opacity *= texture.sample(*a * w + *b * u + *c * v, 1.0).opacity;
        }
        match self.alpha {
            Alpha::Opaque => true,
            Alpha::Mask { cutoff } => opacity >= cutoff,
            Alpha::Blend => {
                let [a, b, c] = self.places[triangle];
                let cell = ((a * w + b * u + c * v) * cells + OFF_ROUND).floor();
                // 21 bits for each axis: the pattern repeats far outside of the scene.
                let bits = |x: f32| (x as i64 as u64) & 0x1f_ffff;
                opacity > hash_unit(0, bits(cell.x) | bits(cell.y) << 21 | bits(cell.z) << 42, 0)
            }
        }
    }
}
