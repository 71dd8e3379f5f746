//! Waiting for MPI, which itself waits by asking all the time: that takes a processor from whoever works there.

use mpi::request::{Request, Scope};
use std::time::{Duration, Instant};

/// Bytes of a rank that go with one operation, as counts of MPI are of 31 bits.
pub(super) const PIECE: usize = 1 << 26;
/// Time for which a thread asks for its message again and again: results of a short loop come within it.
const EAGER: Duration = Duration::from_micros(500);
/// Pauses between two questions after that: a share of the time waited so far, and no longer than the last.
const PAUSE_SHARE: u32 = 64;
const LONGEST_PAUSE: Duration = Duration::from_millis(1);

/// Waits for an operation.
pub(super) fn wait<'a, D: ?Sized, S: Scope<'a>>(mut request: Request<'a, D, S>) {
    let begin = Instant::now();
    loop {
        match request.test() {
            Ok(_) => return,
            Err(pending) => request = pending,
        }
        rest(begin);
    }
}

/// Rests before the next question of who has waited since `begin`.
pub(super) fn rest(begin: Instant) {
    match pause(begin) {
        Some(pause) => std::thread::sleep(pause),
        None => std::thread::yield_now(),
    }
}

/// The pause before the next question of who has waited since `begin`; none at first.
pub(super) fn pause(begin: Instant) -> Option<Duration> {
    let waited = begin.elapsed();
    (waited >= EAGER).then(|| (waited / PAUSE_SHARE).min(LONGEST_PAUSE))
}
