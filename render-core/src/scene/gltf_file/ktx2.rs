//! KTX2 images, as `KHR_texture_basisu` allows them: ETC1S with BasisLZ, or UASTC with or without Zstandard.

use super::guarded;
use super::image_limits::{Texels, check_claim};
use basisu::{DecodeFlags, TargetFormat, Transcoder};

/// Position of the format in the file (KTX 2.0, 3: "File structure").
const FORMAT: usize = 12;
/// Position of the width in the file.
const WIDTH: usize = 20;
/// Position of the height in the file.
const HEIGHT: usize = 24;
/// Position of the depth in the file.
const DEPTH: usize = 28;
/// Position of the number of layers in the file.
const LAYERS: usize = 32;
/// Position of the number of faces in the file.
const FACES: usize = 36;
/// Position of the number of levels in the file.
const LEVELS: usize = 40;
/// Position of the supercompression scheme in the file.
const SUPERCOMPRESSION: usize = 44;
/// Position of the data format descriptor's offset in the file.
const DESCRIPTOR: usize = 48;
/// Position of the offset and length of keys and values, 4 bytes each.
const KEYS: std::ops::Range<usize> = 56..64;
/// Position of the offset and length of the tables that all levels share, 8 bytes each.
const GLOBAL: usize = 64;
/// Position of the first level's offset, length and unpacked length, 8 bytes each.
const LEVEL: usize = 80;
/// Size of the header with the index of one level \[bytes\].
const HEADER: usize = 104;
/// Color model of ETC1S in the data format descriptor (Khronos Data Format 1.4, 5.6).
const ETC1S: u32 = 163;
/// Color model of UASTC in the data format descriptor.
const UASTC: u32 = 166;
/// Side of a block \[texels\].
const BLOCK: u32 = 4;
/// Size of a UASTC block \[bytes\].
const BLOCK_BYTES: u64 = 16;

/// Decodes the largest level. The texture computes the smaller levels from it.
pub(super) fn decode(mut bytes: Vec<u8>) -> Result<Texels, String> {
    let [width, height] = checked_size(&bytes)?;
    // Keys do not affect texels, and their positions are unchecked.
    bytes[KEYS].fill(0);
    let decoded = guarded(|| {
        let image = Transcoder::new(&bytes).ok()?;
        image.transcode(0, TargetFormat::Rgba32, DecodeFlags::NONE).ok()
    });
    let (size, texels) = (width as usize * height as usize, decoded.flatten().unwrap_or_default());
    if texels.len() != 4 * size {
        return Err("its KTX2 data is damaged; export it again".into());
    }
    Ok((width as usize, height as usize, texels.as_chunks().0.to_vec()))
}

/// Checks the header and the size in it before memory is allocated. Returns the size.
fn checked_size(bytes: &[u8]) -> Result<[u32; 2], String> {
    if bytes.len() < HEADER {
        return Err("its KTX2 header is truncated; copy it again".into());
    }
    let word = |at: usize| bytes.get(at..at + 4).map_or(0, |b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]));
    let long = |at: usize| u64::from(word(at)) | (u64::from(word(at + 4)) << 32);
    // Accept a single image: no volume, array or cube map.
    let (width, height) = (word(WIDTH), word(HEIGHT));
    if word(DEPTH) > 0 || word(LAYERS) > 0 || word(FACES) != 1 || word(LEVELS) == 0 {
        return Err("its KTX2 data is not a single image; export it as one".into());
    }
    // Accept the combinations of color model and supercompression that glTF allows.
    let (model, packing) = (word((word(DESCRIPTOR) as usize).saturating_add(12)) & 255, word(SUPERCOMPRESSION));
    if word(FORMAT) != 0 || ![(ETC1S, 1), (UASTC, 0), (UASTC, 2)].contains(&(model, packing)) {
        return Err("its KTX2 data is neither ETC1S nor UASTC; export it as one of them".into());
    }
    // Check that the shared tables and the first level lie inside the file.
    for place in [GLOBAL, LEVEL] {
        if long(place).checked_add(long(place + 8)).is_none_or(|end| end > bytes.len() as u64) {
            return Err("its KTX2 data is truncated; copy it again".into());
        }
    }
    // Check the size, and the unpacked size of Zstandard data.
    check_claim(width, height, bytes.len())?;
    let blocks = u64::from(width.div_ceil(BLOCK)) * u64::from(height.div_ceil(BLOCK));
    if packing == 2 && long(LEVEL + 16) != blocks * BLOCK_BYTES {
        return Err("its KTX2 data does not unpack to the size of the image; export it again".into());
    }
    Ok([width, height])
}
