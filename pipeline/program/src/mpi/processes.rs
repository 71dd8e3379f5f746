//! Ranks as processes that are connected by MPI \[MPI\].
//!
//! A communicator stays on the thread that made it. Each of the two communicators of a [`Team`] therefore has its
//! own thread. The thread accepts one operation at a time, polls for completion and returns the result. A third thread
//! exchanges messages between two ranks; see `post.rs`.

use super::post::Post;
use super::waiting::{PIECE, wait};
use crossbeam_channel::{Receiver, Sender, bounded};
use mpi::Threading;
use mpi::environment::Universe;
use mpi::request::scope;
use mpi::topology::SimpleCommunicator;
use mpi::traits::{Communicator, CommunicatorCollectives, Root};
use pipeline::error::{Error, Result};
use pipeline::team::Team;
use render_core::ranks::Ranks;
use std::sync::{Arc, Mutex, PoisonError};

/// Exit code of all ranks if one of them panics, as in Rust.
const PANICKED: i32 = 101;

/// Connection of this process to the processes that `mpirun` started. Drop it last, because all processes end together.
pub struct Processes {
    team: Team,
    /// Mailbox of this rank in the team.
    post: Arc<Post>,
    _universe: Universe,
}

impl Processes {
    /// Connects to the other processes. From this call on, a panic on any thread ends all processes, with one line of
    /// text.
    ///
    /// # Errors
    /// If MPI was initialized before or does not support several threads, or if a thread cannot be started.
    pub fn join() -> Result<Self> {
        let fail = |text: &str| Error::Ranks(text.into());
        // Require MPI calls on several threads, because each communicator has its own thread.
        let (universe, granted) =
            mpi::initialize_with_threading(Threading::Multiple).ok_or_else(|| fail("MPI was already initialized"))?;
        if granted != Threading::Multiple {
            return Err(fail("this MPI supports one thread only: use one with MPI_THREAD_MULTIPLE"));
        }
        let world = universe.world();
        let (rank, count) = (world.rank() as usize, world.size() as usize);
        end_all_at_panic(rank);

        // Make the communicators in the same order on all ranks, because making one is an operation of all ranks.
        let prepare = Process::served("ranks of prepare", rank, count)?;
        let shade = Process::served("ranks of shade", rank, count)?;
        let post = Arc::new(Post::open(rank, count)?);
        let team = Team { prepare: Arc::new(prepare), shade: Arc::new(shade), mail: post.clone() };
        Ok(Self { team, post, _universe: universe })
    }

    /// Returns the ranks as a team.
    #[must_use]
    pub fn team(&self) -> &Team {
        &self.team
    }
}

impl std::fmt::Debug for Processes {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Processes").field("team", &self.team).finish_non_exhaustive()
    }
}

/// Ends all ranks at once with the exit code `code`. On rank 0, the resulting signal completes the film's file.
pub fn abort(code: i32) -> ! {
    SimpleCommunicator::world().abort(code)
}

/// Makes a rank that panics print one line and end the other ranks, which would otherwise wait for it.
fn end_all_at_panic(rank: usize) {
    std::panic::set_hook(Box::new(move |panic| {
        // Ignore panics on the main thread, which reads scene documents and catches panics of other libraries.
        let place = panic.location().map(|place| format!(" at {place}")).unwrap_or_default();
        let is_main = std::thread::current().name() == Some("main");
        if !is_main {
            let payload = panic.payload();
            let text = payload.downcast_ref::<&str>().copied().or(payload.downcast_ref::<String>().map(String::as_str));
            let text = text.unwrap_or("unknown reason").replace(char::is_control, " ");
            eprintln!("render2mpeg: rank {rank} failed{place}: {text}: this is a bug");
            abort(PANICKED);
        }
    }));
}

impl Drop for Processes {
    fn drop(&mut self) {
        if std::thread::panicking() {
            eprintln!("render2mpeg: rank {} failed: this is a bug", self.team.rank());
            abort(PANICKED);
        }
        // Complete all messages before MPI ends.
        self.post.close();
    }
}

/// Operation that all ranks perform together.
enum Operation {
    AllGather(Vec<u8>),
    Gather(Vec<u8>),
    Broadcast(Vec<u8>),
}

/// One of the ranks, with a thread that performs its operations.
#[derive(Debug)]
struct Process {
    rank: usize,
    count: usize,
    thread: Mutex<Ends>,
}

/// Channels to and from the thread.
#[derive(Debug)]
struct Ends {
    operations: Sender<Operation>,
    results: Receiver<Vec<Vec<u8>>>,
}

impl Process {
    /// Starts a thread with its own communicator, which serves operations.
    fn served(name: &str, rank: usize, count: usize) -> Result<Self> {
        let (operations_out, operations_in) = bounded::<Operation>(1);
        let (results_out, results_in) = bounded(1);
        let serve = move || {
            let line = Line(SimpleCommunicator::world().duplicate());
            let _ = results_out.send(Vec::new());
            for operation in operations_in {
                let result = match operation {
                    Operation::AllGather(own) => line.all_gather(&own),
                    Operation::Gather(own) => line.gather(&own),
                    Operation::Broadcast(own) => vec![line.broadcast(own)],
                };
                if results_out.send(result).is_err() {
                    break;
                }
            }
            // Keep the communicator until all are freed at the end, because freeing it is an operation of all ranks.
            std::mem::forget(line);
        };
        let thread = std::thread::Builder::new().name(name.into()).spawn(serve);
        thread.map_err(|error| Error::Ranks(format!("cannot start a thread: {error}")))?;
        // Wait for the communicator, so that all ranks make communicators in the same order.
        let _ = results_in.recv();
        Ok(Self { rank, count, thread: Mutex::new(Ends { operations: operations_out, results: results_in }) })
    }

    fn result(&self, operation: Operation) -> Vec<Vec<u8>> {
        let thread = self.thread.lock().unwrap_or_else(PoisonError::into_inner);
        let _ = thread.operations.send(operation);
        thread.results.recv().expect("the thread serves until its channels close")
    }
}

impl Ranks for Process {
    fn rank(&self) -> usize {
        self.rank
    }

    fn count(&self) -> usize {
        self.count
    }

    fn all_gather(&self, own: Vec<u8>) -> Vec<Vec<u8>> {
        self.result(Operation::AllGather(own))
    }

    fn gather(&self, own: Vec<u8>) -> Option<Vec<Vec<u8>>> {
        let all = self.result(Operation::Gather(own));
        (self.rank == 0).then_some(all)
    }

    fn broadcast(&self, own: Vec<u8>) -> Vec<u8> {
        self.result(Operation::Broadcast(own)).pop().unwrap_or_default()
    }
}

/// Communicator on its own thread.
struct Line(SimpleCommunicator);

impl Line {
    fn count(&self) -> usize {
        self.0.size() as usize
    }

    /// Returns the number of bytes that each rank contributes, and the maximum of these numbers.
    fn lengths(&self, own: usize) -> (Vec<u64>, usize) {
        let (own, mut lengths) = ([own as u64], vec![0; self.count()]);
        scope(|scope| wait(self.0.immediate_all_gather_into(scope, &own[..], &mut lengths[..])));
        let longest = lengths.iter().copied().max().unwrap_or_default();
        (lengths, longest as usize)
    }

    fn all_gather(&self, own: &[u8]) -> Vec<Vec<u8>> {
        let (lengths, longest) = self.lengths(own.len());
        let mut all = Pieces::new(&lengths);
        for (piece, mut received) in pieces(own, longest, self.count()) {
            scope(|scope| wait(self.0.immediate_all_gather_into(scope, &piece[..], &mut received[..])));
            all.add(&received, piece.len());
        }
        all.whole
    }

    fn gather(&self, own: &[u8]) -> Vec<Vec<u8>> {
        let (lengths, longest) = self.lengths(own.len());
        // Ranks other than 0 send their pieces and receive nothing.
        if self.0.rank() != 0 {
            for (piece, _) in pieces(own, longest, 0) {
                let root = self.0.process_at_rank(0);
                scope(|scope| wait(root.immediate_gather_into(scope, &piece[..])));
            }
            return Vec::new();
        }
        let mut all = Pieces::new(&lengths);
        for (piece, mut received) in pieces(own, longest, self.count()) {
            let root = self.0.this_process();
            scope(|scope| wait(root.immediate_gather_into_root(scope, &piece[..], &mut received[..])));
            all.add(&received, piece.len());
        }
        all.whole
    }

    fn broadcast(&self, mut bytes: Vec<u8>) -> Vec<u8> {
        // Broadcast the length first, because only rank 0 has it.
        let root = self.0.process_at_rank(0);
        let mut length = [bytes.len() as u64];
        scope(|scope| wait(root.immediate_broadcast_into(scope, &mut length[..])));
        bytes.resize(length[0] as usize, 0);
        for piece in bytes.chunks_mut(PIECE) {
            scope(|scope| wait(root.immediate_broadcast_into(scope, piece)));
        }
        bytes
    }
}

/// Returns the pieces of a rank's bytes, padded to `longest`, the maximum length over all ranks. Each piece is paired
/// with a receive buffer for `count` ranks.
fn pieces(own: &[u8], longest: usize, count: usize) -> impl Iterator<Item = (Vec<u8>, Vec<u8>)> {
    (0..longest).step_by(PIECE).map(move |begin| {
        let length = PIECE.min(longest - begin);
        let mut piece = own[begin.min(own.len())..(begin + length).min(own.len())].to_vec();
        piece.resize(length, 0);
        (piece, vec![0; length * count])
    })
}

/// Bytes of every rank, assembled from pieces.
struct Pieces {
    whole: Vec<Vec<u8>>,
    lengths: Vec<usize>,
}

impl Pieces {
    fn new(lengths: &[u64]) -> Self {
        let lengths: Vec<usize> = lengths.iter().map(|&length| length as usize).collect();
        Self { whole: lengths.iter().map(|&length| Vec::with_capacity(length)).collect(), lengths }
    }

    /// Adds a piece of `length` bytes from each rank, without the padding.
    fn add(&mut self, received: &[u8], length: usize) {
        for ((whole, &end), piece) in self.whole.iter_mut().zip(&self.lengths).zip(received.chunks_exact(length)) {
            let own = length.min(end - whole.len());
            whole.extend_from_slice(&piece[..own]);
        }
    }
}
