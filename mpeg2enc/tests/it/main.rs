//! Integration tests of the encoder in one program, with a module per subject.

mod behavior;
mod color;
mod common;
mod container;
mod decode;
mod drift;
mod elementary;
mod extremes;
mod groups;
mod lookahead;
mod mpeg1;
mod program;
mod rates;
mod report;
mod verifier;
mod weights;
