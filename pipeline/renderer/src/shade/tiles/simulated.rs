//! Simulation of any number of ranks on one processor. Each rank lights its tiles with its own cache, in measured time.
//! A simulated network determines the duration of messages. The rank with the earliest clock runs next.

use super::Workers;
use super::job::{Job, TileLight};
use super::master::{Master, Message, Outbox, Outgoing};
use crate::settings::TileSettings;
use crate::shade::layer::{Lit, Visible};
use crate::shade::layers::Layers;
use crate::shade::tolerance::Tolerance;
use rayon::ThreadPool;
use render_core::Busy;
use render_core::cache::SharedRecord;
use render_core::ranks::{Network, Portable};
use std::sync::{Arc, Mutex, PoisonError};

/// Ranks that one process simulates, and their statistics.
#[derive(Clone, Debug)]
pub struct SimulatedRanks {
    /// Number of ranks.
    pub count: usize,
    /// Network between the ranks.
    pub network: Network,
    frames: Arc<Mutex<Vec<SimulatedFrame>>>,
}

impl SimulatedRanks {
    /// Creates `count` simulated ranks, at least one.
    #[must_use]
    pub fn new(count: usize, network: Network) -> Self {
        Self { count: count.max(1), network, frames: Arc::default() }
    }

    /// Returns the statistics of the frames so far.
    #[must_use]
    pub fn frames(&self) -> Vec<SimulatedFrame> {
        self.frames.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

/// Statistics of a frame on several ranks.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SimulatedFrame {
    /// Time from the start of the first rank until all ranks have received all light \[s\].
    pub seconds: f64,
    /// Total CPU time of all ranks \[s\].
    pub all_busy: f64,
    /// CPU time of the busiest rank \[s\].
    pub most_busy: f64,
    /// Number of tiles.
    pub tiles: u64,
    /// Number of computed records.
    pub records: u64,
    /// Number of messages between ranks, excluding the light of tiles.
    pub messages: u64,
    /// Size of all counted messages \[bytes\].
    pub bytes: u64,
}

/// Simulated rank.
struct Rank {
    /// Layers of the rank; `None` for rank 0, which uses the layers of this process.
    layers: Option<Layers>,
    outbox: Outbox,
    /// Records in transit, each list with its arrival time \[s\].
    coming: Vec<(f64, Vec<SharedRecord>)>,
    /// Time since the start of the job \[s\].
    clock: f64,
    /// Time from which the rank's connection is free \[s\].
    line_free: f64,
    /// CPU time of the rank in this frame \[s\].
    busy: f64,
    is_done: bool,
}

/// Simulated ranks of a film.
pub(super) struct SimulatedTeam {
    settings: TileSettings,
    ranks: SimulatedRanks,
    all: Vec<Rank>,
    master: Master,
    /// Pool of one thread, which no other work can interrupt.
    pool: ThreadPool,
    frame: SimulatedFrame,
}

impl SimulatedTeam {
    /// Creates ranks that light tiles, each with its own layers from `layers`.
    pub fn new(settings: TileSettings, ranks: SimulatedRanks, layers: impl Fn() -> Layers) -> Self {
        let rank = |number: usize| Rank {
            layers: (number > 0).then(&layers),
            outbox: Outbox::default(),
            coming: Vec::new(),
            clock: 0.0,
            line_free: 0.0,
            busy: 0.0,
            is_done: false,
        };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread can be started");
        let all = (0..ranks.count).map(rank).collect();
        let master = Master::new(ranks.count);
        Self { settings, ranks, all, master, pool, frame: SimulatedFrame::default() }
    }

    /// Returns the time during which a message of `bytes` bytes occupies a network connection \[s\].
    fn transfer(&self, bytes: usize) -> f64 {
        bytes as f64 / self.ranks.network.bandwidth
    }

    /// Counts a message of `bytes` bytes.
    fn note(&mut self, bytes: usize) {
        self.frame.messages += 1;
        self.frame.bytes += bytes as u64;
    }

    /// Sends records to all other ranks, one after the other, in parallel with the sender's work.
    fn send_to_each(&mut self, from: usize, records: Vec<SharedRecord>) {
        let bytes = Message::Records { records: records.clone() }.bytes().len();
        let mut free = self.all[from].clock.max(self.all[from].line_free);
        for to in (0..self.all.len()).filter(|&to| to != from) {
            free += self.transfer(bytes);
            self.note(bytes);
            self.all[to].coming.push((free + self.ranks.network.latency, records.clone()));
        }
        self.all[from].line_free = free;
    }

    /// Returns the next tile for `rank`, and advances the rank's clock by the waiting time. Rank 0 serves one request
    /// at a time.
    fn ask(&mut self, rank: usize, records: Vec<SharedRecord>) -> Option<u32> {
        // Build the same messages as real ranks: their sizes determine the transfer time.
        let sent = Message::Ask { records: records.clone() }.bytes().len();
        let others = if records.is_empty() { Vec::new() } else { self.master.exchange(rank, records) };
        let tile = self.master.next_tile();
        let answer = Message::Give { tile, records: others.clone() }.bytes().len();
        // Wait until the connection of rank 0 is free: each request occupies it.
        if rank > 0 {
            let latency = self.ranks.network.latency;
            let begin = (self.all[rank].clock + latency).max(self.all[0].line_free);
            let end = begin + self.transfer(sent) + self.transfer(answer);
            self.all[0].line_free = end;
            self.all[rank].clock = end + latency;
            self.note(sent);
            self.note(answer);
        }
        let now = self.all[rank].clock;
        self.all[rank].coming.push((now, others));
        tile
    }

    /// Returns the records that `rank` has received by the time on its clock.
    fn arrived(&mut self, rank: usize) -> Vec<SharedRecord> {
        let Rank { coming, clock, .. } = &mut self.all[rank];
        let mut arrived = Vec::new();
        coming.retain_mut(|(time, records)| {
            let is_there = *time <= *clock;
            if is_there {
                arrived.append(records);
            }
            !is_there
        });
        arrived
    }

    /// Runs `work` with the layers of `rank`, or with `own` for this process, and advances the rank's clock by the CPU
    /// time.
    fn timed<T: Send>(&mut self, rank: usize, own: &mut Layers, work: impl FnOnce(&mut Layers) -> T + Send) -> T {
        let Rank { layers, clock, busy, .. } = &mut self.all[rank];
        let layers = layers.as_mut().unwrap_or(own);
        let measured = Busy::default();
        let result = self.pool.install(|| measured.measure(|| work(layers)));
        *clock += measured.seconds();
        *busy += measured.seconds();
        result
    }

    /// Runs a step of `rank`: sends records, requests a tile and lights it. Returns `None` if no tile remains.
    fn step(&mut self, rank: usize, own: &mut Layers, (job, counts): (&Job, &mut [Lit; 2])) -> Option<TileLight> {
        let Outgoing { to_master, to_each } = self.all[rank].outbox.due(&self.settings);
        if !to_each.is_empty() {
            self.send_to_each(rank, to_each);
        }
        // Light the next tile with all records that have arrived by the rank's clock.
        let tile = self.ask(rank, to_master)?;
        let (arrived, before) = (self.arrived(rank), self.all[rank].busy);
        let (mut lit, made) = self.timed(rank, own, |layers| {
            layers.adopt(arrived);
            (job.light(tile, layers, counts), layers.take_records())
        });
        lit.seconds = self.all[rank].busy - before;
        self.all[rank].outbox.add(made);
        Some(lit)
    }
}

impl Workers for SimulatedTeam {
    fn count(&self) -> usize {
        self.all.len()
    }

    fn begin(&mut self, layers: &mut Layers, visible: &Visible, tolerance: &Tolerance) {
        self.frame = SimulatedFrame::default();
        for rank in 0..self.all.len() {
            self.all[rank].busy = 0.0;
            self.timed(rank, layers, |layers| layers.begin_regions(visible, tolerance));
        }
    }

    fn work(&mut self, layers: &mut Layers, job: &Job, counts: &mut [Lit; 2]) -> Vec<TileLight> {
        // Run one step of one rank at a time, until no tile remains.
        self.master.begin(job.tiles.len());
        let (mut lit, mut sizes) = (Vec::new(), vec![0; self.all.len()]);
        loop {
            // Select the rank with the earliest clock.
            let mut next: Option<usize> = None;
            for (rank, own) in self.all.iter().enumerate() {
                if !own.is_done && next.is_none_or(|next| own.clock < self.all[next].clock) {
                    next = Some(rank);
                }
            }
            let Some(rank) = next else { break };
            match self.step(rank, layers, (job, counts)) {
                Some(tile) => {
                    let mut bytes = Vec::new();
                    tile.put(&mut bytes);
                    sizes[rank] += bytes.len();
                    lit.push(tile);
                }
                None => self.all[rank].is_done = true,
            }
        }

        // Advance all ranks to the last clock: they wait for the light of all tiles.
        let last = self.all.iter().map(|rank| rank.clock).fold(0.0, f64::max);
        let gathered = self.ranks.network.all_gather(&sizes);
        self.frame.seconds += last + gathered;
        for rank in &mut self.all {
            (rank.clock, rank.line_free, rank.is_done) = (0.0, 0.0, false);
            // Deliver all records in transit: they have arrived by then.
            rank.coming.iter_mut().for_each(|(time, _)| *time = 0.0);
        }
        self.frame.tiles += lit.len() as u64;
        self.frame.records += lit.iter().map(|lit| lit.records_computed).sum::<u64>();
        lit.sort_by_key(|lit| lit.tile);
        lit
    }

    fn end(&mut self, layers: &mut Layers, visible: &Visible) {
        for rank in 0..self.all.len() {
            self.timed(rank, layers, |layers| layers.end_regions(visible));
        }
        // Sum the CPU time of the whole frame, including its preparation.
        let busy = self.all.iter().map(|rank| rank.busy);
        self.frame.all_busy = busy.clone().sum();
        self.frame.most_busy = busy.fold(0.0, f64::max);

        // Add the time until the last clock to the time of the frame.
        self.frame.seconds += self.all.iter().map(|rank| rank.clock).fold(0.0, f64::max);
        self.all.iter_mut().for_each(|rank| rank.clock = 0.0);
        self.ranks.frames.lock().unwrap_or_else(PoisonError::into_inner).push(self.frame);
    }

    fn forget(&mut self) {
        for rank in &mut self.all {
            rank.outbox.clear();
            rank.coming.clear();
            rank.layers.iter_mut().for_each(Layers::forget);
        }
    }
}
