//! Forbidden dependencies between crates, direct or indirect.

use super::{CRATES, root};
use std::collections::{BTreeMap, BTreeSet};

/// Crates, and names forbidden among their direct and indirect dependencies.
const NEVER: [(&str, &[&str]); 15] = [
    ("support/lanes", &["glam", "rayon", "serde", "ranks", "plane"]),
    ("support/plane", &["glam", "rayon", "ranks", "render-core"]),
    ("support/threads", &["plane", "lanes", "ranks", "glam", "serde"]),
    ("support/ranks", &["plane", "serde", "render-core", "pipeline", "mpi"]),
    ("support/lightfield", &["plane", "render-core", "gltf"]),
    ("support/mpeg2", &["plane", "rayon", "ranks", "render-core"]),
    ("lighttree", &["render-core", "perceptual", "mpeg2enc", "pipeline", "gltf"]),
    ("perceptual", &["render-core", "lighttree", "mpeg2enc", "pipeline"]),
    ("mpeg2enc", &["render-core", "lighttree", "perceptual", "pipeline", "glam"]),
    ("mpeg2dec", &["mpeg2enc", "rayon", "glam", "render-core", "pipeline"]),
    ("render-core", &["lighttree", "perceptual", "mpeg2enc", "pipeline"]),
    ("pipeline/loop", &["render-core", "lighttree", "mpeg2enc", "renderer", "clap", "image", "gltf", "minijinja"]),
    ("pipeline/renderer", &["mpeg2enc", "render2mpeg", "laboratory", "minijinja", "anyhow", "indicatif"]),
    ("pipeline/live", &["laboratory", "program", "minijinja", "anyhow", "indicatif"]),
    ("pipeline/film", &["laboratory", "program", "minijinja", "anyhow", "indicatif", "csv"]),
];

/// Returns the names in the dependency tables of a crate.
fn dependencies(name: &str) -> BTreeSet<String> {
    let text = std::fs::read_to_string(root().join(name).join("Cargo.toml")).expect("a manifest");
    let mut names = BTreeSet::new();
    let mut within = false;
    // Read the tables of dependencies, without those for tests and builds.
    for line in text.lines() {
        if line.starts_with('[') {
            within = line == "[dependencies]" || line.starts_with("[target.") && line.ends_with(".dependencies]");
        } else if within && !line.starts_with('#') {
            let name = line.split(['.', ' ', '=']).next().unwrap_or_default();
            names.extend((!name.is_empty()).then(|| name.to_owned()));
        }
    }
    names
}

/// Maps the name of each crate of the workspace in manifests to its folder.
fn folders() -> BTreeMap<&'static str, &'static str> {
    let mut folders = BTreeMap::new();
    for folder in CRATES {
        // The names of two crates differ from their folders.
        let name = match folder {
            "pipeline/loop" => "pipeline",
            "pipeline/film" => "render2mpeg",
            folder => folder.rsplit('/').next().expect("a name"),
        };
        folders.insert(name, folder);
    }
    folders
}

#[test]
fn crates_keep_off_the_crates_above_them() {
    let folders = folders();
    let mut found = Vec::new();
    for (of, never) in NEVER {
        // Collect direct and indirect dependencies.
        let (mut reached, mut open) = (BTreeSet::new(), vec![of]);
        while let Some(folder) = open.pop() {
            for name in dependencies(folder) {
                let folder = folders.get(name.as_str());
                if reached.insert(name) {
                    open.extend(folder);
                }
            }
        }
        assert!(of == "support/lanes" || !reached.is_empty(), "{of} has dependencies");
        found
            .extend(never.iter().filter(|name| reached.contains(**name)).map(|name| format!("{of} depends on {name}")));
    }
    assert!(found.is_empty(), "{}", found.join("\n"));
}
