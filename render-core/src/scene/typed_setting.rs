//! Settings from the command line, with their names and valid values.

use super::{SceneSettings, Setting, SettingsError};
use std::str::FromStr;
use toml::{Table, Value};

/// Tables of a settings file, and the keys of each table. A key that occurs in one table only may be given without the
/// table.
const TABLES: [(&str, &[&str]); 11] = [
    ("tone_mapping", &["operator", "exposure", "gamma", "white", "display"]),
    ("sky", &["zenith", "horizon", "ground", "image", "intensity", "rotation"]),
    ("studio", &["kind", "background"]),
    ("sun", &["angular_diameter"]),
    ("camera", &["name", "orbit", "target", "fov", "up", "turn"]),
    ("animation", &["name"]),
    ("variant", &["name"]),
    ("light", &["lamps", "lamp_radius"]),
    ("strokes", &["point_size"]),
    ("video", &["frames", "fps"]),
    ("importance", &["nodes", "viewing_distance", "screen_width"]),
];

impl FromStr for Setting {
    type Err = SettingsError;

    fn from_str(text: &str) -> Result<Self, SettingsError> {
        let wrong = |why: &str| SettingsError::Toml(format!("\"{text}\" {why}"));
        let (name, value) = text.split_once('=').ok_or_else(|| wrong("is not a setting such as exposure=1.5"))?;
        let place = place_of(name.trim());
        let (table, key) =
            place.ok_or_else(|| wrong(&format!("names an unknown setting; settings are {}", all_names())))?;

        // Parse the value as TOML. Otherwise use the text itself, since names need no quotation marks.
        let line = format!("value = {}", value.trim());
        let parsed = line.parse::<Table>().ok().and_then(|mut table| table.remove("value"));
        let value = parsed.unwrap_or_else(|| Value::String(value.trim().into()));
        let setting = Self { table: table.into(), key: key.into(), value };
        check(&setting)?;
        Ok(setting)
    }
}

/// Returns the table and key of a setting `name`, if they exist.
fn place_of(name: &str) -> Option<(&'static str, &'static str)> {
    all_places().find(|(table, key)| name == format!("{table}.{key}") || (name == *key && is_unique(key)))
}

/// Checks type and range of the value, as far as possible without a scene. Another crate checks tone curves.
fn check(setting: &Setting) -> Result<(), SettingsError> {
    let mut tables = Table::new();
    setting.put_into(&mut tables);
    let alone: SceneSettings =
        tables.try_into().map_err(|error: toml::de::Error| SettingsError::of_toml(error.message()))?;
    alone.check_values()
}

/// Returns all pairs of table and key.
fn all_places() -> impl Iterator<Item = (&'static str, &'static str)> {
    TABLES.iter().flat_map(|(table, keys)| keys.iter().map(|key| (*table, *key)))
}

/// Returns whether the key occurs in one table only.
fn is_unique(key: &str) -> bool {
    all_places().filter(|(_, other)| *other == key).count() == 1
}

/// Returns the names of all settings, each in its shortest form.
fn all_names() -> String {
    let name = |(table, key): (&str, &str)| if is_unique(key) { key.into() } else { format!("{table}.{key}") };
    all_places().map(name).collect::<Vec<String>>().join(", ")
}

#[cfg(test)]
mod tests {
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
            ("name=b", "camera.name, orbit, target, fov, up, turn, animation.name"),
            ("camera.nam=b", "settings are operator, exposure"),
            ("exposre=1", "\"exposre=1\" names an unknown setting; settings are operator, exposure, gamma"),
            ("nadir=[0,0,0]", "zenith, horizon, ground"),
            ("frames=0", "[video] frames must be at least 1"),
            ("frames=2.5", "expected a whole number"),
            ("fps=fast", "invalid type: string \"fast\", expected a number"),
            ("fps=0", "[video] fps must be positive"),
            ("intensity=-1", "[sky] intensity -1 must be finite and not negative"),
            ("horizon=[1,1]", "array of length 3"),
            ("sky=3", "names an unknown setting"),
            ("intensity=2", "[sky] needs zenith and horizon, or an image"),
        ] {
            let message = settings(text, &[set]).unwrap_err().to_string();
            assert!(message.contains(word) && !message.contains('\n'), "{message}");
        }
    }

    #[test]
    fn each_key_that_files_may_have_can_be_set_and_no_other() {
        // The error for an unknown key lists the valid keys.
        for (table, keys) in TABLES.iter().filter(|(table, _)| *table != "tone_mapping") {
            let message = SceneSettings::parse(&format!("[{table}]\nno-such-key = 1")).unwrap_err().to_string();
            let known: Vec<&str> = message.split('`').skip(3).step_by(2).collect();
            assert_eq!(&known, keys, "{message}");
        }
        let message = SceneSettings::parse("[no-such-table]").unwrap_err().to_string();
        let tables: Vec<&str> = message.split('`').skip(3).step_by(2).collect();
        assert_eq!(tables.len(), TABLES.len(), "{message}");
        assert!(TABLES.iter().all(|(table, _)| tables.contains(table)), "{message}");
    }
}
