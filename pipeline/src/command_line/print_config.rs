//! `--print-config`: what was chosen, as a file for `--config`.

use crate::Options;
use anyhow::Result;
use std::path::Path;
use toml::Value;

/// The file that makes the same film, every option named. `options` are filled in, `more` are those of the program alone.
///
/// # Errors
/// A path is no valid Unicode.
pub fn text(scene: &Path, options: &Options, more: &[(&str, Option<String>)]) -> Result<String> {
    let line = |key: &str, value: String| format!("{key} = {}\n", Value::String(value));
    let mut text = line("scene", scene.display().to_string());
    text.push_str(&toml::to_string(options)?);
    let more = more.iter().filter_map(|(key, value)| Some(line(key, value.clone()?)));
    text.extend(more);
    Ok(text)
}
