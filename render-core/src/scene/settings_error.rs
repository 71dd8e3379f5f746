//! Errors of the TOML file beside a scene.

/// The text of a settings file makes no sense.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SettingsError {
    /// It is no TOML, or has keys or types that do not exist; one line that names line and key.
    #[error("{0}")]
    Toml(String),
    /// A value is out of its range, or two of them contradict each other.
    #[error("[{table}] {problem}")]
    Value {
        /// The table that holds it.
        table: &'static str,
        /// The key, its fault and the values that it takes.
        problem: String,
    },
}

/// Types of numbers by their names in Rust, and in words.
const NUMBERS: [(&str, &str); 3] = [
    ("expected f32", "expected a number"),
    ("expected f64", "expected a number"),
    ("expected u32", "expected a whole number"),
];

impl SettingsError {
    /// The message of a reader of TOML as one line, with words for types.
    #[must_use]
    pub fn of_toml(message: &str) -> Self {
        let line = message.trim_end().replace('\n', " ");
        Self::Toml(NUMBERS.iter().fold(line, |line, (name, words)| line.replace(name, words)))
    }

    pub(super) fn value(table: &'static str, problem: impl Into<String>) -> Self {
        Self::Value { table, problem: problem.into() }
    }
}
