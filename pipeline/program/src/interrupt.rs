//! Signals that end a command in an orderly way: Ctrl-C, and signals of schedulers.

use anyhow::{Context, Result};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU8, Ordering};

/// Exit code after SIGINT: 128 + SIGINT, as shells report it.
const INTERRUPTED: u8 = 130;
/// Exit code after SIGTERM: 128 + SIGTERM.
const TERMINATED: u8 = 143;

/// Flag that a signal sets, and exit code of the command that the signal ends.
#[derive(Clone, Debug)]
pub struct Interrupt {
    /// True after the first signal.
    pub stop: Arc<AtomicBool>,
    code: Arc<AtomicU8>,
}

/// Reactions of a command to signals. They are called on the thread that waits for signals.
pub struct Reactions {
    /// Function called after the first signal, when the command begins to end.
    pub first: Box<dyn Fn() + Send>,
    /// Function called after the second signal, before the process ends at once.
    pub second: Box<dyn Fn() + Send>,
    /// True if SIGTERM ends the process at once, because `mpirun` kills it soon after.
    pub is_hasty: bool,
}

impl Default for Reactions {
    /// Returns reactions that do nothing.
    fn default() -> Self {
        Self { first: Box::new(|| ()), second: Box::new(|| ()), is_hasty: false }
    }
}

impl Interrupt {
    /// Starts watching for signals. The second signal ends the process at once.
    ///
    /// # Errors
    /// If the system refuses the handler.
    pub fn watch(reactions: Reactions) -> Result<Self> {
        let interrupt = Self { stop: Arc::default(), code: Arc::new(AtomicU8::new(INTERRUPTED)) };
        let watching = interrupt.clone();
        on_signal(move |code| watching.note(code, &reactions)).context("cannot watch for Ctrl-C")?;
        Ok(interrupt)
    }

    fn note(&self, code: u8, reactions: &Reactions) {
        if self.stop.load(Ordering::Relaxed) || reactions.is_hasty && code == TERMINATED {
            // End the process at once after a second signal.
            (reactions.second)();
            std::process::exit(code.into());
        }
        // Let frames in progress finish after the first signal.
        self.code.store(code, Ordering::Relaxed);
        self.stop.store(true, Ordering::Relaxed);
        (reactions.first)();
    }

    /// Returns the exit code of the command: 128 plus the signal's number, as shells report it. The code is 130 for
    /// Ctrl-C, 143 for SIGTERM, and 129 for a closed terminal.
    pub fn exit_code(&self) -> ExitCode {
        ExitCode::from(self.code.load(Ordering::Relaxed))
    }
}

/// Calls `note` with 128 + the signal's number, for each signal that requests the end of the process.
#[cfg(unix)]
fn on_signal(note: impl Fn(u8) + Send + 'static) -> Result<()> {
    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
    let mut signals = signal_hook::iterator::Signals::new([SIGINT, SIGTERM, SIGHUP])?;
    let watch = move || signals.forever().for_each(|signal| note(128 + signal as u8));
    std::thread::Builder::new().name("ctrl-c".into()).spawn(watch)?;
    Ok(())
}

/// Calls `note` after Ctrl-C, the only request to end the process on systems other than Unix.
#[cfg(not(unix))]
fn on_signal(note: impl Fn(u8) + Send + 'static) -> Result<()> {
    ctrlc::set_handler(move || note(INTERRUPTED))?;
    Ok(())
}
