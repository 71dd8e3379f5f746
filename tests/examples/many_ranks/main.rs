//! Films on up to 64 ranks, simulated from the log of one rank:
//!
//! ```sh
//! cargo run -p tests --example many_ranks -- scenes/nave/nave.glb --size 128x128 --frames 3 --samples 5
//! cargo run -p tests --example many_ranks -- scenes/nave/nave.glb --size 128x128 --frames 3 --log off     # CPU time without a log
//! cargo run -p tests --example many_ranks -- scenes/nave/nave.glb --size 128x128 --samples 5 --tiles first-frame
//! cargo run -p tests --example many_ranks -- scenes/nave/nave.glb --size 128x128 --frames 8 --samples 5 --tiles walk --importance saliency:1
//! ```
//!
//! The film is rendered on one thread, so run no other programs meanwhile. `render_core::ranks::LoggedRun` documents the
//! simulation.

mod arguments;
mod replicated;
mod tiles;

use arguments::{Arguments, Figure};

fn main() -> anyhow::Result<()> {
    let arguments = match Arguments::parse(std::env::args().skip(1)) {
        Ok(arguments) => arguments,
        Err(reason) => {
            eprintln!(
                "many_ranks: {reason}\nusage: many_ranks SCENE [--size WxH] [--frames N] [--samples N] [--log off] [--tiles first-frame|walk] [--cost rays|time] [--records none|central:N|each:N] [--ranks N] [--importance MAPS]"
            );
            std::process::exit(2);
        }
    };
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global()?;
    match arguments.figure {
        Figure::Replicated => replicated::print(&arguments),
        Figure::FirstFrame => tiles::first_frame(&arguments),
        Figure::Walk => tiles::walk(&arguments),
    }
}
