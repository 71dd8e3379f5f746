//! The subcommands, where they are more than a call of the library.

#[cfg(feature = "bake")]
pub mod bake;
#[cfg(feature = "compare")]
pub mod compare;
pub mod join;
pub mod plan;
#[cfg(feature = "exr")]
pub mod reference;
pub mod render;
#[cfg(feature = "shell")]
pub mod shell;
#[cfg(feature = "still")]
pub mod still;
#[cfg(feature = "sweep")]
pub mod sweep;
