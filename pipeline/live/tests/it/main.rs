//! Tests of live pictures, without a network.

mod flow;
mod pictures;
