//! Messages with predictable bytes, from every rank to every rank.

use render_core::ranks::{Mail, Message};

/// Number of messages from each rank to each.
const MESSAGES: usize = 40;

/// Exchange of messages of up to about `largest` bytes.
#[derive(Clone, Copy, Debug)]
pub struct Exchange {
    /// Approximate length of the longest message \[bytes\].
    pub largest: usize,
}

impl Exchange {
    /// Sends all messages of this rank, and receives all messages that arrive meanwhile.
    ///
    /// # Panics
    /// If a message differs from the one sent, is out of order, or is superfluous.
    pub fn run(&self, mail: &dyn Mail) {
        // Send all messages before receiving any, so that large messages pass each other.
        let (own, count) = (mail.rank(), mail.count());
        for k in 0..MESSAGES {
            for to in 0..count {
                mail.send(to, self.message(own, to, k));
            }
        }

        // Receive messages alternately by waiting and by polling. A rank that has received all messages sends its number to
        // all ranks as its last message.
        let (mut next, mut left) = (vec![0; count], MESSAGES * count);
        for received in 0..(MESSAGES + 1) * count {
            let Message { from, bytes } = if received % 2 == 0 { mail.receive() } else { asked_for(mail) };
            if next[from] == MESSAGES {
                assert_eq!(bytes, [from as u8], "a message too many of rank {from}");
            } else {
                assert!(bytes == self.message(from, own, next[from]), "message {} of rank {from} to {own}", next[from]);
                left -= 1;
                if left == 0 {
                    (0..count).for_each(|to| mail.send(to, vec![own as u8]));
                }
            }
            next[from] += 1;
        }
        assert_eq!(next, vec![MESSAGES + 1; count]);
        assert_eq!(mail.try_receive(), None);
    }

    /// Returns the bytes of message `k` between two ranks: empty, short, or longer than one transfer. Only ranks 1 and 2
    /// exchange the longest messages.
    fn message(&self, from: usize, to: usize, k: usize) -> Vec<u8> {
        let length = match k {
            7 if from + to == 3 => self.largest + from,
            8..16 => 1 << (k + 4),
            _ => k % 5,
        };
        (0..length).map(|i| (i.wrapping_mul(0x9e37_79b9) >> 13) as u8 ^ (from * 64 + to * 16 + k) as u8).collect()
    }
}

/// Polls for the next message.
fn asked_for(mail: &dyn Mail) -> Message {
    loop {
        match mail.try_receive() {
            Some(message) => return message,
            None => std::thread::yield_now(),
        }
    }
}
