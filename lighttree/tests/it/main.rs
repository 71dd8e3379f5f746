//! Tests of the public API of light trees and lightcuts, in one program with a module per subject.

mod cut;
mod figures;
mod precision;
mod rivals;
