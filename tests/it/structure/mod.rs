//! Rules about sources and documents that no compiler checks.

mod chains;
mod circles;
mod idioms;
mod layers;
mod release;
mod sentences;
mod signatures;
mod tuples;
mod type_names;
mod words;

use std::path::{Path, PathBuf};

/// Folders of the program's crates.
const CRATES: [&str; 17] = [
    "support/lanes",
    "support/plane",
    "support/threads",
    "support/ranks",
    "support/lightfield",
    "support/mpeg2",
    "lighttree",
    "perceptual",
    "mpeg2enc",
    "mpeg2dec",
    "render-core",
    "pipeline/loop",
    "pipeline/renderer",
    "pipeline/film",
    "pipeline/laboratory",
    "pipeline/live",
    "pipeline/program",
];

/// Root folder of the workspace.
fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// Returns the files below `folder` with names that end with `ending`, sorted by name.
fn files_below(folder: &Path, ending: &str) -> Vec<PathBuf> {
    let (mut found, mut open) = (Vec::new(), vec![folder.to_owned()]);
    while let Some(folder) = open.pop() {
        for entry in std::fs::read_dir(&folder).expect("a folder") {
            let path = entry.expect("an entry").path();
            let name = path.file_name().expect("a name").to_string_lossy().into_owned();
            // Build outputs, results of measurements and hidden folders contain no sources.
            if path.is_dir() && name != "target" && name != "out" && !name.starts_with('.') {
                open.push(path);
            } else if path.extension().is_some_and(|found| found == ending) {
                found.push(path);
            }
        }
    }
    found.sort();
    found
}

/// Returns a file's path relative to the workspace.
fn name_of(path: &Path) -> String {
    path.strip_prefix(root()).expect("a file of the workspace").display().to_string()
}

/// Parses the sources of a crate, with their names, except its own test modules.
fn sources_of(name: &str) -> Vec<(String, syn::File)> {
    let mut sources = Vec::new();
    for path in files_below(&root().join(name).join("src"), "rs") {
        if path.file_stem().is_some_and(|stem| stem == "tests") {
            continue;
        }
        let text = std::fs::read_to_string(&path).expect("a source");
        sources.push((name_of(&path), syn::parse_file(&text).expect("Rust")));
    }
    assert!(!sources.is_empty(), "{name} has sources");
    sources
}

/// Returns whether an item exists only in its crate's tests.
fn only_in_tests(attributes: &[syn::Attribute]) -> bool {
    let is_test = |attribute: &syn::Attribute| {
        attribute.path().is_ident("cfg") && attribute.parse_args::<syn::Ident>().is_ok_and(|name| name == "test")
    };
    attributes.iter().any(is_test)
}
