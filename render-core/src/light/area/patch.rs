//! Pieces of an emissive mesh: its triangles and parallelograms, split where a texture makes the emission uneven.

use super::cell::Cell;
use super::order::along_curve;
use crate::luminance;
use crate::sampling::{hammersley, triangle};
use crate::scene::{Material, Mesh, Scene, mesh_interpolate};
use crate::surface::Surfaces;
use glam::{Vec2, Vec3, Vec3A};

/// Number of points at which the emission of a triangle is averaged.
const POINTS_OF_A_TRIANGLE: usize = 64;
/// Number of points at which the emission of a cell is averaged: 4 × 4.
const POINTS_OF_A_CELL: usize = 16;
/// Fraction of the light's flux above which a cell is split. Each of the 64 points for shadow rays then represents a
/// few cells of its own.
const SHARE_OF_A_CELL: f32 = 1.0 / 256.0;
/// Maximum contrast of a cell's luminance for even emission: (maximum − minimum) / mean.
const EVEN: f32 = 0.25;
/// Side of the smallest cells \[texels\]. Between the centers of two texels, the interpolated texture is linear.
const SMALLEST: f32 = 0.5;
/// Maximum number of pieces of a mesh that keep the order of the file. More pieces are sorted spatially.
const FEW: usize = 64;

/// Emissive triangle, parallelogram of two triangles, or cell of either. With parallelograms, points spread over whole
/// panels.
#[derive(Clone, Copy, Debug)]
pub(super) struct Patch {
    pub triangle: usize,
    pub parallelogram: bool,
    pub cell: Cell,
    /// Area of the patch \[m²\].
    pub area: f32,
    /// Mean emission of the patch \[W·m⁻²·sr⁻¹\].
    pub emission: Vec3,
}

impl Patch {
    /// Returns the luminous power of one side, divided by π.
    pub fn power(&self) -> f32 {
        self.area * luminance(self.emission)
    }

    /// Returns the triangle and barycentric weights of a point in the patch's coordinates.
    pub fn located(&self, p: Vec2) -> (usize, f32, f32) {
        let t = self.triangle;
        if !self.parallelogram {
            return (t, p.x, p.y);
        }
        // From corner p, `x` runs along the side from p to q and `y` along the side from q to r. The triangles p q r
        // and p r s meet at the diagonal x = y.
        let Vec2 { x, y } = p;
        if y <= x { (t, x - y, y) } else { (t + 1, x, y - x) }
    }

    /// Returns the patch's coordinates of the point at these weights of a triangle, or `None` if the patch does not
    /// contain the triangle.
    pub fn place(&self, triangle: usize, u: f32, v: f32) -> Option<Vec2> {
        match triangle.checked_sub(self.triangle)? {
            0 if !self.parallelogram => Some(Vec2::new(u, v)),
            0 => Some(Vec2::new(u + v, v)),
            1 if self.parallelogram => Some(Vec2::new(u, u + v)),
            _ => None,
        }
    }
}

/// Emission of a mesh.
struct Glow<'a> {
    scene: &'a Scene,
    mesh: &'a Mesh,
    material: &'a Material,
}

impl Glow<'_> {
    /// Returns the emission at a point of a triangle, with the texture blurred to `footprint` texels.
    fn at(&self, t: usize, u: f32, v: f32, footprint: f32) -> Vec3 {
        let Some(slot) = self.material.emission_texture else { return self.material.emission };
        let texture = &self.scene.textures[slot.texture];
        let uv = mesh_interpolate(&self.mesh.uvs[slot.uv_set], self.mesh.triangles[t], u, v);
        self.material.emission * uv.map_or(Vec3::ONE, |uv| texture.sample(slot.map(uv), footprint).color)
    }

    /// Returns the mean emission of a triangle at a few points, which is exact for textures that are smooth at that
    /// scale.
    fn of_triangle(&self, t: usize) -> Vec3 {
        let Some(slot) = self.material.emission_texture else { return self.material.emission };
        let texture = &self.scene.textures[slot.texture];
        let at = |u, v| mesh_interpolate(&self.mesh.uvs[slot.uv_set], self.mesh.triangles[t], u, v);
        let sum: Vec3 = (0..POINTS_OF_A_TRIANGLE)
            .map(|i| {
                let (u, v) = triangle(hammersley(i, POINTS_OF_A_TRIANGLE));
                at(u, v).map_or(Vec3::ONE, |uv| texture.sample(slot.map(uv), texture.size().x / 16.0).color)
            })
            .sum();
        self.material.emission * (sum / POINTS_OF_A_TRIANGLE as f32)
    }

    /// Returns the side of the whole patch in the texture \[texels\].
    fn texels_across(&self, patch: &Patch) -> f32 {
        let Some(slot) = self.material.emission_texture else { return 0.0 };
        let size = self.scene.textures[slot.texture].size();
        let uv = |u, v| {
            let uv = mesh_interpolate(&self.mesh.uvs[slot.uv_set], self.mesh.triangles[patch.triangle], u, v)?;
            Some(slot.map(uv) * size)
        };
        let [Some(a), Some(b), Some(c)] = [uv(0.0, 0.0), uv(1.0, 0.0), uv(0.0, 1.0)] else { return 0.0 };
        // Use the two sides that span the shape: ab and bc for a parallelogram. Its diagonal would blur more.
        (b - a).length().max(if patch.parallelogram { c - b } else { c - a }.length())
    }

    /// Returns the mean emission and the luminance contrast (maximum − minimum) / mean of a cell `texels` wide.
    fn of_cell(&self, patch: &Patch, cell: Cell, texels: f32) -> (Vec3, f32) {
        let (mut sum, mut least, mut most) = (Vec3::ZERO, f32::INFINITY, 0.0f32);
        // Make each sample twice as wide as the spacing of samples. The samples then cover the whole texture, including
        // bright texels next to the cell, which interpolation blends into it.
        let across = (POINTS_OF_A_CELL as f32).sqrt();
        for i in 0..POINTS_OF_A_CELL {
            let q = Vec2::new(i as f32 % across, (i as f32 / across).floor());
            let (t, u, v) = patch.located(cell.point((q + 0.5) / across));
            let emission = self.at(t, u, v, 2.0 * texels / across);
            let y = luminance(emission);
            (sum, least, most) = (sum + emission, least.min(y), most.max(y));
        }
        let mean = sum / POINTS_OF_A_CELL as f32;
        (mean, (most - least) / luminance(mean).max(f32::MIN_POSITIVE))
    }

    /// Appends `patch` to `cells`, split where its emission is uneven and its power exceeds `share`. Returns the mean
    /// emission of the cells.
    fn split(&self, patch: Patch, share: f32, across: f32, cells: &mut Vec<Patch>) -> Vec3 {
        let texels = across * patch.cell.side();
        let (mean, contrast) = self.of_cell(&patch, patch.cell, texels);
        let patch = Patch { emission: mean, ..patch };
        // A cell that appears dark at low resolution may contain a bright texel. The mean includes the flux of this texel.
        if contrast <= EVEN || patch.power() <= share || texels <= SMALLEST {
            cells.push(patch);
            return mean;
        }
        let quarters = patch.cell.split().map(|cell| Patch { cell, area: patch.area / 4.0, ..patch });
        quarters.map(|quarter| self.split(quarter, share, across, cells)).iter().sum::<Vec3>() / 4.0
    }
}

/// Emissive pieces of a mesh.
pub(super) struct Pieces {
    pub patches: Vec<Patch>,
    /// Number of rectangles, plus triangles outside any rectangle, before splitting.
    pub panels: usize,
}

/// Builds the pieces of `instance`.
pub(super) fn pieces(surfaces: &Surfaces, instance: usize) -> Pieces {
    let scene = surfaces.scene();
    let mesh = &scene.meshes[scene.instances[instance].mesh];
    let glow = Glow { scene, mesh, material: surfaces.material(instance) };
    let patches = panels(surfaces, instance, &glow);
    let panels = patches.len();

    // Split unevenly bright textures into cells of roughly even emission.
    let mut patches = if glow.material.emission_texture.is_some() { split(&glow, patches) } else { patches };

    // Sort the patches spatially, so that strata of power are compact.
    if panels > FEW {
        let middle = |patch: &Patch| {
            let (t, u, v) = patch.located(patch.cell.point(Vec2::splat(0.5)));
            let [a, b, c] = surfaces.corners(instance, t);
            a + (b - a) * u + (c - a) * v
        };
        let middles: Vec<Vec3A> = patches.iter().map(middle).collect();
        patches = along_curve(&middles).into_iter().map(|index| patches[index]).collect();
    }
    Pieces { patches, panels }
}

/// Returns the triangles of a mesh, with pairs that form a parallelogram merged.
fn panels(surfaces: &Surfaces, instance: usize, glow: &Glow) -> Vec<Patch> {
    let mut patches: Vec<Patch> = Vec::new();
    for t in 0..glow.mesh.triangles.len() {
        let [a, b, c] = surfaces.corners(instance, t);
        let area = (b - a).cross(c - a).length() / 2.0;
        let emission = glow.of_triangle(t);

        // Test whether the triangle completes the previous one to a parallelogram.
        let completes = patches.last().is_some_and(|last| {
            // Exporters split a rectangle into corners p q r and p r s with q − p = r − s.
            let [p, q, r] = surfaces.corners(instance, last.triangle);
            let tolerance = 1e-4 * (r - p).length();
            !last.parallelogram
                && last.triangle + 1 == t
                && (a - p).length() <= tolerance
                && (b - r).length() <= tolerance
                && ((q - p) - (r - c)).length() <= tolerance
        });

        // Merge the pair, with the mean emission weighted by area.
        match patches.last_mut() {
            Some(last) if completes => {
                last.parallelogram = true;
                last.cell = Cell::whole(true);
                last.emission =
                    (last.emission * last.area + emission * area) / (last.area + area).max(f32::MIN_POSITIVE);
                last.area += area;
            }
            _ => patches.push(Patch { triangle: t, parallelogram: false, cell: Cell::whole(false), area, emission }),
        }
    }
    patches
}

/// Splits textured `patches` into cells. Patches with even emission or little power are not split.
fn split(glow: &Glow, patches: Vec<Patch>) -> Vec<Patch> {
    let share = patches.iter().map(Patch::power).sum::<f32>() * SHARE_OF_A_CELL;
    let mut pieces = Vec::new();
    for patch in patches {
        let mut cells = Vec::new();
        let mean = glow.split(patch, share, glow.texels_across(&patch), &mut cells);
        match &cells[..] {
            [_] => pieces.push(patch),
            _ if mean == Vec3::ZERO => pieces.push(patch),
            // Cells without emission need no points.
            _ => pieces.extend(cells.into_iter().filter(|cell| cell.emission != Vec3::ZERO)),
        }
    }
    pieces
}
