//! Container of binary files (glTF 2.0, 4.4): a header, JSON and a binary chunk.

use super::{LoadError, Loader, without_mark};

/// Size of the header: magic, version and length \[bytes\].
const HEADER: usize = 12;

/// Size of the length and type before the data of a chunk \[bytes\].
const CHUNK_HEADER: usize = 8;

impl Loader<'_> {
    /// Splits a file into its JSON and its binary chunk. Chunks of other types are skipped, as 4.4.3 demands.
    pub(super) fn split<'b>(&self, bytes: &'b [u8]) -> Result<(&'b [u8], Option<&'b [u8]>), LoadError> {
        if !bytes.starts_with(b"glTF") {
            return Ok((without_mark(bytes), None));
        }

        // Check the header.
        let (Some(version), Some(length)) = (word(bytes, 4), word(bytes, 8)) else {
            return self.bad("not a complete glTF file (its header is truncated); export or copy it again");
        };
        if version != 2 {
            return self.bad(format!("a .glb file of version {version}, but only 2 is read; export it as glTF 2.0"));
        }
        if (length as usize) < HEADER {
            return self.bad(format!(
                "its header claims {length} bytes, fewer than the header itself has; export or copy it again"
            ));
        }
        if length as usize > bytes.len() {
            return self
                .bad(format!("not a complete glTF file ({} of {length} bytes); export or copy it again", bytes.len()));
        }

        // Use the first chunk of each known type.
        let (mut json, mut binary) = (None, None);
        let mut rest = &bytes[HEADER..];
        while let (Some(size), Some(kind)) = (word(rest, 0), rest.get(4..CHUNK_HEADER)) {
            let Some(data) = rest[CHUNK_HEADER..].get(..size as usize) else {
                return self.bad(format!(
                    "not a complete glTF file (a chunk of {size} bytes has {}); export or copy it again",
                    rest.len() - CHUNK_HEADER
                ));
            };
            match kind {
                b"JSON" if json.is_none() => json = Some(data),
                b"BIN\0" if binary.is_none() => binary = Some(data),
                _ => {}
            }
            rest = &rest[CHUNK_HEADER + data.len()..];
        }
        let Some(json) = json else {
            return self.bad("not a complete glTF file (it has no JSON); export or copy it again");
        };
        // Some exporters pad the text with zeros instead of spaces.
        let end = json.iter().rposition(|&byte| byte != 0).map_or(0, |last| last + 1);
        Ok((without_mark(&json[..end]), binary))
    }
}

/// Returns the little-endian 32-bit number at offset `at`.
fn word(bytes: &[u8], at: usize) -> Option<u32> {
    let word = bytes.get(at..at + 4)?;
    Some(u32::from_le_bytes([word[0], word[1], word[2], word[3]]))
}
