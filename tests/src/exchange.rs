//! Messages of every rank to every rank, of known bytes.

use render_core::ranks::{Mail, Message};

/// Messages of each rank to each.
const MESSAGES: usize = 40;

/// An exchange of messages of up to `largest` bytes and a few more.
#[derive(Clone, Copy, Debug)]
pub struct Exchange {
    /// Bytes of the longest message, about.
    pub largest: usize,
}

impl Exchange {
    /// Sends all messages of this rank, and receives all that others send to it meanwhile.
    ///
    /// # Panics
    /// If a message differs from what was sent, is out of order, or is one too many.
    pub fn run(&self, mail: &dyn Mail) {
        // All are sent before any is received, so large ones pass each other.
        let (own, count) = (mail.rank(), mail.count());
        for k in 0..MESSAGES {
            for to in 0..count {
                mail.send(to, self.message(own, to, k));
            }
        }

        // Half of them are waited for, and half asked for. A rank that has the messages of all says so to all: its last word.
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

    /// The bytes of message `k` between two ranks: none, few, more than go at once, and between ranks 1 and 2 the most.
    fn message(&self, from: usize, to: usize, k: usize) -> Vec<u8> {
        let length = match k {
            7 if from + to == 3 => self.largest + from,
            8..16 => 1 << (k + 4),
            _ => k % 5,
        };
        (0..length).map(|i| (i.wrapping_mul(0x9e37_79b9) >> 13) as u8 ^ (from * 64 + to * 16 + k) as u8).collect()
    }
}

/// The next message, without waiting inside of [`Mail`].
fn asked_for(mail: &dyn Mail) -> Message {
    loop {
        match mail.try_receive() {
            Some(message) => return message,
            None => std::thread::yield_now(),
        }
    }
}
