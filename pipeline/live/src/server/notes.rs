//! Log lines about refused requests and disconnected viewers. Strangers cannot fill the log.

use std::fmt::Display;
use std::net::SocketAddr;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Maximum number of lines in a period.
const MOST: u32 = 100;
const PERIOD: Duration = Duration::from_secs(60);

/// Log with a maximum number of lines per minute.
#[derive(Debug)]
pub(super) struct Notes(Mutex<Period>);

#[derive(Debug)]
struct Period {
    begin: Instant,
    lines: u32,
}

impl Notes {
    pub fn new() -> Self {
        Self(Mutex::new(Period { begin: Instant::now(), lines: 0 }))
    }

    /// Logs why a request was refused, or why a connection ended.
    pub fn note(&self, address: SocketAddr, reason: impl Display) {
        let mut period = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let now = Instant::now();
        if now.duration_since(period.begin) > PERIOD {
            *period = Period { begin: now, lines: 0 };
        }
        period.lines = period.lines.saturating_add(1);
        match period.lines {
            ..=MOST => tracing::info!("refused {address}: {reason}"),
            line if line == MOST + 1 => tracing::info!("further refusals of this minute are not logged"),
            _ => {}
        }
    }
}
