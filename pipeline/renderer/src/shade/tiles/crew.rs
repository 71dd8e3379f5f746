//! Ranks that request tiles by messages. Rank 0 also lights tiles; one of its threads answers the other ranks.

use super::Workers;
use super::job::{Job, TileLight};
use super::master::{Master, Message, Outbox, Outgoing};
use crate::settings::TileSettings;
use crate::shade::layer::{Lit, Visible};
use crate::shade::layers::Layers;
use crate::shade::tolerance::Tolerance;
use render_core::cache::SharedRecord;
use render_core::ranks::{Mail, Portable, Ranks};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Panic message for invalid data from another rank.
const DIFFERENT: &str = "ranks run the same program";

/// This rank as a member of a team.
pub(super) struct Team {
    settings: TileSettings,
    mail: Arc<dyn Mail>,
    ranks: Arc<dyn Ranks>,
    /// Tiles and records on rank 0; unused on other ranks.
    master: Mutex<Master>,
    /// Records from other ranks that are not in the cache yet.
    inbox: Mutex<Vec<SharedRecord>>,
    /// Records of this rank that no other rank has.
    outbox: Outbox,
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Team {
    /// Creates the team member of this rank, before any frame.
    pub fn new(settings: TileSettings, mail: Arc<dyn Mail>, ranks: Arc<dyn Ranks>) -> Self {
        let master = Mutex::new(Master::new(mail.count()));
        Self { settings, mail, ranks, master, inbox: Mutex::default(), outbox: Outbox::default() }
    }

    /// Answers the other ranks until each has received the answer that no tile remains.
    fn serve(&self) {
        let mut at_work = self.mail.count() - 1;
        while at_work > 0 {
            let (from, message) = self.next();
            match message {
                Message::Ask { records } => {
                    let give = self.give(from, records);
                    at_work -= usize::from(matches!(give, Message::Give { tile: None, .. }));
                    self.mail.send(from, give.bytes());
                }
                Message::Records { records } => locked(&self.inbox).extend(records),
                Message::Give { .. } => unreachable!("only rank 0 gives tiles"),
            }
        }
    }

    /// Returns the answer of rank 0 to a request of `rank`.
    fn give(&self, rank: usize, records: Vec<SharedRecord>) -> Message {
        let mut master = locked(&self.master);
        let records = if records.is_empty() { Vec::new() } else { master.exchange(rank, records) };
        Message::Give { tile: master.next_tile(), records }
    }

    /// Waits for the next message, and returns its sender and content.
    fn next(&self) -> (usize, Message) {
        let received = self.mail.receive();
        (received.from, Message::take(&mut &received.bytes[..]).expect(DIFFERENT))
    }

    /// Requests the next tile for this rank, and receives records of other ranks.
    fn ask(&self, records: Vec<SharedRecord>) -> Option<u32> {
        // Take the tile directly on rank 0, without a message.
        if self.mail.rank() == 0 {
            let Message::Give { tile, records } = self.give(0, records) else { unreachable!("it gives") };
            locked(&self.inbox).extend(records);
            return tile;
        }
        // Wait for the answer, and store records that arrive before it.
        self.mail.send(0, Message::Ask { records }.bytes());
        loop {
            match self.next().1 {
                Message::Give { tile, records } => {
                    locked(&self.inbox).extend(records);
                    return tile;
                }
                Message::Records { records } => locked(&self.inbox).extend(records),
                Message::Ask { .. } => unreachable!("only rank 0 receives requests"),
            }
        }
    }

    /// Lights one tile after another, until none remains.
    fn take_tiles(
        &self,
        layers: &mut Layers,
        outbox: &mut Outbox,
        (job, counts): (&Job, &mut [Lit; 2]),
    ) -> Vec<TileLight> {
        let mut lit = Vec::new();
        loop {
            // Send this rank's records when they fill the buffer.
            let Outgoing { to_master, to_each } = outbox.due(&self.settings);
            if !to_each.is_empty() {
                self.send_to_each(to_each);
            }
            let Some(tile) = self.ask(to_master) else { return lit };
            // Add received records before lighting: the tile then needs fewer new ones.
            layers.adopt(std::mem::take(&mut *locked(&self.inbox)));
            lit.push(job.light(tile, layers, counts));
            outbox.add(layers.take_records());
        }
    }

    fn send_to_each(&self, records: Vec<SharedRecord>) {
        let bytes = Message::Records { records }.bytes();
        for to in (0..self.mail.count()).filter(|&to| to != self.mail.rank()) {
            self.mail.send(to, bytes.clone());
        }
    }
}

impl Workers for Team {
    fn count(&self) -> usize {
        self.mail.count()
    }

    fn begin(&mut self, layers: &mut Layers, visible: &Visible, tolerance: &Tolerance) {
        layers.begin_regions(visible, tolerance);
    }

    fn work(&mut self, layers: &mut Layers, job: &Job, counts: &mut [Lit; 2]) -> Vec<TileLight> {
        // Answer requests on another thread of rank 0 while this thread lights tiles.
        let mut outbox = std::mem::take(&mut self.outbox);
        let team = &*self;
        let own = std::thread::scope(|scope| {
            if team.mail.rank() == 0 {
                locked(&team.master).begin(job.tiles.len());
                scope.spawn(|| team.serve());
            }
            team.take_tiles(layers, &mut outbox, (job, counts))
        });
        self.outbox = outbox;

        // Exchange the light of all tiles between all ranks.
        let mut bytes = Vec::new();
        own.put(&mut bytes);
        let mut all: Vec<TileLight> = Vec::new();
        for bytes in self.ranks.all_gather(bytes) {
            all.extend(Vec::<TileLight>::take(&mut &bytes[..]).expect(DIFFERENT));
        }
        all.sort_by_key(|lit| lit.tile);
        all
    }

    fn end(&mut self, layers: &mut Layers, visible: &Visible) {
        layers.end_regions(visible);
    }

    fn forget(&mut self) {
        self.outbox.clear();
        locked(&self.inbox).clear();
    }
}
