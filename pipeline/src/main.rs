//! The program `render2mpeg`.

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

mod command_line;

/// Prints errors and sets the exit code; nothing else does.
fn main() -> std::process::ExitCode {
    match command_line::run(std::env::args_os().collect()) {
        Ok(code) => code,
        Err(error) => {
            tell!("render2mpeg: {error:#}");
            std::process::ExitCode::FAILURE
        }
    }
}
