//! Rank 0 as the master: it hands out tiles, and keeps the list of a centralized cache.

use render_core::cache::SharedRecord;
use render_core::ranks::Portable;

/// The tiles that are left, and all records of a centralized cache \[Debattista05, section 4.3\].
#[derive(Debug)]
pub(super) struct Master {
    tiles: u32,
    next: u32,
    /// Records with the rank that made each, but for those that every rank has.
    list: Vec<(usize, SharedRecord)>,
    /// Number of the first of them, and by rank, of the first that it was not given. Numbers run on from frame to frame.
    first: usize,
    given: Vec<usize>,
}

impl Master {
    /// The master of so many ranks.
    pub fn new(ranks: usize) -> Self {
        Self { tiles: 0, next: 0, list: Vec::new(), first: 0, given: vec![0; ranks] }
    }

    /// Has so many tiles to hand out from now on.
    pub fn begin(&mut self, tiles: usize) {
        (self.tiles, self.next) = (tiles as u32, 0);
    }

    /// The next tile, if one is left.
    pub fn next_tile(&mut self) -> Option<u32> {
        let tile = (self.next < self.tiles).then_some(self.next);
        self.next += u32::from(tile.is_some());
        tile
    }

    /// Takes records of a rank, and gives it those of all others that it was not given before.
    pub fn exchange(&mut self, rank: usize, records: Vec<SharedRecord>) -> Vec<SharedRecord> {
        let mut others = Vec::new();
        for &(maker, record) in &self.list[self.given[rank] - self.first..] {
            if maker != rank {
                others.push(record);
            }
        }
        self.list.extend(records.into_iter().map(|record| (rank, record)));
        self.given[rank] = self.first + self.list.len();

        // Records that all have are not needed any more.
        let all_have = self.given.iter().copied().min().unwrap_or_default();
        self.list.drain(..all_have - self.first);
        self.first = all_have;
        others
    }
}

/// A message between ranks that take tiles.
#[derive(Debug, PartialEq)]
pub(super) enum Message {
    /// To rank 0: the next tile is wanted. With records, the others' are wanted as well.
    Ask { records: Vec<SharedRecord> },
    /// The answer of rank 0.
    Give { tile: Option<u32>, records: Vec<SharedRecord> },
    /// From each to each: records.
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
    /// The bytes of the message.
    pub fn bytes(&self) -> Vec<u8> {
        let mut bytes = Vec::new();
        self.put(&mut bytes);
        bytes
    }
}
