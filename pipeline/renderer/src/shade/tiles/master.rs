//! Master on rank 0: distributes tiles, and stores the records of a centralized cache.

use crate::settings::{RecordSharing, TileSettings};
use render_core::cache::SharedRecord;
use render_core::ranks::Portable;

/// Tiles to be lit, and the records of a centralized cache \[Debattista05, section 4.3\].
#[derive(Debug)]
pub(super) struct Master {
    tiles: u32,
    next: u32,
    /// Records that some rank lacks, each with the rank that computed it.
    list: Vec<(usize, SharedRecord)>,
    /// Number of the first record in `list`. Records are numbered continuously across frames.
    first: usize,
    /// Number of the first unsent record, for each receiving rank.
    given: Vec<usize>,
}

impl Master {
    /// Creates a master of `ranks` ranks, without tiles or records.
    pub fn new(ranks: usize) -> Self {
        Self { tiles: 0, next: 0, list: Vec::new(), first: 0, given: vec![0; ranks] }
    }

    /// Makes the tiles 0 … `tiles` − 1 available for distribution.
    pub fn begin(&mut self, tiles: usize) {
        (self.tiles, self.next) = (tiles as u32, 0);
    }

    /// Returns the next tile; `None` if none remains.
    pub fn next_tile(&mut self) -> Option<u32> {
        let tile = (self.next < self.tiles).then_some(self.next);
        self.next += u32::from(tile.is_some());
        tile
    }

    /// Stores the records of `rank`, and returns the records of other ranks that `rank` has not received yet.
    pub fn exchange(&mut self, rank: usize, records: Vec<SharedRecord>) -> Vec<SharedRecord> {
        let mut others = Vec::new();
        for &(maker, record) in &self.list[self.given[rank] - self.first..] {
            if maker != rank {
                others.push(record);
            }
        }
        self.list.extend(records.into_iter().map(|record| (rank, record)));
        self.given[rank] = self.first + self.list.len();

        // Drop records that every rank has.
        let all_have = self.given.iter().copied().min().unwrap_or_default();
        self.list.drain(..all_have - self.first);
        self.first = all_have;
        others
    }
}

/// Records of this rank that no other rank has.
#[derive(Debug, Default)]
pub(super) struct Outbox(Vec<SharedRecord>);

/// Records to be sent now, by recipient; usually none.
#[derive(Debug, Default, PartialEq)]
pub(super) struct Outgoing {
    /// Records for rank 0, sent with the next request.
    pub to_master: Vec<SharedRecord>,
    /// Records for each of the other ranks.
    pub to_each: Vec<SharedRecord>,
}

impl Outbox {
    /// Adds records that this rank has computed.
    pub fn add(&mut self, made: Vec<SharedRecord>) {
        self.0.extend(made);
    }

    /// Takes all records if they fill the buffer; otherwise none.
    pub fn due(&mut self, settings: &TileSettings) -> Outgoing {
        let mut due = Outgoing::default();
        let is_full = self.0.len() >= settings.buffer as usize;
        match settings.records {
            RecordSharing::None => self.0.clear(),
            RecordSharing::Central if is_full => due.to_master = std::mem::take(&mut self.0),
            RecordSharing::Each if is_full => due.to_each = std::mem::take(&mut self.0),
            RecordSharing::Central | RecordSharing::Each => {}
        }
        due
    }

    /// Discards all records.
    pub fn clear(&mut self) {
        self.0.clear();
    }
}

/// Message between ranks that light tiles.
#[derive(Debug, PartialEq)]
pub(super) enum Message {
    /// Request to rank 0 for the next tile. In a centralized cache, it contains new records and requests other ranks'
    /// records.
    Ask { records: Vec<SharedRecord> },
    /// Answer of rank 0: the next tile, if any, and the records of other ranks.
    Give { tile: Option<u32>, records: Vec<SharedRecord> },
    /// Records of the sender for the recipient's cache.
    Records { records: Vec<SharedRecord> },
}

impl Portable for Message {
    fn put(&self, bytes: &mut Vec<u8>) {
        let (kind, records) = match self {
            Self::Ask { records } => (0u8, records),
            Self::Give { records, .. } => (1, records),
            Self::Records { records } => (2, records),
        };
        kind.put(bytes);
        if let Self::Give { tile, .. } = self {
            tile.put(bytes);
        }
        records.put(bytes);
    }

    fn take(bytes: &mut &[u8]) -> Option<Self> {
        Some(match u8::take(bytes)? {
            0 => Self::Ask { records: Portable::take(bytes)? },
            1 => Self::Give { tile: Portable::take(bytes)?, records: Portable::take(bytes)? },
            2 => Self::Records { records: Portable::take(bytes)? },
            _ => return None,
        })
    }
}

impl Message {
    /// Returns the message as bytes.
    pub fn bytes(&self) -> Vec<u8> {
        let mut bytes = Vec::new();
        self.put(&mut bytes);
        bytes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a record that its first byte identifies.
    fn record(k: u8) -> SharedRecord {
        // Fill the rest with zeros: any bytes are valid numbers and form a record.
        let bytes = [&[k][..], &[0; 400]].concat();
        SharedRecord::take(&mut &bytes[..]).expect("enough bytes for a record")
    }

    /// Checks that each rank receives each record of the other ranks once, for any order of requests. The reference is
    /// a list of the records that each rank has.
    #[test]
    fn every_rank_is_given_what_it_lacks() {
        const RANKS: usize = 4;
        let mut master = Master::new(RANKS);
        let mut all: Vec<(usize, u8)> = Vec::new();
        let mut had = [0; RANKS];
        let mut next = 0u8;
        for turn in 0..60usize {
            // Let ranks request in an irregular order, the last one rarely.
            let rank = if turn % 11 == 10 { RANKS - 1 } else { turn * turn % (RANKS - 1) };
            let own: Vec<u8> = (next..next + (turn % 4) as u8).collect();
            next += own.len() as u8;

            let others = master.exchange(rank, own.iter().map(|&k| record(k)).collect());
            let lacked = all[had[rank]..].iter().filter(|(maker, _)| *maker != rank);
            assert_eq!(others, Vec::from_iter(lacked.map(|&(_, k)| record(k))), "turn {turn}");
            all.extend(own.iter().map(|&k| (rank, k)));
            had[rank] = all.len();

            // Expect that records of all ranks are dropped.
            assert_eq!(master.list.len(), all.len() - had.iter().min().unwrap());
        }
        assert!(next > 80 && had[RANKS - 1] > 0);
    }

    /// Checks that each mode sends no records before the buffer is full, and then all records at once.
    #[test]
    fn records_go_out_when_there_are_enough() {
        for (text, by_master, by_each) in [("rays,none", 0, 0), ("rays,central:3", 3, 0), ("rays,each:3", 0, 3)] {
            let settings: TileSettings = text.parse().unwrap();
            let mut outbox = Outbox::default();
            outbox.add(vec![record(1), record(2)]);
            assert_eq!(outbox.due(&settings), Outgoing::default(), "{text}");
            outbox.add(if text == "rays,none" { Vec::new() } else { vec![record(3)] });
            let due = outbox.due(&settings);
            assert_eq!((due.to_master.len(), due.to_each.len()), (by_master, by_each), "{text}");
            assert_eq!(outbox.due(&settings), Outgoing::default(), "{text}");
        }
    }

    #[test]
    fn tiles_are_given_once_each() {
        let mut master = Master::new(2);
        assert_eq!(master.next_tile(), None);
        for tiles in [3, 0, 1] {
            master.begin(tiles);
            let given: Vec<u32> = std::iter::from_fn(|| master.next_tile()).collect();
            assert_eq!(given, Vec::from_iter(0..tiles as u32));
        }
    }

    #[test]
    fn messages_come_back_from_their_bytes() {
        let records = || vec![record(1), record(7)];
        for message in [
            Message::Ask { records: Vec::new() },
            Message::Ask { records: records() },
            Message::Give { tile: None, records: Vec::new() },
            Message::Give { tile: Some(5), records: records() },
            Message::Records { records: records() },
        ] {
            let bytes = message.bytes();
            assert_eq!(Message::take(&mut &bytes[..]), Some(message));
            assert_eq!(Message::take(&mut &bytes[..bytes.len() - 1]), None);
        }
        assert_eq!(Message::take(&mut &[9u8][..]), None);
    }
}
