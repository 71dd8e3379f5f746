//! The command line: arguments and files with options, a file for each command, and what is shown meanwhile.
//!
//! [`main`] is all of the program `render2mpeg`. The rest of the library knows nothing of it.

/// As `println!`; a reader that closes its end early is no failure.
macro_rules! say {
    ($($text:tt)*) => {{
        use std::io::Write;
        let _ = writeln!(std::io::stdout(), $($text)*);
    }};
}

/// As `eprintln!`, likewise.
macro_rules! tell {
    ($($text:tt)*) => {{
        use std::io::Write;
        let _ = writeln!(std::io::stderr(), $($text)*);
    }};
}

mod args;
mod commands;
mod config_file;
mod examples;
mod log;
mod parts;
mod print_config;
mod progress;
mod source;
#[cfg(feature = "trace")]
mod trace;

use anyhow::{Context, Result};
use args::Command;
#[cfg(feature = "shell")]
use clap::CommandFactory;
use std::ffi::OsString;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// As shells report a command that was interrupted: 128 + SIGINT.
const INTERRUPTED: u8 = 130;

/// The program `render2mpeg`: runs the command that the process was started with, prints errors, returns the exit code.
#[must_use]
pub fn main() -> ExitCode {
    match run(std::env::args_os().collect()) {
        Ok(code) => code,
        Err(error) => {
            tell!("render2mpeg: {error:#}");
            ExitCode::FAILURE
        }
    }
}

/// Runs the command that was typed.
fn run(typed: Vec<OsString>) -> Result<ExitCode> {
    match config_file::parse(typed)?.command {
        Command::Plan(arguments) => commands::plan::run(*arguments),
        Command::Render(arguments) => {
            use_threads(arguments.threads)?;
            commands::render::run(*arguments)
        }
        #[cfg(feature = "bake")]
        Command::Bake(arguments) => {
            use_threads(arguments.threads)?;
            commands::bake::run(arguments)
        }
        #[cfg(feature = "exr")]
        Command::Reference(arguments) => {
            use_threads(arguments.threads)?;
            commands::reference::run(arguments)
        }
        #[cfg(feature = "shell")]
        Command::Completions { shell } => commands::shell::completions(args::Arguments::command(), shell),
        #[cfg(feature = "shell")]
        Command::Man { command } => commands::shell::man(args::Arguments::command(), command.as_deref()),
        #[cfg(feature = "sweep")]
        Command::Sweep(arguments) => {
            use_threads(arguments.threads)?;
            let stop = stop_on_interrupt()?;
            match commands::sweep::run(arguments, &stop) {
                Err(error) if stop.load(Ordering::Relaxed) => {
                    tell!("render2mpeg: {error:#}");
                    Ok(ExitCode::from(INTERRUPTED))
                }
                result => result,
            }
        }
        #[cfg(feature = "compare")]
        Command::Compare(arguments) => commands::compare::run(&arguments),
    }
}

fn use_threads(threads: Option<u16>) -> Result<()> {
    if let Some(threads) = threads {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.into());
        pool.build_global().context("the threads cannot be started")?;
    }
    Ok(())
}

/// A flag that Ctrl-C sets.
fn stop_on_interrupt() -> Result<Arc<AtomicBool>> {
    let stop = Arc::new(AtomicBool::new(false));
    let flag = stop.clone();
    ctrlc::set_handler(move || {
        // The second time, the user means it.
        if flag.swap(true, Ordering::Relaxed) {
            std::process::exit(INTERRUPTED.into());
        }
    })
    .context("Ctrl-C cannot be watched for")?;
    Ok(stop)
}
