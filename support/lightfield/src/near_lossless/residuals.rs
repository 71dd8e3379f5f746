//! Codes of one tile as residuals of a prediction, with an error of at most δ.
//!
//! ```text
//! x̂ = MED(W, N, NW)                        prediction from decoded neighbors, same direction and channel [Weinberger00]
//! MED = min(W, N) if NW ≥ max(W, N);  max(W, N) if NW ≤ min(W, N);  otherwise W + N − NW
//! e = x − x̂,   k = sign(e) ⌊(|e| + δ) / (2δ + 1)⌋
//! y = clamp(x̂ + k (2δ + 1))                 decoded
//! ```
//!
//! |x − y| ≤ δ, because k (2δ + 1) is the multiple of 2δ + 1 nearest to e. Clamping moves y towards the range that
//! contains x. With δ = 0, k is counted modulo the number of codes, and y = x.
//!
//! In the first row the prediction is W, in the first column N. The prediction of the first texel is its own decoded
//! value in the previous direction, or 0. The value of an absent texel is its prediction.
//!
//! # Differences from the paper
//!
//! The coder has no contexts, bias correction, Golomb codes or run mode. Residuals go to a general-purpose
//! compressor.

use crate::tiles::{Mask, TILE_SIDE, TILE_SLOTS, is_set};

/// Type of sample codes, with values from 0 to [`Code::MOST`].
pub(crate) trait Code: Copy + Default + Into<i32> {
    /// The largest code.
    const MOST: i32;
    /// Number of bytes of a residual.
    const BYTES: usize;
    /// Converts a value from 0 to [`Code::MOST`] to a code.
    fn of(value: i32) -> Self;
    /// Maps `k` to the residue nearest to zero, modulo the number of codes.
    fn around_zero(k: i32) -> i32;
}

impl Code for u8 {
    const MOST: i32 = 0xff;
    const BYTES: usize = 1;

    fn of(value: i32) -> Self {
        value as Self
    }

    fn around_zero(k: i32) -> i32 {
        i32::from(k as i8)
    }
}

impl Code for u16 {
    const MOST: i32 = 0xffff;
    const BYTES: usize = 2;

    fn of(value: i32) -> Self {
        value as Self
    }

    fn around_zero(k: i32) -> i32 {
        i32::from(k as i16)
    }
}

/// Returns the prediction of the median edge detector [Weinberger00].
#[inline]
fn median_edge(west: i32, north: i32, northwest: i32) -> i32 {
    let (low, high) = (west.min(north), west.max(north));
    if northwest >= high {
        low
    } else if northwest <= low {
        high
    } else {
        west + north - northwest
    }
}

/// Visits the codes of a tile in storage order: by direction, then channel, then texel. `decoded` receives the index
/// of a code in the tile (by rank, direction, channel) and its prediction, and returns the decoded code.
fn walk(mask: &Mask, directions: usize, mut decoded: impl FnMut(usize, i32) -> i32) {
    let present: [bool; TILE_SLOTS] = std::array::from_fn(|bit| is_set(mask, bit));
    let mut first = [0; 3];
    for direction in 0..directions {
        for (channel, first) in first.iter_mut().enumerate() {
            let mut plane = [0; TILE_SLOTS];
            let mut place = direction * 3 + channel;
            for slot in 0..TILE_SLOTS {
                // Replace missing neighbors by existing neighbors.
                let predicted = match (slot % TILE_SIDE, slot / TILE_SIDE) {
                    (0, 0) => *first,
                    (_, 0) => plane[slot - 1],
                    (0, _) => plane[slot - TILE_SIDE],
                    _ => median_edge(plane[slot - 1], plane[slot - TILE_SIDE], plane[slot - TILE_SIDE - 1]),
                };
                plane[slot] = predicted;
                if present[slot] {
                    plane[slot] = decoded(place, predicted);
                    place += directions * 3;
                }
            }
            // Predict the first texel of the next direction from this direction.
            *first = plane[0];
        }
    }
}

/// Returns the decoded code for a prediction and a quantized residual. It is in the valid range for any 16-bit `k`.
#[inline]
fn reconstruct<C: Code>(predicted: i32, k: i32, delta: i32) -> i32 {
    if delta == 0 { (predicted + k) & C::MOST } else { (predicted + k * (2 * delta + 1)).clamp(0, C::MOST) }
}

/// Returns the residuals of the codes of a tile. `codes` are ordered by the texel's rank, then direction, then channel.
///
/// The lowest bit contains the sign, so that small residuals are small numbers. For 16-bit codes, all low bytes
/// precede all high bytes.
pub(crate) fn encode<C: Code>(codes: &[C], mask: &Mask, directions: usize, delta: u16) -> Vec<u8> {
    let delta = i32::from(delta);
    let step = 2 * delta + 1;
    let mut residuals = vec![0; codes.len() * C::BYTES];
    let mut count = 0;
    walk(mask, directions, |place, predicted| {
        let code: i32 = codes[place].into();
        let e = code - predicted;
        // Quantize the residual, and move its sign to the lowest bit.
        let k = C::around_zero(e.signum() * ((e.abs() + delta) / step));
        let folded = (k << 1) ^ (k >> 31);
        for byte in 0..C::BYTES {
            residuals[count + byte * codes.len()] = (folded >> (8 * byte)) as u8;
        }
        count += 1;
        reconstruct::<C>(predicted, k, delta)
    });
    residuals
}

/// Returns the codes of residuals from [`encode`]. Accepts any bytes of the right length.
pub(crate) fn decode<C: Code>(residuals: &[u8], mask: &Mask, directions: usize, delta: u16) -> Vec<C> {
    let delta = i32::from(delta);
    let codes = residuals.len() / C::BYTES;
    let mut found = vec![C::default(); codes];
    let mut count = 0;
    walk(mask, directions, |place, predicted| {
        let mut folded = 0;
        for byte in 0..C::BYTES {
            folded |= i32::from(residuals[count + byte * codes]) << (8 * byte);
        }
        count += 1;
        // Restore the sign from the lowest bit.
        let k = (folded >> 1) ^ -(folded & 1);
        let code = reconstruct::<C>(predicted, k, delta);
        found[place] = C::of(code);
        code
    });
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The prediction equals the median of W, N and W + N − NW.
    #[test]
    fn the_edge_detector_is_a_median() {
        for (west, north, northwest) in (0..12 * 12 * 12).map(|k| (k % 12, k / 12 % 12, k / 144)) {
            let mut three = [west, north, west + north - northwest];
            three.sort_unstable();
            assert_eq!(median_edge(west, north, northwest), three[1]);
        }
    }

    /// The test covers every 8-bit code, prediction and limit.
    #[test]
    fn every_code_is_decoded_within_delta() {
        for delta in 0..=255 {
            for predicted in 0..=255 {
                for code in 0..=255 {
                    let e: i32 = code - predicted;
                    let k = u8::around_zero(e.signum() * ((e.abs() + delta) / (2 * delta + 1)));
                    assert!(delta == 0 || (-128..128).contains(&k));
                    let found = reconstruct::<u8>(predicted, k, delta);
                    assert!((found - code).abs() <= delta, "{code}, {predicted}, {delta}: {found}");
                }
            }
        }
    }
}
