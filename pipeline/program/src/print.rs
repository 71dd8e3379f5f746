//! Text for terminals, escaped so that names in files cannot forge the program's output.

use std::borrow::Cow;

/// Escapes control characters in `text` as `\u{…}`, except for line breaks and tabs.
pub fn printable(text: &str) -> Cow<'_, str> {
    escaped(text, |c| is_control(c) && c != '\n' && c != '\t')
}

/// Escapes all control characters in `text`, including line breaks and tabs.
pub fn single_line(text: &str) -> Cow<'_, str> {
    escaped(text, is_control)
}

/// Returns whether a terminal interprets the character instead of displaying it. These are C0 and C1 controls, and
/// bidirectional controls.
fn is_control(c: char) -> bool {
    c.is_control() || matches!(c, '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

fn escaped(text: &str, is_escaped: impl Fn(char) -> bool) -> Cow<'_, str> {
    // Copy the text only if it contains escaped characters.
    if !text.contains(&is_escaped) {
        return Cow::Borrowed(text);
    }
    let mut shown = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        if is_escaped(c) { shown.extend(c.escape_unicode()) } else { shown.push(c) }
    }
    Cow::Owned(shown)
}

/// Formats a count with its noun: "1 frame", "2 frames".
pub(crate) fn counted(number: usize, noun: &str) -> String {
    format!("{number} {noun}{}", if number == 1 { "" } else { "s" })
}

/// Formats seconds in a suitable unit.
pub(crate) fn rough_time(seconds: f64) -> String {
    match seconds {
        ..120.0 => format!("{seconds:.0} s"),
        120.0..7200.0 => format!("{:.0} min", seconds / 60.0),
        _ => format!("{:.1} h", seconds / 3600.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_is_singular() {
        assert_eq!([0, 1, 2].map(|number| counted(number, "frame")), ["0 frames", "1 frame", "2 frames"]);
    }

    #[test]
    fn terminals_obey_no_name() {
        assert_eq!(single_line("a\u{1b}[2Jb\nrender2mpeg: done"), "a\\u{1b}[2Jb\\u{a}render2mpeg: done");
        assert_eq!(printable("one\n\ttwo\r\u{9b}31m"), "one\n\ttwo\\u{d}\\u{9b}31m");
        assert_eq!(single_line("\u{202e}gnp.exe"), "\\u{202e}gnp.exe");
        for plain in ["Kirche – Schiff", "日本", "a b"] {
            assert!(matches!(single_line(plain), Cow::Borrowed(text) if text == plain));
        }
    }
}
