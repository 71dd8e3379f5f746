//! The program `render2mpeg`.

fn main() -> std::process::ExitCode {
    pipeline::command_line::main()
}
