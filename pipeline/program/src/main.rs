//! Executable of the program `render2mpeg`.

fn main() -> std::process::ExitCode {
    program::main()
}
