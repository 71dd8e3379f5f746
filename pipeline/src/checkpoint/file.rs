//! A checkpoint as a file.
//!
//! ```text
//! "R2MC"  version (u32)  length of the body (u64)  CRC-32 of the body (u32)  body (bincode)     all little-endian
//! ```
//! The one place where bincode is named.

use crate::error::{Context, Error, Result, Source};
use crate::output::Output;
use crate::settings::Settings;
use render_core::scene::SceneSettings;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::fs;
use std::path::Path;

const MAGIC: [u8; 4] = *b"R2MC";
/// Counts changes of anything that is stored.
const VERSION: u32 = 2;
const HEADER: usize = 20;
const CONFIG: bincode::config::Configuration = bincode::config::standard();

pub(crate) fn encode(value: &impl Serialize) -> Vec<u8> {
    bincode::serde::encode_to_vec(value, CONFIG).expect("what stages carry can be encoded")
}

pub(crate) fn decode<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, Source> {
    // For texts memory is reserved as long as they are said to be. Numbers of eight bytes may be stored as one, so what is
    // decoded is at most eight times as large as what is stored; limits can only be constants.
    match bytes.len().checked_ilog2() {
        None | Some(0..16) => decode_within::<T, 0x8_0000>(bytes),
        Some(16..24) => decode_within::<T, 0x800_0000>(bytes),
        Some(24..28) => decode_within::<T, 0x8000_0000>(bytes),
        Some(28..32) => decode_within::<T, 0x8_0000_0000>(bytes),
        _ => decode_within::<T, { usize::MAX }>(bytes),
    }
}

fn decode_within<T: DeserializeOwned, const LIMIT: usize>(bytes: &[u8]) -> Result<T, Source> {
    let (value, used) = bincode::serde::decode_from_slice(bytes, CONFIG.with_limit::<LIMIT>())?;
    if used != bytes.len() {
        return Err(format!("{} bytes too many", bytes.len() - used).into());
    }
    Ok(value)
}

/// What a film is made from: only the same can be continued.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Job {
    program: String,
    /// All settings, as JSON.
    settings: String,
    /// CRC-32 of the scene's files.
    scene: u32,
}

/// All that a run carries from one frame to the next.
#[derive(Serialize, Deserialize)]
pub(super) struct Stored {
    pub job: Job,
    /// The last frame that is done.
    pub frame: u32,
    /// By [`Part`](super::Part); empty where there is none.
    pub parts: Vec<Vec<u8>>,
}

impl Job {
    pub fn new(settings: &Settings) -> Result<Self> {
        let settings_text = serde_json::to_string(settings).context("the settings cannot be put into JSON")?;
        let program = concat!("render2mpeg ", env!("CARGO_PKG_VERSION")).into();
        Ok(Self { program, settings: settings_text, scene: sum_of_scene(&settings.scene)? })
    }

    /// In what `self`, which was stored, is another job than `wanted`; none if it is the same.
    pub fn difference(&self, wanted: &Self) -> Option<String> {
        if self.program != wanted.program {
            return Some(format!("it is of {}, and this is {}", self.program, wanted.program));
        }
        if self.settings != wanted.settings {
            let read = |text: &str| serde_json::from_str::<serde_json::Value>(text).unwrap_or_default();
            let (then, now) = (read(&self.settings), read(&wanted.settings));
            let names = now.as_object().into_iter().flat_map(|object| object.keys());
            let other = names.into_iter().find(|name| then[name.as_str()] != now[name.as_str()]);
            return Some(match other {
                Some(name) => format!("{name} was {} and is now {}", then[name.as_str()], now[name.as_str()]),
                None => "it is of other settings".into(),
            });
        }
        (self.scene != wanted.scene).then(|| "the scene has changed".into())
    }
}

/// CRC-32 of a scene's own file, of the one beside it with its settings, and of those that its JSON names.
fn sum_of_scene(path: &Path) -> Result<u32> {
    let mut sum = crc32fast::Hasher::new();
    let bytes = fs::read(path).map_err(Error::file(path, "cannot be read"))?;
    sum.update(&bytes);
    let mut others = vec![SceneSettings::path_for(path)];
    let document: serde_json::Value = serde_json::from_slice(&bytes).unwrap_or_default();
    for list in ["buffers", "images"] {
        let entries = document[list].as_array().into_iter().flatten();
        let names = entries.filter_map(|entry| entry["uri"].as_str()).filter(|uri| !uri.starts_with("data:"));
        others.extend(names.map(|name| path.with_file_name(name)));
    }
    // Names may be escaped; what is not found under them was not what was loaded.
    others.iter().filter_map(|other| fs::read(other).ok()).for_each(|bytes| sum.update(&bytes));
    Ok(sum.finalize())
}

impl Stored {
    /// Writes the checkpoint; until it is whole, the one before it stays.
    pub fn write(&self, path: &Path) -> Result<()> {
        let body = encode(self);
        let mut header = Vec::with_capacity(HEADER);
        header.extend(MAGIC);
        header.extend(VERSION.to_le_bytes());
        header.extend((body.len() as u64).to_le_bytes());
        header.extend(crc32fast::hash(&body).to_le_bytes());
        let mut file = Output::create(path)?;
        file.write(&header)?;
        file.write(&body)?;
        file.finish()
    }

    pub fn read(path: &Path) -> Result<Self> {
        let bytes = fs::read(path).map_err(Error::file(path, "cannot be read"))?;
        Self::from_bytes(&bytes).map_err(|source| Error::Content {
            path: path.into(),
            problem: ": start anew, without --resume".into(),
            source: Some(source),
        })
    }

    fn from_bytes(bytes: &[u8]) -> Result<Self, Source> {
        let Some((header, body)) = bytes.split_at_checked(HEADER).filter(|(header, _)| header[..4] == MAGIC) else {
            return Err("this is no checkpoint".into());
        };
        let number = |range: std::ops::Range<usize>| {
            header[range].iter().rev().fold(0u64, |value, &byte| value << 8 | u64::from(byte))
        };
        if number(4..8) != u64::from(VERSION) {
            return Err(format!("a checkpoint of version {}, and this program knows {VERSION}", number(4..8)).into());
        }
        if number(8..16) != body.len() as u64 || number(16..20) != u64::from(crc32fast::hash(body)) {
            return Err("the checkpoint is cut short or damaged".into());
        }
        let stored: Self = decode(body)?;
        if stored.parts.len() != super::PARTS {
            return Err(format!("a checkpoint of {} parts", stored.parts.len()).into());
        }
        Ok(stored)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_changed_byte_and_every_cut_is_noticed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("film.m2v.checkpoint");
        let job = Job { program: "p 1".into(), settings: r#"{"qscale":8,"gop":15}"#.into(), scene: 7 };
        let parts = vec![vec![1], vec![], vec![2, 3], vec![250; 300], vec![4], vec![]];
        Stored { job: job.clone(), frame: 41, parts: parts.clone() }.write(&path).unwrap();
        let read = Stored::read(&path).unwrap();
        assert!(read.job == job && read.frame == 41 && read.parts == parts);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "nothing else stays");

        let bytes = fs::read(&path).unwrap();
        for place in 0..bytes.len() {
            let mut changed = bytes.clone();
            changed[place] ^= 0x10;
            assert!(Stored::from_bytes(&changed).is_err(), "byte {place}");
            assert!(Stored::from_bytes(&bytes[..place]).is_err(), "cut at {place}");
        }
    }

    #[test]
    fn texts_are_no_longer_than_their_file() {
        // A length of 2⁵⁰ bytes, as bincode writes it.
        let length = [&[253][..], &(1u64 << 50).to_le_bytes()].concat();
        assert!(decode::<String>(&length).is_err());
        assert!(decode::<(u8, Vec<u8>)>(&[&[1], &length[..]].concat()).is_err());
        let numbers = vec![u64::MAX, 1, 0];
        assert_eq!(decode::<Vec<u64>>(&encode(&numbers)).unwrap(), numbers);
        for count in [0, 1000, 0x1_0000, 0x10_0000] {
            // Every number takes a byte, the least that eight can.
            let numbers = vec![7u64; count];
            assert!(decode::<Vec<u64>>(&encode(&numbers)).unwrap() == numbers, "{count} numbers");
        }
    }

    #[test]
    fn what_differs_is_named() {
        let job = Job { program: "p 1".into(), settings: r#"{"qscale":8,"gop":15}"#.into(), scene: 7 };
        assert_eq!(job.difference(&job), None);
        let other = Job { settings: r#"{"qscale":16,"gop":15}"#.into(), ..job.clone() };
        assert_eq!(job.difference(&other).unwrap(), "qscale was 8 and is now 16");
        let other = Job { scene: 8, ..job.clone() };
        assert!(job.difference(&other).unwrap().contains("scene"));
    }
}
