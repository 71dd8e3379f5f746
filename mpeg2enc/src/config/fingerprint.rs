//! A hash that distinguishes settings.

use super::Config;
use std::hash::{Hash, Hasher};

impl Config {
    /// Returns a hash of all settings except the quantiser.
    pub(crate) fn fingerprint(&self) -> u64 {
        // Start from the offset basis of 64-bit FNV.
        let mut hash = Fnv(0xcbf2_9ce4_8422_2325);
        Self { quantiser_scale: 0, mean_quantiser_x256: None, raised: None, ..self.clone() }.hash(&mut hash);
        hash.finish()
    }
}

/// FNV-1a hash (Fowler, Noll and Vo), which is equal in every build.
struct Fnv(u64);

impl Hasher for Fnv {
    fn write(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            self.0 = (self.0 ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3);
        }
    }

    fn finish(&self) -> u64 {
        self.0
    }
}
