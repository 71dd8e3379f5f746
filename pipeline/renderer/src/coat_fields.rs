//! Light that coats at rest reflect, for each texel of an atlas and each direction, as it was baked.
//!
//! Texels whose coats are equally rough, by the side n of their maps, share a field. A look-up is bilinear in directions; that in
//! texels is up to the caller, who knows the blend.

use glam::Vec3;
use lightfield::{DirectionCells, FieldError, LookUp, NearLossless, OctahedralMap, TILE_SIDE, TILE_SLOTS};
use pipeline::state::{decode, encode};
use render_core::Atlas;
use serde::{Deserialize, Serialize};

/// Fields of all coats that are baked, with their texels.
#[derive(Debug, Default)]
pub struct CoatFields {
    fields: Vec<CoatField>,
    /// For each texel of the atlas its field and its slot there, if its coat is baked.
    places: Vec<Option<TexelSlot>>,
}

/// The place of a texel's light.
#[derive(Clone, Copy, Debug)]
struct TexelSlot {
    field: u32,
    slot: u32,
}

/// The light of equally rough coats.
pub(crate) struct CoatField {
    map: OctahedralMap,
    /// For each tile of the field its number in the atlas: by rows of tiles.
    tiles: Vec<u32>,
    /// The light of each code \[W·m⁻²·sr⁻¹\]: a film looks up 48 codes a pixel.
    light_of: Vec<f32>,
    light: NearLossless,
}

/// A field as files have it.
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
    /// A field on a map of n × n directions, n = `side`, whose tiles have these numbers in the atlas.
    ///
    /// # Errors
    /// The light does not fit the map or the tiles, or has no logarithmic scale.
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

    /// Light in the slot of a texel, bilinear in `mirrored` direction; none where no such texel is.
    fn light(&self, slot: usize, mirrored: Vec3) -> Option<Vec3> {
        let DirectionCells { cells, weights } = self.map.bilinear(mirrored);
        let mut sum = Vec3::ZERO;
        for (cell, weight) in cells.into_iter().zip(weights) {
            let codes = self.light.codes(slot, cell)?;
            sum += weight * Vec3::from(codes.map(|code| self.light_of[code as usize]));
        }
        Some(sum)
    }
}

impl CoatFields {
    /// The fields of coats on `atlas`. None if a tile is not one of the atlas, or has texels that are not in use there.
    pub(crate) fn new(atlas: &Atlas, fields: Vec<CoatField>) -> Option<Self> {
        let columns = atlas.size().0 / TILE_SIDE as u32;
        let mut places = vec![None; atlas.len()];
        for (number, field) in fields.iter().enumerate() {
            for slot in field.light.tiles().slots() {
                let (tile, within) = (field.tiles[slot / TILE_SLOTS], (slot % TILE_SLOTS) as u32);
                let x = (tile % columns.max(1)) * TILE_SIDE as u32 + within % TILE_SIDE as u32;
                let y = (tile / columns.max(1)).checked_mul(TILE_SIDE as u32)? + within / TILE_SIDE as u32;
                let place = TexelSlot { field: number as u32, slot: slot as u32 };
                *places.get_mut(atlas.texel(x, y)? as usize)? = Some(place);
            }
        }
        Some(Self { fields, places })
    }

    /// Whether no coat is baked.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.fields.is_empty()
    }

    /// Texels whose coats are baked.
    #[must_use]
    pub fn texels(&self) -> usize {
        self.fields.iter().map(|field| field.light.tiles().texels()).sum()
    }

    /// Samples of light: texels, each times its directions.
    #[must_use]
    pub fn samples(&self) -> usize {
        self.fields.iter().map(|field| field.light.tiles().texels() * field.map.len()).sum()
    }

    /// Bytes of the light as it is stored.
    #[must_use]
    pub fn stored_bytes(&self) -> usize {
        self.fields.iter().map(|field| field.light.as_bytes().len()).sum()
    }

    /// Mean radiance \[W·m⁻²·sr⁻¹\] that the coat of a texel reflects towards a viewer to whom a mirror would show the world in
    /// the unit direction `mirrored`; the albedo of the coat is the caller's factor. None where the coat is not baked.
    #[must_use]
    pub fn mean_radiance(&self, texel: usize, mirrored: Vec3) -> Option<Vec3> {
        let TexelSlot { field, slot } = (*self.places.get(texel)?)?;
        self.fields[field as usize].light(slot as usize, mirrored)
    }

    /// The fields as bytes.
    pub(crate) fn to_bytes(&self) -> Vec<u8> {
        let mut stored = Vec::new();
        for CoatField { map, tiles, light, .. } in &self.fields {
            let (side, tiles, light) = (map.side as u32, tiles.clone(), light.as_bytes().to_vec());
            stored.push(StoredField { side, tiles, light });
        }
        encode(&stored)
    }

    /// Fields of `atlas` from bytes; the error is a text without a name of the file.
    pub(crate) fn from_bytes(atlas: &Atlas, bytes: &[u8]) -> Result<Self, String> {
        let stored: Vec<StoredField> = decode(bytes).map_err(|error| error.chain())?;
        let mut fields = Vec::new();
        for StoredField { side, tiles, light } in stored {
            let light = NearLossless::from_bytes(light).map_err(|error| error.to_string())?;
            fields.push(CoatField::new(side as usize, tiles, light).map_err(|error| error.to_string())?);
        }
        Self::new(atlas, fields).ok_or_else(|| "texels of coats that the atlas does not have".into())
    }
}
