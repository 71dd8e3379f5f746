//! Messages from one rank to another, of which the others know nothing.

use std::collections::VecDeque;
use std::fmt::Debug;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

/// Bytes that a rank has sent.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Message {
    /// The number of the rank.
    pub from: usize,
    /// As they were sent.
    pub bytes: Vec<u8>,
}

/// One rank's messages to and from each of the ranks.
///
/// Unlike the operations of [`Ranks`](super::Ranks), a message concerns two ranks alone, and comes when it comes: work that goes
/// to whoever is idle is handed out so \[Debattista05, 4.2\]. The order in which messages of different ranks arrive depends on time.
///
/// Any thread may send and receive, but none inside of a rayon job may wait.
pub trait Mail: Send + Sync + Debug {
    /// The number of this process, from 0.
    fn rank(&self) -> usize;

    /// Processes in all, 1 at least.
    fn count(&self) -> usize;

    /// Sends `bytes` to the rank `to`, which may be this one, and returns at once. Messages of one rank to another arrive in order.
    /// A message to a rank that has ended is lost.
    ///
    /// # Panics
    /// If there is no such rank.
    fn send(&self, to: usize, bytes: Vec<u8>);

    /// The next message of any rank; waits until there is one.
    ///
    /// A process alone waits until another of its threads sends something.
    ///
    /// # Panics
    /// If no message is left, and all other ranks have ended.
    fn receive(&self) -> Message;

    /// The next message if there is one.
    fn try_receive(&self) -> Option<Message>;
}

/// Messages that have arrived at a rank, for those who carry them there and those who wait for them.
#[derive(Debug)]
pub struct Inbox {
    /// Ranks beside this one.
    others: usize,
    arrived: Mutex<Arrived>,
    changed: Condvar,
}

/// Messages by the order in which they came, and how many of the other ranks have ended.
#[derive(Debug, Default)]
struct Arrived {
    messages: VecDeque<Message>,
    ended: usize,
}

impl Inbox {
    /// An empty inbox of a rank beside which there are `others` ranks.
    #[must_use]
    pub fn new(others: usize) -> Self {
        Self { others, arrived: Mutex::default(), changed: Condvar::new() }
    }

    /// Adds a message.
    pub fn put(&self, message: Message) {
        self.arrived().messages.push_back(message);
        self.changed.notify_one();
    }

    /// Notes that one of the other ranks has ended, after its last message. To be called once for each of them.
    pub fn note_end(&self) {
        self.arrived().ended += 1;
        self.changed.notify_all();
    }

    /// Takes the first message, as [`Mail::receive`] does.
    ///
    /// # Panics
    /// If no message is left, and all other ranks have ended.
    pub fn take(&self) -> Message {
        let mut arrived = self.arrived();
        loop {
            if let Some(message) = arrived.messages.pop_front() {
                return message;
            }
            assert!(self.others == 0 || arrived.ended < self.others, "another rank has ended");
            arrived = self.changed.wait(arrived).unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// Takes the first message if there is one.
    pub fn try_take(&self) -> Option<Message> {
        self.arrived().messages.pop_front()
    }

    fn arrived(&self) -> MutexGuard<'_, Arrived> {
        self.arrived.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Mail of a rank that is a thread, or of a process alone. It ends when it is dropped.
#[derive(Debug)]
pub struct ThreadMail {
    rank: usize,
    /// By rank.
    inboxes: Arc<[Inbox]>,
}

impl ThreadMail {
    /// Mail of `count` ranks, in order: one for each thread.
    #[must_use]
    pub fn new(count: usize) -> Vec<Self> {
        let inboxes: Arc<[Inbox]> = (0..count).map(|_| Inbox::new(count - 1)).collect();
        (0..count).map(|rank| Self { rank, inboxes: inboxes.clone() }).collect()
    }

    /// Mail of a process alone.
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

    /// A process alone receives what it sends itself, also where a thread of it waits already.
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

    /// A rank takes what is left of the others, and fails once all of them have ended.
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
