//! Waiting for MPI, whose own wait polls continuously and occupies a processor.

use mpi::request::{Request, Scope};
use std::time::{Duration, Instant};

/// Maximum number of bytes per operation: MPI counts have 31 bits.
pub(super) const PIECE: usize = 1 << 26;
/// Time during which a thread polls without pauses: results of short loops arrive within it.
const EAGER: Duration = Duration::from_micros(500);
/// Later polls pause for the time waited so far divided by this, up to [`LONGEST_PAUSE`].
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

/// Pauses before the next poll, for a caller that has waited since `begin`.
pub(super) fn rest(begin: Instant) {
    match pause(begin) {
        Some(pause) => std::thread::sleep(pause),
        None => std::thread::yield_now(),
    }
}

/// Pause before the next poll, for a caller that has waited since `begin`; `None` at first.
pub(super) fn pause(begin: Instant) -> Option<Duration> {
    let waited = begin.elapsed();
    (waited >= EAGER).then(|| (waited / PAUSE_SHARE).min(LONGEST_PAUSE))
}
