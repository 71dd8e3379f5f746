//! Time of a run on any number of ranks, from the log of the same run on one: no machine has to have them.
//!
//! ```text
//! C(R) = S + max_r Σ_l c_rl                        CPU time of the busiest rank
//! T(R) = S + Σ_l ( max_r c_rl + t(b_1l … b_Rl) )   time of the run, if each rank has one processor
//! t(b_1 … b_R) = 2 ⌈log₂ R⌉ α + (R − 1) (8 + max_r b_r) / β
//!
//! S     CPU time of all that is no item of a shared loop: every rank goes through it
//! c_rl  CPU time of rank r for its own items of loop l, and for results on their way
//! b_rl  bytes that rank r sends after loop l
//! α, β  latency and bandwidth between two ranks
//! ```
//! t is the time of an all-gather by recursive doubling \[Thakur05\]. There are two for each loop, as \[MPI\] wants to know
//! lengths: these go first, then the bytes, filled up to those of the rank that has most.
//!
//! # Differs from a real run
//! * Loops wait for each other, and work for nothing: in a real run a stage works while another waits.
//! * Messages from rank 0 to the others, two numbers a pixel and frame, take no time.
//! * All ranks are equally fast, and memory is as fast for many of them as for one.

use super::{LoopLog, Turn};

/// Ways between ranks, each as good as any other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Network {
    /// Time until the first byte comes \[s\].
    pub latency: f64,
    /// \[bytes/s\]
    pub bandwidth: f64,
}

/// Bytes of a length.
const LENGTH: usize = 8;

impl Network {
    /// Time until every rank has what all of them send: t of the module, by the `sizes` of what each rank sends \[s\].
    #[must_use]
    pub fn all_gather(&self, sizes: &[usize]) -> f64 {
        let longest = sizes.iter().copied().max().unwrap_or_default();
        let bytes = sizes.len().saturating_sub(1) * (LENGTH + longest);
        let steps = sizes.len().max(1).next_power_of_two().trailing_zeros();
        2.0 * f64::from(steps) * self.latency + bytes as f64 / self.bandwidth
    }
}

/// A whole run on one rank of one thread.
#[derive(Clone, Debug, Default)]
pub struct LoggedRun {
    /// The loops that it would share with others.
    pub loops: Vec<LoopLog>,
    /// CPU time of the process \[s\].
    pub cpu: f64,
    /// A part of it that no other rank has, such as coding \[s\].
    pub of_first_rank: f64,
}

/// A run on several ranks, as the simulation has it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Simulated {
    /// CPU time of the rank that has most of it \[s\].
    pub busiest: f64,
    /// Time of the whole \[s\].
    pub seconds: f64,
}

impl LoggedRun {
    /// CPU time of all that is no item of a shared loop \[s\].
    #[must_use]
    pub fn unshared(&self) -> f64 {
        let mut unshared = self.cpu;
        for one in &self.loops {
            unshared -= one.work.iter().map(|(_, seconds)| seconds).sum::<f64>() + one.logging;
        }
        unshared
    }

    /// The same run on `count` ranks, one at least.
    #[must_use]
    pub fn on(&self, count: usize, network: &Network) -> Simulated {
        // Rank 0 has its own part beside what all have.
        let unshared = self.unshared();
        let mut of_rank = vec![unshared - self.of_first_rank; count];
        of_rank[0] = unshared;
        let mut seconds = unshared;
        for one in &self.loops {
            let (own, sizes) = of_each(one, count);
            of_rank.iter_mut().zip(&own).for_each(|(sum, own)| *sum += own);
            seconds += greatest(&own);
            if count > 1 {
                seconds += network.all_gather(&sizes);
            }
        }
        Simulated { busiest: greatest(&of_rank), seconds }
    }
}

/// CPU time of each of `count` ranks for a loop \[s\], and the bytes that it sends.
fn of_each(one: &LoopLog, count: usize) -> (Vec<f64>, Vec<usize>) {
    let (mut own, mut sizes) = (vec![0.0; count], vec![0; count]);
    let of = |turn: &Turn| turn.owner(count);
    for (turn, seconds) in &one.work {
        own[of(turn)] += seconds;
    }
    if count == 1 {
        return (own, sizes);
    }

    // Each packs its own, and takes in those of all. With results comes how many items there are.
    for (turn, bytes) in &one.results {
        sizes[of(turn)] += bytes;
    }
    let header = if one.results.is_empty() { 0 } else { LENGTH };
    for (own, size) in own.iter_mut().zip(&mut sizes) {
        let share = *size as f64 / one.items.bytes.max(1) as f64;
        *own += share * one.items.packing + one.items.unpacking;
        *own += one.sums.packing + count as f64 * one.sums.unpacking;
        *size += header + one.sums.bytes;
    }
    (own, sizes)
}

fn greatest(values: &[f64]) -> f64 {
    values.iter().copied().fold(f64::NEG_INFINITY, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Parcel;

    /// Nothing takes time there.
    const AT_ONCE: Network = Network { latency: 0.0, bandwidth: f64::INFINITY };

    fn run(loops: Vec<LoopLog>, cpu: f64) -> LoggedRun {
        LoggedRun { loops, cpu, of_first_rank: 0.0 }
    }

    fn items(seconds: &[f64]) -> LoopLog {
        let work = seconds.iter().zip(0..).map(|(&seconds, k)| (Turn::InOrder(k), seconds)).collect();
        LoopLog { work, ..LoopLog::default() }
    }

    /// Sums in another order differ by rounding.
    fn assert_near(simulated: Simulated, busiest: f64, seconds: f64) {
        let is_near = |a: f64, b: f64| (a - b).abs() < 1e-9 * b.abs().max(1.0);
        assert!(
            is_near(simulated.busiest, busiest) && is_near(simulated.seconds, seconds),
            "{simulated:?}: {busiest} {seconds}"
        );
    }

    /// C = T = S + n/R c, wherever R divides n.
    #[test]
    fn equal_items_are_divided_by_ranks() {
        let run = run(vec![items(&[0.25; 64]); 3], 50.0);
        for count in [1, 2, 4, 8, 16, 32, 64] {
            let expected = 2.0 + 48.0 / count as f64;
            assert_near(run.on(count, &AT_ONCE), expected, expected);
        }
    }

    /// Loops of one large item each, of other ranks: none waits for itself alone, and time is that of one rank.
    #[test]
    fn large_items_are_not_divided() {
        let large = |k: usize| {
            let mut seconds = [0.0; 4];
            seconds[k] = 5.0;
            items(&seconds)
        };
        let run = run(vec![large(0), large(1), large(3)], 16.0);
        assert_near(run.on(2, &AT_ONCE), 11.0, 16.0);
        assert_near(run.on(4, &AT_ONCE), 6.0, 16.0);
    }

    #[test]
    fn what_is_not_shared_stays() {
        for count in [1, 7, 64] {
            assert_near(run(Vec::new(), 3.0).on(count, &AT_ONCE), 3.0, 3.0);
        }
        // What rank 0 has alone is beside the others' work.
        let run = LoggedRun { of_first_rank: 2.0, ..run(vec![items(&[0.0, 3.0])], 8.0) };
        assert_near(run.on(2, &AT_ONCE), 6.0, 8.0);
    }

    /// Two all-gathers a loop, each of ⌈log₂ R⌉ steps.
    #[test]
    fn latency_goes_by_steps() {
        let network = Network { latency: 0.5, ..AT_ONCE };
        let run = run(vec![items(&[]); 10], 1.0);
        for (count, steps) in [(1, 0.0), (2, 1.0), (3, 2.0), (4, 2.0), (5, 3.0), (64, 6.0)] {
            assert_near(run.on(count, &network), 1.0, 1.0 + 10.0 * steps);
        }
    }

    /// Rank 0 of two has three results of four bytes, and their number; rank 1 fills up what it has of two.
    #[test]
    fn bytes_are_those_of_the_longest() {
        let network = Network { latency: 0.0, bandwidth: 100.0 };
        let results = (0..5).map(|k| (Turn::InOrder(k), 4)).collect();
        let of_items = LoopLog { results, items: Parcel { bytes: 20, ..Parcel::default() }, ..LoopLog::default() };
        let sum = LoopLog { sums: Parcel { bytes: 92, ..Parcel::default() }, ..LoopLog::default() };
        let run = run(vec![of_items, sum], 0.0);
        assert_near(run.on(1, &network), 0.0, 0.0);
        assert_near(run.on(2, &network), 0.0, 0.28 + 1.0);
        assert_near(run.on(11, &network), 0.0, 10.0 * (0.20 + 1.0));
    }

    /// Results are packed once among all ranks and taken by each, sums packed by each and taken by each from all. The log's own
    /// time is nobody's.
    #[test]
    fn packing_takes_time_among_several() {
        let (results, half) = (vec![(Turn::InOrder(0), 3), (Turn::InOrder(1), 1)], 0.5);
        let packed = Parcel { bytes: 4, packing: 4.0, unpacking: 8.0 };
        let of_items = LoopLog { results, items: packed, logging: half, ..LoopLog::default() };
        let sum = LoopLog { sums: packed, logging: half, ..LoopLog::default() };
        let run = run(vec![of_items, sum], 2.0);
        assert_near(run.on(1, &AT_ONCE), 1.0, 1.0);
        assert_near(run.on(2, &AT_ONCE), 1.0 + 3.0 + 8.0 + 4.0 + 16.0, 1.0 + 3.0 + 8.0 + 4.0 + 16.0);
    }
}
