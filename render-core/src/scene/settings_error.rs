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

impl SettingsError {
    pub(super) fn value(table: &'static str, problem: impl Into<String>) -> Self {
        Self::Value { table, problem: problem.into() }
    }
}
