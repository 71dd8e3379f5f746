//! Errors in the TOML file next to a scene.

/// Error in a settings file.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SettingsError {
    /// The text is not TOML, or has unknown keys or types. The message is one line with line and key.
    #[error("{0}")]
    Toml(String),
    /// A value is out of range, or two values contradict each other.
    #[error("[{table}] {problem}")]
    Value {
        /// Table of the value.
        table: &'static str,
        /// Message with the key, the problem and the valid values.
        problem: String,
    },
}

/// Rust's names of number types, each with its description.
const NUMBERS: [(&str, &str); 3] = [
    ("expected f32", "expected a number"),
    ("expected f64", "expected a number"),
    ("expected u32", "expected a whole number"),
];

impl SettingsError {
    /// Converts a TOML parser's message to one line, with descriptions for types.
    #[must_use]
    pub fn of_toml(message: &str) -> Self {
        let line = message.trim_end().replace('\n', " ");
        Self::Toml(NUMBERS.iter().fold(line, |line, (name, words)| line.replace(name, words)))
    }

    pub(super) fn value(table: &'static str, problem: impl Into<String>) -> Self {
        Self::Value { table, problem: problem.into() }
    }
}
