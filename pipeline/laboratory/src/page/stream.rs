//! Streams embedded in a page, and the player that shows them.

use super::html::base64;
use minijinja::{Value, context};
use pipeline::stage::CodedUnit;
use plane::PictureType;
use render2mpeg::error::Result;
use serde::Serialize;
use serde_json::json;

/// I picture at which decoding can start.
#[derive(Clone, Copy, Debug)]
struct StreamEntry {
    /// Offset of its headers in the stream \[bytes\].
    offset: usize,
    /// Display position of the picture.
    position: u64,
    /// Number of displayed pictures before this group.
    count: u64,
}

/// Elementary stream of whole groups of pictures, with limited length.
#[derive(Clone, Debug)]
pub struct PageStream {
    limit: usize,
    bytes: Vec<u8>,
    entries: Vec<StreamEntry>,
    /// Number of displayed pictures.
    count: u64,
    /// Whether pictures at the end are missing because of the limit.
    is_cut: bool,
}

impl PageStream {
    /// Returns an empty stream of at most `limit` bytes.
    #[must_use]
    pub fn new(limit: usize) -> Self {
        Self { limit, bytes: Vec::new(), entries: Vec::new(), count: 0, is_cut: false }
    }

    /// Adds the next picture in coding order. The stream starts with the first I picture, and ends before the first group
    /// of pictures that exceeds the limit.
    pub fn push(&mut self, unit: &CodedUnit) {
        let (offset, position) = (self.bytes.len(), unit.position);
        let is_entry = unit.picture_type == PictureType::I;
        if self.is_cut || self.entries.is_empty() && !is_entry {
            return;
        }
        if is_entry {
            self.entries.push(StreamEntry { offset, position, count: self.count });
        }
        if offset + unit.bytes.len() > self.limit {
            self.is_cut = true;
            if let Some(last) = self.entries.pop() {
                self.bytes.truncate(last.offset);
                self.count = last.count;
            }
            return;
        }
        self.bytes.extend_from_slice(&unit.bytes);
        // Decoders drop pictures that precede the first I picture in display order.
        self.count += u64::from(self.entries.first().is_some_and(|first| position >= first.position));
    }

    /// Returns whether pictures at the end are missing because of the limit.
    #[must_use]
    pub fn is_cut(&self) -> bool {
        self.is_cut
    }

    /// Returns the display positions of the pictures; `None` for an empty stream.
    #[must_use]
    pub fn positions(&self) -> Option<std::ops::RangeInclusive<u64>> {
        let first = self.entries.first()?.position;
        Some(first..=(first + self.count).checked_sub(1)?)
    }

    /// Returns the stream for the player, with positions relative to the first picture.
    fn json(&self) -> serde_json::Value {
        let first = self.entries.first().map_or(0, |entry| entry.position);
        let entries = self.entries.iter().map(|entry| (entry.offset as u64, entry.position.saturating_sub(first)));
        let entries: Vec<(u64, u64)> = entries.collect();
        json!({ "count": self.count, "entries": entries, "base64": base64(&self.bytes) })
    }
}

/// Times and frame numbers of streams that are played together.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Playback {
    /// Pictures per second.
    pub rate: f64,
    /// Number of the first frame.
    pub first: u64,
    /// Number of pictures per frame.
    pub repeats: u64,
    /// Display position at which the player starts.
    pub start: u64,
    /// Whether the player starts to play when the page is loaded.
    pub plays: bool,
}

/// Returns the data of the template `player.html`.
///
/// # Errors
/// If the data cannot be serialized, which is a bug.
pub fn player(streams: &[&PageStream], playback: Playback) -> Result<Value> {
    let streams: Vec<serde_json::Value> = streams.iter().map(|stream| stream.json()).collect();
    let data = json_for_script(&json!({ "playback": playback, "streams": streams }))?;
    let script = [mpeg2dec::web::SCRIPT, include_str!("templates/player.js")].concat();
    Ok(context! { data, script, module => base64(mpeg2dec::web::MODULE) })
}

/// Formats JSON for embedding in a script.
fn json_for_script(value: &impl Serialize) -> Result<String> {
    Ok(serde_json::to_string(value)?.replace('<', "\\u003c"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stream(limit: usize, units: &[(PictureType, u64, usize)]) -> PageStream {
        let mut stream = PageStream::new(limit);
        for &(picture_type, position, length) in units {
            stream.push(&CodedUnit { position, picture_type, bytes: vec![position as u8; length] });
        }
        stream
    }

    #[test]
    fn long_streams_end_before_a_group() {
        use PictureType::{B, I, P};
        let units = [(I, 0, 10), (P, 1, 5), (I, 4, 10), (B, 2, 1), (B, 3, 1), (P, 5, 5), (I, 6, 10)];
        let whole = stream(100, &units);
        assert_eq!((whole.bytes.len(), whole.positions(), whole.is_cut()), (42, Some(0..=6), false));
        let entries: Vec<(usize, u64)> = whole.entries.iter().map(|entry| (entry.offset, entry.position)).collect();
        assert_eq!(entries, [(0, 0), (15, 4), (32, 6)]);
        // The limit is reached within the second group.
        let short = stream(31, &units);
        assert_eq!((short.bytes.len(), short.positions(), short.is_cut()), (15, Some(0..=1), true));
        // A resumed film starts within a group, and the next I picture has preceding B pictures.
        let resumed = stream(100, &units[1..]);
        assert_eq!((resumed.bytes.len(), resumed.positions()), (27, Some(4..=6)));
        assert_eq!(stream(9, &units).positions(), None);
    }
}
