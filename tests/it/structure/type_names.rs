//! Each name denotes one public type of a crate.

use super::{CRATES, only_in_tests, sources_of};
use std::collections::{BTreeMap, BTreeSet};

/// Accepted names of two public types of one crate.
///
/// `lanes` has each vector type twice, for two kinds of processor, of which a build compiles one.
const KNOWN: [(&str, &str); 4] = [
    ("support/lanes", "Absolute"),
    ("support/lanes", "Bytes"),
    ("support/lanes", "Squared"),
    ("support/lanes", "Words"),
];

/// Accepted names of more than two private or public types of the workspace.
///
/// `lanes` has a vector type for each kind of processor, `Readme` contains doc tests, and each container has a `Writer`.
const SHARED: [&str; 6] = ["Absolute", "Display", "Readme", "Squared", "Words", "Writer"];

/// Adds the names of types in `items` with their defining module. Two definitions in one module are variants by
/// configuration. Private types count if `private` is set.
fn add(items: &[syn::Item], module: &str, private: bool, names: &mut BTreeMap<String, BTreeSet<String>>) {
    for item in items {
        // Search inline modules too, except modules of tests.
        let (visibility, name, attributes) = match item {
            syn::Item::Struct(item) => (&item.vis, &item.ident, &item.attrs),
            syn::Item::Enum(item) => (&item.vis, &item.ident, &item.attrs),
            syn::Item::Union(item) => (&item.vis, &item.ident, &item.attrs),
            syn::Item::Type(item) => (&item.vis, &item.ident, &item.attrs),
            syn::Item::Trait(item) => (&item.vis, &item.ident, &item.attrs),
            syn::Item::Mod(inner) => {
                if let Some((_, items)) = inner.content.as_ref().filter(|_| !only_in_tests(&inner.attrs)) {
                    add(items, &format!("{module} {}", inner.ident), private, names);
                }
                continue;
            }
            _ => continue,
        };
        let counts = private || matches!(visibility, syn::Visibility::Public(_));
        if counts && !only_in_tests(attributes) {
            names.entry(name.to_string()).or_default().insert(module.to_owned());
        }
    }
}

/// Returns the names of a crate's public types, each with its defining files.
pub fn public_types(sources: &[(String, syn::File)]) -> BTreeMap<String, BTreeSet<String>> {
    let mut names = BTreeMap::new();
    for (file, source) in sources {
        add(&source.items, file, false, &mut names);
    }
    names
}

#[test]
fn a_name_is_one_public_type_of_a_crate() {
    let (mut found, mut known) = (Vec::new(), Vec::new());
    for name in CRATES {
        let names = public_types(&sources_of(name));
        assert!(!names.is_empty(), "{name} has public types");
        for (kind, modules) in names {
            let exception = KNOWN.into_iter().find(|exception| *exception == (name, kind.as_str()));
            if modules.len() > 1 && exception.is_none() {
                found.push(format!("{name}: {kind} is defined in {}", Vec::from_iter(modules).join(" and in ")));
            } else if modules.len() > 1 {
                known.extend(exception);
            }
        }
    }
    assert!(found.is_empty(), "{}", found.join("\n"));
    // An obsolete exception must leave the list.
    assert_eq!(known, KNOWN);
}

#[test]
fn a_name_is_at_most_two_types_of_the_workspace() {
    let mut names = BTreeMap::new();
    for name in CRATES {
        let sources = sources_of(name);
        for (file, source) in sources.iter().filter(|(file, _)| !file.contains("/tests/")) {
            add(&source.items, file, true, &mut names);
        }
    }
    let shared: Vec<_> = names.into_iter().filter(|(_, places)| places.len() > 2).collect();
    let known = shared.iter().map(|(name, _)| name.as_str()).eq(SHARED);
    assert!(known, "names of more than two types: {shared:#?}");
}
