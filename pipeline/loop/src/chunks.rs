//! Films in chunks: all state is reset every N frames.

/// Returns whether frame `index` is the first of a chunk of `chunk` frames; always false without chunks.
#[must_use]
pub fn begins_chunk(chunk: Option<u32>, index: u32) -> bool {
    chunk.is_some_and(|frames| index.is_multiple_of(frames))
}
