//! Command line of the program: arguments, option files, one module per command, and progress output.
//!
//! [`main`] is the complete program `render2mpeg`.
#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

/// Prints like `println!`, but ignores errors, because a reader may close its end of the pipe early.
macro_rules! say {
    ($($text:tt)*) => {{
        use std::io::Write;
        let _ = writeln!(std::io::stdout(), "{}", crate::print::printable(&format!($($text)*)));
    }};
}

/// Prints like `eprintln!`, but ignores errors.
macro_rules! tell {
    ($($text:tt)*) => {{
        use std::io::Write;
        let _ = writeln!(std::io::stderr(), "{}", crate::print::printable(&format!($($text)*)));
    }};
}

mod args;
mod commands;
mod config_file;
mod display_server;
mod examples;
mod features;
mod foreign;
mod guesses;
mod heartbeat;
mod interrupt;
mod lines;
mod log;
#[cfg(feature = "mpi")]
pub mod mpi;
mod notes;
mod overwrite;
mod picture;
mod print;
mod print_config;
mod progress;
mod ranks;
mod reference;
mod source;
mod trace;

use anyhow::{Context, Result};
use args::Command;
use clap::CommandFactory;
use print::single_line;
use ranks::Ranks;
pub use reference::{options_page, progress_schema, report_schema};
use std::process::ExitCode;

/// Exit code for errors that recur with the same arguments, as in clap. All other errors have exit code 1.
const WRONG_ARGUMENTS: u8 = 2;

/// Default duration of a turntable's film.
const TURNTABLE_SECONDS: f32 = 6.0;

/// Runs the program `render2mpeg`: executes the command in the process's arguments, prints errors and returns the exit
/// code.
#[must_use]
pub fn main() -> ExitCode {
    let result = config_file::parse(std::env::args_os().collect()).and_then(|arguments| {
        ranks::check(arguments.command.is_shared())?;
        Ok(arguments)
    });
    // Several processes run a command without shared work once.
    if let Ok(arguments) = &result
        && !arguments.command.is_shared()
        && ranks::are_several()
    {
        if ranks::is_silent() {
            return ExitCode::SUCCESS;
        }
        tell!("note: only render and bake share their work among ranks; rank 0 runs this command alone");
    }
    // Exit with a different code if the arguments are wrong.
    let result = result.map_err(|error| (error, WRONG_ARGUMENTS));
    match result.and_then(|arguments| run(arguments.command).map_err(with_exit_code)) {
        Ok(code) => code,
        Err((error, code)) => {
            // Print errors on rank 0 only, because other ranks have the same error.
            if !ranks::is_silent() {
                tell!("render2mpeg: {}", single_line(&format!("{error:#}")));
            }
            ExitCode::from(code)
        }
    }
}

/// Returns the error with its exit code.
fn with_exit_code(error: anyhow::Error) -> (anyhow::Error, u8) {
    let of_film = matches!(error.downcast_ref(), Some(render2mpeg::Error::Options(_) | render2mpeg::Error::Encoder(_)));
    let of_part = matches!(error.downcast_ref(), Some(pipeline::Error::Options(_)));
    let is_of_arguments = of_film || of_part;
    (error, if is_of_arguments { WRONG_ARGUMENTS } else { 1 })
}

/// Runs a command.
fn run(command: Command) -> Result<ExitCode> {
    // Start the threads before a command that renders uses them.
    match command {
        Command::Join(arguments) => commands::join::run(&arguments),
        Command::Plan(arguments) => commands::plan::run(*arguments),
        Command::Render(arguments) => {
            use_threads(arguments.threads)?;
            let ranks = Ranks::join()?;
            commands::render::run_among(*arguments, &ranks)
        }
        Command::Turntable(mut arguments) => {
            use_threads(arguments.threads)?;
            arguments.turn_in(TURNTABLE_SECONDS);
            commands::render::run_among(*arguments, &Ranks::join()?)
        }
        Command::Views(arguments) => {
            use_threads(arguments.picture.threads)?;
            commands::views::run(*arguments)
        }
        #[cfg(feature = "bake")]
        Command::Bake(arguments) => {
            use_threads(arguments.threads)?;
            commands::bake::run(arguments, &Ranks::join()?)
        }
        Command::Reference(arguments) => {
            use_threads(arguments.threads)?;
            commands::reference::run(arguments)
        }
        #[cfg(feature = "serve")]
        Command::Serve(arguments) => {
            use_threads(arguments.threads)?;
            commands::serve::run(*arguments)
        }
        Command::Still(arguments) => {
            use_threads(arguments.picture.threads)?;
            commands::still::run(*arguments)
        }
        Command::Completions { shell } => commands::shell::completions(args::Arguments::command(), shell),
        Command::Man { command } => commands::shell::man(args::Arguments::command(), command.as_deref()),
        Command::Sweep(arguments) => {
            use_threads(arguments.threads)?;
            commands::sweep::run(arguments)
        }
        Command::Compare(arguments) => commands::compare::run(&arguments),
    }
}

fn use_threads(threads: Option<u16>) -> Result<()> {
    if let Some(threads) = threads {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.into());
        pool.build_global().context("cannot start the threads")?;
    }
    Ok(())
}
