//! Distributed loops with bit-exact results. Every rank has the same state, and the ranks share the most expensive
//! loops.
//!
//! ```text
//! items 0 … n−1 of a loop ──► one rank computes each, such as i mod R ──► results go to all ranks ──► all n, in order
//! ```
//! Each item depends only on state that all ranks have. The results are therefore bit-identical for any number of
//! ranks.
//!
//! [`Ranks`] lists the required operations of a message-passing library: the collective operations with the same names
//! in \[MPI\]. [`Alone`] implements them for a single process, [`ThreadRanks`] for several threads of one process.
//! [`LoggedAlone`] logs the cost of its loops. From this log, [`LoggedRun`] simulates the cost on any number of ranks.
//! [`Mail`] sends messages between two ranks, to assign work to idle ranks.

#![forbid(unsafe_code)]

mod assignment;
mod busy;
mod log;
mod mail;
mod portable;
mod simulation;
mod threads;

pub use assignment::{Assignment, in_order};
pub use busy::{Busy, Timed, process_seconds};
pub use log::{Laps, LoggedAlone, LoopLog, Meter, Parcel, WorkLog};
pub use mail::{Inbox, Mail, Message, ThreadMail};
pub use portable::Portable;
pub use simulation::{LoggedRun, Network, Simulated};
pub use threads::ThreadRanks;

use rayon::prelude::*;
use std::fmt::Debug;

/// Processes that run the same computation. The number of a process is its rank.
///
/// All ranks call the same operations in the same order, one at a time. An operation returns once its result is
/// complete. This may be long after the call, because other ranks may be busy. Never call an operation inside a rayon
/// job.
pub trait Ranks: Send + Sync + Debug {
    /// Number of this process, starting at 0.
    fn rank(&self) -> usize;

    /// Total number of processes, at least 1.
    fn count(&self) -> usize;

    /// Sends the bytes of all ranks, ordered by rank, to every rank.
    fn all_gather(&self, own: Vec<u8>) -> Vec<Vec<u8>>;

    /// Sends the bytes of all ranks, ordered by rank, to rank 0. Other ranks receive `None`.
    fn gather(&self, own: Vec<u8>) -> Option<Vec<Vec<u8>>>;

    /// Sends the bytes of rank 0 to every rank. The bytes of other ranks are ignored.
    fn broadcast(&self, own: Vec<u8>) -> Vec<u8>;

    /// Log of the costs of shared loops, if this is the only rank and it logs them.
    fn log(&self) -> Option<&WorkLog> {
        None
    }
}

/// The only rank of a single process.
#[derive(Clone, Copy, Debug, Default)]
pub struct Alone;

impl Ranks for Alone {
    fn rank(&self) -> usize {
        0
    }

    fn count(&self) -> usize {
        1
    }

    fn all_gather(&self, own: Vec<u8>) -> Vec<Vec<u8>> {
        vec![own]
    }

    fn gather(&self, own: Vec<u8>) -> Option<Vec<Vec<u8>>> {
        Some(vec![own])
    }

    fn broadcast(&self, own: Vec<u8>) -> Vec<u8> {
        own
    }
}

/// Shares a loop among the ranks. `assignments` assigns each item to a rank and must be equal on every rank.
///
/// `compute` receives the indices of this rank's own items in ascending order and returns one result per item. It notes
/// every finished item in the meter. Every rank receives the results of all items in order.
///
/// # Panics
/// If `compute` does not return one result per item, or if the ranks run different programs.
pub fn share<T: Portable>(
    ranks: &dyn Ranks,
    assignments: &[Assignment],
    compute: impl FnOnce(&[usize], &Meter) -> Vec<T>,
) -> Vec<T> {
    let (count, meter) = (ranks.count(), Meter::of(ranks.log()));
    // Compute the items of this rank.
    let own: Vec<usize> =
        (0..assignments.len()).filter(|&item| assignments[item].owner(count) == ranks.rank()).collect();
    let computed = compute(&own, &meter);
    assert_eq!(computed.len(), own.len(), "a result for each item");
    // Skip the exchange for an empty loop and for a single rank.
    if assignments.is_empty() {
        return computed;
    }
    if count == 1 {
        if let Some(log) = ranks.log() {
            log.add_results(meter, assignments, &computed);
        }
        return computed;
    }

    // Decode even the rank's own results from the transmitted bytes, so that all ranks decode the same bits. Ranks that
    // share different loops have diverged and cannot recover.
    let mut bytes = Vec::new();
    (assignments.len() as u64).put(&mut bytes);
    for value in &computed {
        value.put(&mut bytes);
    }
    let all = ranks.all_gather(bytes);
    let mut left: Vec<&[u8]> = all.iter().map(Vec::as_slice).collect();
    for (rank, left) in left.iter_mut().enumerate() {
        let items = u64::take(left).unwrap_or_default();
        assert!(
            items == assignments.len() as u64,
            "{} items here and {items} on rank {rank}: ranks differ",
            assignments.len()
        );
    }
    // Merge the results in the order of the items.
    let next = |assignment: &Assignment| {
        T::take(&mut left[assignment.owner(count)]).expect("every rank gives a result for each of its items")
    };
    assignments.iter().map(next).collect()
}

/// Shares a loop like [`share`], but calls `compute` for each item with its index and scratch memory. `scratch` creates
/// the memory of a thread.
///
/// A thread processes at least `at_once` items at a time. The CPU time in the result is the time of this rank only.
///
/// # Panics
/// If the ranks run different programs.
pub fn share_each<T: Portable + Send, S>(
    ranks: &dyn Ranks,
    assignments: &[Assignment],
    at_once: usize,
    scratch: impl Fn() -> S + Sync + Send,
    compute: impl Fn(&mut S, usize) -> T + Sync,
) -> Timed<Vec<T>> {
    Timed::of(|busy| {
        share(ranks, assignments, |own, meter| {
            let some = |scratch: &mut S, items: &[usize]| {
                busy.measure(|| {
                    // Log the CPU time of each item.
                    let mut laps = meter.laps();
                    let mut results = Vec::with_capacity(items.len());
                    for &item in items {
                        results.push(compute(scratch, item));
                        laps.note(assignments[item]);
                    }
                    results
                })
            };
            // Give each thread consecutive items, with scratch memory to reuse.
            own.par_chunks(at_once).map_init(scratch, some).flatten_iter().collect()
        })
    })
}

/// Shares a loop of `count` cheap items in blocks of `at_once` consecutive items, in order.
///
/// # Panics
/// If the ranks run different programs, or `at_once` is 0.
pub fn share_blocks<T: Portable + Send>(
    ranks: &dyn Ranks,
    count: usize,
    at_once: usize,
    compute: impl Fn(usize) -> T + Sync,
) -> Timed<Vec<T>> {
    let blocks = in_order(count.div_ceil(at_once));
    let block = |(): &mut (), number: usize| {
        let begin = number * at_once;
        (begin..(begin + at_once).min(count)).map(&compute).collect::<Vec<T>>()
    };
    share_each(ranks, &blocks, 1, || (), block).map(|blocks| blocks.into_iter().flatten().collect())
}

/// Adds the results of `compute` on all ranks and returns the sum on every rank. `compute` processes this rank's own
/// items of a loop.
///
/// `plus` adds two results. It must be exact, so that the order does not change the bits.
///
/// # Panics
/// If the ranks run different programs.
pub fn sum_of_all<T: Portable>(ranks: &dyn Ranks, compute: impl FnOnce(&Meter) -> T, plus: impl Fn(T, T) -> T) -> T {
    let meter = Meter::of(ranks.log());
    let own = compute(&meter);
    if ranks.count() == 1 {
        if let Some(log) = ranks.log() {
            log.add_sum(meter, &own, plus);
        }
        return own;
    }
    let mut bytes = Vec::new();
    own.put(&mut bytes);
    let all = ranks.all_gather(bytes);
    // Add the sums in the order of the ranks, including this rank's own.
    let of = |bytes: &Vec<u8>| T::take(&mut &bytes[..]).expect("every rank gives its sum");
    all.iter().map(of).reduce(plus).expect("there is a rank")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Runs the same function on `count` ranks, each a thread, and returns the results by rank.
    fn on_ranks<T: Send>(count: usize, run: impl Fn(&dyn Ranks) -> T + Sync) -> Vec<T> {
        let run = &run;
        std::thread::scope(|scope| {
            let started: Vec<_> =
                ThreadRanks::new(count).into_iter().map(|own| scope.spawn(move || run(&own))).collect();
            started.into_iter().map(|thread| thread.join().expect("no rank fails")).collect()
        })
    }

    /// Returns a number of any sign and magnitude that depends on all bits of `k`.
    fn odd_number(k: usize) -> f32 {
        f32::from_bits((k as u32).wrapping_mul(0x9e37_79b9) & 0xbfff_ffff)
    }

    #[test]
    fn shared_loops_give_what_one_rank_gives() {
        let bits = |values: Vec<(f32, Vec<u32>)>| -> Vec<(u32, Vec<u32>)> {
            values.into_iter().map(|(number, list)| (number.to_bits(), list)).collect()
        };
        for items in [0, 1, 2, 7, 1000] {
            let of = |&k: &usize| (odd_number(k), vec![k as u32; k % 4]);
            let plain = bits((0..items).map(|k| of(&k)).collect());
            for count in [1, 2, 3, 5] {
                let shared = on_ranks(count, |ranks| {
                    let compute = |own: &[usize], _: &Meter| own.par_iter().map(of).collect();
                    bits(share(ranks, &in_order(items), compute))
                });
                assert!(shared.iter().all(|list| *list == plain), "{items} items on {count} ranks");
                let one_by_one =
                    on_ranks(count, |ranks| bits(share_each(ranks, &in_order(items), 3, || (), |(), k| of(&k)).value));
                assert!(one_by_one == shared, "{items} items on {count} ranks");
            }
        }
    }

    /// Each rank adds the squares of its own numbers, and every rank receives the sum.
    #[test]
    fn sums_are_those_of_all_ranks() {
        for count in [1, 2, 3, 5] {
            let sums = on_ranks(count, |ranks| {
                let own = |_: &Meter| (0..100u64).filter(|k| *k as usize % count == ranks.rank()).map(|k| k * k).sum();
                sum_of_all(ranks, own, |a: u64, b| a + b)
            });
            assert_eq!(sums, vec![99 * 100 * 199 / 6; count]);
        }
    }

    #[test]
    fn logs_have_every_item_and_its_bytes() {
        let ranks = LoggedAlone::default();
        let assignments = [3, 3, 1, 8].map(Assignment::Golden);
        let lists = share_each(&ranks, &assignments, 2, || (), |(), k| vec![k as u32; k]).value;
        assert_eq!(lists, [vec![], vec![1], vec![2; 2], vec![3; 3]]);
        let none: Vec<u8> = share(&ranks, &[], |_, _| Vec::new());
        assert!(none.is_empty());
        let sum = sum_of_all(
            &ranks,
            |meter| {
                let mut laps = meter.laps();
                laps.note_together([Assignment::InOrder(4); 2].into_iter());
                laps.note(Assignment::InOrder(5));
                [7.0f32; 6]
            },
            |_, other| other,
        );
        assert_eq!(sum, [7.0; 6]);

        // A list starts with its length. Consecutive items with the same assignment are merged.
        let [items, sums] = &ranks.log().expect("it keeps one").loops()[..] else { panic!("two loops") };
        assert_eq!(
            items.results,
            [(assignments[0], 8), (assignments[1], 12), (assignments[2], 16), (assignments[3], 20)]
        );
        assert_eq!((items.items.bytes, items.sums), (56, Parcel::default()));
        let assignments_of = |one: &LoopLog| one.work.iter().map(|&(assignment, _)| assignment).collect::<Vec<_>>();
        let mut timed = assignments_of(items);
        timed.sort_unstable_by_key(|&assignment| assignments.iter().position(|&one| one == assignment));
        assert_eq!(timed, [assignments[0], assignments[2], assignments[3]]);
        assert_eq!(assignments_of(sums), [Assignment::InOrder(4), Assignment::InOrder(5)]);
        assert_eq!((sums.sums.bytes, sums.items, sums.results.len()), (24, Parcel::default(), 0));
        assert!([items, sums].iter().all(|one| one.work.iter().all(|(_, seconds)| *seconds >= 0.0)));
    }

    /// Owners need not follow a pattern, and a rank may own no items.
    #[test]
    fn items_are_computed_by_their_owners_alone() {
        let owners = [2, 2, 0, 3, 2, 0];
        let assignments = owners.map(Assignment::InOrder);
        let results = on_ranks(4, |ranks| {
            let mut seen = Vec::new();
            let all = share(ranks, &assignments, |own, _| {
                seen = own.to_vec();
                own.iter().map(|&k| (k as u32, ranks.rank() as u32)).collect()
            });
            (seen, all)
        });
        let expected: Vec<(u32, u32)> = owners.iter().zip(0..).map(|(&owner, k)| (k, owner)).collect();
        let own: Vec<Vec<usize>> = results.iter().map(|(seen, _)| seen.clone()).collect();
        assert_eq!(own, [vec![2, 5], vec![], vec![0, 1, 4], vec![3]]);
        assert!(results.iter().all(|(_, all)| *all == expected));
    }

    #[test]
    fn operations_of_threads_are_those_of_their_names() {
        let given = |rank: usize| vec![rank as u8; 3 * rank];
        let all: Vec<Vec<u8>> = (0..3).map(given).collect();
        let results = on_ranks(3, |ranks| {
            let own = || given(ranks.rank());
            (ranks.all_gather(own()), ranks.gather(own()), ranks.broadcast(vec![ranks.rank() as u8 + 7]))
        });
        for (rank, (everywhere, at_first, of_first)) in results.into_iter().enumerate() {
            assert_eq!((everywhere, of_first), (all.clone(), vec![7]));
            assert_eq!(at_first, (rank == 0).then(|| all.clone()));
        }
        assert_eq!(Alone.gather(vec![1, 2]), Some(Alone.all_gather(vec![1, 2])));
    }

    /// Ranks with different states panic instead of using each other's results.
    #[test]
    fn loops_of_different_length_are_not_shared() {
        let results: Vec<bool> = std::thread::scope(|scope| {
            let share_own = |ranks: ThreadRanks| {
                let items = 5 + ranks.rank();
                share(&ranks, &in_order(items), |own, _| vec![0u8; own.len()])
            };
            let started: Vec<_> =
                ThreadRanks::new(2).into_iter().map(|own| scope.spawn(move || share_own(own))).collect();
            started.into_iter().map(|thread| thread.join().is_err()).collect()
        });
        assert_eq!(results, [true, true]);
    }

    /// A rank that waits for an ended rank panics.
    #[test]
    fn who_waits_for_a_rank_that_is_gone_fails() {
        let mut ranks = ThreadRanks::new(2);
        drop(ranks.pop());
        let [first] = ranks.try_into().expect("one is left");
        let waits = std::thread::spawn(move || first.all_gather(Vec::new()));
        assert!(waits.join().is_err());
    }
}

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
