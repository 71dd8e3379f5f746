//! Decoded macroblocks of a picture.

/// Record of the decoded macroblocks of a picture, and of their motion.
#[derive(Default)]
pub(crate) struct MacroblockRecord {
    /// Forward vector of each macroblock, or `None` if the macroblock was not decoded.
    vectors: Vec<Option<[i16; 2]>>,
    /// Slices that ended with an error.
    pub damaged_slices: u32,
}

impl MacroblockRecord {
    /// Starts a picture of `count` macroblocks.
    pub fn start(&mut self, count: usize) {
        self.vectors.clear();
        self.vectors.resize(count, None);
        self.damaged_slices = 0;
    }

    /// Registers a macroblock with its forward vector.
    #[inline]
    pub fn set(&mut self, address: usize, vector: [i32; 2]) {
        if let Some(entry) = self.vectors.get_mut(address) {
            *entry = Some(vector.map(|v| v as i16));
        }
    }

    /// Returns the forward vector of a macroblock, or `None` if the macroblock was not decoded.
    pub fn vector(&self, address: usize) -> Option<[i32; 2]> {
        self.vectors.get(address).copied().flatten().map(|vector| vector.map(i32::from))
    }

    /// Returns the number of macroblocks of the picture.
    pub fn len(&self) -> usize {
        self.vectors.len()
    }
}
