//! Time stamps of 33 bits.

/// Number of values of a time stamp.
const RANGE: i64 = 1 << 33;

/// Converts time stamps to times that continue after the 33-bit counter wraps.
#[derive(Default)]
pub(super) struct TimeUnwrapper {
    last: Option<i64>,
}

impl TimeUnwrapper {
    /// Returns the time nearest to the previous one with these 33 bits.
    pub fn unwrap(&mut self, stamp: i64) -> i64 {
        let time = match self.last {
            None => stamp,
            Some(last) => {
                let difference = (stamp - last).rem_euclid(RANGE);
                last + if difference >= RANGE / 2 { difference - RANGE } else { difference }
            }
        };
        self.last = Some(time);
        time
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_continue_after_the_wrap() {
        let mut unwrapper = TimeUnwrapper::default();
        assert_eq!(unwrapper.unwrap(RANGE - 1000), RANGE - 1000);
        assert_eq!(unwrapper.unwrap(2000), RANGE + 2000);
        assert_eq!(unwrapper.unwrap(RANGE - 500), RANGE - 500, "reordered pictures");
        assert_eq!(unwrapper.unwrap(5000), RANGE + 5000);
    }
}
