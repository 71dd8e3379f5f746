//! The command that made a film, with names of files and without folders of the machine.

use std::borrow::Cow;
use std::ffi::OsString;
use std::path::Path;

/// `arguments` of the program, its own name first, as a shell takes them.
#[must_use]
pub fn command_line(arguments: impl IntoIterator<Item = OsString>) -> String {
    let mut words: Vec<String> = Vec::new();
    for argument in arguments {
        words.push(quoted(&without_folders(&argument.to_string_lossy())));
    }
    words.join(" ")
}

/// An argument with its last name alone where it is a path; `--option=PATH` keeps the option.
fn without_folders(argument: &str) -> String {
    match argument.split_once('=') {
        Some((option, value)) if option.starts_with('-') => format!("{option}={}", file_name(value)),
        _ => file_name(argument).into_owned(),
    }
}

/// The last name of a path.
pub(super) fn file_name(path: &str) -> Cow<'_, str> {
    let name = Path::new(path).file_name();
    name.map_or(Cow::Borrowed(path.trim_matches(['/', '.'])), |name| name.to_string_lossy())
}

/// A word in quotes, if a shell would take it apart.
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
