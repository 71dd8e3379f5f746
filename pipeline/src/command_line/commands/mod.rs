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

/// Says which picture was made, and in what time.
#[cfg(any(feature = "exr", feature = "still"))]
fn tell_of_picture(path: &std::path::Path, size: crate::settings::Size, begin: std::time::Instant) {
    tell!("{}: {size} pixels in {:.1} s", path.display(), begin.elapsed().as_secs_f64());
}
