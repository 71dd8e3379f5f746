//! Lists of frames for stills.

use crate::error::{Error, Result};
use std::fmt;
use std::str::FromStr;

/// Frame numbers from 0, in ascending order without duplicates, such as `2,4,10-20`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FrameList(Vec<u32>);

/// Maximum number of frames in a list.
const MOST: usize = 1_000_000;

impl FrameList {
    /// Returns a list of one frame.
    #[must_use]
    pub fn one(frame: u32) -> Self {
        Self(vec![frame])
    }

    /// Returns the frames of the list, at least one.
    #[must_use]
    pub fn frames(&self) -> &[u32] {
        &self.0
    }

    /// Returns the last frame of the list.
    #[must_use]
    pub fn last(&self) -> u32 {
        self.0.last().copied().unwrap_or(0)
    }
}

impl FromStr for FrameList {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let wrong = || Error::Options(format!("\"{text}\" is not a list of frames such as 2,4,10-20, counted from 0"));
        let number = |text: &str| text.trim().parse::<u32>().ok().filter(|&frame| frame < u32::MAX).ok_or_else(wrong);

        // Limit the length before each range is expanded, because a typing error could exceed the memory.
        let mut frames = Vec::new();
        for part in text.split(',') {
            let (first, last) = part.split_once('-').unwrap_or((part, part));
            let (first, last) = (number(first)?, number(last)?);
            if first > last || (last - first) as usize >= MOST - frames.len() {
                return Err(wrong());
            }
            frames.extend(first..=last);
        }
        // Sort the frames and drop duplicates, so that each frame is rendered once.
        frames.sort_unstable();
        frames.dedup();
        Ok(Self(frames))
    }
}

impl fmt::Display for FrameList {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let frames: Vec<String> = self.0.iter().map(u32::to_string).collect();
        write!(f, "{}", frames.join(","))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_are_numbers_and_ranges() {
        let frames = |text: &str| text.parse::<FrameList>().map(|list| list.0);
        assert_eq!(frames("7").unwrap(), [7]);
        assert_eq!(frames("2,4,10-13").unwrap(), [2, 4, 10, 11, 12, 13]);
        assert_eq!(frames("5-6, 1,5").unwrap(), [1, 5, 6]);
        for text in ["", "a", "1,", "3-1", "-2", "1-2-3", "4294967295", "0-4000000000", "1;2"] {
            assert!(frames(text).unwrap_err().to_string().contains("2,4,10-20"), "{text}");
        }
    }
}
