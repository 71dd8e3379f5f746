//! Shared code of the tests across crates: the program as users start it, two independent decoders, and small scenes.
//!
//! The decoders are `ffmpeg` and `mpeg2dec`, which `.ci/run` installs. The program is built with the tests.
#![forbid(unsafe_code)]

mod blocks;
mod browser;
mod decoders;
mod exchange;
pub mod fuzz;
mod glb;
mod hostile;
pub mod killed;
mod program;
mod replay;
mod tools;
pub mod truth;

pub use blocks::{Blocks, Comparison};
pub use browser::{Shown, show};
pub use decoders::{decode_ffmpeg, decode_mpeg2dec, read_y4m, tolerant_frame_count};
pub use exchange::Exchange;
pub use glb::{Ball, Glb, Moving, Quad, checkered_room, furnace, textured_square};
pub use hostile::{Hostile, Random, damaged, hostile_scenes};
pub use program::{
    Finished, Rendered, assert_fails, cornell, ended, program, render, render2mpeg, shared_scenes, sorted_names,
    start_until_checkpoint,
};
pub use replay::{correspondences, encode, load, render_as_coded};
pub use tools::{is_required, need};
