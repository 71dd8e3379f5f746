//! CPU time of threads. It excludes waiting time and the time of other programs.

use std::sync::atomic::{AtomicU64, Ordering};

/// CPU time of tasks, summed over the threads that ran them.
///
/// Work passed to [`Busy::measure`] must not use other threads. Measure inside a parallel loop, not around it.
///
/// ```
/// let busy = ranks::Busy::default();
/// let sum: u64 = busy.measure(|| (0..1000).sum());
/// assert!(sum == 499_500 && busy.seconds() < 1.0);
/// ```
#[derive(Debug, Default)]
pub struct Busy {
    nanoseconds: AtomicU64,
}

impl Busy {
    /// Runs `work` and adds its CPU time to the sum.
    pub fn measure<T>(&self, work: impl FnOnce() -> T) -> T {
        let start = thread_nanoseconds();
        let result = work();
        self.nanoseconds.fetch_add(thread_nanoseconds().saturating_sub(start), Ordering::Relaxed);
        result
    }

    /// Adds the CPU time of a result to the sum and returns the result.
    pub fn take<T>(&self, timed: Timed<T>) -> T {
        self.nanoseconds.fetch_add((timed.seconds * 1e9).round() as u64, Ordering::Relaxed);
        timed.value
    }

    /// Returns the CPU time measured so far \[s\].
    #[must_use]
    pub fn seconds(&self) -> f64 {
        self.nanoseconds.load(Ordering::Relaxed) as f64 * 1e-9
    }
}

/// A result and its CPU time.
#[derive(Clone, Copy, Debug, PartialEq)]
#[must_use]
pub struct Timed<T> {
    /// Result of the work.
    pub value: T,
    /// CPU time of all threads that contributed to the result \[s\].
    pub seconds: f64,
}

impl<T> Timed<T> {
    /// Runs `work`, which measures its own sections with the [`Busy`], and returns its result and CPU time.
    pub fn of(work: impl FnOnce(&Busy) -> T) -> Self {
        let busy = Busy::default();
        let value = work(&busy);
        Self { value, seconds: busy.seconds() }
    }

    /// Applies `change` to the result and keeps the CPU time.
    pub fn map<U>(self, change: impl FnOnce(T) -> U) -> Timed<U> {
        Timed { value: change(self.value), seconds: self.seconds }
    }
}

/// Returns the CPU time of all threads since the process began \[s\]. On systems other than Unix, returns wall-clock
/// time.
#[must_use]
pub fn process_seconds() -> f64 {
    #[cfg(unix)]
    {
        let time = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
        time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
    }
    #[cfg(not(unix))]
    {
        thread_nanoseconds() as f64 * 1e-9
    }
}

/// Returns the CPU time of this thread \[ns\]. On systems other than Unix, returns wall-clock time.
#[cfg(unix)]
pub(crate) fn thread_nanoseconds() -> u64 {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    time.tv_sec as u64 * 1_000_000_000 + time.tv_nsec as u64
}

#[cfg(not(unix))]
pub(crate) fn thread_nanoseconds() -> u64 {
    static START: std::sync::OnceLock<std::time::Instant> = std::sync::OnceLock::new();
    START.get_or_init(std::time::Instant::now).elapsed().as_nanos() as u64
}
