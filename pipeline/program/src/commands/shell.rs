//! Commands `render2mpeg completions` and `render2mpeg man`: completion scripts and manual pages.

use anyhow::{Context, Result};
use clap::Command;
use std::process::ExitCode;

/// Prints the completion script of `program` for `shell`.
pub fn completions(mut program: Command, shell: clap_complete::Shell) -> Result<ExitCode> {
    let mut text = Vec::new();
    clap_complete::generate(shell, &mut program, "render2mpeg", &mut text);
    print_whole(&text);
    Ok(ExitCode::SUCCESS)
}

/// Prints the manual page of `program` or of one of its commands.
///
/// # Errors
/// If the command does not exist.
pub fn man(program: Command, command: Option<&str>) -> Result<ExitCode> {
    print_whole(&page(program, command)?);
    Ok(ExitCode::SUCCESS)
}

fn page(mut program: Command, command: Option<&str>) -> Result<Vec<u8>> {
    // Complete the definitions of all subcommands, which clap otherwise does while parsing.
    program.build();
    let page = match command {
        None => program,
        Some(name) => {
            let found = program.get_subcommands().find(|one| one.get_name() == name).cloned();
            found.with_context(|| format!("there is no command {name}: see render2mpeg --help"))?
        }
    };
    let mut text = Vec::new();
    clap_mangen::Man::new(page).render(&mut text)?;
    Ok(text)
}

/// Prints a complete text. A reader that closes its end early does not cause an error.
fn print_whole(text: &[u8]) {
    use std::io::Write;
    let _ = std::io::stdout().write_all(text);
}
