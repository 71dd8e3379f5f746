//! Encodes a YUV4MPEG2 file (4:2:0, 8 bits) to MPEG-2, as an elementary stream or in a container:
//!
//! ```text
//! ffmpeg -f lavfi -i testsrc2=size=512x512:rate=25:duration=2 -pix_fmt yuv420p clip.y4m
//! cargo run --release -p mpeg2enc --example mpeg2enc -- clip.y4m -o clip.m2v --qscale 8
//! ```
//! `--help` lists all options.

mod program;

use program::Streams;
use std::{io, process::ExitCode};

fn main() -> ExitCode {
    let streams = Streams { input: &mut io::stdin(), output: &mut io::stdout(), messages: &mut io::stderr() };
    program::run(std::env::args_os(), streams).into()
}
