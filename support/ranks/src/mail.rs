//! Messages between two ranks.

use std::collections::VecDeque;
use std::fmt::Debug;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

/// Message from a rank.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Message {
    /// Rank of the sender.
    pub from: usize,
    /// Content of the message, unchanged.
    pub bytes: Vec<u8>,
}

/// Messages between one rank and any other rank or itself.
///
/// A message concerns only two ranks and arrives at any time, unlike the operations of [`Ranks`](super::Ranks).
/// Messages assign work to idle ranks \[Debattista05, 4.2\]. The order of messages from different ranks depends on
/// timing.
///
/// Any thread may send and receive, but no thread may wait inside a rayon job.
pub trait Mail: Send + Sync + Debug {
    /// Number of this process, starting at 0.
    fn rank(&self) -> usize;

    /// Total number of processes, at least 1.
    fn count(&self) -> usize;

    /// Sends `bytes` to the rank `to`, which may be the sender, and returns immediately.
    ///
    /// Messages from one rank to another arrive in order. A message to a rank that has ended is lost.
    ///
    /// # Panics
    /// If the rank `to` does not exist.
    fn send(&self, to: usize, bytes: Vec<u8>);

    /// Waits for the next message from any rank and returns it.
    ///
    /// In a single process, waits until another thread sends a message.
    ///
    /// # Panics
    /// If no message remains and all other ranks have ended.
    fn receive(&self) -> Message;

    /// Returns the next message, or `None` if no message has arrived.
    fn try_receive(&self) -> Option<Message>;
}

/// Queue of the messages that have arrived at a rank. Threads that deliver and receive messages share it.
#[derive(Debug)]
pub struct Inbox {
    /// Number of other ranks.
    others: usize,
    arrived: Mutex<Arrived>,
    changed: Condvar,
}

/// Messages in order of arrival, and the number of other ranks that have ended.
#[derive(Debug, Default)]
struct Arrived {
    messages: VecDeque<Message>,
    ended: usize,
}

impl Inbox {
    /// Creates the empty inbox of a rank in a group with `others` other ranks.
    #[must_use]
    pub fn new(others: usize) -> Self {
        Self { others, arrived: Mutex::default(), changed: Condvar::new() }
    }

    /// Adds a message to the end of the queue.
    pub fn put(&self, message: Message) {
        self.arrived().messages.push_back(message);
        self.changed.notify_one();
    }

    /// Records that another rank has ended and sends no more messages. Call it once for each of the other ranks.
    pub fn note_end(&self) {
        self.arrived().ended += 1;
        self.changed.notify_all();
    }

    /// Removes and returns the first message. Waits for one like [`Mail::receive`].
    ///
    /// # Panics
    /// If no message remains and all other ranks have ended.
    pub fn take(&self) -> Message {
        let mut arrived = self.arrived();
        loop {
            // Deliver all messages before reporting ended ranks.
            if let Some(message) = arrived.messages.pop_front() {
                return message;
            }
            // If all other ranks have ended, no message can arrive.
            assert!(self.others == 0 || arrived.ended < self.others, "another rank has ended");
            arrived = self.changed.wait(arrived).unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// Removes and returns the first message, or returns `None` if no message has arrived.
    pub fn try_take(&self) -> Option<Message> {
        self.arrived().messages.pop_front()
    }

    fn arrived(&self) -> MutexGuard<'_, Arrived> {
        self.arrived.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Mail of a single process, or of a rank that is a thread. Dropping the mail ends the rank.
#[derive(Debug)]
pub struct ThreadMail {
    rank: usize,
    /// Inboxes, indexed by rank.
    inboxes: Arc<[Inbox]>,
}

impl ThreadMail {
    /// Creates the mail of `count` ranks in order, one per thread.
    #[must_use]
    pub fn new(count: usize) -> Vec<Self> {
        let inboxes: Arc<[Inbox]> = (0..count).map(|_| Inbox::new(count - 1)).collect();
        (0..count).map(|rank| Self { rank, inboxes: inboxes.clone() }).collect()
    }

    /// Creates the mail of a single process.
    #[must_use]
    pub fn alone() -> Self {
        Self { rank: 0, inboxes: Arc::new([Inbox::new(0)]) }
    }
}

impl Mail for ThreadMail {
    fn rank(&self) -> usize {
        self.rank
    }

    fn count(&self) -> usize {
        self.inboxes.len()
    }

    fn send(&self, to: usize, bytes: Vec<u8>) {
        self.inboxes[to].put(Message { from: self.rank, bytes });
    }

    fn receive(&self) -> Message {
        self.inboxes[self.rank].take()
    }

    fn try_receive(&self) -> Option<Message> {
        self.inboxes[self.rank].try_take()
    }
}

impl Drop for ThreadMail {
    fn drop(&mut self) {
        // Wake the ranks that wait for a message, because none may arrive.
        let others = self.inboxes.iter().enumerate().filter(|&(rank, _)| rank != self.rank);
        others.for_each(|(_, inbox)| inbox.note_end());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(from: usize, bytes: &[u8]) -> Message {
        Message { from, bytes: bytes.to_vec() }
    }

    /// A single process receives its own messages, even in a thread that is already waiting.
    #[test]
    fn a_process_alone_has_its_own_messages() {
        let mail = ThreadMail::alone();
        assert_eq!((mail.rank(), mail.count(), mail.try_receive()), (0, 1, None));
        mail.send(0, vec![1]);
        mail.send(0, Vec::new());
        assert_eq!([mail.receive(), mail.receive()], [message(0, &[1]), message(0, &[])]);
        let last = std::thread::scope(|scope| {
            let waits = scope.spawn(|| mail.receive());
            mail.send(0, vec![2]);
            waits.join().expect("it gets the message")
        });
        assert_eq!((last, mail.try_receive()), (message(0, &[2]), None));
    }

    /// A rank receives the remaining messages of ended ranks. It panics once all others have ended and no message
    /// remains.
    #[test]
    fn who_waits_for_ranks_that_are_gone_fails() {
        let mut mail = ThreadMail::new(3);
        let (third, second) = (mail.pop().expect("three"), mail.pop().expect("three"));
        let [first] = mail.try_into().expect("one is left");
        second.send(0, vec![7]);
        drop(second);
        third.send(0, vec![8]);
        third.send(1, vec![9]);
        let waits = std::thread::spawn(move || {
            let messages = [first.receive(), first.receive()];
            let fails = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| first.receive()));
            (messages, fails.is_err())
        });
        drop(third);
        let (messages, fails) = waits.join().expect("only the last call fails");
        assert_eq!((messages, fails), ([message(1, &[7]), message(2, &[8])], true));
    }
}
