//! Simulated time of a run on any number of ranks, computed from the log of the run on one rank.
//!
//! ```text
//! C(R) = S + max_r Σ_l c_rl                        CPU time of the busiest rank
//! T(R) = S + Σ_l ( max_r c_rl + t(b_1l … b_Rl) )   time of the run, if each rank has one processor
//! t(b_1 … b_R) = 2 ⌈log₂ R⌉ α + (R − 1) (8 + max_r b_r) / β
//!
//! S     CPU time outside the items of shared loops, which every rank spends
//! c_rl  CPU time of rank r for its own items of loop l and for packing and unpacking results
//! b_rl  bytes that rank r sends after loop l
//! α, β  latency and bandwidth between two ranks
//! ```
//! t is the time of an all-gather by recursive doubling \[Thakur05\]. Each loop has two all-gathers, because \[MPI\]
//! needs the lengths first. The second all-gather sends the bytes, padded to the length of the longest rank.
//!
//! # Differences from a real run
//! * Each loop waits for the previous one, and ranks are idle meanwhile. In a real run, one stage works while another
//!   stage waits.
//! * Messages from rank 0 to the other ranks (two numbers per pixel and frame) take no time.
//! * All ranks are equally fast, and memory access does not slow down with the number of ranks.

use super::{Assignment, LoopLog};

/// Connections between ranks. All connections have the same speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Network {
    /// Time from sending until the first byte arrives \[s\].
    pub latency: f64,
    /// Bandwidth of one connection \[bytes/s\].
    pub bandwidth: f64,
}

/// Size of a transmitted length \[bytes\].
const LENGTH: usize = 8;

impl Network {
    /// Returns the time of an all-gather \[s\], t(b_1 … b_R) in the module's equations. `sizes` contains the bytes that
    /// each rank sends.
    #[must_use]
    pub fn all_gather(&self, sizes: &[usize]) -> f64 {
        let longest = sizes.iter().copied().max().unwrap_or_default();
        let bytes = sizes.len().saturating_sub(1) * (LENGTH + longest);
        // Recursive doubling takes ⌈log₂ R⌉ steps.
        let steps = sizes.len().max(1).next_power_of_two().trailing_zeros();
        2.0 * f64::from(steps) * self.latency + bytes as f64 / self.bandwidth
    }
}

/// Log of a whole run on one rank with one thread.
#[derive(Clone, Debug, Default)]
pub struct LoggedRun {
    /// Logs of the loops that several ranks would share.
    pub loops: Vec<LoopLog>,
    /// CPU time of the process \[s\].
    pub cpu: f64,
    /// CPU time of work that only rank 0 performs, for example encoding \[s\]. It is included in `cpu`.
    pub of_first_rank: f64,
}

/// Simulated cost of a run on several ranks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Simulated {
    /// CPU time of the busiest rank \[s\].
    pub busiest: f64,
    /// Duration of the run \[s\].
    pub seconds: f64,
}

impl LoggedRun {
    /// Returns the CPU time outside the items of shared loops \[s\].
    #[must_use]
    pub fn unshared(&self) -> f64 {
        let mut unshared = self.cpu;
        // Subtract the items of shared loops, and the cost of logging them.
        for one in &self.loops {
            unshared -= one.work.iter().map(|(_, seconds)| seconds).sum::<f64>() + one.logging;
        }
        unshared
    }

    /// Simulates the logged run on `count` ranks, at least 1.
    #[must_use]
    pub fn on(&self, count: usize, network: &Network) -> Simulated {
        // The CPU time in `of_first_rank` occurs on rank 0 only.
        let unshared = self.unshared();
        let mut of_rank = vec![unshared - self.of_first_rank; count];
        of_rank[0] = unshared;
        let mut seconds = unshared;
        for one in &self.loops {
            // Each loop lasts as long as its busiest rank, followed by the exchange.
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

/// Returns, for each of `count` ranks, the CPU time in a loop \[s\] and the number of bytes that the rank sends.
fn of_each(one: &LoopLog, count: usize) -> (Vec<f64>, Vec<usize>) {
    let (mut own, mut sizes) = (vec![0.0; count], vec![0; count]);
    let of = |assignment: &Assignment| assignment.owner(count);
    for (assignment, seconds) in &one.work {
        own[of(assignment)] += seconds;
    }
    if count == 1 {
        return (own, sizes);
    }

    // Each rank packs its own results and unpacks the results of all ranks. The results start with the number of items.
    for (assignment, bytes) in &one.results {
        sizes[of(assignment)] += bytes;
    }
    let header = if one.results.is_empty() { 0 } else { LENGTH };
    for (own, size) in own.iter_mut().zip(&mut sizes) {
        // Packing is proportional to a rank's own bytes. Unpacking is equal on all ranks.
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

    /// Network without latency and with unlimited bandwidth.
    const AT_ONCE: Network = Network { latency: 0.0, bandwidth: f64::INFINITY };

    fn run(loops: Vec<LoopLog>, cpu: f64) -> LoggedRun {
        LoggedRun { loops, cpu, of_first_rank: 0.0 }
    }

    fn items(seconds: &[f64]) -> LoopLog {
        let work = seconds.iter().zip(0..).map(|(&seconds, k)| (Assignment::InOrder(k), seconds)).collect();
        LoopLog { work, ..LoopLog::default() }
    }

    /// Compares with a tolerance, because a different summation order changes the rounding.
    fn assert_near(simulated: Simulated, busiest: f64, seconds: f64) {
        let is_near = |a: f64, b: f64| (a - b).abs() < 1e-9 * b.abs().max(1.0);
        assert!(
            is_near(simulated.busiest, busiest) && is_near(simulated.seconds, seconds),
            "{simulated:?}: {busiest} {seconds}"
        );
    }

    /// C = T = S + (n / R) c if R divides n: n items of c seconds each.
    #[test]
    fn equal_items_are_divided_by_ranks() {
        let run = run(vec![items(&[0.25; 64]); 3], 50.0);
        for count in [1, 2, 4, 8, 16, 32, 64] {
            let expected = 2.0 + 48.0 / count as f64;
            assert_near(run.on(count, &AT_ONCE), expected, expected);
        }
    }

    /// Each loop has one large item, and a different rank owns it. The time equals the time of one rank.
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
        // Work that only rank 0 performs runs in parallel with the other ranks' work.
        let run = LoggedRun { of_first_rank: 2.0, ..run(vec![items(&[0.0, 3.0])], 8.0) };
        assert_near(run.on(2, &AT_ONCE), 6.0, 8.0);
    }

    /// Each loop has two all-gathers of ⌈log₂ R⌉ steps.
    #[test]
    fn latency_goes_by_steps() {
        let network = Network { latency: 0.5, ..AT_ONCE };
        let run = run(vec![items(&[]); 10], 1.0);
        for (count, steps) in [(1, 0.0), (2, 1.0), (3, 2.0), (4, 2.0), (5, 3.0), (64, 6.0)] {
            assert_near(run.on(count, &network), 1.0, 1.0 + 10.0 * steps);
        }
    }

    /// Rank 0 of two ranks sends three results of four bytes and their count. Rank 1 pads its two results to that
    /// length.
    #[test]
    fn bytes_are_those_of_the_longest() {
        let network = Network { latency: 0.0, bandwidth: 100.0 };
        let results = (0..5).map(|k| (Assignment::InOrder(k), 4)).collect();
        let of_items = LoopLog { results, items: Parcel { bytes: 20, ..Parcel::default() }, ..LoopLog::default() };
        let sum = LoopLog { sums: Parcel { bytes: 92, ..Parcel::default() }, ..LoopLog::default() };
        let run = run(vec![of_items, sum], 0.0);
        assert_near(run.on(1, &network), 0.0, 0.0);
        assert_near(run.on(2, &network), 0.0, 0.28 + 1.0);
        assert_near(run.on(11, &network), 0.0, 10.0 * (0.20 + 1.0));
    }

    /// Results are packed once in total, and each rank unpacks them. Each rank packs its own sums and unpacks the sums
    /// of all ranks. The log's own CPU time is not counted.
    #[test]
    fn packing_takes_time_among_several() {
        let (results, half) = (vec![(Assignment::InOrder(0), 3), (Assignment::InOrder(1), 1)], 0.5);
        let packed = Parcel { bytes: 4, packing: 4.0, unpacking: 8.0 };
        let of_items = LoopLog { results, items: packed, logging: half, ..LoopLog::default() };
        let sum = LoopLog { sums: packed, logging: half, ..LoopLog::default() };
        let run = run(vec![of_items, sum], 2.0);
        assert_near(run.on(1, &AT_ONCE), 1.0, 1.0);
        assert_near(run.on(2, &AT_ONCE), 1.0 + 3.0 + 8.0 + 4.0 + 16.0, 1.0 + 3.0 + 8.0 + 4.0 + 16.0);
    }
}
