//! Films on up to 64 ranks, simulated from the log of the same film on one:
//!
//! ```sh
//! cargo run -p tests --example many_ranks -- scenes/nave.glb --size 128x128 --frames 3 --samples 5
//! cargo run -p tests --example many_ranks -- scenes/nave.glb --size 128x128 --frames 3 --log off     # CPU time without a log
//! ```
//!
//! One thread makes the film, so run it while nothing else runs. `render_core::ranks::LoggedRun` says what is simulated, and how.

mod arguments;
mod replicated;

use arguments::Arguments;

fn main() -> anyhow::Result<()> {
    let arguments = match Arguments::parse(std::env::args().skip(1)) {
        Ok(arguments) => arguments,
        Err(reason) => {
            eprintln!(
                "many_ranks: {reason}\nusage: many_ranks SCENE [--size WxH] [--frames N] [--samples N] [--log off]"
            );
            std::process::exit(2);
        }
    };
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global()?;
    replicated::print(&arguments)
}
