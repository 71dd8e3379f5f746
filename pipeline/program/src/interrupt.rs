//! Signals that end a command in order: Ctrl-C, and what schedulers send.

use anyhow::{Context, Result};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU8, Ordering};

/// As shells report a command that was interrupted: 128 + SIGINT.
const INTERRUPTED: u8 = 130;
/// 128 + SIGTERM.
const TERMINATED: u8 = 143;

/// A flag that a signal sets, and the exit code of a command that it ended.
#[derive(Clone, Debug)]
pub struct Interrupt {
    /// True once a signal has come.
    pub stop: Arc<AtomicBool>,
    code: Arc<AtomicU8>,
}

/// Reactions of a command to signals, on a thread that waits for them.
pub struct Reactions {
    /// After the first, with which the command begins to end.
    pub first: Box<dyn Fn() + Send>,
    /// After the second, before the process ends at once.
    pub second: Box<dyn Fn() + Send>,
    /// Whether SIGTERM counts as the second: who sends it leaves no time.
    pub is_hasty: bool,
}

impl Default for Reactions {
    /// Nothing more than that.
    fn default() -> Self {
        Self { first: Box::new(|| ()), second: Box::new(|| ()), is_hasty: false }
    }
}

impl Interrupt {
    /// Watches for signals from now on. The second one ends the process at once.
    ///
    /// # Errors
    /// The system refuses it.
    pub fn watch(reactions: Reactions) -> Result<Self> {
        let interrupt = Self { stop: Arc::default(), code: Arc::new(AtomicU8::new(INTERRUPTED)) };
        let watching = interrupt.clone();
        on_signal(move |code| watching.note(code, &reactions)).context("Ctrl-C cannot be watched for")?;
        Ok(interrupt)
    }

    fn note(&self, code: u8, reactions: &Reactions) {
        if self.stop.load(Ordering::Relaxed) || reactions.is_hasty && code == TERMINATED {
            // The second time, the user means it.
            (reactions.second)();
            std::process::exit(code.into());
        }
        self.code.store(code, Ordering::Relaxed);
        self.stop.store(true, Ordering::Relaxed);
        (reactions.first)();
    }

    /// 130 after Ctrl-C, 143 after SIGTERM, 129 after a terminal was closed: 128 and the number of the signal, as shells report it.
    pub fn exit_code(&self) -> ExitCode {
        ExitCode::from(self.code.load(Ordering::Relaxed))
    }
}

/// Calls `note` with 128 + the number of each signal that asks the process to end.
#[cfg(unix)]
fn on_signal(note: impl Fn(u8) + Send + 'static) -> Result<()> {
    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
    let mut signals = signal_hook::iterator::Signals::new([SIGINT, SIGTERM, SIGHUP])?;
    let watch = move || signals.forever().for_each(|signal| note(128 + signal as u8));
    std::thread::Builder::new().name("ctrl-c".into()).spawn(watch)?;
    Ok(())
}

/// Elsewhere there is Ctrl-C alone.
#[cfg(not(unix))]
fn on_signal(note: impl Fn(u8) + Send + 'static) -> Result<()> {
    ctrlc::set_handler(move || note(INTERRUPTED))?;
    Ok(())
}
