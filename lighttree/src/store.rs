//! Serialization of trees, for files and other processes.
//!
//! ```text
//! "LTRE"  version (u32)  length of the body (u64)  CRC-32 of the body (u32)  body (bincode)     all little-endian
//! ```

use crate::draw::Draws;
use crate::light::Light;
use crate::node::Node;
use crate::sites::Sites;
use crate::tree::LightTree;
use crate::validate::InvalidTree;

const MAGIC: [u8; 4] = *b"LTRE";
const VERSION: u32 = 2;
const HEADER: usize = 20;
const CONFIG: bincode::config::Configuration = bincode::config::standard();

/// Error in the deserialization of a tree.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum StoreError {
    /// The magic number is missing.
    NotATree,
    /// The bytes were written by another version of this crate.
    Version(u32),
    /// The bytes are truncated or changed: the length or the checksum does not match.
    Damaged,
    /// Length and checksum match, but [`LightTree::validate`] finds a broken invariant.
    Invalid(InvalidTree),
}

impl std::fmt::Display for StoreError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::NotATree => write!(f, "these bytes are not a light tree"),
            Self::Version(found) => write!(f, "light tree of version {found}, expected {VERSION}: build it again"),
            Self::Damaged => write!(f, "the light tree is cut short or damaged: build it again"),
            Self::Invalid(what) => write!(f, "the light tree is invalid: {what}"),
        }
    }
}

impl std::error::Error for StoreError {}

/// Deserialized fields of a tree before they are validated.
#[derive(serde::Deserialize)]
pub(crate) struct Stored {
    nodes: Vec<Node>,
    lights: Vec<Light>,
    geometry_term_bound: f32,
    extents: Vec<f32>,
    depth: usize,
    cost_at_build: f64,
    misplaced: Vec<u32>,
    rejected: usize,
    seed: u64,
}

impl TryFrom<Stored> for LightTree {
    type Error = InvalidTree;

    fn try_from(stored: Stored) -> Result<Self, InvalidTree> {
        let Stored { nodes, lights, geometry_term_bound, extents, depth, cost_at_build, misplaced, rejected, seed } =
            stored;
        // Recompute the values that the file does not contain.
        let sites = Sites::new(&nodes, &lights, seed);
        let draws = Draws::new(&nodes);
        let tree = Self {
            nodes,
            lights,
            sites,
            draws,
            geometry_term_bound,
            extents,
            depth,
            cost_at_build,
            misplaced,
            rejected,
            seed,
        };
        tree.validate()?;
        Ok(tree)
    }
}

impl LightTree {
    /// Serializes the tree for [`LightTree::from_bytes`].
    ///
    /// ```
    /// # use lighttree::{BuildParams, Emission, Light, LightTree, StoreError};
    /// # use glam::Vec3;
    /// let lamp = Light { position: Vec3::Y, emission: Emission::Omni, intensity: Vec3::ONE };
    /// let tree = LightTree::build(&[lamp], BuildParams::bounded_by(1e-4).with_seed(1));
    /// let bytes = tree.to_bytes();
    /// assert_eq!(LightTree::from_bytes(&bytes).unwrap().lights(), tree.lights());
    /// assert_eq!(LightTree::from_bytes(&bytes[..30]).unwrap_err(), StoreError::Damaged);
    /// ```
    #[must_use]
    #[allow(clippy::missing_panics_doc, reason = "vectors of numbers can always be encoded")]
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

    /// Deserializes a tree written by [`LightTree::to_bytes`] and validates it completely. Any other bytes give an
    /// error, not a panic.
    ///
    /// # Errors
    ///
    /// If the bytes are not a valid tree: see the variants of [`StoreError`].
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, StoreError> {
        // Check magic number and version first, so that other files get a precise error.
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
        // Check length and checksum before decoding.
        if number(8..16) != body.len() as u64 || number(16..20) != u64::from(crc32fast::hash(body)) {
            return Err(StoreError::Damaged);
        }
        let decoded = bincode::serde::decode_from_slice::<Stored, _>(body, CONFIG);
        let (stored, used) = decoded.map_err(|_| StoreError::Damaged)?;
        // Reject trailing bytes.
        if used != body.len() {
            return Err(StoreError::Damaged);
        }
        Self::try_from(stored).map_err(StoreError::Invalid)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{BuildParams, Emission, Lambert, Scratch, Stop};
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
        LightTree::build(&(0..40).map(lamp).collect::<Vec<_>>(), BuildParams::bounded_by(0.01).with_seed(5))
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

    /// Calls every function that reads or changes a tree. A valid tree must not cause a panic.
    fn use_it(mut tree: LightTree) {
        assert_eq!(tree.validate(), Ok(()));
        let receiver = Lambert { position: Vec3::new(7.0, 2.0, -1.0), normal: Vec3::Z, reflectance: Vec3::ONE };
        let mut scratch = Scratch::default();
        for stop in [Stop::Absolute(0.0), Stop::Relative { fraction: 0.02, known_luminance: 0.0 }] {
            tree.lightcut(&receiver, stop, |_, _| true, &mut scratch);
            tree.lightcut_kept(&receiver, stop, |_, _| true, &mut scratch);
            scratch.kept().iter().for_each(|kept| drop(tree.cluster_lights(kept.cluster)));
        }
        tree.update(&vec![Vec3::ONE; tree.len()]);
        tree.update_drawn(&vec![Vec3::X; tree.len()]);
        assert_eq!(tree.validate(), Ok(()));
    }

    /// One byte of the body is replaced at a time. The result is deserialized with [`LightTree::from_bytes`] and a
    /// correct checksum, and directly with serde.
    #[test]
    fn a_forged_body_is_refused_or_harmless() {
        let bytes = tree().to_bytes();
        let mut refused = 0;
        for place in HEADER..bytes.len() {
            for value in [0, 1, 0x7f, 0xfb, 0xff] {
                let mut forged = bytes.clone();
                forged[place] = value;
                let sum = crc32fast::hash(&forged[HEADER..]).to_le_bytes();
                forged[16..HEADER].copy_from_slice(&sum);
                let read = LightTree::from_bytes(&forged);
                let by_serde = bincode::serde::decode_from_slice::<LightTree, _>(&forged[HEADER..], CONFIG);
                if read.is_ok() {
                    assert!(by_serde.is_ok());
                }
                refused += usize::from(by_serde.is_err());
                // Some changes, such as changes of a seed or an extent, are harmless.
                by_serde.into_iter().for_each(|(tree, _)| use_it(tree));
            }
        }
        assert!(refused > bytes.len(), "{refused} refused");
    }

    /// The forgeries are accepted by serde. Each breaks one invariant.
    #[test]
    fn broken_invariants_are_named() {
        type Forgery = fn(&mut LightTree);
        let last = |tree: &LightTree| tree.nodes.len() - 1;
        let forgeries: [(&str, Forgery); 12] = [
            ("has children at 1", |tree| tree.nodes[1].representative_child = 1),
            ("has children at 999", |tree| tree.nodes[0].representative_child = 999),
            ("nodes for 40 lights", |tree| tree.nodes.truncate(78)),
            ("box", |tree| tree.nodes[1].low = Vec3::NAN),
            ("cone", |tree| tree.nodes[1].cone_cosine = f32::NAN),
            ("axis", |tree| tree.nodes[1].axis = Vec3::ZERO),
            ("intensity", |tree| tree.nodes[1].intensity = Vec3::INFINITY),
            ("unusable", |tree| tree.lights[3].intensity = Vec3::INFINITY),
            ("misplaced", |tree| tree.misplaced = vec![4_000_000]),
            ("misplaced", |tree| tree.misplaced = vec![7]),
            ("extent", |tree| tree.extents[2] = f32::NAN),
            ("geometry-term bound", |tree| tree.geometry_term_bound = f32::NAN),
        ];
        for (expected, forge) in forgeries {
            let mut tree = tree();
            assert_eq!(tree.validate(), Ok(()));
            forge(&mut tree);
            let body = bincode::serde::encode_to_vec(&tree, CONFIG).unwrap();
            let error = bincode::serde::decode_from_slice::<LightTree, _>(&body, CONFIG).unwrap_err();
            assert!(error.to_string().contains(expected), "{expected}: {error}");
        }
        // This tree has two unreachable subtrees. One of them points outside the tree.
        let mut tree = tree();
        let leaf = (0..tree.nodes.len()).rev().find(|&k| tree.nodes[k].is_leaf()).unwrap();
        tree.nodes[0] = tree.nodes[leaf];
        let end = last(&tree);
        tree.nodes[end].representative_child = u32::MAX;
        let body = bincode::serde::encode_to_vec(&tree, CONFIG).unwrap();
        let error = bincode::serde::decode_from_slice::<LightTree, _>(&body, CONFIG).unwrap_err();
        assert!(error.to_string().contains("has no parent"), "{error}");
    }
}
