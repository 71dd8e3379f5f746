//! `--print-config`: prints the chosen options as a file for `--config`.

use anyhow::Result;
use render2mpeg::Options;
use std::path::Path;
use toml::Value;

/// Option of the program that is not an option of the film.
pub struct ProgramOption {
    pub name: &'static str,
    /// Value as written in the file; `None` if the user did not choose one.
    pub value: Option<Value>,
}

impl ProgramOption {
    /// Returns an option with one value; without a value if `value` is `None`.
    pub fn text(name: &'static str, value: Option<String>) -> Self {
        Self { name, value: value.map(Value::String) }
    }

    /// Returns an option that may have several values.
    pub fn list(name: &'static str, values: impl Iterator<Item = String>) -> Self {
        let values: Vec<Value> = values.map(Value::String).collect();
        Self { name, value: (!values.is_empty()).then_some(Value::Array(values)) }
    }
}

/// Returns the text of an option file that makes the same film. The file contains every option: `options`, with all
/// defaults filled in, and `more`, the program's own options.
///
/// # Errors
/// If a path is not valid Unicode.
pub fn text(scene: &Path, options: &Options, more: &[ProgramOption]) -> Result<String> {
    let line = |key: &str, value: Value| format!("{key} = {value}\n");
    let mut text = line("scene", Value::String(scene.display().to_string()));
    text.push_str(&toml::to_string(options)?);
    let more = more.iter().filter_map(|option| Some(line(option.name, option.value.clone()?)));
    text.extend(more);
    Ok(text)
}
