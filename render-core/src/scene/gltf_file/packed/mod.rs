//! Meshes and buffer views that an extension packs: the document is changed to one that has them plain.
//!
//! Unpacked data becomes buffers after those of the file. Data that cannot be unpacked is no error where the document has a plain
//! copy of it.

#[cfg(feature = "draco")]
mod draco;
#[cfg(feature = "meshopt")]
mod meshopt;
#[cfg(any(feature = "draco", feature = "meshopt"))]
mod parts;
#[cfg(feature = "draco")]
mod primitives;
#[cfg(feature = "meshopt")]
mod views;

use super::stored::StoredBuffers;
use super::{LoadError, Loader};
use serde_json::Value;

impl Loader<'_> {
    /// Unpacks the data that the document uses; returns a note for each packed part in whose place its plain copy is read.
    ///
    /// # Errors
    /// Packed data is damaged, and has no plain copy.
    pub(super) fn unpack(&self, root: &mut Value, stored: &mut StoredBuffers) -> Result<Vec<String>, LoadError> {
        let mut notes = Vec::new();
        #[cfg(feature = "meshopt")]
        self.unpack_views(root, stored, &mut notes)?;
        #[cfg(feature = "draco")]
        self.unpack_primitives(root, stored, &mut notes)?;
        // Without the features there is nothing to do.
        let _ = (root, stored, &mut notes);
        Ok(notes)
    }
}
