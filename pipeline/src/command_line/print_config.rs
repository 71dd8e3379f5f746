//! `--print-config`: what was chosen, as a file for `--config`.

use crate::Options;
use anyhow::Result;
use std::path::Path;
use toml::Value;

/// An option of the program alone.
pub struct ProgramOption {
    pub name: &'static str,
    /// As it is written; none if it was not chosen.
    pub value: Option<String>,
}

/// The file that makes the same film, every option named. `options` are filled in, `more` are those of the program alone.
///
/// # Errors
/// A path is no valid Unicode.
pub fn text(scene: &Path, options: &Options, more: &[ProgramOption]) -> Result<String> {
    let line = |key: &str, value: String| format!("{key} = {}\n", Value::String(value));
    let mut text = line("scene", scene.display().to_string());
    text.push_str(&toml::to_string(options)?);
    let more = more.iter().filter_map(|option| Some(line(option.name, option.value.clone()?)));
    text.extend(more);
    Ok(text)
}
