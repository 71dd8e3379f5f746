//! Messages between two ranks through MPI \[MPI, 3.7 and 3.8\], sent and received in parallel with the ranks' work.
//!
//! ```text
//! send ──► letters ──► thread ═══ MPI ═══► thread of the other rank ──► inbox ──► receive
//! ```
//! One thread sends and receives all messages of a rank, because a communicator stays on the thread that made it. While
//! sending, the thread receives messages from other ranks. Two ranks that send large messages to each other therefore
//! do not block.
//!
//! A message consists of its length (8 bytes) and its bytes, sent in pieces. Pieces from the same rank arrive in order
//! \[MPI, 3.5\]. A rank that ends notifies all others and waits for their notifications. MPI therefore ends with no
//! message in transit, and no message is lost.

use super::waiting::{PIECE, pause, rest, wait};
use crossbeam_channel::{Receiver, RecvTimeoutError, Sender, bounded, unbounded};
use mpi::request::scope;
use mpi::topology::SimpleCommunicator;
use mpi::traits::{Communicator, Destination, Equivalence, Source};
use pipeline::error::{Error, Result};
use render_core::ranks::{Inbox, Mail, Message};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::Instant;

/// Size of a message's length field \[bytes\].
const HEAD: usize = 8;
/// Value of the length field that announces the sender's end.
const END: u64 = u64::MAX;

/// Mailbox of a rank that runs as a process.
#[derive(Debug)]
pub(super) struct Post {
    rank: usize,
    count: usize,
    letters: Sender<Letter>,
    inbox: Arc<Inbox>,
    thread: Mutex<Option<JoinHandle<()>>>,
}

/// Message to send.
enum Letter {
    /// Receiving rank, and the bytes with their length field.
    To(usize, Vec<u8>),
    /// End of all messages.
    End,
}

impl Post {
    /// Starts the thread with its own communicator. All ranks must call this function at the same position in the order
    /// in which communicators are made.
    pub fn open(rank: usize, count: usize) -> Result<Self> {
        let (letters_out, letters_in) = unbounded();
        let (ready_out, ready_in) = bounded(1);
        let inbox = Arc::new(Inbox::new(count - 1));
        let own_inbox = inbox.clone();
        let carry = move || {
            let mut carrier = Carrier::new(own_inbox);
            let _ = ready_out.send(());
            carrier.carry(&letters_in);
            // Keep the communicator until all are freed at the end, because freeing it is an operation of all ranks.
            std::mem::forget(carrier.line);
        };
        let thread = std::thread::Builder::new().name("mail of ranks".into()).spawn(carry);
        let thread = thread.map_err(|error| Error::Ranks(format!("cannot start a thread: {error}")))?;
        // Wait for the communicator, so that all ranks make communicators in the same order.
        let _ = ready_in.recv();
        Ok(Self { rank, count, letters: letters_out, inbox, thread: Mutex::new(Some(thread)) })
    }

    /// Sends the remaining messages, and returns when all ranks have called this function. Messages sent later are
    /// lost.
    pub fn close(&self) {
        let _ = self.letters.send(Letter::End);
        let thread = self.thread.lock().unwrap_or_else(PoisonError::into_inner).take();
        if let Some(thread) = thread {
            let _ = thread.join();
        }
    }
}

impl Mail for Post {
    fn rank(&self) -> usize {
        self.rank
    }

    fn count(&self) -> usize {
        self.count
    }

    fn send(&self, to: usize, bytes: Vec<u8>) {
        assert!(to < self.count, "rank {to} of {}", self.count);
        // Deliver messages to this rank directly.
        if to == self.rank {
            self.inbox.put(Message { from: to, bytes });
            return;
        }
        // Prefix the length, so that the receiver detects the last piece.
        let mut framed = Vec::with_capacity(HEAD + bytes.len());
        framed.extend((bytes.len() as u64).to_le_bytes());
        framed.extend(bytes);
        let _ = self.letters.send(Letter::To(to, framed));
    }

    fn receive(&self) -> Message {
        self.inbox.take()
    }

    fn try_receive(&self) -> Option<Message> {
        self.inbox.try_take()
    }
}

/// Communicator on its own thread, and the messages received through it.
struct Carrier {
    line: SimpleCommunicator,
    inbox: Arc<Inbox>,
    /// Bytes received so far of the unfinished message of each rank.
    begun: Vec<Vec<u8>>,
    /// Number of other ranks that have ended.
    ended: usize,
    /// Time at which the last message piece was sent or received.
    last: Instant,
}

impl Carrier {
    fn new(inbox: Arc<Inbox>) -> Self {
        let line = SimpleCommunicator::world().duplicate();
        let begun = vec![Vec::new(); line.size() as usize];
        Self { line, inbox, begun, ended: 0, last: Instant::now() }
    }

    /// Sends and receives messages until all ranks have ended.
    fn carry(&mut self, letters: &Receiver<Letter>) {
        // Alternate between receiving and sending, so that neither waits for the other.
        loop {
            self.take_in();
            match self.next(letters) {
                Some(Letter::To(to, framed)) => self.send(to, &framed),
                Some(Letter::End) => break,
                None => {}
            }
        }

        // Notify the other ranks, and receive their messages until they end.
        let (own, count) = (self.line.rank() as usize, self.begun.len());
        for to in (0..count).filter(|&to| to != own) {
            self.send(to, &END.to_le_bytes());
        }
        while self.ended + 1 < count {
            self.take_in();
            rest(self.last);
        }
    }

    /// Returns the next letter, if one arrives within the pause before the next poll.
    fn next(&self, letters: &Receiver<Letter>) -> Option<Letter> {
        // Poll without pauses while messages are frequent.
        let Some(pause) = pause(self.last) else {
            std::thread::yield_now();
            return letters.try_recv().ok();
        };
        match letters.recv_timeout(pause) {
            Ok(letter) => Some(letter),
            Err(RecvTimeoutError::Timeout) => None,
            Err(RecvTimeoutError::Disconnected) => Some(Letter::End),
        }
    }

    /// Sends bytes to another rank, and receives incoming messages in the meantime.
    fn send(&mut self, to: usize, framed: &[u8]) {
        for piece in framed.chunks(PIECE) {
            let begin = Instant::now();
            scope(|scope| {
                let mut request = self.line.process_at_rank(to as i32).immediate_send(scope, piece);
                // Receive during the transfer, so that two large messages do not block each other.
                while let Err(pending) = request.test() {
                    request = pending;
                    self.take_in();
                    rest(begin.max(self.last));
                }
            });
            self.last = Instant::now();
        }
    }

    /// Receives all message pieces that have arrived from other ranks.
    fn take_in(&mut self) {
        while let Some((message, status)) = self.line.any_process().immediate_matched_probe() {
            let mut piece = vec![0u8; status.count(u8::equivalent_datatype()) as usize];
            scope(|scope| wait(message.immediate_matched_receive_into(scope, &mut piece[..])));
            self.add(status.source_rank() as usize, piece);
            self.last = Instant::now();
        }
    }

    /// Adds a piece to the message that a rank is sending, and delivers the message when it is complete.
    fn add(&mut self, from: usize, piece: Vec<u8>) {
        let begun = &mut self.begun[from];
        match begun.is_empty() {
            true => *begun = piece,
            false => begun.extend(piece),
        }
        // The first piece contains the whole length field.
        let head = begun.first_chunk::<HEAD>().expect("the first piece has the length");
        match u64::from_le_bytes(*head) {
            END => {
                begun.clear();
                self.ended += 1;
                self.inbox.note_end();
            }
            length if begun.len() as u64 == HEAD as u64 + length => {
                let mut bytes = std::mem::take(begun);
                bytes.drain(..HEAD);
                self.inbox.put(Message { from, bytes });
            }
            _ => {}
        }
    }
}
