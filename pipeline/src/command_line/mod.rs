//! The command line: arguments and files with options, a file for each command, and what is shown meanwhile.
//!
//! [`main`] is all of the program `render2mpeg`. The rest of the library knows nothing of it.

/// As `println!`; a reader that closes its end early is no failure.
macro_rules! say {
    ($($text:tt)*) => {{
        use std::io::Write;
        let _ = writeln!(std::io::stdout(), "{}", crate::command_line::print::printable(&format!($($text)*)));
    }};
}

/// As `eprintln!`, likewise.
macro_rules! tell {
    ($($text:tt)*) => {{
        use std::io::Write;
        let _ = writeln!(std::io::stderr(), "{}", crate::command_line::print::printable(&format!($($text)*)));
    }};
}

mod args;
mod commands;
mod config_file;
mod examples;
mod foreign;
mod guesses;
mod interrupt;
mod lines;
mod log;
mod notes;
mod overwrite;
mod parts;
mod print;
mod print_config;
mod progress;
mod ranks;
mod source;
#[cfg(feature = "trace")]
mod trace;

use anyhow::{Context, Result};
use args::Command;
#[cfg(feature = "shell")]
use clap::CommandFactory;
use print::single_line;
use ranks::Ranks;
use std::process::ExitCode;

/// Exit code where the same arguments fail everywhere and always, as clap has it. All other failures are 1.
const WRONG_ARGUMENTS: u8 = 2;

/// The program `render2mpeg`: runs the command that the process was started with, prints errors, returns the exit code.
#[must_use]
pub fn main() -> ExitCode {
    let result = config_file::parse(std::env::args_os().collect()).and_then(|arguments| {
        ranks::check(matches!(arguments.command, Command::Render(_)))?;
        Ok(arguments)
    });
    let result = result.map_err(|error| (error, WRONG_ARGUMENTS));
    match result.and_then(|arguments| run(arguments.command).map_err(with_exit_code)) {
        Ok(code) => code,
        Err((error, code)) => {
            // Other ranks say the same.
            if !ranks::is_silent() {
                tell!("render2mpeg: {}", single_line(&format!("{error:#}")));
            }
            ExitCode::from(code)
        }
    }
}

/// The error with the exit code of its kind.
fn with_exit_code(error: anyhow::Error) -> (anyhow::Error, u8) {
    let is_of_arguments = matches!(error.downcast_ref(), Some(crate::Error::Options(_) | crate::Error::Encoder(_)));
    (error, if is_of_arguments { WRONG_ARGUMENTS } else { 1 })
}

/// Runs the command that was typed.
fn run(command: Command) -> Result<ExitCode> {
    match command {
        Command::Join(arguments) => commands::join::run(&arguments),
        Command::Plan(arguments) => commands::plan::run(*arguments),
        Command::Render(arguments) => {
            use_threads(arguments.threads)?;
            let ranks = Ranks::join()?;
            commands::render::run_among(*arguments, &ranks)
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
        #[cfg(feature = "still")]
        Command::Still(arguments) => {
            use_threads(arguments.threads)?;
            commands::still::run(*arguments)
        }
        #[cfg(feature = "shell")]
        Command::Completions { shell } => commands::shell::completions(args::Arguments::command(), shell),
        #[cfg(feature = "shell")]
        Command::Man { command } => commands::shell::man(args::Arguments::command(), command.as_deref()),
        #[cfg(feature = "sweep")]
        Command::Sweep(arguments) => {
            use_threads(arguments.threads)?;
            commands::sweep::run(arguments)
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
