//! Opacity of triangles, which determines whether they stop rays.
//!
//! A mask has holes where its opacity is below the cutoff. If the cone of a ray covers several texels, the opacity of a
//! mask is the fraction of texels outside holes. A blended surface blocks a fraction of the light behind it that equals
//! its opacity.
//!
//! Photons and rays of indirect light cannot be split, so they hit blended surfaces stochastically. A point stops a ray
//! if its opacity exceeds a threshold. The threshold is drawn once for each small cell of the object's local space
//! \[Wyman17\].
//!
//! # Differs from the paper
//! * The cells are far smaller than pixels. Camera rays and shadow rays show no noise, because they are split
//!   (`sheets.rs`).

use super::triangles::Owner;
use crate::sampling::hash_unit;
use crate::scene::{Alpha, Material, Mesh, Pose, Scene, Texture, TextureSlot};
use glam::{Vec2, Vec3, Vec3A};
use std::collections::HashMap;
use std::sync::Arc;

/// Number of cells across the scene. Cells are so small that two rays rarely share a cell, and so large that rounding
/// keeps a point in its cell.
const CELLS: f32 = 131_072.0;
/// Offset of the cell borders from round coordinates, at which flat surfaces often lie \[cells\].
const OFF_ROUND: f32 = 0.381_966;

/// Rule for sheets, which are surfaces with holes or partial opacity. It determines whether they stop the rays of an
/// [`Accelerator`](super::Accelerator).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Sheets {
    /// Masks stop rays outside their holes; blended surfaces stop them stochastically, in proportion to their opacity.
    ByChance,
    /// Sheets stop rays everywhere.
    AsWholes,
}

/// Opacity of all instances with holes.
pub(crate) struct CutOuts {
    /// For each instance, its sheet and the number of cells per unit length of its mesh.
    sheets: Vec<Option<(Arc<Sheet>, f32)>>,
}

/// Opacity of a mesh. Lists are indexed by triangle. Unused lists are empty.
#[derive(Clone)]
struct Sheet {
    /// Index of the material if it is animated, and the texture coordinates before the texture transform.
    changing: Option<(usize, Vec<[Vec2; 3]>)>,
    alpha: Alpha,
    opacity: f32,
    texture: Option<Texture>,
    /// Fraction of the area outside holes, for masks. Used for areas at least two texels wide.
    far: Option<Texture>,
    coordinates: Vec<[Vec2; 3]>,
    vertex_opacity: Vec<[f32; 3]>,
    /// Undeformed corners in the mesh's local space, which determine the cells.
    places: Vec<[Vec3; 3]>,
}

impl CutOuts {
    /// Collects the holes of all instances of `scene`, or returns `None` if no instance has holes. Sizes are measured
    /// in `pose`.
    pub(super) fn new(scene: &Scene, pose: &Pose, extent: f32) -> Option<Self> {
        // Share one sheet between all instances of a mesh.
        let changing = scene.changing_materials();
        let mut of_mesh: HashMap<usize, Option<Arc<Sheet>>> = HashMap::new();
        let mut far = FarMasks::default();
        let sheets: Vec<Option<(Arc<Sheet>, f32)>> = (0..scene.instances.len())
            .map(|instance| {
                let index = scene.instances[instance].mesh;
                let mesh = &scene.meshes[index];
                let new = || Sheet::new(scene, mesh, changing[mesh.material], &mut far).map(Arc::new);
                let sheet = of_mesh.entry(index).or_insert_with(new).clone()?;
                // Measure the scale of the shape between mesh and world, because skins often change it.
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

    /// Returns the holes with these `materials`, or `None` if no hole has changed.
    pub(super) fn at(&self, materials: &[Material]) -> Option<Self> {
        let changes = |(sheet, _): &(Arc<Sheet>, f32)| sheet.changing.is_some();
        if materials.is_empty() || !self.sheets.iter().flatten().any(changes) {
            return None;
        }
        let sheets = self.sheets.iter().map(|sheet| {
            let (sheet, cells) = sheet.as_ref()?;
            // Rebuild only sheets with animated materials; the others stay shared.
            let changed = sheet.changing.as_ref().map(|(material, _)| Arc::new(sheet.with(&materials[*material])));
            Some((changed.unwrap_or_else(|| sheet.clone()), *cells))
        });
        Some(Self { sheets: sheets.collect() })
    }

    /// Returns whether the holes of `instance` depend on animated materials.
    pub(super) fn has_changing_holes(&self, instance: usize) -> bool {
        self.sheets[instance].as_ref().is_some_and(|(sheet, _)| sheet.changing.is_some())
    }

    /// Returns whether `instance` has points through which rays may pass.
    pub(super) fn has_holes(&self, instance: usize) -> bool {
        self.sheets[instance].is_some()
    }

    /// Returns whether `instance` is a blended surface.
    pub(super) fn is_blended(&self, instance: usize) -> bool {
        self.sheets[instance].as_ref().is_some_and(|(sheet, _)| sheet.alpha == Alpha::Blend)
    }

    /// Returns whether a point of a triangle stops a ray under the rule `sheets`. `at` contains the barycentric weights
    /// of the second and third corner.
    pub(super) fn stops(&self, owner: Owner, at: [f32; 2], sheets: Sheets) -> bool {
        let Some((sheet, cells)) = &self.sheets[owner.instance as usize] else { return true };
        let triangle = owner.triangle as usize;
        match sheet.alpha {
            _ if sheets == Sheets::AsWholes => true,
            Alpha::Opaque => true,
            Alpha::Mask { cutoff } => sheet.opacity(triangle, at, 0.0) >= cutoff,
            Alpha::Blend => sheet.opacity(triangle, at, 0.0) > sheet.threshold(triangle, at, *cells),
        }
    }

    /// Returns the opacity of a triangle around a point, 0…1, filtered over an area. The area is the fraction `share`
    /// of the parallelogram spanned by two sides of the triangle.
    pub(super) fn opacity(&self, owner: Owner, at: [f32; 2], share: f32) -> f32 {
        let Some((sheet, _)) = &self.sheets[owner.instance as usize] else { return 1.0 };
        let triangle = owner.triangle as usize;
        let texels = sheet.texels(triangle, share);
        match sheet.alpha {
            Alpha::Opaque => 1.0,
            Alpha::Mask { cutoff } => sheet.mask(triangle, at, texels, cutoff),
            Alpha::Blend => sheet.opacity(triangle, at, texels).clamp(0.0, 1.0),
        }
    }

    /// Returns the opacity of a blended surface at a point, 0…1. Returns 0 for all other sheets.
    pub(super) fn blended_opacity(&self, owner: Owner, at: [f32; 2]) -> f32 {
        let sheet = self.sheets[owner.instance as usize].as_ref().filter(|(sheet, _)| sheet.alpha == Alpha::Blend);
        sheet.map_or(0.0, |(sheet, _)| sheet.opacity(owner.triangle as usize, at, 0.0).clamp(0.0, 1.0))
    }
}

/// Coverage images of masks. The keys are the texture and the bits of the minimum opacity outside holes.
#[derive(Default)]
struct FarMasks(HashMap<(usize, u32), Texture>);

impl FarMasks {
    fn of(&mut self, scene: &Scene, texture: usize, least: f32) -> Texture {
        let build = || scene.textures[texture].coverage(least);
        self.0.entry((texture, least.to_bits())).or_insert_with(build).clone()
    }
}

fn diagonal(points: impl Iterator<Item = Vec3A>) -> f32 {
    let start = (Vec3A::INFINITY, Vec3A::NEG_INFINITY);
    let (min, max) = points.fold(start, |(min, max), p| (min.min(p), max.max(p)));
    if min.cmple(max).all() { (max - min).length() } else { 0.0 }
}

impl Sheet {
    /// Returns the opacity of a mesh, or `None` for a mesh without holes.
    fn new(scene: &Scene, mesh: &Mesh, changes: bool, far: &mut FarMasks) -> Option<Self> {
        let material = &scene.materials[mesh.material];
        let needed = match material.alpha {
            Alpha::Opaque => return None,
            Alpha::Mask { cutoff } => cutoff,
            Alpha::Blend => 1.0,
        };
        // Ignore the coordinates of a texture without transparent texels.
        let has_coordinates = |slot: &TextureSlot| !mesh.uvs[slot.uv_set].is_empty();
        let textured = material.base_color_texture.filter(has_coordinates).and_then(|slot| {
            let texture = &scene.textures[slot.texture];
            (texture.least_opacity() < 1.0).then_some((slot, texture.clone()))
        });
        // Create a sheet only if some point may be transparent.
        let by_vertex = mesh.colors.iter().map(|color| color.w).fold(1.0, f32::min);
        let least = material.opacity * by_vertex * textured.as_ref().map_or(1.0, |(_, t)| t.least_opacity());
        if least >= needed && !changes {
            return None;
        }
        // Store the coordinates per corner, with and without the texture transform.
        let triangles = || mesh.triangles.iter();
        let coordinates = textured.as_ref().map_or_else(Vec::new, |(slot, _)| {
            triangles().map(|t| t.map(|vertex| slot.map(mesh.uvs[slot.uv_set][vertex as usize]))).collect()
        });
        let of_file = |(slot, _): &(TextureSlot, Texture)| {
            triangles().map(|t| t.map(|vertex| mesh.uvs[slot.uv_set][vertex as usize])).collect()
        };
        let changing = changes.then(|| (mesh.material, textured.as_ref().map_or_else(Vec::new, of_file)));
        // Store opacity by vertex, and undeformed corners for the cells of blended surfaces.
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
        // Build no coverage image if opacity varies by vertex or the cutoff is animated, because no single image
        // represents the coverage.
        let far = match (&textured, material.alpha) {
            (Some((slot, _)), Alpha::Mask { cutoff })
                if vertex_opacity.is_empty() && material.opacity > 0.0 && !changes =>
            {
                Some(far.of(scene, slot.texture, cutoff / material.opacity))
            }
            _ => None,
        };
        Some(Self {
            changing,
            far,
            alpha: material.alpha,
            opacity: material.opacity,
            texture: textured.map(|(_, texture)| texture),
            coordinates,
            vertex_opacity,
            places,
        })
    }

    /// Returns the sheet of the mesh with another material.
    fn with(&self, material: &Material) -> Self {
        let mut sheet = Self { alpha: material.alpha, opacity: material.opacity, far: None, ..self.clone() };
        if let (Some(slot), Some((_, of_file))) = (&material.base_color_texture, &self.changing)
            && self.texture.is_some()
        {
            sheet.coordinates = of_file.iter().map(|corners| corners.map(|uv| slot.map(uv))).collect();
        }
        sheet
    }

    /// Returns the width \[texels\] of an area around a point. The area is the fraction `share` of the parallelogram
    /// spanned by two sides of the triangle.
    fn texels(&self, triangle: usize, share: f32) -> f32 {
        let (Some(texture), Some([a, b, c])) = (&self.texture, self.coordinates.get(triangle)) else { return 0.0 };
        let size = texture.size();
        (share * ((*b - *a) * size).perp_dot((*c - *a) * size).abs()).sqrt()
    }

    /// Returns the opacity of the material at a point, filtered over a width of `texels`.
    fn opacity(&self, triangle: usize, [u, v]: [f32; 2], texels: f32) -> f32 {
        let w = 1.0 - u - v;
        let mut opacity = self.opacity;
        if let Some([a, b, c]) = self.vertex_opacity.get(triangle) {
            opacity *= a * w + b * u + c * v;
        }
        if let Some((texture, uv)) = self.texture.as_ref().zip(self.coordinates_at(triangle, [u, v])) {
            opacity *= texture.sample(uv, texels).opacity;
        }
        opacity
    }

    /// Returns the coverage of a mask around a point. Coverage is 0 or 1 for widths within a texel. For widths of two
    /// texels or more, it is the fraction of the area outside holes.
    fn mask(&self, triangle: usize, at: [f32; 2], texels: f32, cutoff: f32) -> f32 {
        let sharp = || if self.opacity(triangle, at, 0.0) >= cutoff { 1.0 } else { 0.0 };
        // Use the coverage image only where the cone covers more than one texel.
        let far = self.far.as_ref().filter(|_| texels > 1.0).zip(self.coordinates_at(triangle, at));
        let Some((far, uv)) = far else { return sharp() };
        let share = far.sample(uv, 0.5 * texels).opacity;
        // Blend both between widths of one and two texels.
        let blend = texels.log2().min(1.0);
        if blend < 1.0 { sharp() * (1.0 - blend) + share * blend } else { share }
    }

    fn coordinates_at(&self, triangle: usize, [u, v]: [f32; 2]) -> Option<Vec2> {
        self.coordinates.get(triangle).map(|[a, b, c]| *a * (1.0 - u - v) + *b * u + *c * v)
    }

    /// Returns the opacity threshold at a point, 0…1.
    fn threshold(&self, triangle: usize, [u, v]: [f32; 2], cells: f32) -> f32 {
        let [a, b, c] = self.places[triangle];
        let cell = ((a * (1.0 - u - v) + b * u + c * v) * cells + OFF_ROUND).floor();
        // Use 21 bits per axis. The pattern then repeats only far outside the scene.
        let bits = |x: f32| (x as i64 as u64) & 0x1f_ffff;
        hash_unit(0, bits(cell.x) | bits(cell.y) << 21 | bits(cell.z) << 42, 0)
    }
}
