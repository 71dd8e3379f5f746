//! Tests of the public API of light trees and cuts, in one program with a module per subject.

mod cut;
mod precision;
mod rivals;
