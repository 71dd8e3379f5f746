//! Checks that parts belong to the same film, are complete, and are in order.

use super::part::WholePart;
use crate::error::{Error, Result};
use crate::settings::FrameRange;
use serde_json::Value;

/// Settings of a single part that change no bit of the stream: paths, and the part's range.
const OF_ONE_PART: [&str; 9] = ["scene", "output", "range", "baked", "light", "exr", "exr_depth", "aov", "y4m"];

/// Checks `parts` in the order in which they will be joined.
///
/// # Errors
/// If a part belongs to a film other than the first part's, or does not follow the previous part.
pub(super) fn check(parts: &[WholePart]) -> Result<()> {
    let [first, others @ ..] = parts else {
        return Err(Error::Options("no parts to join".into()));
    };
    others.iter().try_for_each(|part| check_same_film(first, part))?;
    check_order(parts)
}

/// Checks that `part` belongs to the film of the `first` part.
fn check_same_film(first: &WholePart, part: &WholePart) -> Result<()> {
    let (one, other) = (&first.report, &part.report);
    let differs = |what: &str, then: &dyn std::fmt::Display, now: &dyn std::fmt::Display| {
        let first_file = first.path.display();
        Err(Error::content(
            &part.path,
            format!(" belongs to another film: {what} is {now}, but {then} in {first_file}"),
        ))
    };

    // Compare program and settings, except for settings of a single part.
    if one.program != other.program || one.schema != other.schema {
        return differs("the program", &one.program, &other.program);
    }
    let names = one.settings.keys().chain(other.settings.keys());
    for name in names.filter(|name| !OF_ONE_PART.contains(&name.as_str())) {
        let [then, now] = [one, other].map(|report| report.settings.get(name).unwrap_or(&Value::Null));
        if then != now {
            return differs(name, then, now);
        }
    }

    // Compare inputs and headers, because equal settings do not imply the same scene version and encoder.
    if one.inputs != other.inputs {
        let first_file = first.path.display();
        let text = format!(" was made from another scene than {first_file}: a file of the scene changed between them");
        return Err(Error::content(&part.path, text));
    }
    if first.sequence_header != part.sequence_header {
        let text = format!(" has another sequence header than {}: it belongs to another film", first.path.display());
        return Err(Error::content(&part.path, text));
    }
    Ok(())
}

/// Checks that the parts are consecutive and cover the film from the first frame to the last.
fn check_order(parts: &[WholePart]) -> Result<()> {
    let mut next = 0;
    for part in parts {
        let wrong = |text: String| Err(Error::content(&part.path, format!(", frames {}, {text}", part.range)));
        let FrameRange { first, last } = part.range;
        // Report overlaps first: reordering the parts would not remove them.
        if let Some(other) = parts.iter().find(|other| !std::ptr::eq(*other, part) && overlap(other, part)) {
            return wrong(format!("overlaps {}, frames {}", other.path.display(), other.range));
        }
        if first != next {
            // Distinguish parts in the wrong order from a missing part.
            return match parts.iter().find(|other| other.range.first == next) {
                Some(other) => wrong(format!("is out of order: {} comes first", other.path.display())),
                None => wrong(format!("cannot come next: the part that begins with frame {next} is missing")),
            };
        }
        // Reject a range that exceeds the film's length in the part's own report.
        let frames = part.film_frames;
        if last >= frames {
            return wrong(format!("continues after the end of its film of {frames} frames"));
        }
        next = last + 1;
    }

    // Check the end separately: no later part reveals that the last one is missing.
    match parts.last() {
        Some(part) if next < part.film_frames => {
            let frames = part.film_frames;
            let text = format!(
                ", frames {}, is not the end of its film of {frames} frames: the part that begins with frame {next} is missing",
                part.range
            );
            Err(Error::content(&part.path, text))
        }
        _ => Ok(()),
    }
}

fn overlap(one: &WholePart, other: &WholePart) -> bool {
    one.range.first <= other.range.last && other.range.first <= one.range.last
}
