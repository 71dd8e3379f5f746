//! The subcommands, where they are more than a call of the library.

#[cfg(feature = "bake")]
pub mod bake;
pub mod compare;
pub mod join;
pub mod plan;
pub mod reference;
pub mod render;
pub mod shell;
pub mod still;
pub mod sweep;

/// Says which picture was made, and in what time.
fn tell_of_picture(path: &std::path::Path, size: renderer::settings::Size, begin: std::time::Instant) {
    tell!("{}: {size} pixels in {:.1} s", path.display(), begin.elapsed().as_secs_f64());
}
