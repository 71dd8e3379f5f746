//! Parser of documents and reader of their buffers.

use super::accessor::Buffers;
use super::stored::StoredBuffers;
use super::{LoadError, Loader, extensions, lenient};
use gltf::json;
use serde_json::Value;
use std::collections::HashSet;
use std::path::Path;

/// Document with its buffers.
pub(super) struct Parsed {
    pub document: gltf::Document,
    pub buffers: Buffers,
    /// Content that the `gltf` crate does not read.
    pub found: lenient::Normalized,
}

impl Loader<'_> {
    /// Parses and validates a document. Required extensions are checked first: the crate refuses some that this loader
    /// reads, without naming them.
    pub(super) fn document(&self, bytes: &[u8]) -> Result<Parsed, LoadError> {
        // Refuse other formats by their first byte, and split binary files.
        let first = bytes.trim_ascii_start().first();
        if first.is_some_and(|&first| first != b'{') && !bytes.starts_with(b"glTF") {
            return self.bad("this is not a glTF file; scenes are .glb or .gltf files exported by modeling programs");
        }
        let (text, blob) = self.split(bytes)?;
        let mut value: Value = serde_json::from_slice(text).or_else(|error| {
            self.bad(format!("not a complete glTF file ({}); export or copy it again", one_line(&error.to_string())))
        })?;

        // Convert the JSON to the form that the crate accepts.
        let mut stored = StoredBuffers::new(self, blob);
        let notes = self.unpack(&mut value, &mut stored)?;
        let mut found = lenient::normalize(&mut value, bytes.starts_with(b"glTF")).or_else(|why| self.bad(why))?;
        found.notes.extend(notes);
        let mut root: json::Root = serde_json::from_value(value).or_else(|error| {
            self.bad(format!("its JSON does not follow glTF 2.0 ({}); export it again", one_line(&error.to_string())))
        })?;

        // Refuse required extensions that this build does not read. The error names the extension.
        if let Some(extension) = root.extensions_required.iter().find(|name| !extensions::may_be_required(name)) {
            if let Some(feature) = extensions::missing_feature(extension) {
                return self.bad(format!(
                    "needs the glTF extension {extension}, which this build does not read; build it with the feature {feature}"
                ));
            }
            return Err(LoadError::Unsupported { path: self.path.into(), extension: extension.clone() });
        }
        root.extensions_required.clear();
        // An accessor without view and sparse data is all zeros. The crate requires a view, so use an arbitrary one.
        let mut zeros = HashSet::new();
        let any_view = (!root.buffer_views.is_empty()).then(|| json::Index::new(0));
        for (index, accessor) in root.accessors.iter_mut().enumerate() {
            if accessor.buffer_view.is_none() && accessor.sparse.is_none() {
                accessor.buffer_view = any_view;
                zeros.insert(index);
            }
        }

        // Validate the document, then read the buffers in use.
        self.check_document(&root)?;
        let document = gltf::Document::from_json(root)
            .or_else(|error| self.bad(one_line(&error.to_string()).trim_end_matches(';')))?;
        for buffer in document.buffers().filter(|buffer| found.used_buffers.contains(&buffer.index())) {
            let uri = match buffer.source() {
                gltf::buffer::Source::Bin => None,
                gltf::buffer::Source::Uri(uri) => Some(uri),
            };
            stored.read(buffer.index(), uri, buffer.length())?;
        }
        let (bytes, allowance) = stored.into_parts(document.buffers().len());
        Ok(Parsed { document, buffers: Buffers::new(bytes, zeros, allowance), found })
    }

    /// Reads a `data:` URI or a file next to the scene.
    pub(super) fn resource(&self, what: &str, uri: &str) -> Result<Vec<u8>, LoadError> {
        // Shorten long URIs in messages.
        let shown =
            if uri.len() > 80 { format!("{}…", uri.chars().take(40).collect::<String>()) } else { uri.into() };
        let fail = |why: &str| LoadError::Resource {
            path: self.path.into(),
            what: what.into(),
            uri: shown.clone(),
            why: why.into(),
        };
        // Decode embedded data.
        if let Some(data) = uri.strip_prefix("data:") {
            let encoded = data.split_once(";base64,").ok_or_else(|| fail("only base64 data is read"))?.1;
            return decode_base64(encoded).ok_or_else(|| fail("invalid base64 data"));
        }
        // Refuse network addresses.
        if uri.contains("://") {
            return Err(fail("it is outside the scene's folder"));
        }
        // Some exporters write Windows' separators, which URIs never contain (RFC 3986, 2). A file with exactly this
        // name takes precedence.
        let name = decode_percent(uri);
        let read = self.files.read_named(Path::new(&name));
        match read {
            Err(_) if name.contains('\\') => self.files.read_named(Path::new(&name.replace('\\', "/"))),
            read => read,
        }
        .map_err(|why| fail(&why))
    }
}

pub(super) fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Decodes percent-encoding, such as `%20`, in relative URIs (RFC 3986, 2.1).
fn decode_percent(uri: &str) -> String {
    let bytes = uri.as_bytes();
    let mut out = Vec::with_capacity(bytes.len());
    let mut i = 0;
    while i < bytes.len() {
        // Keep invalid escapes unchanged.
        let digits = (bytes[i] == b'%').then(|| uri.get(i + 1..i + 3)).flatten();
        match digits.and_then(|d| u8::from_str_radix(d, 16).ok()) {
            Some(byte) => {
                out.push(byte);
                i += 3;
            }
            None => {
                out.push(bytes[i]);
                i += 1;
            }
        }
    }
    String::from_utf8_lossy(&out).into_owned()
}

/// Decodes base64 (RFC 4648, 4). Returns `None` if a character is outside the alphabet.
fn decode_base64(text: &str) -> Option<Vec<u8>> {
    let mut out = Vec::with_capacity(text.len() / 4 * 3);
    let (mut bits, mut count) = (0u32, 0u32);
    for c in text.bytes().filter(|c| *c != b'=') {
        let value = match c {
            b'A'..=b'Z' => c - b'A',
            b'a'..=b'z' => c - b'a' + 26,
            b'0'..=b'9' => c - b'0' + 52,
            b'+' => 62,
            b'/' => 63,
            _ => return None,
        };
        // Collect six bits per character, and output complete bytes.
        bits = (bits << 6) | u32::from(value);
        count += 6;
        if count >= 8 {
            count -= 8;
            out.push((bits >> count) as u8);
        }
    }
    Some(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_are_decoded() {
        assert_eq!(decode_percent("Box%20With%20Spaces.bin"), "Box With Spaces.bin");
        assert_eq!(decode_percent("100%.png"), "100%.png");
        assert_eq!(decode_base64("aGVsbG8=").unwrap(), b"hello");
        assert!(decode_base64("a*b").is_none());
    }
}
