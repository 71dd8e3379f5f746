//! Single settings that override the TOML file next to a scene.

use std::fmt;
use toml::{Table, Value};

/// Single setting: `exposure=1.5`, or with its table `tone_mapping.exposure=1.5`.
///
/// ```
/// use render_core::scene::Setting;
/// let setting: Setting = "exposure=1.5".parse()?;
/// assert_eq!(setting.to_string(), "tone_mapping.exposure = 1.5");
/// # Ok::<(), render_core::scene::SettingsError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Setting {
    pub(super) table: String,
    pub(super) key: String,
    pub(super) value: Value,
}

impl Setting {
    /// Builds the setting `key` of a `table` from a text, such as a name.
    #[must_use]
    pub fn text(table: &str, key: &str, value: &str) -> Self {
        Self { table: table.into(), key: key.into(), value: Value::String(value.into()) }
    }

    /// Returns the value of the setting as text.
    #[must_use]
    pub fn value(&self) -> String {
        self.value.to_string()
    }

    /// Returns whether the setting gives this text to a key.
    pub(super) fn is_text(&self, table: &str, key: &str, value: &str) -> bool {
        self.table == table && self.key == key && self.value.as_str() == Some(value)
    }

    /// Overwrites the value in the tables of a settings file.
    pub(super) fn put_into(&self, tables: &mut Table) {
        let table = tables.entry(&self.table).or_insert_with(|| Value::Table(Table::new()));
        // If the table's name is used for a value, parsing the settings later reports the error.
        if let Some(table) = table.as_table_mut() {
            table.insert(self.key.clone(), self.value.clone());
        }
    }
}

impl fmt::Display for Setting {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{} = {}", self.table, self.key, self.value)
    }
}
