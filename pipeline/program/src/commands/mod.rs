//! Subcommands that do more than call the library.

#[cfg(feature = "bake")]
pub mod bake;
pub mod compare;
pub mod join;
pub mod plan;
pub mod reference;
pub mod render;
#[cfg(feature = "serve")]
pub mod serve;
pub mod shell;
pub mod still;
pub mod sweep;
pub mod views;

/// Prints a picture's path, size and render time.
fn tell_of_picture(path: &std::path::Path, size: renderer::settings::Size, begin: std::time::Instant) {
    tell!("{}: {size} pixels in {:.1} s", path.display(), begin.elapsed().as_secs_f64());
}
