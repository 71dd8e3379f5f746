//! Conversion of stage states to bytes, for checkpoints. No other file of this crate uses bincode.

use crate::error::{Context, Error, Result};
use serde::Serialize;
use serde::de::DeserializeOwned;

const CONFIG: bincode::config::Configuration = bincode::config::standard();

/// Message for a state that does not belong to this film.
pub const NONSENSE: &str = "the checkpoint is invalid: restart without --resume";

/// Encodes a state as bytes, for [`decode`].
///
/// # Panics
/// If the value cannot be encoded, such as a map of unknown length.
#[must_use]
pub fn encode(value: &impl Serialize) -> Vec<u8> {
    bincode::serde::encode_to_vec(value, CONFIG).expect("states of stages can be encoded")
}

/// Decodes a state from the bytes of [`encode`].
///
/// # Errors
/// If the bytes are not an encoded `T`.
pub fn decode<T: DeserializeOwned>(state: &[u8]) -> Result<T> {
    decode_bytes(state).context(NONSENSE)
}

/// Decodes bytes as [`decode`] does, but with the decoder's error message.
///
/// # Errors
/// If the bytes are not an encoded `T`.
pub fn decode_bytes<T: DeserializeOwned>(bytes: &[u8]) -> Result<T> {
    // Limit the decoded size. The decoder reserves memory for a string by its stated length. Encoding shrinks
    // eight-byte numbers to one byte at best, so decoded data has at most eight times the stored size. Limits must be
    // constants.
    match bytes.len().checked_ilog2() {
        None | Some(0..16) => decode_within::<T, 0x8_0000>(bytes),
        Some(16..24) => decode_within::<T, 0x800_0000>(bytes),
        Some(24..28) => decode_within::<T, 0x8000_0000>(bytes),
        Some(28..32) => decode_within::<T, 0x8_0000_0000>(bytes),
        _ => decode_within::<T, { usize::MAX }>(bytes),
    }
}

fn decode_within<T: DeserializeOwned, const LIMIT: usize>(bytes: &[u8]) -> Result<T> {
    let (value, used) = bincode::serde::decode_from_slice(bytes, CONFIG.with_limit::<LIMIT>()).map_err(Error::other)?;
    if used != bytes.len() {
        return Err(Error::Checkpoint(format!("{} bytes too many", bytes.len() - used)));
    }
    Ok(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_are_no_longer_than_their_file() {
        // Encode a length of 2⁵⁰ bytes in bincode's format.
        let length = [&[253][..], &(1u64 << 50).to_le_bytes()].concat();
        assert!(decode::<String>(&length).is_err());
        assert!(decode::<(u8, Vec<u8>)>(&[&[1], &length[..]].concat()).is_err());
        let numbers = vec![u64::MAX, 1, 0];
        assert_eq!(decode::<Vec<u64>>(&encode(&numbers)).unwrap(), numbers);
        for count in [0, 1000, 0x1_0000, 0x10_0000] {
            // Use numbers that are stored in one byte each, the minimum for eight.
            let numbers = vec![7u64; count];
            assert!(decode::<Vec<u64>>(&encode(&numbers)).unwrap() == numbers, "{count} numbers");
        }
    }
}
