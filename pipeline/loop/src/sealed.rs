//! Files that hold one value, with a version and a checksum.
//!
//! ```text
//! magic (4 bytes)  version (u32)  length of the body (u64)  CRC-32 of the body (u32)  body (bincode)     little-endian
//! ```

use crate::error::{Context, Error, Result};
use crate::output::Output;
use crate::state::{decode_bytes, encode};
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::fs;
use std::path::Path;

const HEADER: usize = 20;

/// Format of a sealed file.
#[derive(Clone, Copy, Debug)]
pub struct SealedFormat {
    /// First bytes of the file.
    pub magic: [u8; 4],
    /// Version of the stored data, incremented with every change.
    pub version: u32,
    /// Name of such a file in messages, such as "checkpoint".
    pub name: &'static str,
    /// Advice that ends every message about the content.
    pub remedy: &'static str,
}

impl SealedFormat {
    /// Writes `value` to the file at `path`. An existing file is replaced only when the new one is complete.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write(&self, path: &Path, value: &impl Serialize) -> Result<()> {
        let body = encode(value);
        let mut header = Vec::with_capacity(HEADER);
        header.extend(self.magic);
        header.extend(self.version.to_le_bytes());
        header.extend((body.len() as u64).to_le_bytes());
        header.extend(crc32fast::hash(&body).to_le_bytes());
        let mut file = Output::create(path)?;
        file.write(&header)?;
        file.write(&body)?;
        file.finish()
    }

    /// Reads the value in the file at `path`.
    ///
    /// # Errors
    /// If the file cannot be read, is damaged, or belongs to another format or version.
    pub fn read<T: DeserializeOwned>(&self, path: &Path) -> Result<T> {
        let bytes = fs::read(path).map_err(Error::file(path, "cannot be read"))?;
        self.decode(&bytes).context(format!("{}: {}", path.display(), self.remedy))
    }

    /// Decodes the content of a file.
    pub(crate) fn decode<T: DeserializeOwned>(&self, bytes: &[u8]) -> Result<T> {
        // Check magic and version first, as the rest of the header depends on them.
        let Self { magic, version, name, .. } = *self;
        let Some((header, body)) = bytes.split_at_checked(HEADER).filter(|(header, _)| header[..4] == magic) else {
            return Err(Error::Checkpoint(format!("not a {name}")));
        };
        let number = |range: std::ops::Range<usize>| {
            header[range].iter().rev().fold(0u64, |value, &byte| value << 8 | u64::from(byte))
        };
        if number(4..8) != u64::from(version) {
            let text = format!("{name} version {}, but this program reads version {version}", number(4..8));
            return Err(Error::Checkpoint(text));
        }

        // Check length and checksum, so that the decoder reads only complete data.
        if number(8..16) != body.len() as u64 || number(16..20) != u64::from(crc32fast::hash(body)) {
            return Err(Error::Checkpoint(format!("the {name} is truncated or damaged")));
        }
        decode_bytes(body)
    }
}
