//! Tests of light trees and cuts as their users see them, in one program: a module for each subject.

mod cut;
mod precision;
mod rivals;
