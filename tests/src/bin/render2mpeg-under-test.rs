//! The program `render2mpeg`, built together with the tests that start it.

fn main() -> std::process::ExitCode {
    program::main()
}
