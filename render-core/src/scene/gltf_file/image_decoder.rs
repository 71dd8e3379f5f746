//! Decoder of images to texels, within limits. The data determines the format, not the document.

use super::image_limits::Texels;
#[cfg(feature = "textures")]
use super::image_limits::{SIDE, TEXELS, TEXELS_PER_BYTE, impossible};

/// Decodes an image file.
#[cfg(feature = "textures")]
pub(super) fn decode(bytes: Vec<u8>) -> Result<Texels, String> {
    // Recognize the format by its signature.
    let is_webp = bytes.starts_with(b"RIFF") && bytes.get(8..12) == Some(b"WEBP");
    if bytes.starts_with(b"\xabKTX 20\xbb\r\n\x1a\n") {
        #[cfg(feature = "basis")]
        return super::ktx2::decode(bytes);
        #[cfg(not(feature = "basis"))]
        return Err("this build does not read KTX2; build it with the feature basis".into());
    }
    if is_webp && cfg!(not(feature = "webp")) {
        return Err("this build does not read WebP; build it with the feature webp".into());
    }
    decode_plain(&bytes, is_webp)
}

/// Decodes PNG, JPEG and WebP.
#[cfg(feature = "textures")]
fn decode_plain(bytes: &[u8], is_webp: bool) -> Result<Texels, String> {
    /// Maximum memory for decoding \[bytes\].
    const BYTES: u64 = 1 << 30;
    let length = bytes.len() as u64;
    let open = || image::ImageReader::new(std::io::Cursor::new(bytes)).with_guessed_format();
    // Limit the decoder's memory.
    let mut reader = open().map_err(|error| error.to_string())?;
    let mut limits = image::Limits::default();
    limits.max_image_width = Some(SIDE);
    limits.max_image_height = Some(SIDE);
    limits.max_alloc = Some(BYTES);
    reader.limits(limits);
    // Refuse sizes that the data cannot fill, before the decoder allocates memory.
    let claimed = open().map_err(|error| error.to_string())?.into_dimensions();
    let free = if is_webp { TEXELS } else { 0 };
    if let Some((width, height)) =
        claimed.ok().filter(|&(w, h)| u64::from(w) * u64::from(h) > free.max(TEXELS_PER_BYTE * length))
    {
        return Err(impossible(width, height, length));
    }
    let why = |error: image::ImageError| super::document::one_line(&error.to_string());
    let decoded = reader.decode().map_err(|error| format!("{}; {} are read", why(error), READ))?;
    let pixels = decoded.into_rgba8();
    let texels = pixels.pixels().map(|pixel| pixel.0).collect();
    Ok((pixels.width() as usize, pixels.height() as usize, texels))
}

/// Formats that this build reads.
#[cfg(feature = "textures")]
const READ: &str = match (cfg!(feature = "webp"), cfg!(feature = "basis")) {
    (true, true) => "PNG, JPEG, WebP and KTX2",
    (true, false) => "PNG, JPEG and WebP",
    (false, true) => "PNG, JPEG and KTX2",
    (false, false) => "PNG and JPEG",
};

/// Returns an error: a picture without the texture would look correct despite the wrong color.
#[cfg(not(feature = "textures"))]
pub(super) fn decode(_: Vec<u8>) -> Result<Texels, String> {
    Err("this build does not read images on surfaces; build it with the feature textures".into())
}
