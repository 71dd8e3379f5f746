//! Films in chunks, and ranges of a film for several machines.
//!
//! All state is reset every `chunk` frames, at a closed group of pictures, so a chunk does not depend on earlier
//! frames. Machines that each make some chunks produce the same film as one machine. A range without chunks is one
//! chunk.

use crate::error::{Error, Result};
use renderer::settings::parsed;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::fmt;
use std::str::FromStr;

/// Range of frames counted from 0, inclusive: `10-19`, or `10` for one frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrameRange {
    /// First frame.
    pub first: u32,
    /// Last frame, inclusive.
    pub last: u32,
}

impl FromStr for FrameRange {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        // Direct users with a list of frames to `still`, which accepts lists.
        let pictures = if text.contains(',') { "; for a list of pictures use render2mpeg still --frame" } else { "" };
        let wrong =
            || Error::Options(format!("\"{text}\" is not a range of frames such as 10-19, counted from 0{pictures}"));
        // Accept a single number as a range of one frame.
        let (first, last) = text.split_once('-').unwrap_or((text, text));
        let number = |text: &str| text.trim().parse::<u32>().map_err(|_| wrong());
        let range = Self { first: number(first)?, last: number(last)? };
        // Reject u32::MAX, because half-open ranges end at last + 1.
        if range.first > range.last || range.last == u32::MAX { Err(wrong()) } else { Ok(range) }
    }
}

impl fmt::Display for FrameRange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}-{}", self.first, self.last)
    }
}

impl Serialize for FrameRange {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for FrameRange {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        parsed(deserializer)
    }
}

/// Returns the range of the chunk with this index in a film of `frames` frames. The last chunk may be shorter.
///
/// # Errors
/// If chunks have no length, or the film has no such chunk.
pub(super) fn range_of_chunk(chunk: Option<u32>, index: u32, frames: u32) -> Result<FrameRange> {
    let fail = |text: String| Err(Error::Options(text));
    let Some(chunk) = chunk.filter(|&chunk| chunk > 0) else {
        return fail(format!("--chunk-index {index} needs --chunk N, with at least one frame per chunk"));
    };
    let last = frames.div_ceil(chunk) - 1;
    if index > last {
        return fail(format!("--chunk-index {index} exceeds the film: its last chunk has the index {}", last));
    }
    let first = index * chunk;
    Ok(FrameRange { first, last: first.saturating_add(chunk).min(frames) - 1 })
}

/// Returns the checked range of frames to make, or `None` for all frames. The film has `frames` frames. With `chunk`
/// frames per chunk, a range consists of whole chunks. The last chunk may be shorter than the others, but its range may
/// be given at full chunk length.
///
/// # Errors
/// If the range is not a whole number of chunks or exceeds the film. The message names a valid range.
pub(super) fn checked_range(chunk: Option<u32>, range: Option<FrameRange>, frames: u32) -> Result<Option<FrameRange>> {
    let fail = |text: String| Err(Error::Options(text));
    if chunk == Some(0) {
        return fail("--chunk 0: a chunk has at least one frame".into());
    }
    let Some(FrameRange { first, last }) = range else { return Ok(None) };
    // Reject a range outside the film. With chunks, the last frame is checked below.
    if first >= frames || chunk.is_none() && last >= frames {
        return fail(format!("--range {first}-{last} exceeds the film: its last frame is {}", frames - 1));
    }
    let Some(chunk) = chunk else { return Ok(range) };

    // Suggest the smallest range of whole chunks that contains the given range.
    let begin = first - first % chunk;
    let (frames, chunk) = (u64::from(frames), u64::from(chunk));
    let end = (u64::from(last) / chunk + 1) * chunk;
    let whole = FrameRange { first: begin, last: (end.min(frames) - 1) as u32 };
    if first != begin || u64::from(last) + 1 != end && last != whole.last || end >= frames + chunk {
        return fail(format!("--range {first}-{last} is not whole chunks of {chunk} frames; {whole} is"));
    }
    Ok(Some(whole))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn filled(chunk: Option<u32>, range: &str, frames: u32) -> Result<Option<FrameRange>> {
        checked_range(chunk, Some(range.parse()?), frames)
    }

    #[test]
    fn chunk_indices_cover_the_film_once() {
        for (chunk, frames) in [(10, 30), (10, 25), (7, 7), (1, 3), (100, 8), (u32::MAX, u32::MAX)] {
            let mut next = 0;
            for index in 0..u32::div_ceil(frames, chunk) {
                let range = range_of_chunk(Some(chunk), index, frames).unwrap();
                assert_eq!(checked_range(Some(chunk), Some(range), frames).unwrap(), Some(range));
                assert_eq!(range.first, next);
                next = range.last + 1;
            }
            assert_eq!(next, frames);
            assert!(range_of_chunk(Some(chunk), frames.div_ceil(chunk), frames).is_err());
        }
        assert!(range_of_chunk(None, 0, 8).is_err() && range_of_chunk(Some(0), 0, 8).is_err());
    }

    #[test]
    fn lists_of_frames_lead_to_still() {
        let message = |text: &str| text.parse::<FrameRange>().unwrap_err().to_string();
        assert!(message("2,4,10-20").contains("still --frame"), "{}", message("2,4,10-20"));
        assert!(!message("2-x").contains("still"), "{}", message("2-x"));
    }

    #[test]
    fn ranges_are_whole_chunks() {
        for (chunk, range, frames, expected) in [
            (10, "0-9", 30, "0-9"),
            (10, "10-29", 30, "10-29"),
            (10, "20-24", 25, "20-24"),
            // Scripts may give the last chunk at full length.
            (10, "20-29", 25, "20-24"),
            (10, "20", 21, "20-20"),
            (1, "7", 30, "7-7"),
            (100, "0-29", 30, "0-29"),
            (u32::MAX, "0-3", 4, "0-3"),
        ] {
            assert_eq!(filled(Some(chunk), range, frames).unwrap().unwrap().to_string(), expected, "{range}");
        }
        // Without chunks, a range may contain any frames of the film.
        assert_eq!(filled(None, "5-13", 14).unwrap().unwrap().to_string(), "5-13");
    }

    #[test]
    fn others_are_refused_with_the_nearest_that_is_right() {
        for (chunk, range, frames, word) in [
            (Some(10), "5-9", 30, "0-9 is"),
            (Some(10), "10-18", 30, "10-19 is"),
            (Some(10), "10-20", 30, "10-29 is"),
            (Some(10), "20-26", 25, "20-24 is"),
            (Some(10), "20-39", 25, "20-24 is"),
            (Some(10), "30-39", 30, "last frame is 29"),
            (None, "20-30", 30, "last frame is 29"),
            (Some(0), "0-9", 30, "at least one"),
            (Some(10), "9-0", 30, "10-19"),
            (Some(10), "a-b", 30, "10-19"),
            (Some(10), "-5", 30, "10-19"),
            (Some(10), "0-4294967295", 30, "10-19"),
        ] {
            let message = filled(chunk, range, frames).unwrap_err().to_string();
            assert!(message.contains(word), "{range}: {message}");
        }
    }
}
