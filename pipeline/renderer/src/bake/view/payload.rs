//! Blocks of bytes in the page: predicted, compressed, and encoded as base64.
//!
//! A block of records is stored by columns: first the first bytes of all records, then the second bytes, and so on.
//! Each byte is the difference from the previous byte of its column, modulo 256. Similar records then compress well.

use base64::Engine;
use flate2::Compression;
use flate2::write::ZlibEncoder;
use pipeline::error::{Context, Result};
use serde_json::{Map, Value, json};
use std::io::Write;

/// Blocks of a page, in the order of their addition.
#[derive(Debug, Default)]
pub(super) struct Payload {
    bytes: Vec<u8>,
    blocks: Map<String, Value>,
}

impl Payload {
    /// Adds a block of records with `stride` bytes each. A trailing incomplete record is omitted.
    pub fn add(&mut self, name: &str, records: &[u8], stride: usize) {
        let (first, count) = (self.bytes.len(), records.len() / stride);
        for column in 0..stride {
            let mut previous = 0;
            for record in 0..count {
                let byte = records[record * stride + column];
                self.bytes.push(byte.wrapping_sub(previous));
                previous = byte;
            }
        }
        self.blocks.insert(name.into(), json!({ "first": first, "count": count, "stride": stride }));
    }

    /// Adds a block of bytes that are compressed already.
    pub fn add_raw(&mut self, name: &str, bytes: &[u8]) {
        self.blocks.insert(name.into(), json!({ "first": self.bytes.len(), "count": bytes.len(), "stride": 0 }));
        self.bytes.extend(bytes);
    }

    /// Returns the position, count of records and stride of each block, by name.
    pub fn list(&self) -> Value {
        Value::Object(self.blocks.clone())
    }

    /// Returns all blocks as base64 of a zlib stream (RFC 1950).
    pub fn base64(&self) -> Result<String> {
        let mut encoder = ZlibEncoder::new(Vec::new(), Compression::best());
        encoder.write_all(&self.bytes).context("the page's data")?;
        let compressed = encoder.finish().context("the page's data")?;
        Ok(base64::engine::general_purpose::STANDARD.encode(compressed))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Read;

    #[test]
    fn blocks_come_back() {
        let mut payload = Payload::default();
        let records: Vec<u8> = (0..60u8).map(|k| k.wrapping_mul(37)).collect();
        payload.add("records", &records, 6);
        payload.add_raw("raw", &[1, 2, 3]);
        let zlib = base64::engine::general_purpose::STANDARD.decode(payload.base64().unwrap()).unwrap();
        let mut bytes = Vec::new();
        flate2::read::ZlibDecoder::new(&zlib[..]).read_to_end(&mut bytes).unwrap();
        let mut found = vec![0; 60];
        for column in 0..6 {
            let mut byte = 0u8;
            for record in 0..10 {
                byte = byte.wrapping_add(bytes[column * 10 + record]);
                found[record * 6 + column] = byte;
            }
        }
        assert_eq!(found, records);
        assert_eq!(bytes[60..], [1, 2, 3]);
        assert_eq!(payload.list()["raw"], json!({ "first": 60, "count": 3, "stride": 0 }));
    }
}
