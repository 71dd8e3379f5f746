//! `render2mpeg plan`.

use crate::command_line::args::Plan as Arguments;
use anyhow::Result;
use pipeline::{Plan, Settings};
use render_core::scene;
use std::process::ExitCode;

/// Prints the plan.
pub fn run(arguments: Arguments) -> Result<ExitCode> {
    let path = arguments.source.path();
    let scene = scene::load(&path)?;
    let settings = Settings::new(path, &scene, &arguments.options)?;
    settings.encoder_config()?;
    say!("{}", Plan::new(&scene, &settings).table().trim_end());
    scene.warnings.iter().for_each(|warning| say!("note: {warning}"));
    Ok(ExitCode::SUCCESS)
}
