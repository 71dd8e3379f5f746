//! Settings of tiles that ranks request on demand.

use super::values::parsed;
use pipeline::error::{Error, Result};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::fmt;
use std::str::FromStr;

/// Default number of records that a rank collects before it sends them. On 16 ranks, buffers of 4 to 64 records change
/// the number of records in four frames of `nave` by at most 0.5 %. A buffer of 256 adds 10 %.
const BUFFER: u32 = 32;
/// Number of tiles per rank and frame. With 4, the first frame of `nave` on 16 ranks took 10 % longer.
pub(crate) const TILES_PER_RANK: usize = 8;

/// Division of a frame into tiles for ranks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TileSettings {
    /// Cost that is about equal in all tiles.
    pub cost: TileCost,
    /// Exchange of irradiance cache records between ranks.
    pub records: RecordSharing,
    /// Number of new records that a rank collects before it sends them.
    pub buffer: u32,
}

/// Cost that the division into tiles balances.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum TileCost {
    /// Number of primary rays, as in \[Debattista05, 4.2\].
    Rays,
    /// CPU time of the same surfaces in the previous frame.
    Time,
}

/// Exchange of records between ranks \[Debattista05, 4.3\].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum RecordSharing {
    /// Ranks exchange no records.
    None,
    /// Ranks exchange records through rank 0, which returns the records of all other ranks.
    Central,
    /// Each rank exchanges records directly with every other rank.
    Each,
}

impl FromStr for TileSettings {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let wrong = || {
            let known = "rays or time, with \"none\", \"central:N\" or \"each:N\" for records";
            Error::Options(format!("\"{text}\" is not {known}, such as rays or time,each:32"))
        };
        let mut tiles = Self { cost: TileCost::Rays, records: RecordSharing::Each, buffer: BUFFER };
        for part in text.split(',') {
            // Separate a value from its optional buffer size, 1 to 10000 records.
            let (name, number) = match part.split_once(':') {
                Some((name, number)) => {
                    let number = number.parse::<u32>().ok().filter(|number| (1..=10_000).contains(number));
                    (name, Some(number.ok_or_else(wrong)?))
                }
                None => (part, None),
            };
            // Reject a buffer size after values that have no buffer.
            match (name, number) {
                ("rays", None) => tiles.cost = TileCost::Rays,
                ("time", None) => tiles.cost = TileCost::Time,
                ("none", None) => tiles.records = RecordSharing::None,
                ("central", number) => {
                    (tiles.records, tiles.buffer) = (RecordSharing::Central, number.unwrap_or(BUFFER))
                }
                ("each", number) => (tiles.records, tiles.buffer) = (RecordSharing::Each, number.unwrap_or(BUFFER)),
                _ => return Err(wrong()),
            }
        }
        Ok(tiles)
    }
}

impl fmt::Display for TileSettings {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { cost, records, buffer } = self;
        let cost = match cost {
            TileCost::Rays => "rays",
            TileCost::Time => "time",
        };
        match records {
            RecordSharing::None => write!(f, "{cost},none"),
            RecordSharing::Central => write!(f, "{cost},central:{buffer}"),
            RecordSharing::Each => write!(f, "{cost},each:{buffer}"),
        }
    }
}

impl Serialize for TileSettings {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for TileSettings {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        parsed(deserializer)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_of_tiles_are_read_as_they_are_written() {
        for (text, whole) in [
            ("rays", "rays,each:32"),
            ("time", "time,each:32"),
            ("none,rays", "rays,none"),
            ("time,central", "time,central:32"),
            ("each:7", "rays,each:7"),
        ] {
            let tiles: TileSettings = text.parse().unwrap();
            assert_eq!(tiles.to_string(), whole);
            assert_eq!(whole.parse::<TileSettings>().unwrap().to_string(), whole);
        }
        for text in ["", "squares", "rays:3", "each:0", "central:x", "per-rank:8", "each:10001", "rays,,time"] {
            let message = text.parse::<TileSettings>().unwrap_err().to_string();
            assert!(message.contains("such as rays"), "{text}: {message}");
        }
    }
}
