//! Progress lines for standard error that is not a terminal, such as a log file.

use crate::print::{rough_time, single_line};
use indicatif::ProgressBar;
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread::{self, JoinHandle};
use std::time::Duration;

/// Interval between lines: long enough for logs of farms, short enough for a waiting person.
const INTERVAL: Duration = Duration::from_secs(30);

/// Thread that calls a function at regular intervals until it is dropped.
pub(crate) struct Heartbeat {
    stop: Option<Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Heartbeat {
    /// Prints the state of `bar` every half minute, if the bar is not visible. `noun` is the plural of its units.
    pub fn of(bar: &ProgressBar, noun: &'static str) -> Self {
        if !bar.is_hidden() {
            return Self { stop: None, thread: None };
        }
        let bar = bar.clone();
        Self::every(INTERVAL, move || tell!("{}", single_line(&line(&bar, noun))))
    }

    /// Calls `beat` at regular intervals.
    fn every(interval: Duration, mut beat: impl FnMut() + Send + 'static) -> Self {
        let (stop, stopped) = channel::<()>();
        let thread = thread::spawn(move || {
            while stopped.recv_timeout(interval) == Err(RecvTimeoutError::Timeout) {
                beat();
            }
        });
        Self { stop: Some(stop), thread: Some(thread) }
    }
}

impl Drop for Heartbeat {
    fn drop(&mut self) {
        drop(self.stop.take());
        // Wait for a line that is being printed, so that no line follows the result.
        self.thread.take().map(JoinHandle::join);
    }
}

/// Returns position, time and message of a bar.
fn line(bar: &ProgressBar, noun: &str) -> String {
    let done = match (bar.position(), bar.length().unwrap_or(0)) {
        (_, 0) => String::new(),
        (position, length) if noun == "%" => format!("{} %, ", 100 * position / length),
        (position, length) => format!("{position} of {length} {noun}, "),
    };
    let message = bar.message();
    let colon = if message.is_empty() { "" } else { ": " };
    format!("{done}{} so far{colon}{message}", rough_time(bar.elapsed().as_secs_f64()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_state_position_and_time() {
        let bar = ProgressBar::hidden();
        assert_eq!(line(&bar, "frames"), "0 s so far");
        bar.set_length(40);
        bar.set_position(10);
        assert_eq!(line(&bar, "%"), "25 %, 0 s so far");
        bar.set_message("1.2 s per frame");
        assert_eq!(line(&bar, "frames"), "10 of 40 frames, 0 s so far: 1.2 s per frame");
    }

    #[test]
    fn beats_come_until_the_end() {
        let (beat, beats) = channel();
        let heart = Heartbeat::every(Duration::from_millis(5), move || beat.send(()).unwrap());
        assert!(
            beats.recv_timeout(Duration::from_secs(20)).is_ok() && beats.recv_timeout(Duration::from_secs(20)).is_ok()
        );
        drop(heart);
        // All beats have come before the end, and the thread is gone.
        while beats.try_recv().is_ok() {}
        assert!(beats.recv().is_err());
    }
}
