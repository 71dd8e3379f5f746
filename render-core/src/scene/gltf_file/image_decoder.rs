//! PNG and JPEG into texels, within limits.

/// Width, height, and R′G′B′ with opacity in raster order.
type Texels = (usize, usize, Vec<[u8; 4]>);

/// Decodes what `bytes` are a file of.
#[cfg(feature = "textures")]
pub(super) fn decode(bytes: Vec<u8>) -> Result<Texels, String> {
    /// Largest side of a texture, and the most memory that decoding one may take.
    const SIDE: u32 = 16384;
    const BYTES: u64 = 1 << 30;
    let file = image::ImageReader::new(std::io::Cursor::new(bytes)).with_guessed_format();
    let mut reader = file.map_err(|error| error.to_string())?;
    let mut limits = image::Limits::default();
    limits.max_image_width = Some(SIDE);
    limits.max_image_height = Some(SIDE);
    limits.max_alloc = Some(BYTES);
    reader.limits(limits);
    let why = |error: image::ImageError| super::document::one_line(&error.to_string());
    let pixels = reader.decode().map_err(|error| format!("{}; PNG and JPEG are read", why(error)))?.into_rgba8();
    let texels = pixels.pixels().map(|pixel| pixel.0).collect();
    Ok((pixels.width() as usize, pixels.height() as usize, texels))
}

/// A picture with a surface in a wrong colour would look as if it were right.
#[cfg(not(feature = "textures"))]
pub(super) fn decode(_: Vec<u8>) -> Result<Texels, String> {
    Err("this build reads no images on surfaces; build it with the feature textures".into())
}
