//! Data files embedded in a page.

use super::html::data_uri;
use super::svg::Svg;
use minijinja::{Value, context};
use pipeline::report::FrameReport;
use render2mpeg::error::Result;

/// Returns a link that saves `bytes` as `name`.
pub fn download(name: &str, mime: &str, bytes: &[u8]) -> Value {
    context! { name, uri => data_uri(mime, bytes) }
}

/// Returns a drawing with a link that saves it as `name`.
pub(super) fn drawing(name: &str, svg: &Svg) -> Value {
    context! { svg => svg.inline(), file => download(name, "image/svg+xml", svg.file().as_bytes()) }
}

/// Formats the figures of frames as comma-separated values, one line per frame. Unknown figures are empty.
///
/// # Errors
/// If a report cannot be serialized, which is a bug.
pub(super) fn csv_of(frames: &[FrameReport]) -> Result<String> {
    let mut text = String::new();
    for frame in frames {
        let cells = cells(frame)?;
        let line = |of: fn(&(String, String)) -> &String| cells.iter().map(of).cloned().collect::<Vec<_>>().join(",");
        // Write the headings before the first frame.
        if text.is_empty() {
            text = line(|(name, _)| name) + "\n";
        }
        text += &(line(|(_, value)| value) + "\n");
    }
    Ok(text)
}

/// Returns names and values of a frame's figures, starting with the frame number. Figures of stages have names such as
/// `seconds.direct`.
fn cells(frame: &FrameReport) -> Result<Vec<(String, String)>> {
    let mut cells = vec![("index".to_owned(), frame.index.to_string())];
    let serde_json::Value::Object(figures) = serde_json::to_value(frame)? else { return Ok(cells) };
    for (name, value) in figures.into_iter().filter(|(name, _)| name != "index") {
        match value {
            serde_json::Value::Object(parts) => {
                cells.extend(parts.iter().map(|(part, value)| (format!("{name}.{part}"), cell(value))));
            }
            value => cells.push((name, cell(&value))),
        }
    }
    Ok(cells)
}

fn cell(value: &serde_json::Value) -> String {
    match value {
        serde_json::Value::Null => String::new(),
        serde_json::Value::String(text) => text.clone(),
        other => other.to_string(),
    }
}
