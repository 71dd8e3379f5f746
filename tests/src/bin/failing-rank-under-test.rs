//! The program `render2mpeg` with a thread that panics after the first pictures are written, for tests of ranks.

use std::time::Duration;

fn main() -> std::process::ExitCode {
    let fails = || {
        let has_pictures = || std::fs::metadata("film.m2v.part").is_ok_and(|part| part.len() > 6_000);
        while !has_pictures() {
            std::thread::sleep(Duration::from_millis(5));
        }
        panic!("on purpose");
    };
    // Panic outside the main thread, as a stage or rayon would.
    std::thread::spawn(fails);
    program::main()
}
