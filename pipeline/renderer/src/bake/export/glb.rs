//! Packing of a document into a single file: one buffer with all bytes, including images.

use super::document::Document;
use pipeline::error::{Error, Result};
use serde_json::json;
use std::path::Path;

/// Type of the JSON chunk of a .glb file (glTF 2.0, 4.4.3).
const JSON: [u8; 4] = *b"JSON";
/// Type of the binary chunk of a .glb file (glTF 2.0, 4.4.3).
const BINARY: [u8; 4] = *b"BIN\0";
/// Number of bytes before the first chunk.
const HEADER: usize = 12;
/// Number of header bytes of each chunk.
const CHUNK_HEADER: usize = 8;

/// Moves images from other files or data URIs into the buffers.
pub(super) fn take_images_in(document: &mut Document) -> Result<()> {
    for index in 0..document.list("images").len() {
        let Some(uri) = document.list("images")[index]["uri"].as_str().map(str::to_owned) else { continue };
        let bytes = document.resource(&format!("image {index}"), &uri)?;
        // Recognize the format by its content: a URI need not have an extension.
        let kind = kind(&bytes)
            .ok_or_else(|| document.damaged(&format!("image {index}, not a PNG, JPEG, WebP or KTX2 file,")))?;
        let view = document.add_view(bytes);
        let mut image = document.list("images")[index].clone();
        if let Some(fields) = image.as_object_mut() {
            fields.remove("uri");
            fields.insert("bufferView".into(), json!(view));
            fields.insert("mimeType".into(), json!(kind));
        }
        document.json["images"][index] = image;
    }
    Ok(())
}

/// Returns the media type of an image, recognized by its first bytes.
pub(in crate::bake) fn kind(bytes: &[u8]) -> Option<&'static str> {
    match bytes {
        [0x89, b'P', b'N', b'G', ..] => Some("image/png"),
        [0xff, 0xd8, 0xff, ..] => Some("image/jpeg"),
        [b'R', b'I', b'F', b'F', ..] => Some("image/webp"),
        [0xab, b'K', b'T', b'X', ..] => Some("image/ktx2"),
        _ => None,
    }
}

/// Returns the bytes of the .glb file; `path` is only used in the error message.
pub(super) fn packed(mut document: Document, path: &Path) -> Result<Vec<u8>> {
    // Join the views in order, each aligned to four bytes.
    let mut binary = Vec::new();
    for index in 0..document.list("bufferViews").len() {
        let Some(bytes) = document.view(index) else { return Err(document.damaged(&format!("buffer view {index}"))) };
        let first = binary.len();
        binary.extend(bytes);
        binary.resize(binary.len().next_multiple_of(4), 0);
        let view = &mut document.json["bufferViews"][index];
        (view["buffer"], view["byteOffset"]) = (json!(0), json!(first));
    }

    // Pad the JSON text to four bytes, too (glTF 2.0, 4.4.3).
    document.json["buffers"] = json!([{ "byteLength": binary.len() }]);
    document.json["asset"]["generator"] = json!(concat!("render2mpeg ", env!("CARGO_PKG_VERSION")));
    let mut text = document.json.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');

    // Write the chunks: the JSON text, then the binary buffer.
    let length = HEADER + 2 * CHUNK_HEADER + text.len() + binary.len();
    let Ok(length) = u32::try_from(length) else {
        let problem = format!(
            " would have {length} bytes, but a .glb file is limited to less than 2³²: choose a smaller --texture"
        );
        return Err(Error::content(path, problem));
    };
    let mut file = Vec::with_capacity(length as usize);
    file.extend(*b"glTF");
    file.extend(2u32.to_le_bytes());
    file.extend(length.to_le_bytes());
    for (kind, chunk) in [(JSON, &text), (BINARY, &binary)] {
        file.extend((chunk.len() as u32).to_le_bytes());
        file.extend(kind);
        file.extend(chunk);
    }
    Ok(file)
}
