//! Ranks that are threads of one process, for tests and for callers without a message-passing library.

use super::Ranks;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Mutex, PoisonError};

/// A rank that is a thread, with one channel to every rank and one channel from every rank. Channels buffer messages,
/// so sending never blocks.
#[derive(Debug)]
pub struct ThreadRanks {
    rank: usize,
    /// Channels to the ranks, indexed by rank.
    to: Vec<Sender<Vec<u8>>>,
    from: Vec<Mutex<Receiver<Vec<u8>>>>,
}

impl ThreadRanks {
    /// Creates `count` ranks in order, one per thread.
    #[must_use]
    pub fn new(count: usize) -> Vec<Self> {
        let mut ranks: Vec<Self> = (0..count).map(|rank| Self { rank, to: Vec::new(), from: Vec::new() }).collect();
        // Connect each rank with every rank, including itself.
        for from in 0..count {
            for to in 0..count {
                let (sender, receiver) = channel();
                ranks[from].to.push(sender);
                ranks[to].from.push(Mutex::new(receiver));
            }
        }
        ranks
    }

    /// Sends `bytes` to a rank. Does nothing if that rank has ended.
    fn send(&self, to: usize, bytes: Vec<u8>) {
        let _ = self.to[to].send(bytes);
    }

    /// Waits for the next bytes from rank `from` and returns them.
    ///
    /// # Panics
    /// If that rank has ended.
    fn next_of(&self, from: usize) -> Vec<u8> {
        let receiver = self.from[from].lock().unwrap_or_else(PoisonError::into_inner);
        receiver.recv().expect("another rank has ended")
    }
}

impl Ranks for ThreadRanks {
    fn rank(&self) -> usize {
        self.rank
    }

    fn count(&self) -> usize {
        self.to.len()
    }

    fn all_gather(&self, own: Vec<u8>) -> Vec<Vec<u8>> {
        for to in 0..self.count() {
            self.send(to, own.clone());
        }
        (0..self.count()).map(|from| self.next_of(from)).collect()
    }

    fn gather(&self, own: Vec<u8>) -> Option<Vec<Vec<u8>>> {
        self.send(0, own);
        (self.rank == 0).then(|| (0..self.count()).map(|from| self.next_of(from)).collect())
    }

    fn broadcast(&self, own: Vec<u8>) -> Vec<u8> {
        if self.rank == 0 {
            for to in 0..self.count() {
                self.send(to, own.clone());
            }
        }
        self.next_of(0)
    }
}
