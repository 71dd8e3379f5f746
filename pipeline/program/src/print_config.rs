//! `--print-config`: what was chosen, as a file for `--config`.

use anyhow::Result;
use render2mpeg::Options;
use std::path::Path;
use toml::Value;

/// An option of the program alone.
pub struct ProgramOption {
    pub name: &'static str,
    /// As it is written; none if it was not chosen.
    pub value: Option<Value>,
}

impl ProgramOption {
    /// An option with one value, if it was chosen.
    pub fn text(name: &'static str, value: Option<String>) -> Self {
        Self { name, value: value.map(Value::String) }
    }

    /// An option that may be repeated.
    pub fn list(name: &'static str, values: impl Iterator<Item = String>) -> Self {
        let values: Vec<Value> = values.map(Value::String).collect();
        Self { name, value: (!values.is_empty()).then_some(Value::Array(values)) }
    }
}

/// The file that makes the same film, every option named. `options` are filled in, `more` are those of the program alone.
///
/// # Errors
/// A path is no valid Unicode.
pub fn text(scene: &Path, options: &Options, more: &[ProgramOption]) -> Result<String> {
    let line = |key: &str, value: Value| format!("{key} = {value}\n");
    let mut text = line("scene", Value::String(scene.display().to_string()));
    text.push_str(&toml::to_string(options)?);
    let more = more.iter().filter_map(|option| Some(line(option.name, option.value.clone()?)));
    text.extend(more);
    Ok(text)
}
