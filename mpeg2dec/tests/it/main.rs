//! Tests of the decoder against ffmpeg, and with damaged streams.

mod common;
mod containers;
mod damage;
mod encoders;
mod faults;
mod random;
mod wasm;
