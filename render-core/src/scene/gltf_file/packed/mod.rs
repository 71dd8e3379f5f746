//! Unpacking of meshes and buffer views packed by extensions. Afterwards, the document refers to plain data.
//!
//! Unpacked data becomes buffers after the file's own buffers. If data cannot be unpacked but has a plain copy, a note
//! replaces the error.

#[cfg(feature = "draco")]
mod draco;
#[cfg(feature = "meshopt")]
mod meshopt;
#[cfg(feature = "draco")]
mod primitives;
#[cfg(any(feature = "draco", feature = "meshopt"))]
mod raw;
#[cfg(feature = "meshopt")]
mod views;

use super::stored::StoredBuffers;
use super::{LoadError, Loader};
use serde_json::Value;

impl Loader<'_> {
    /// Unpacks the data that the document uses. Returns a note for each item replaced by its plain copy.
    ///
    /// # Errors
    /// Packed data is damaged and has no plain copy.
    pub(super) fn unpack(&self, root: &mut Value, stored: &mut StoredBuffers) -> Result<Vec<String>, LoadError> {
        let mut notes = Vec::new();
        #[cfg(feature = "meshopt")]
        self.unpack_views(root, stored, &mut notes)?;
        #[cfg(feature = "draco")]
        self.unpack_primitives(root, stored, &mut notes)?;
        // Without the features, the arguments are unused.
        let _ = (root, stored, &mut notes);
        Ok(notes)
    }
}
