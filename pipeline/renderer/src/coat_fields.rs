//! Baked light that static coats reflect, for each texel of an atlas and each direction.
//!
//! Texels of equal coat roughness, quantized to the side n of their maps, share a field. Samples of a map are bilinear
//! in direction. Callers blend the samples of several texels.

use glam::Vec3;
use lightfield::{DirectionCells, FieldError, LookUp, NearLossless, OctahedralMap, Slot, TILE_SIDE, TILE_SLOTS};
use pipeline::state::{decode, encode};
use render_core::Atlas;
use serde::{Deserialize, Serialize};

/// Fields of all baked coats, and the slots of their texels.
#[derive(Debug, Default)]
pub struct CoatFields {
    fields: Vec<CoatField>,
    /// Field and slot of each texel in the atlas; `None` for a texel without a baked coat.
    places: Vec<Option<TexelSlot>>,
}

/// Position of a texel's light: index of the field, and slot in the field.
#[derive(Clone, Copy, Debug)]
struct TexelSlot {
    field: u32,
    slot: u32,
}

/// Light of coats with equal roughness.
pub(crate) struct CoatField {
    map: OctahedralMap,
    /// Index in the atlas of each tile of the field; the atlas's tiles are counted by rows.
    tiles: Vec<u32>,
    /// Radiance of each code \[W·m⁻²·sr⁻¹\], as a table: a film reads 48 codes per pixel.
    light_of: Vec<f32>,
    light: NearLossless,
}

/// A field as stored in files.
#[derive(Serialize, Deserialize)]
struct StoredField {
    side: u32,
    tiles: Vec<u32>,
    light: Vec<u8>,
}

impl PartialEq for CoatFields {
    fn eq(&self, other: &Self) -> bool {
        self.to_bytes() == other.to_bytes()
    }
}

impl std::fmt::Debug for CoatField {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (side, texels) = (self.map.side, self.light.tiles().texels());
        f.debug_struct("CoatField").field("side", &side).field("texels", &texels).finish_non_exhaustive()
    }
}

impl CoatField {
    /// Creates a field with maps of n × n directions, n = `side`. `tiles` contains the index in the atlas of each tile.
    ///
    /// # Errors
    /// If the light does not fit the map or the tiles, or lacks a logarithmic scale.
    pub fn new(side: usize, tiles: Vec<u32>, light: NearLossless) -> Result<Self, FieldError> {
        let map = OctahedralMap { side };
        if light.directions() != map.len() {
            return Err(FieldError::Directions(light.directions()));
        }
        let length = FieldError::Length { found: tiles.len(), expected: light.tiles().len() };
        match light.scale() {
            Some(scale) if tiles.len() == light.tiles().len() => {
                let light_of = (0..=u16::MAX).map(|code| scale.light(code.into())).collect();
                Ok(Self { map, tiles, light_of, light })
            }
            Some(_) => Err(length),
            None => Err(FieldError::Unit(0.0)),
        }
    }

    /// Returns the radiance of the texel in a slot \[W·m⁻²·sr⁻¹\], bilinear in the `mirrored` direction; `None` for an
    /// empty slot.
    fn light(&self, slot: usize, mirrored: Vec3) -> Option<Vec3> {
        let DirectionCells { cells, weights } = self.map.bilinear(mirrored);
        let mut sum = Vec3::ZERO;
        for (cell, weight) in cells.into_iter().zip(weights) {
            let codes = self.light.codes(Slot(slot), cell)?;
            sum += weight * Vec3::from(codes.map(|code| self.light_of[code as usize]));
        }
        Some(sum)
    }
}

impl CoatFields {
    /// Creates the fields of coats on `atlas`; `None` if `atlas` lacks a tile or a used texel.
    pub(crate) fn new(atlas: &Atlas, fields: Vec<CoatField>) -> Option<Self> {
        let columns = atlas.size().0 / TILE_SIDE as u32;
        let mut places = vec![None; atlas.len()];
        for (number, field) in fields.iter().enumerate() {
            for Slot(slot) in field.light.tiles().slots() {
                // Convert the slot within its tile to the position of the texel in the atlas.
                let (tile, within) = (field.tiles[slot / TILE_SLOTS], (slot % TILE_SLOTS) as u32);
                let x = (tile % columns.max(1)) * TILE_SIDE as u32 + within % TILE_SIDE as u32;
                let y = (tile / columns.max(1)).checked_mul(TILE_SIDE as u32)? + within / TILE_SIDE as u32;
                let place = TexelSlot { field: number as u32, slot: slot as u32 };
                *places.get_mut(atlas.texel(x, y)? as usize)? = Some(place);
            }
        }
        Some(Self { fields, places })
    }

    /// Returns whether no coat is baked.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.fields.is_empty()
    }

    /// Returns the number of texels with baked coats.
    #[must_use]
    pub fn texels(&self) -> usize {
        self.fields.iter().map(|field| field.light.tiles().texels()).sum()
    }

    /// Returns the number of light samples: the number of directions, summed over texels.
    #[must_use]
    pub fn samples(&self) -> usize {
        self.fields.iter().map(|field| field.light.tiles().texels() * field.map.len()).sum()
    }

    /// Returns the stored size of the light in bytes.
    #[must_use]
    pub fn stored_bytes(&self) -> usize {
        self.fields.iter().map(|field| field.light.as_bytes().len()).sum()
    }

    /// Returns the mean radiance \[W·m⁻²·sr⁻¹\] that a texel's coat reflects, to be multiplied by the coat's albedo.
    /// The unit vector `mirrored` is the mirror direction. Returns `None` if the coat is not baked.
    #[must_use]
    pub fn mean_radiance(&self, texel: usize, mirrored: Vec3) -> Option<Vec3> {
        let TexelSlot { field, slot } = (*self.places.get(texel)?)?;
        self.fields[field as usize].light(slot as usize, mirrored)
    }

    /// Encodes the fields as bytes.
    pub(crate) fn to_bytes(&self) -> Vec<u8> {
        let mut stored = Vec::new();
        for CoatField { map, tiles, light, .. } in &self.fields {
            let (side, tiles, light) = (map.side as u32, tiles.clone(), light.as_bytes().to_vec());
            stored.push(StoredField { side, tiles, light });
        }
        encode(&stored)
    }

    /// Decodes the fields of `atlas`; the error text does not contain the file name.
    pub(crate) fn from_bytes(atlas: &Atlas, bytes: &[u8]) -> Result<Self, String> {
        let stored: Vec<StoredField> = decode(bytes).map_err(|error| error.chain())?;
        let mut fields = Vec::new();
        for StoredField { side, tiles, light } in stored {
            let light = NearLossless::from_bytes(light).map_err(|error| error.to_string())?;
            fields.push(CoatField::new(side as usize, tiles, light).map_err(|error| error.to_string())?);
        }
        Self::new(atlas, fields).ok_or_else(|| "its coats refer to texels outside of the atlas".into())
    }
}
