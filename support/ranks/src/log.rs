//! Costs of shared loops, as the only rank finds them: from these a simulation tells what any number of ranks would take.

use super::{Alone, Portable, Ranks, Turn};
use crate::busy::thread_nanoseconds;
use std::sync::{Mutex, PoisonError};

/// The only rank, which keeps a log of its shared loops. Its results are those of [`Alone`].
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

/// Loops that the only rank has been through.
#[derive(Debug, Default)]
pub struct WorkLog {
    loops: Mutex<Vec<LoopLog>>,
}

/// A shared loop: the work on its items, and results on their way to other ranks. In another order than the items.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LoopLog {
    /// CPU time of each item \[s\], with the turn that says whose it is.
    pub work: Vec<(Turn, f64)>,
    /// Size of each item's result \[bytes\], likewise.
    pub results: Vec<(Turn, usize)>,
    /// The results of all items together.
    pub items: Parcel,
    /// The sums that each rank sends, whatever items it has.
    pub sums: Parcel,
    /// CPU time that the log itself took \[s\].
    pub logging: f64,
}

/// Something on its way from rank to rank.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Parcel {
    /// Size \[bytes\].
    pub bytes: usize,
    /// CPU time to make bytes of it \[s\].
    pub packing: f64,
    /// CPU time to take it from bytes, and to add it where it is a sum \[s\].
    pub unpacking: f64,
}

impl WorkLog {
    /// The loops so far, in order.
    #[must_use]
    pub fn loops(&self) -> Vec<LoopLog> {
        self.loops.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    fn add(&self, done: LoopLog) {
        self.loops.lock().unwrap_or_else(PoisonError::into_inner).push(done);
    }

    /// Notes a loop whose items have these `turns` and `results`.
    pub(super) fn add_results<T: Portable>(&self, meter: Meter, turns: &[Turn], results: &[T]) {
        let start = thread_nanoseconds();
        let mut done = LoopLog { work: meter.into_work(), ..LoopLog::default() };

        // As they would go to other ranks and come there.
        let mut bytes = Vec::new();
        let mut sizes = Vec::with_capacity(turns.len());
        done.items.packing = seconds_of(|| {
            for result in results {
                let before = bytes.len();
                result.put(&mut bytes);
                sizes.push(bytes.len() - before);
            }
        });
        done.items.bytes = bytes.len();
        let mut left = &bytes[..];
        done.items.unpacking = seconds_of(|| drop(Vec::from_iter(results.iter().map(|_| T::take(&mut left)))));
        done.results = turns.iter().copied().zip(sizes).collect();
        done.logging = seconds_since(start);
        self.add(done);
    }

    /// Notes a loop in which each rank finds such a sum as `own`, and adds up those of all.
    pub(super) fn add_sum<T: Portable>(&self, meter: Meter, own: &T, plus: impl Fn(T, T) -> T) {
        let start = thread_nanoseconds();
        let mut done = LoopLog { work: meter.into_work(), ..LoopLog::default() };
        let mut bytes = Vec::new();
        done.sums.packing = seconds_of(|| own.put(&mut bytes));
        done.sums.bytes = bytes.len();
        if let Some(other) = T::take(&mut &bytes[..]) {
            done.sums.unpacking = seconds_of(|| drop(T::take(&mut &bytes[..]).map(|sum| plus(other, sum))));
        }
        done.logging = seconds_since(start);
        self.add(done);
    }
}

/// Times the items of a shared loop if there is a log, and does nothing otherwise.
#[derive(Debug)]
pub struct Meter {
    work: Option<Mutex<Vec<(Turn, f64)>>>,
}

impl Meter {
    pub(super) fn of(log: Option<&WorkLog>) -> Self {
        Self { work: log.map(|_| Mutex::default()) }
    }

    /// Begins to time items that this thread computes one after the other.
    #[must_use]
    pub fn laps(&self) -> Laps<'_> {
        Laps { last: if self.work.is_some() { thread_nanoseconds() } else { 0 }, work: Vec::new(), meter: self }
    }

    fn into_work(self) -> Vec<(Turn, f64)> {
        self.work.map(|work| work.into_inner().unwrap_or_else(PoisonError::into_inner)).unwrap_or_default()
    }
}

/// CPU time of a thread from item to item.
#[derive(Debug)]
pub struct Laps<'a> {
    meter: &'a Meter,
    /// End of the item before.
    last: u64,
    work: Vec<(Turn, f64)>,
}

impl Laps<'_> {
    /// An item with this turn is done.
    pub fn note(&mut self, turn: Turn) {
        self.note_together(std::iter::once(turn));
    }

    /// Items with these turns are done, of equal cost.
    pub fn note_together(&mut self, turns: impl ExactSizeIterator<Item = Turn>) {
        if self.meter.work.is_none() {
            return;
        }
        let now = thread_nanoseconds();
        let seconds = now.saturating_sub(self.last) as f64 * 1e-9 / turns.len() as f64;
        self.last = now;
        for turn in turns {
            match self.work.last_mut() {
                Some((last, sum)) if *last == turn => *sum += seconds,
                _ => self.work.push((turn, seconds)),
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

/// CPU time of `work` \[s\].
fn seconds_of(work: impl FnOnce()) -> f64 {
    let start = thread_nanoseconds();
    work();
    seconds_since(start)
}

fn seconds_since(start: u64) -> f64 {
    thread_nanoseconds().saturating_sub(start) as f64 * 1e-9
}
