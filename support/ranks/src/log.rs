//! Costs of shared loops, measured on a single rank. From these costs, a simulation predicts the cost on any number of
//! ranks.

use super::{Alone, Assignment, Portable, Ranks};
use crate::busy::thread_nanoseconds;
use std::sync::{Mutex, PoisonError};

/// The only rank of a process, with a log of the shared loops. The results equal the results of [`Alone`].
#[derive(Debug, Default)]
pub struct LoggedAlone {
    log: WorkLog,
}

impl Ranks for LoggedAlone {
    fn rank(&self) -> usize {
        Alone.rank()
    }

    fn count(&self) -> usize {
        Alone.count()
    }

    fn all_gather(&self, own: Vec<u8>) -> Vec<Vec<u8>> {
        Alone.all_gather(own)
    }

    fn gather(&self, own: Vec<u8>) -> Option<Vec<Vec<u8>>> {
        Alone.gather(own)
    }

    fn broadcast(&self, own: Vec<u8>) -> Vec<u8> {
        Alone.broadcast(own)
    }

    fn log(&self) -> Option<&WorkLog> {
        Some(&self.log)
    }
}

/// Log of the shared loops of a single rank.
#[derive(Debug, Default)]
pub struct WorkLog {
    loops: Mutex<Vec<LoopLog>>,
}

/// Cost of one shared loop: the work on the items, and packing and unpacking of results. Entries are not in item order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LoopLog {
    /// CPU time of each item \[s\], with the [`Assignment`] that determines its owner.
    pub work: Vec<(Assignment, f64)>,
    /// Size of each item's result \[bytes\], with the [`Assignment`] that determines its owner.
    pub results: Vec<(Assignment, usize)>,
    /// All items' results, packed together.
    pub items: Parcel,
    /// The sum that each rank sends. Its size does not depend on the rank's items.
    pub sums: Parcel,
    /// CPU time of the log itself \[s\].
    pub logging: f64,
}

/// Data sent from rank to rank.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Parcel {
    /// Size \[bytes\].
    pub bytes: usize,
    /// CPU time of serialization \[s\].
    pub packing: f64,
    /// CPU time of deserialization, including the addition of a sum \[s\].
    pub unpacking: f64,
}

impl WorkLog {
    /// Returns the logged loops, in order of execution.
    #[must_use]
    pub fn loops(&self) -> Vec<LoopLog> {
        self.loops.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    fn add(&self, done: LoopLog) {
        self.loops.lock().unwrap_or_else(PoisonError::into_inner).push(done);
    }

    /// Logs a loop with the given results of items and the `assignments` that assign them to ranks.
    pub(super) fn add_results<T: Portable>(&self, meter: Meter, assignments: &[Assignment], results: &[T]) {
        let start = thread_nanoseconds();
        let mut done = LoopLog { work: meter.into_work(), ..LoopLog::default() };

        // Serialize and deserialize the results as for other ranks.
        let mut bytes = Vec::new();
        let mut sizes = Vec::with_capacity(assignments.len());
        done.items.packing = seconds_of(|| {
            for result in results {
                let before = bytes.len();
                result.put(&mut bytes);
                sizes.push(bytes.len() - before);
            }
        });
        done.items.bytes = bytes.len();
        // Every rank deserializes the results of all items.
        let mut left = &bytes[..];
        done.items.unpacking = seconds_of(|| drop(Vec::from_iter(results.iter().map(|_| T::take(&mut left)))));
        done.results = assignments.iter().copied().zip(sizes).collect();
        done.logging = seconds_since(start);
        self.add(done);
    }

    /// Logs a sum over ranks: each rank contributes a sum like `own` and adds the sums of all ranks.
    pub(super) fn add_sum<T: Portable>(&self, meter: Meter, own: &T, plus: impl Fn(T, T) -> T) {
        let start = thread_nanoseconds();
        let mut done = LoopLog { work: meter.into_work(), ..LoopLog::default() };
        let mut bytes = Vec::new();
        done.sums.packing = seconds_of(|| own.put(&mut bytes));
        done.sums.bytes = bytes.len();
        // Measure the deserialization and addition of one rank's sum.
        if let Some(other) = T::take(&mut &bytes[..]) {
            done.sums.unpacking = seconds_of(|| drop(T::take(&mut &bytes[..]).map(|sum| plus(other, sum))));
        }
        done.logging = seconds_since(start);
        self.add(done);
    }
}

/// Timer for the items of a shared loop. Without a log it does nothing.
#[derive(Debug)]
pub struct Meter {
    work: Option<Mutex<Vec<(Assignment, f64)>>>,
}

impl Meter {
    pub(super) fn of(log: Option<&WorkLog>) -> Self {
        Self { work: log.map(|_| Mutex::default()) }
    }

    /// Starts timing items that this thread computes one after the other.
    #[must_use]
    pub fn laps(&self) -> Laps<'_> {
        // Without a log, do not read the clock.
        Laps { last: if self.work.is_some() { thread_nanoseconds() } else { 0 }, work: Vec::new(), meter: self }
    }

    fn into_work(self) -> Vec<(Assignment, f64)> {
        self.work.map(|work| work.into_inner().unwrap_or_else(PoisonError::into_inner)).unwrap_or_default()
    }
}

/// CPU time of a thread between consecutive items.
#[derive(Debug)]
pub struct Laps<'a> {
    meter: &'a Meter,
    /// End of the previous item \[ns\].
    last: u64,
    work: Vec<(Assignment, f64)>,
}

impl Laps<'_> {
    /// Records that this thread has finished an item with this `assignment`.
    pub fn note(&mut self, assignment: Assignment) {
        self.note_together(std::iter::once(assignment));
    }

    /// Records that this thread has finished items of equal cost with these `assignments`.
    pub fn note_together(&mut self, assignments: impl ExactSizeIterator<Item = Assignment>) {
        if self.meter.work.is_none() {
            return;
        }
        // Divide the elapsed CPU time equally among the items.
        let now = thread_nanoseconds();
        let seconds = now.saturating_sub(self.last) as f64 * 1e-9 / assignments.len() as f64;
        self.last = now;
        for assignment in assignments {
            // Merge consecutive items of the same assignment, to keep the log short.
            match self.work.last_mut() {
                Some((last, sum)) if *last == assignment => *sum += seconds,
                _ => self.work.push((assignment, seconds)),
            }
        }
    }
}

impl Drop for Laps<'_> {
    fn drop(&mut self) {
        if let Some(work) = &self.meter.work {
            work.lock().unwrap_or_else(PoisonError::into_inner).append(&mut self.work);
        }
    }
}

/// Returns the CPU time of `work` \[s\].
fn seconds_of(work: impl FnOnce()) -> f64 {
    let start = thread_nanoseconds();
    work();
    seconds_since(start)
}

fn seconds_since(start: u64) -> f64 {
    thread_nanoseconds().saturating_sub(start) as f64 * 1e-9
}
