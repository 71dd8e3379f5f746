//! Trees as bytes, to be kept on disk or sent to another process.
//!
//! ```text
//! "LTRE"  version (u32)  length of the body (u64)  CRC-32 of the body (u32)  body (bincode)     all little-endian
//! ```

use crate::LightTree;

const MAGIC: [u8; 4] = *b"LTRE";
const VERSION: u32 = 2;
const HEADER: usize = 20;
const CONFIG: bincode::config::Configuration = bincode::config::standard();

/// Why bytes are no tree.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum StoreError {
    /// They do not begin like a tree.
    NotATree,
    /// Written by another version of this crate.
    Version(u32),
    /// Cut short or changed: length or check sum do not fit.
    Damaged,
    /// Whole, but not a tree that this crate wrote: what [`LightTree::validate`] found.
    Invalid(String),
}

impl std::fmt::Display for StoreError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::NotATree => write!(f, "these bytes are not a light tree"),
            Self::Version(found) => write!(f, "light tree of version {found}, expected {VERSION}: build it again"),
            Self::Damaged => write!(f, "the light tree is cut short or damaged: build it again"),
            Self::Invalid(what) => write!(f, "the light tree makes no sense: {what}"),
        }
    }
}

impl std::error::Error for StoreError {}

impl LightTree {
    /// The tree as bytes, for [`LightTree::from_bytes`].
    ///
    /// ```
    /// # use lighttree::{BuildParams, Emission, Light, LightTree, StoreError};
    /// # use glam::Vec3;
    /// let lamp = Light { position: Vec3::Y, emission: Emission::Omni, intensity: Vec3::ONE };
    /// let tree = LightTree::build(&[lamp], BuildParams { softening2: 1e-4, seed: 1 });
    /// let bytes = tree.to_bytes();
    /// assert_eq!(LightTree::from_bytes(&bytes).unwrap().lights(), tree.lights());
    /// assert_eq!(LightTree::from_bytes(&bytes[..30]).unwrap_err(), StoreError::Damaged);
    /// ```
    pub fn to_bytes(&self) -> Vec<u8> {
        let body = bincode::serde::encode_to_vec(self, CONFIG).expect("a tree holds nothing that cannot be encoded");
        let mut bytes = Vec::with_capacity(HEADER + body.len());
        bytes.extend(MAGIC);
        bytes.extend(VERSION.to_le_bytes());
        bytes.extend((body.len() as u64).to_le_bytes());
        bytes.extend(crc32fast::hash(&body).to_le_bytes());
        bytes.extend(body);
        bytes
    }

    /// The tree that [`LightTree::to_bytes`] wrote, checked as a whole: bytes from elsewhere give an error, not a panic.
    ///
    /// # Errors
    ///
    /// See [`StoreError`].
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, StoreError> {
        let (header, body) = bytes.split_at_checked(HEADER).ok_or(StoreError::NotATree)?;
        if header[..4] != MAGIC {
            return Err(StoreError::NotATree);
        }
        let number = |range: std::ops::Range<usize>| {
            header[range].iter().rev().fold(0u64, |value, &byte| value << 8 | u64::from(byte))
        };
        if number(4..8) != u64::from(VERSION) {
            return Err(StoreError::Version(number(4..8) as u32));
        }
        if number(8..16) != body.len() as u64 || number(16..20) != u64::from(crc32fast::hash(body)) {
            return Err(StoreError::Damaged);
        }
        let decoded = bincode::serde::decode_from_slice::<LightTree, _>(body, CONFIG);
        let (tree, used) = decoded.map_err(|_| StoreError::Damaged)?;
        if used != body.len() {
            return Err(StoreError::Damaged);
        }
        tree.validate().map_err(StoreError::Invalid)?;
        Ok(tree)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{BuildParams, Emission, Light};
    use glam::Vec3;

    fn tree() -> LightTree {
        let lamp = |k: u32| Light {
            position: Vec3::new(k as f32, (k * k % 7) as f32, 0.5),
            emission: match k % 4 {
                0 => Emission::Omni,
                1 => Emission::Directional(Vec3::NEG_Y),
                _ => Emission::Cosine(Vec3::Y),
            },
            intensity: Vec3::splat(1.0 + k as f32),
        };
        LightTree::build(&(0..40).map(lamp).collect::<Vec<_>>(), BuildParams { softening2: 0.01, seed: 5 })
    }

    #[test]
    fn every_changed_byte_and_every_cut_is_noticed() {
        let bytes = tree().to_bytes();
        assert_eq!(LightTree::from_bytes(&bytes).unwrap().to_bytes(), bytes);
        for place in 0..bytes.len() {
            let mut changed = bytes.clone();
            changed[place] ^= 0x10;
            assert!(LightTree::from_bytes(&changed).is_err(), "byte {place}");
            assert!(LightTree::from_bytes(&bytes[..place]).is_err(), "cut at {place}");
        }
    }

    #[test]
    fn a_forged_body_is_refused_without_a_panic() {
        let bytes = tree().to_bytes();
        for place in HEADER..bytes.len() {
            for value in [0, 0x7f, 0xfb, 0xff] {
                let mut forged = bytes.clone();
                forged[place] = value;
                let sum = crc32fast::hash(&forged[HEADER..]).to_le_bytes();
                forged[16..HEADER].copy_from_slice(&sum);
                // Some changes are harmless, such as of an intensity's last bit in a leaf that is alone; none may panic.
                let _ = LightTree::from_bytes(&forged);
            }
        }
    }
}
