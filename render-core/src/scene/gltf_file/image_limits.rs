//! Limits on image sizes, checked before memory is allocated.

/// Width, height, and R′G′B′ with opacity in raster order.
pub(super) type Texels = (usize, usize, Vec<[u8; 4]>);

/// Maximum side of a texture \[texels\].
#[cfg(feature = "textures")]
pub(super) const SIDE: u32 = 16384;
/// Maximum number of texels per byte that a file may claim: deflate's limit of 1032 to 1, at eight texels per byte.
/// Decoders allocate memory for the size in the header before they detect missing data.
#[cfg(feature = "textures")]
pub(super) const TEXELS_PER_BYTE: u64 = 8256;
/// Number of texels that any WebP or KTX2 file may claim: an image of one color has almost no data.
#[cfg(feature = "textures")]
pub(super) const TEXELS: u64 = 1 << 24;

/// Refuses sizes above the limit, and sizes that a file of `length` bytes cannot contain.
#[cfg(feature = "basis")]
pub(super) fn check_claim(width: u32, height: u32, length: usize) -> Result<(), String> {
    if width.max(height) > SIDE {
        return Err(format!("{width}x{height} texels; at most {SIDE} per side are allowed"));
    }
    if u64::from(width) * u64::from(height) > TEXELS.max(TEXELS_PER_BYTE * length as u64) {
        return Err(impossible(width, height, length as u64));
    }
    Ok(())
}

/// Returns the message for a size that a file cannot have.
#[cfg(feature = "textures")]
pub(super) fn impossible(width: u32, height: u32, length: u64) -> String {
    format!("{width}x{height} texels in {length} bytes are impossible; copy the file again")
}
