//! A name stands for one public type of a crate.

use super::{CRATES, only_in_tests, sources_of};
use std::collections::{BTreeMap, BTreeSet};

/// Names that stand for two public types of a crate and are left as they are.
///
/// Exceptions: `lanes` has each vector type twice, for two kinds of processor. A build has one kind.
const KNOWN: [(&str, &str); 4] = [
    ("support/lanes", "Absolute"),
    ("support/lanes", "Bytes"),
    ("support/lanes", "Squared"),
    ("support/lanes", "Words"),
];

/// Names that more than two private or public types of the workspace have.
///
/// `lanes` has a vector type for each kind of processor; `Readme` holds doc tests; a `Writer` is named by its container.
const SHARED: [&str; 6] = ["Absolute", "Display", "Readme", "Squared", "Words", "Writer"];

/// Adds the names of types among `items` with the module that defines each. Two definitions in one module are
/// variants of one type, by configuration. Private types count if `private`.
fn add(items: &[syn::Item], module: &str, private: bool, names: &mut BTreeMap<String, BTreeSet<String>>) {
    for item in items {
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

/// The names of a crate's public types, each with the files that define it.
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
    // An exception that is none any more leaves the list.
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
