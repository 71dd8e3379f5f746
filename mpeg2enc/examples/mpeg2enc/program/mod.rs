//! Main function of the program, which tests can call with their own arguments and streams.

mod arguments;
mod clip;
mod encode;
mod output;
mod y4m;

use anyhow::Result;
use arguments::{Arguments, WrongArguments};
use clap::Parser;
use std::{
    ffi::OsString,
    io::{Read, Write},
};

/// Exit code of a finished film.
pub const DONE: u8 = 0;
/// Exit code if the clip cannot be read or encoded, or the film cannot be written.
pub const FAILED: u8 = 1;
/// Exit code of wrong arguments.
pub const WRONG_ARGUMENTS: u8 = 2;

/// Standard input, output and error.
pub struct Streams<'a> {
    pub input: &'a mut (dyn Read + Send),
    pub output: &'a mut (dyn Write + Send),
    pub messages: &'a mut (dyn Write + Send),
}

impl Streams<'_> {
    /// Borrows the streams for one call.
    fn borrowed(&mut self) -> Streams<'_> {
        Streams { input: &mut *self.input, output: &mut *self.output, messages: &mut *self.messages }
    }
}

/// Runs the program and returns the exit code; the first argument is the program's name.
pub fn run(arguments: impl IntoIterator<Item = OsString>, mut streams: Streams) -> u8 {
    let arguments = match Arguments::try_parse_from(arguments) {
        Ok(arguments) => arguments,
        Err(error) => {
            let to: &mut dyn Write = if error.use_stderr() { streams.messages } else { streams.output };
            let is_told = write!(to, "{}", error.render()).is_ok();
            return if is_told { error.exit_code() as u8 } else { FAILED };
        }
    };
    let Err(error) = encode_in_pool(&arguments, &mut streams) else { return DONE };
    // The exit code reports the error even if the message cannot be written.
    let _ = writeln!(streams.messages, "mpeg2enc: {error:#}");
    if error.is::<WrongArguments>() { WRONG_ARGUMENTS } else { FAILED }
}

fn encode_in_pool(arguments: &Arguments, streams: &mut Streams) -> Result<()> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(arguments.threads).build()?;
    pool.install(|| encode::encode(arguments, streams))
}
