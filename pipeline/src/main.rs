//! `render2mpeg`: arguments, settings, run, report. The one place that prints errors and sets the exit code.

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
mod command;
mod config_file;
mod log;
mod parts;
mod progress;
#[cfg(feature = "trace")]
mod trace;

use anyhow::{Context, Result};
use args::Command;
use pipeline::{Plan, Settings};
use render_core::scene;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// As shells report a command that was interrupted: 128 + SIGINT.
const INTERRUPTED: u8 = 130;

fn main() -> ExitCode {
    let arguments = config_file::parse(std::env::args_os().collect());
    match arguments.and_then(|arguments| run(arguments.command)) {
        Ok(code) => code,
        Err(error) => {
            tell!("render2mpeg: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn run(command: Command) -> Result<ExitCode> {
    match command {
        Command::Plan { job } => {
            let (path, wishes) = job.wishes();
            let scene = scene::load(&path)?;
            let settings = Settings::new(path, &scene, wishes)?;
            settings.encoder_config()?;
            say!("{}", Plan::new(&scene, &settings).table().trim_end());
            scene.warnings.iter().for_each(|warning| say!("note: {warning}"));
            Ok(ExitCode::SUCCESS)
        }
        Command::Render(arguments) => {
            use_threads(arguments.threads)?;
            command::render::run(*arguments)
        }
        #[cfg(feature = "exr")]
        Command::Reference(arguments) => {
            use_threads(arguments.threads)?;
            command::reference::run(arguments)
        }
        #[cfg(feature = "shell")]
        Command::Completions { shell } => command::shell::completions(shell),
        #[cfg(feature = "shell")]
        Command::Man { command } => command::shell::man(command.as_deref()),
        #[cfg(feature = "sweep")]
        Command::Sweep(arguments) => {
            use_threads(arguments.threads)?;
            let stop = stop_on_interrupt()?;
            match command::sweep::run(arguments, &stop) {
                Err(error) if stop.load(Ordering::Relaxed) => {
                    tell!("render2mpeg: {error:#}");
                    Ok(ExitCode::from(INTERRUPTED))
                }
                result => result,
            }
        }
        #[cfg(feature = "compare")]
        Command::Compare(arguments) => command::compare::run(&arguments),
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
