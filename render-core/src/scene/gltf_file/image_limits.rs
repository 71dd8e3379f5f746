//! Sizes that images may have, before memory is taken for them.

/// Width, height, and R′G′B′ with opacity in raster order.
pub(super) type Texels = (usize, usize, Vec<[u8; 4]>);

/// Largest side of a texture.
#[cfg(feature = "textures")]
pub(super) const SIDE: u32 = 16384;
/// Most texels that a file of some bytes may claim: deflate's limit, 1032 to 1, at eight texels a byte. Memory is taken for
/// the size in the header, before it shows that the rest is missing.
#[cfg(feature = "textures")]
pub(super) const TEXELS_PER_BYTE: u64 = 8256;
/// Texels that any file of WebP and KTX2 may claim: an image of one color takes no bytes.
#[cfg(feature = "textures")]
pub(super) const TEXELS: u64 = 1 << 24;

/// Refuses sizes that are too large, or too large for a file of `length` bytes.
#[cfg(feature = "basis")]
pub(super) fn check_claim(width: u32, height: u32, length: usize) -> Result<(), String> {
    if width.max(height) > SIDE {
        return Err(format!("{width}x{height} texels; {SIDE} along a side are the most"));
    }
    if u64::from(width) * u64::from(height) > TEXELS.max(TEXELS_PER_BYTE * length as u64) {
        return Err(impossible(width, height, length as u64));
    }
    Ok(())
}

/// The line on a size that a file cannot have.
#[cfg(feature = "textures")]
pub(super) fn impossible(width: u32, height: u32, length: u64) -> String {
    format!("{width}x{height} texels in {length} bytes cannot be; copy the file again")
}
