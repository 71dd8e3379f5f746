//! Command that made a film, without the machine's folders.

use std::borrow::Cow;
use std::ffi::OsString;
use std::path::Path;

/// Formats the program's `arguments`, including its name, for a shell.
#[must_use]
pub fn command_line(arguments: impl IntoIterator<Item = OsString>) -> String {
    let mut words: Vec<String> = Vec::new();
    for argument in arguments {
        words.push(quoted(&without_folders(&argument.to_string_lossy())));
    }
    words.join(" ")
}

/// Reduces paths in an argument to their file names; `--option=PATH` keeps the option.
fn without_folders(argument: &str) -> String {
    match argument.split_once('=') {
        Some((option, value)) if option.starts_with('-') => format!("{option}={}", file_name(value)),
        _ => file_name(argument).into_owned(),
    }
}

/// Returns the file name of a path.
pub(super) fn file_name(path: &str) -> Cow<'_, str> {
    let name = Path::new(path).file_name();
    name.map_or(Cow::Borrowed(path.trim_matches(['/', '.'])), |name| name.to_string_lossy())
}

/// Quotes a word if a shell would split it.
fn quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_alphanumeric() || "-_=.,:+%@/".contains(c);
    if !word.is_empty() && word.chars().all(is_plain) {
        word.into()
    } else {
        format!("'{}'", word.replace('\'', "'\\''"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_are_left_out() {
        let of = |words: &[&str]| command_line(words.iter().map(OsString::from));
        assert_eq!(
            of(&[
                "/home/me/bin/render2mpeg",
                "render",
                "../a/box.glb",
                "--html=/tmp/x/box.html",
                "--exr",
                "/a/frames/"
            ]),
            "render2mpeg render box.glb --html=box.html --exr frames"
        );
        assert_eq!(
            of(&["r", "--thresholds", "fixed:0.02", "a film.glb", "it's"]),
            "r --thresholds fixed:0.02 'a film.glb' 'it'\\''s'"
        );
        assert_eq!(of(&["r", "/", ""]), "r '' ''");
    }
}
