//! Baked light of static coats: a directional map for each texel of a coated surface.

use super::inside::Places;
use super::light::TexelLight;
use super::loops::{BakeLoops, LoopEnd};
use crate::coat_fields::{CoatField, CoatFields};
use crate::{BAKED_ROUGHNESS, KnownScene, TexelCoat};
use glam::Vec3;
use lightfield::{Field, LogScale, NearLossless, OctahedralMap, Samples, TILE_SIDE, TexelTiles, map_side};
use lighttree::Scratch;
use rayon::prelude::*;
use render_core::{Atlas, AtlasPoint, Hit, ShadingPoint, Surface};
use std::collections::BTreeMap;
use std::f32::consts::PI;

/// Maximum error of a code: 0.5 % of the light. A factor of two has 256 steps.
const DELTA: u16 = 2;
/// Unit L₀ of the logarithmic scale, as a fraction of the mean radiance of white texels. Darker light has linear steps.
const UNIT: f32 = 1.0 / 64.0;

/// Maximum angle between directions of adjacent cells, times the map's side n \[rad\]: √6 · 2/n per axis of the
/// octahedral map.
const LARGEST_STEP: f32 = 9.8;

/// A texel with a baked coat.
struct CoatTexel {
    texel: usize,
    surface: Surface,
    point: ShadingPoint,
}

/// Texels with coats rough enough for baking, grouped by the side of their maps.
#[derive(Default)]
pub(super) struct CoatTexels(BTreeMap<usize, Vec<CoatTexel>>);

impl CoatTexels {
    /// Finds the texels with rough coats. `points` contains the shading points of the texels of `places`. A texel
    /// without a point uses the point of an adjacent texel. If no adjacent texel has a point, the texel is omitted.
    pub fn find(places: &Places, points: &[Option<ShadingPoint>]) -> Self {
        let atlas = places.atlas;
        let beside = |texel| {
            let neighbors = atlas.neighbors(texel).into_iter().flatten();
            neighbors.filter_map(|neighbor| points[neighbor as usize]).next()
        };
        // Find the texels on all threads; the list keeps the order of the atlas.
        let coated = (0..atlas.len()).into_par_iter().filter_map(|texel| {
            let site = *atlas.sites(texel, places.surfaces).first()?;
            let surface = atlas.surface(&site, places.surfaces);
            let is_baked = surface.specular != Vec3::ZERO && surface.roughness >= BAKED_ROUGHNESS;
            let point = points[texel].or_else(|| beside(texel)).filter(|_| is_baked)?;
            Some(CoatTexel { texel, surface, point })
        });
        // Group the texels by the size of their maps, which depends on roughness.
        let mut by_side: BTreeMap<usize, Vec<CoatTexel>> = BTreeMap::new();
        for texel in coated.collect::<Vec<CoatTexel>>() {
            by_side.entry(map_side(texel.surface.roughness)).or_default().push(texel);
        }
        Self(by_side)
    }

    /// Returns the number of texels.
    pub fn len(&self) -> usize {
        self.0.values().map(Vec::len).sum()
    }
}

/// The scene that coats reflect, and the irradiance of the scene's texels.
pub(super) struct CoatBake<'a> {
    pub places: &'a Places<'a>,
    pub light: &'a TexelLight,
    /// Index in the scene of the atlas, for each instance of the baked scene.
    pub instances: &'a [u32],
}

impl CoatBake<'_> {
    /// Bakes the light of coats. `done` is called with the number of texels completed since the previous call.
    pub fn fields(
        &self,
        coats: &CoatTexels,
        loops: &mut BakeLoops,
        done: &dyn Fn(usize),
    ) -> Result<CoatFields, LoopEnd> {
        let mut fields = Vec::new();
        for (&side, group) in &coats.0 {
            fields.push(self.field(side, group, loops, done)?);
        }
        Ok(CoatFields::new(self.places.atlas, fields).expect("tiles consist of texels of the atlas"))
    }

    /// Returns the logarithmic scale of the codes.
    fn scale(&self) -> LogScale {
        let unit = (UNIT * self.light.mean() / PI).max(f32::MIN_POSITIVE);
        LogScale::new(unit).expect("a normal number")
    }

    /// Bakes the texels that have maps of n × n directions, n = `side`.
    fn field(
        &self,
        side: usize,
        group: &[CoatTexel],
        loops: &mut BakeLoops,
        done: &dyn Fn(usize),
    ) -> Result<CoatField, LoopEnd> {
        // Find the tiles of the atlas, each with a mask of its texels, and the texels in storage order.
        let (numbers, tiles, order) = tiled(self.places.atlas, group);

        // Compute the codes of each texel's light in all directions.
        let (map, scale) = (OctahedralMap { side }, self.scale());
        let codes_of = |scratch: &mut Scratch, place: usize| self.codes(&group[order[place]], map, scale, scratch);
        let codes: Vec<Vec<u16>> = loops.each(order.len(), Scratch::default, codes_of, |_| done(1))?;
        let samples = Samples::Logarithmic { scale, codes: codes.concat() };
        let field = Field::new(tiles, map.len(), samples).expect("a map for each texel");
        let light = NearLossless::encode(&field, DELTA).expect("the limit is small");
        Ok(CoatField::new(side, numbers, light).expect("the field has this map and these tiles"))
    }

    /// Returns the baked irradiance \[W·m⁻²\] at a ray's hit; `None` if the atlas lacks the surface.
    pub fn irradiance(&self, hit: &Hit, surface: &Surface) -> Option<Vec3> {
        let &Surface { position, geometric_normal, .. } = surface;
        let instance = *self.instances.get(hit.instance as usize)?;
        let at = AtlasPoint { instance, triangle: hit.triangle, position, geometric_normal };
        let blend = self.places.atlas.bilinear(self.places.surfaces, &at)?;
        let mut irradiance = Vec3::ZERO;
        for (texel, weight) in blend.texels.into_iter().zip(blend.weights) {
            irradiance += weight * self.light.irradiance(texel as usize);
        }
        Some(irradiance)
    }

    /// Returns the codes of a texel's light: three per direction.
    fn codes(&self, texel: &CoatTexel, map: OctahedralMap, scale: LogScale, scratch: &mut Scratch) -> Vec<u16> {
        let CoatTexel { surface, point, .. } = texel;
        // Trace the rays once: all directions of the map use the same light.
        let known = |hit: &Hit, surface: &Surface| self.irradiance(hit, surface);
        let scene = KnownScene { frame: self.places.frame, known: &known };
        let coat = TexelCoat::trace(scene, *point, surface, map.len(), scratch);
        let below = coat.as_ref().map_or(Vec3::ZERO, TexelCoat::mean_of_all);
        let mut codes = Vec::with_capacity(3 * map.len());
        for direction in 0..map.len() {
            let mirrored = map.direction(direction % map.side, direction / map.side);
            // Give all cells that no direction above the horizon samples one value, which compresses well.
            let is_read = point.normal.dot(mirrored.into()) >= -LARGEST_STEP / map.side as f32;
            let light = match &coat {
                Some(coat) if is_read => coat.mean_radiance(mirrored),
                _ => below,
            };
            codes.extend(light.to_array().map(|light| scale.code(light).unwrap_or_default()));
        }
        codes
    }
}

/// Returns the atlas tiles with texels of a group, by rows: their indices and masks, and the indices into the group in
/// storage order.
fn tiled(atlas: &Atlas, group: &[CoatTexel]) -> (Vec<u32>, TexelTiles, Vec<usize>) {
    let (side, columns) = (TILE_SIDE as u32, atlas.size().0 / TILE_SIDE as u32);
    let mut by_tile: BTreeMap<u32, BTreeMap<u32, usize>> = BTreeMap::new();
    // Sort the texels by tile, and by position within the tile.
    for (index, coated) in group.iter().enumerate() {
        let (x, y) = atlas.place(coated.texel);
        let tile = by_tile.entry(y / side * columns + x / side).or_default();
        tile.insert(y % side * side + x % side, index);
    }
    // Mark the positions in use, and list the texels in the order of the marks.
    let (mut numbers, mut masks, mut order) = (Vec::new(), Vec::new(), Vec::new());
    for (number, texels) in by_tile {
        let mut mask = [0u64; 4];
        for (bit, index) in texels {
            mask[bit as usize / 64] |= 1 << (bit % 64);
            order.push(index);
        }
        numbers.push(number);
        masks.push(mask);
    }
    (numbers, TexelTiles::new(masks), order)
}
