//! Single settings that take the place of those in the TOML file beside a scene.

use super::SettingsError;
use std::fmt;
use std::str::FromStr;
use toml::{Table, Value};

/// The table of each key that may be named without it.
const TABLES: [(&str, &str); 17] = [
    ("operator", "tone_mapping"),
    ("exposure", "tone_mapping"),
    ("gamma", "tone_mapping"),
    ("white", "tone_mapping"),
    ("display", "tone_mapping"),
    ("zenith", "sky"),
    ("horizon", "sky"),
    ("nadir", "sky"),
    ("image", "sky"),
    ("intensity", "sky"),
    ("rotation", "sky"),
    ("angular_diameter", "sun"),
    ("frames", "video"),
    ("fps", "video"),
    ("nodes", "importance"),
    ("viewing_distance", "importance"),
    ("screen_width", "importance"),
];

/// One setting: `exposure=1.5`, or with its table `tone_mapping.exposure=1.5`.
///
/// ```
/// use render_core::scene::Setting;
/// let setting: Setting = "exposure=1.5".parse()?;
/// assert_eq!(setting.to_string(), "tone_mapping.exposure = 1.5");
/// # Ok::<(), render_core::scene::SettingsError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Setting {
    table: String,
    key: String,
    value: Value,
}

impl Setting {
    /// The setting `key` of a `table` as a text, such as a name.
    #[must_use]
    pub fn text(table: &str, key: &str, value: &str) -> Self {
        Self { table: table.into(), key: key.into(), value: Value::String(value.into()) }
    }

    /// Writes it over what the tables of a settings file say.
    pub(super) fn put_into(&self, tables: &mut Table) {
        let table = tables.entry(&self.table).or_insert_with(|| Value::Table(Table::new()));
        // What is no table is refused when the settings are read.
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

impl FromStr for Setting {
    type Err = SettingsError;

    fn from_str(text: &str) -> Result<Self, SettingsError> {
        let wrong = |why: &str| SettingsError::Toml(format!("\"{text}\" {why}"));
        let (name, value) = text.split_once('=').ok_or_else(|| wrong("is no setting such as exposure=1.5"))?;
        let name = name.trim();
        let (table, key) = match name.split_once('.') {
            Some(parts) => parts,
            None => {
                let known = TABLES.iter().find(|(key, _)| *key == name);
                let (key, table) = known.ok_or_else(|| wrong("names no setting; write TABLE.KEY=VALUE"))?;
                (*table, *key)
            }
        };

        // As TOML has it; else the text itself, so that names need no quotation marks.
        let line = format!("value = {}", value.trim());
        let parsed = line.parse::<Table>().ok().and_then(|mut table| table.remove("value"));
        let value = parsed.unwrap_or_else(|| Value::String(value.trim().into()));
        Ok(Self { table: table.into(), key: key.into(), value })
    }
}

#[cfg(test)]
mod tests {
    use super::super::SceneSettings;
    use super::*;

    fn settings(text: &str, set: &[&str]) -> Result<SceneSettings, SettingsError> {
        let set: Vec<Setting> = set.iter().map(|one| one.parse()).collect::<Result<_, _>>()?;
        SceneSettings::parse_with(text, &set)
    }

    #[test]
    fn settings_take_the_place_of_those_in_the_file() {
        let text = "[camera]\nname = \"a\"\n[video]\nfps = 24\n";
        let set =
            settings(text, &["camera.name = b", "frames=3", "zenith=[1,2,3]", "sky.horizon = [0, 0, 1]"]).unwrap();
        assert_eq!((set.camera.name.as_deref(), set.video.frames, set.video.fps), (Some("b"), Some(3), Some(24.0)));
        assert_eq!(set.sky.unwrap().zenith, Some([1.0, 2.0, 3.0]));
        assert_eq!(settings(text, &[]).unwrap(), SceneSettings::parse(text).unwrap());
        for (set, word) in [
            ("exposure", "exposure=1.5"),
            ("name=b", "TABLE.KEY"),
            ("camera.nam=b", "nam"),
            ("frames=0", "frames"),
            ("fps=fast", "fps"),
            ("sky=3", "TABLE.KEY"),
        ] {
            let message = settings(text, &[set]).unwrap_err().to_string();
            assert!(message.contains(word) && !message.contains('\n'), "{message}");
        }
    }
}
