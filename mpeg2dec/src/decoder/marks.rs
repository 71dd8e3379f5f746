//! Time stamps by their position in the elementary stream.

use std::collections::VecDeque;

/// Maximum number of time stamps that wait for a picture.
const MARKS_MAX: usize = 64;

/// A time stamp and the stream offset from which it applies.
struct TimeMark {
    offset: u64,
    time: i64,
}

/// Time stamps that wait for a picture.
#[derive(Default)]
pub(super) struct TimeMarks(VecDeque<TimeMark>);

impl TimeMarks {
    pub fn add(&mut self, offset: u64, time: i64) {
        if self.0.len() == MARKS_MAX {
            self.0.pop_front();
        }
        self.0.push_back(TimeMark { offset, time });
    }

    /// Removes the time stamps up to a stream offset and returns the last one.
    pub fn take(&mut self, offset: u64) -> Option<i64> {
        let mut time = None;
        while let Some(mark) = self.0.front().filter(|mark| mark.offset <= offset) {
            time = Some(mark.time);
            self.0.pop_front();
        }
        time
    }
}
