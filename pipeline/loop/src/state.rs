//! The state of a part as bytes, for checkpoints. No other file of this crate names bincode.

use crate::error::{Context, Error, Result};
use serde::Serialize;
use serde::de::DeserializeOwned;

const CONFIG: bincode::config::Configuration = bincode::config::standard();

/// The message about states that no part of this film left.
pub const NONSENSE: &str = "the checkpoint makes no sense: start anew, without --resume";

/// A state as bytes, for [`decode`].
///
/// # Panics
/// The value cannot be stored, as a map whose keys are unknown.
#[must_use]
pub fn encode(value: &impl Serialize) -> Vec<u8> {
    bincode::serde::encode_to_vec(value, CONFIG).expect("what stages carry can be encoded")
}

/// Decodes a state from the bytes of [`encode`].
///
/// # Errors
/// The bytes are of something else.
pub fn decode<T: DeserializeOwned>(state: &[u8]) -> Result<T> {
    decode_bytes(state).context(NONSENSE)
}

/// As [`decode`]; the message is that of the bytes alone.
///
/// # Errors
/// The bytes are of something else.
pub fn decode_bytes<T: DeserializeOwned>(bytes: &[u8]) -> Result<T> {
    // For texts memory is reserved as long as they are said to be. Numbers of eight bytes may be stored as one, so what is
    // decoded is at most eight times as large as what is stored; limits can only be constants.
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
        // A length of 2⁵⁰ bytes, as bincode writes it.
        let length = [&[253][..], &(1u64 << 50).to_le_bytes()].concat();
        assert!(decode::<String>(&length).is_err());
        assert!(decode::<(u8, Vec<u8>)>(&[&[1], &length[..]].concat()).is_err());
        let numbers = vec![u64::MAX, 1, 0];
        assert_eq!(decode::<Vec<u64>>(&encode(&numbers)).unwrap(), numbers);
        for count in [0, 1000, 0x1_0000, 0x10_0000] {
            // Every number takes a byte, the least that eight can.
            let numbers = vec![7u64; count];
            assert!(decode::<Vec<u64>>(&encode(&numbers)).unwrap() == numbers, "{count} numbers");
        }
    }
}
