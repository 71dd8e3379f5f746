//! Release files contain the versions of the workspace.

use super::{CRATES, root};
use std::fs;

/// Returns the text between the first `before` and the next `after` in a file of the workspace.
fn value_in(file: &str, before: &str, after: &str) -> String {
    let text = fs::read_to_string(root().join(file)).unwrap();
    let found = text.split_once(before).and_then(|(_, rest)| rest.split_once(after));
    found.unwrap_or_else(|| panic!("{file} has no {before:?}")).0.to_owned()
}

#[test]
fn the_citation_is_of_this_version() {
    assert_eq!(value_in("CITATION.cff", "\nversion: ", "\n"), value_in("Cargo.toml", "\nversion = \"", "\""));
}

#[test]
fn containers_are_built_with_the_oldest_rust() {
    assert_eq!(
        value_in("packaging/Dockerfile", "FROM rust:", "-"),
        value_in("Cargo.toml", "\nrust-version = \"", "\"")
    );
}

#[test]
fn every_package_has_links() {
    for folder in CRATES {
        let manifest = format!("{folder}/Cargo.toml");
        let name = value_in(&manifest, "\nname = \"", "\"");
        assert_eq!(value_in(&manifest, "\nrepository.workspace = ", "\n"), "true", "{manifest}");
        match folder {
            "pipeline/program" => assert_eq!(value_in(&manifest, "\ndocumentation.workspace = ", "\n"), "true"),
            _ => assert_eq!(value_in(&manifest, "\ndocumentation = \"", "\""), format!("https://docs.rs/{name}")),
        }
    }
}
