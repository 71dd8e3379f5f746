//! Settings of a film, as listed on a page.

use super::command::file_name;
use render2mpeg::error::Result;
use render2mpeg::report::Report;
use render2mpeg::settings::Settings;
use serde_json::Value;
use std::path::PathBuf;

/// Setting as text, and the default value `usual` if it differs from the setting.
#[derive(Clone, Debug, serde::Serialize)]
pub(super) struct Choice {
    name: String,
    value: String,
    usual: Option<String>,
}

/// Returns all settings, each with its default in `usual` if the default differs.
///
/// # Errors
/// If the settings cannot be serialized, which is a bug.
pub(super) fn choices(settings: &Settings, usual: Option<&Settings>) -> Result<Vec<Choice>> {
    let usual = usual.map(rows).transpose()?.unwrap_or_default();
    let known = |name: &str| usual.iter().find(|(own, _)| own == name).map(|(_, value)| value.clone());
    let choice = |(name, value): (String, String)| {
        // Settings that are listed only if set have no default, so show a dash.
        let default = known(&name).or((!usual.is_empty()).then(|| "–".into()));
        Choice { usual: default.filter(|usual| *usual != value), name, value }
    };
    Ok(rows(settings)?.into_iter().map(choice).collect())
}

/// Returns names and values of settings. A nested value is named by the outer and the inner name, joined by a dot.
fn rows(settings: &Settings) -> Result<Vec<(String, String)>> {
    let mut rows = Vec::new();
    let Value::Object(all) = serde_json::to_value(settings)? else { return Ok(rows) };
    for (name, value) in all {
        match value {
            Value::Object(parts) => {
                rows.extend(parts.iter().map(|(part, value)| (format!("{name}.{part}"), plain(value))));
            }
            value => rows.push((name, plain(&value))),
        }
    }
    Ok(rows)
}

/// Formats a JSON value as plain text.
pub(super) fn plain(value: &Value) -> String {
    match value {
        Value::Null => "–".into(),
        Value::String(text) => text.clone(),
        Value::Bool(true) => "yes".into(),
        Value::Bool(false) => "no".into(),
        Value::Number(number) => number.to_string().trim_end_matches(".0").to_owned(),
        Value::Array(values) if values.is_empty() => "–".into(),
        other => other.to_string(),
    }
}

/// Returns `settings` with file names in place of paths.
fn settings_without_folders(settings: &Settings) -> Settings {
    let name = |path: &PathBuf| PathBuf::from(file_name(&path.to_string_lossy()).as_ref());
    let mut named = settings.clone();
    (named.scene, named.output) = (name(&settings.scene), name(&settings.output));
    let files = &mut named.files;
    for path in [&mut files.baked, &mut files.png, &mut files.exr, &mut files.y4m].into_iter().flatten() {
        *path = name(path);
    }
    named
}

/// Returns a report without the machine's folders.
pub(super) fn without_folders(report: &Report) -> Report {
    let mut report = report.clone();
    report.settings = settings_without_folders(&report.settings);
    let folder = report.scene.file.parent().map(|folder| format!("{}/", folder.display())).unwrap_or_default();
    report.scene.file = report.settings.scene.clone();
    // A scene without a folder has the prefix "/", which must not be removed.
    if folder.len() > 1 {
        report.scene.warnings.iter_mut().for_each(|warning| *warning = warning.replace(&folder, ""));
    }
    report
}

/// Returns the settings `usual` without folders, for comparison with settings without folders.
pub(super) fn usual_without_folders(usual: Option<&Settings>) -> Option<Settings> {
    usual.map(settings_without_folders)
}
