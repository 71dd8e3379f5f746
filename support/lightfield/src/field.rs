//! Raw samples per texel and direction.

use crate::error::{FieldError, MOST_DIRECTIONS, MOST_TILES};
use crate::look_up::LookUp;
use crate::scale::LogScale;
use crate::tiles::{Rank, Slot, TexelTiles};

/// Samples of a field, ordered by the texel's rank, then direction, then channel.
#[derive(Clone, Debug, PartialEq)]
pub enum Samples {
    /// Display codes, 0 to 255.
    Bytes(Vec<u8>),
    /// Light as codes on a logarithmic scale.
    Logarithmic {
        /// Scale of the codes.
        scale: LogScale,
        /// Codes of the light.
        codes: Vec<u16>,
    },
}

impl Samples {
    /// Number of samples.
    #[must_use]
    pub fn len(&self) -> usize {
        match self {
            Self::Bytes(codes) => codes.len(),
            Self::Logarithmic { codes, .. } => codes.len(),
        }
    }

    /// Returns whether there are no samples.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns three codes, starting at index `at`.
    #[inline]
    pub(crate) fn three(&self, at: usize) -> [f32; 3] {
        match self {
            Self::Bytes(codes) => [0, 1, 2].map(|c| f32::from(codes[at + c])),
            Self::Logarithmic { codes, .. } => [0, 1, 2].map(|c| f32::from(codes[at + c])),
        }
    }

    /// Scale of logarithmic codes, or `None` for 8-bit codes.
    #[must_use]
    pub fn scale(&self) -> Option<LogScale> {
        match self {
            Self::Bytes(_) => None,
            Self::Logarithmic { scale, .. } => Some(*scale),
        }
    }
}

/// Outgoing light: three samples per texel and direction.
#[derive(Clone, Debug, PartialEq)]
pub struct Field {
    tiles: TexelTiles,
    directions: usize,
    samples: Samples,
}

impl Field {
    /// Creates a field from samples.
    ///
    /// # Errors
    ///
    /// * [`FieldError::Directions`] if `directions` is not in 1 to 4096.
    /// * [`FieldError::Tiles`] if there are more than 2²⁴ tiles.
    /// * [`FieldError::Length`] if there are not three samples per texel and direction.
    pub fn new(tiles: TexelTiles, directions: usize, samples: Samples) -> Result<Self, FieldError> {
        if !(1..=MOST_DIRECTIONS).contains(&directions) {
            return Err(FieldError::Directions(directions));
        }
        if tiles.len() > MOST_TILES {
            return Err(FieldError::Tiles(tiles.len()));
        }
        let (found, expected) = (samples.len(), tiles.texels() * directions * 3);
        if found != expected {
            return Err(FieldError::Length { found, expected });
        }
        Ok(Self { tiles, directions, samples })
    }

    /// Creates a field of light on a logarithmic scale. `light` is ordered by the texel's rank, then direction.
    /// [`TexelTiles::slots`] lists the slots of all texels in this order.
    ///
    /// # Errors
    ///
    /// Returns the errors of [`Field::new`], or [`FieldError::Light`] with the texel if light is negative, infinite or
    /// NaN.
    pub fn of_light(
        tiles: TexelTiles,
        directions: usize,
        scale: LogScale,
        light: &[[f32; 3]],
    ) -> Result<Self, FieldError> {
        let mut codes = Vec::with_capacity(light.len() * 3);
        // Check lengths first, so that each light value has a texel.
        if !(1..=MOST_DIRECTIONS).contains(&directions) {
            return Err(FieldError::Directions(directions));
        }
        if light.len() != tiles.texels() * directions {
            return Err(FieldError::Length { found: light.len() * 3, expected: tiles.texels() * directions * 3 });
        }
        for (place, rgb) in light.iter().enumerate() {
            for &value in rgb {
                // Search the slot only for an error, because the search visits a whole tile.
                let (slot, direction) = (|| tiles.slot(Rank(place / directions)), place % directions);
                codes.push(scale.code(value).ok_or_else(|| FieldError::Light { slot: slot(), direction, value })?);
            }
        }
        Self::new(tiles, directions, Samples::Logarithmic { scale, codes })
    }

    /// Texels of the field.
    #[must_use]
    pub fn tiles(&self) -> &TexelTiles {
        &self.tiles
    }

    /// Number of directions per texel.
    #[must_use]
    pub fn directions(&self) -> usize {
        self.directions
    }

    /// Samples ordered by the texel's rank, then direction, then channel.
    #[must_use]
    pub fn samples(&self) -> &Samples {
        &self.samples
    }
}

impl LookUp for Field {
    #[inline]
    fn codes(&self, slot: Slot, direction: usize) -> Option<[f32; 3]> {
        let Rank(rank) = self.tiles.rank(slot).filter(|_| direction < self.directions)?;
        Some(self.samples.three((rank * self.directions + direction) * 3))
    }

    fn scale(&self) -> Option<LogScale> {
        self.samples.scale()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unfit_samples_are_named() {
        let tiles = || TexelTiles::of_picture(17, 2);
        let bytes = |n: usize| Samples::Bytes(vec![0; n]);
        assert_eq!(Field::new(tiles(), 0, bytes(0)), Err(FieldError::Directions(0)));
        assert_eq!(Field::new(tiles(), 5000, bytes(0)), Err(FieldError::Directions(5000)));
        assert_eq!(Field::new(tiles(), 2, bytes(9)), Err(FieldError::Length { found: 9, expected: 204 }));
        let scale = LogScale::new(1.0).unwrap();
        assert!(Field::of_light(tiles(), 2, scale, &[[0.0; 3]; 67]).is_err());
        for value in [-1.0, f32::NAN, f32::INFINITY] {
            let mut light = vec![[1.0; 3]; 68];
            // All texels of the first tile precede the second tile. Rank 33 is the last texel of the second tile.
            light[67][2] = value;
            let message = Field::of_light(tiles(), 2, scale, &light).unwrap_err().to_string();
            let place = "light of tile 1, texel (0, 1), direction 1 is ";
            assert_eq!(message, format!("{place}{value}: expected a finite number of at least 0"));
        }
    }

    #[test]
    fn codes_are_found_by_slot() {
        let tiles = TexelTiles::new(vec![[0; 4], [0b1010, 0, 0, 1 << 63]]);
        let field = Field::new(tiles, 2, Samples::Bytes((0..18).collect())).unwrap();
        assert_eq!(field.codes(Slot(256 + 3), 1), Some([9.0, 10.0, 11.0]));
        assert_eq!(field.codes(Slot(256 + 255), 0), Some([12.0, 13.0, 14.0]));
        assert_eq!(
            [(3, 1), (256 + 3, 2), (1000, 0)].map(|(slot, direction)| field.codes(Slot(slot), direction)),
            [None; 3]
        );
    }
}
