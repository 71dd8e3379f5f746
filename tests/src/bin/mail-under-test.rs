//! One of several processes that send messages to each other, for tests of ranks.

use program::mpi::Processes;
use tests::Exchange;

/// Length of the longest message \[bytes\]: more than one MPI operation transfers.
const LARGEST: usize = (1 << 26) + 12_345;

fn main() {
    let processes = Processes::join().expect("MPI begins");
    let mail = &processes.team().mail;
    match std::env::args().nth(1).as_deref() {
        Some("exchange") => {
            Exchange { largest: LARGEST }.run(&**mail);
            println!("rank {} has all messages", mail.rank());
        }
        Some("alone") if mail.rank() == 0 => {
            let mut senders = [mail.receive().from, mail.receive().from];
            senders.sort_unstable();
            println!("rank 0 has a message of rank {} and one of rank {}", senders[0], senders[1]);
            // A panic of the main thread prints no reason.
            std::thread::scope(|scope| scope.spawn(|| mail.receive()).join().map(drop))
                .expect("the other ranks have ended");
        }
        Some("alone") => mail.send(0, vec![1]),
        _ => panic!("exchange or alone"),
    }
}
