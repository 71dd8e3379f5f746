//! PNG and JPEG into texels, within limits.

/// Width, height, and R′G′B′ with opacity in raster order.
type Texels = (usize, usize, Vec<[u8; 4]>);

/// Decodes what `bytes` are a file of.
#[cfg(feature = "textures")]
pub(super) fn decode(bytes: Vec<u8>) -> Result<Texels, String> {
    /// Largest side of a texture, and the most memory that decoding one may take.
    const SIDE: u32 = 16384;
    const BYTES: u64 = 1 << 30;
    /// Most texels that a file of some bytes may claim: deflate's limit, 1032 to 1, at eight texels a byte. Memory is taken for
    /// what the header says, before it shows that the rest is missing.
    const TEXELS_PER_BYTE: u64 = 8256;
    let length = bytes.len() as u64;
    let open = || image::ImageReader::new(std::io::Cursor::new(&bytes)).with_guessed_format();
    let mut reader = open().map_err(|error| error.to_string())?;
    let mut limits = image::Limits::default();
    limits.max_image_width = Some(SIDE);
    limits.max_image_height = Some(SIDE);
    limits.max_alloc = Some(BYTES);
    reader.limits(limits);
    let claimed = open().map_err(|error| error.to_string())?.into_dimensions();
    if let Some((width, height)) = claimed.ok().filter(|&(w, h)| u64::from(w) * u64::from(h) > TEXELS_PER_BYTE * length)
    {
        return Err(format!("{width}x{height} texels in {length} bytes cannot be; copy the file again"));
    }
    let why = |error: image::ImageError| super::document::one_line(&error.to_string());
    let pixels = reader.decode().map_err(|error| format!("{}; PNG and JPEG are read", why(error)))?.into_rgba8();
    let texels = pixels.pixels().map(|pixel| pixel.0).collect();
    Ok((pixels.width() as usize, pixels.height() as usize, texels))
}

/// A picture with a surface in a wrong color would look as if it were right.
#[cfg(not(feature = "textures"))]
pub(super) fn decode(_: Vec<u8>) -> Result<Texels, String> {
    Err("this build reads no images on surfaces; build it with the feature textures".into())
}
