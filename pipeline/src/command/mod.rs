//! What subcommands do, where that is more than a call of the library.

pub mod compare;
pub mod sweep;
