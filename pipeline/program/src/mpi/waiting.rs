//! Waiting for MPI operations with pauses, because MPI's own wait polls continuously and occupies a processor.

use mpi::request::{Request, Scope};
use std::time::{Duration, Instant};

/// Maximum number of bytes per operation, because MPI counts have 31 bits.
pub(super) const PIECE: usize = 1 << 26;
/// Time during which a thread polls without pauses. Results of short loops usually arrive within this time.
const EAGER: Duration = Duration::from_micros(500);
/// Divisor of the time waited so far, which yields the pause before the next poll, up to [`LONGEST_PAUSE`].
const PAUSE_SHARE: u32 = 64;
/// Maximum pause between two polls.
const LONGEST_PAUSE: Duration = Duration::from_millis(1);

/// Waits until an operation is complete.
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

/// Pauses before the next poll, for a caller that has waited since `begin`.
pub(super) fn rest(begin: Instant) {
    match pause(begin) {
        Some(pause) => std::thread::sleep(pause),
        None => std::thread::yield_now(),
    }
}

/// Returns the pause before the next poll, for a caller that has waited since `begin`; `None` within the first
/// [`EAGER`].
pub(super) fn pause(begin: Instant) -> Option<Duration> {
    let waited = begin.elapsed();
    (waited >= EAGER).then(|| (waited / PAUSE_SHARE).min(LONGEST_PAUSE))
}
