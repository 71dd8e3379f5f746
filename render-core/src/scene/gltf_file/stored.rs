//! Buffers, read on first use, and the memory that a document may allocate.

use super::{LoadError, Loader};
use std::cell::Cell;

/// Limits on the memory that a document may allocate: a number of bytes, plus a multiple of the bytes in its buffers.
/// Many accessors may refer to the same bytes, and packed data is smaller than its contents.
const ALLOWANCE: (usize, usize) = (1 << 28, 256);

/// Memory that a document may still allocate \[bytes\]; `None` after a request exceeded it.
pub(super) struct Allowance(Cell<Option<usize>>);

impl Allowance {
    /// Returns whether a request exceeded the memory allowed for a file of this size.
    pub fn is_exhausted(&self) -> bool {
        self.0.get().is_none()
    }

    /// Subtracts `bytes` from the allowance. Returns `None` if the allowance is exhausted.
    pub fn charge(&self, bytes: usize) -> Option<()> {
        let left = self.0.get().and_then(|left| left.checked_sub(bytes));
        self.0.set(left);
        left.map(|_| ())
    }

    /// Returns the remaining allowance \[bytes\].
    #[cfg(feature = "draco")]
    pub fn left(&self) -> usize {
        self.0.get().unwrap_or(0)
    }

    fn extend(&self, file_bytes: usize) {
        self.0.set(self.0.get().map(|left| left.saturating_add(file_bytes.saturating_mul(ALLOWANCE.1))));
    }
}

/// Buffers of a document.
pub(super) struct StoredBuffers<'a> {
    loader: &'a Loader<'a>,
    /// Binary chunk of the file, until a buffer takes ownership of it.
    blob: Option<&'a [u8]>,
    held: Vec<Option<Vec<u8>>>,
    pub allowance: Allowance,
}

impl<'a> StoredBuffers<'a> {
    /// Builds the buffers without reading any.
    pub fn new(loader: &'a Loader<'a>, blob: Option<&'a [u8]>) -> Self {
        Self { loader, blob, held: Vec::new(), allowance: Allowance(Cell::new(Some(ALLOWANCE.0))) }
    }

    /// Returns the buffer at `index`, which must have at least `length` bytes. Without `uri`, the buffer is the file's
    /// binary chunk.
    pub fn read(&mut self, index: usize, uri: Option<&str>, length: usize) -> Result<&[u8], LoadError> {
        if self.held.len() <= index {
            self.held.resize(index + 1, None);
        }
        if self.held[index].is_none() {
            // Read the buffer from its URI. The first buffer without URI is the binary chunk.
            let what = format!("buffer {index}");
            let data = match (uri, self.blob) {
                (Some(uri), _) => self.loader.resource(&what, uri)?,
                (None, Some(data)) => {
                    self.blob = None;
                    data.to_vec()
                }
                (None, None) => {
                    return self.loader.bad(format!("{what}: the file has no binary part; export it again"));
                }
            };
            // Refuse truncated files, then raise the allowance by the bytes read.
            if data.len() < length {
                return self
                    .loader
                    .bad(format!("{what} has {} of {length} bytes: the file is truncated; copy it again", data.len()));
            }
            self.allowance.extend(data.len());
            self.held[index] = Some(data);
        }
        Ok(self.held[index].as_deref().unwrap_or_default())
    }

    /// Adds a buffer of unpacked data.
    #[cfg(any(feature = "draco", feature = "meshopt"))]
    pub fn put(&mut self, index: usize, data: Vec<u8>) {
        if self.held.len() <= index {
            self.held.resize(index + 1, None);
        }
        self.held[index] = Some(data);
    }

    /// Returns whether the file has a binary chunk.
    #[cfg(feature = "meshopt")]
    pub fn has_binary(&self) -> bool {
        self.blob.is_some() || self.held.first().is_some_and(Option::is_some)
    }

    /// Returns `count` buffers and the remaining allowance. Buffers that were never read are empty.
    pub fn into_parts(mut self, count: usize) -> (Vec<Vec<u8>>, Allowance) {
        self.held.resize(count, None);
        (self.held.into_iter().map(Option::unwrap_or_default).collect(), self.allowance)
    }
}
