//! Sources and documents have American spelling.
//!
//! MPEG-2's own words, such as `quantiser_scale`, keep the spelling of the standard.

use super::{files_below, name_of, root};

/// Parts of words that only British spelling has.
const BRITISH: [&str; 41] = [
    "analyse ",
    "analysed",
    "analyser",
    "artefact",
    "behaviour",
    "catalogue",
    "centre",
    "colour",
    "favour",
    "generalis",
    "grey",
    "honour",
    "initialis",
    "judgement",
    "labelled",
    "labelling",
    "licence",
    "litre",
    "maximis",
    "metre",
    "minimis",
    "modelled",
    "modelling",
    "mould",
    "neighbour",
    "normalis",
    "optimis",
    "parallelis",
    "programme ",
    "programmes",
    "randomis",
    "recognis",
    "rumour",
    "serialis",
    "specialis",
    "synchronis",
    "travelled",
    "travelling",
    "vectoris",
    "visualis",
    "whilst",
];
/// What stays: words that look like them, syntax elements of MPEG-2, and an option that is still accepted.
const KEPT: [&str; 5] = ["optimistic", "colour_description", "colour_primaries", "alias = \"centre\"", "`--centre`"];
/// This list itself.
const LIST: &str = "tests/it/structure/words.rs";

/// Lines of `text` in British spelling, by number. Blocks of output in documents are what programs of others say.
fn british_lines(text: &str, is_document: bool) -> Vec<(usize, &'static str)> {
    let (mut found, mut in_block) = (Vec::new(), false);
    for (number, line) in text.lines().enumerate() {
        if is_document && line.trim_start().starts_with("```") {
            in_block = !in_block;
        }
        if in_block {
            continue;
        }
        let mut line = format!("{} ", line.to_lowercase());
        for kept in KEPT {
            line = line.replace(kept, "");
        }
        let words = BRITISH.iter().filter(|word| line.contains(*word));
        found.extend(words.map(|word| (number + 1, *word)));
    }
    found
}

#[test]
fn sources_and_documents_are_in_american_spelling() {
    let mut found = Vec::new();
    for ending in ["rs", "md"] {
        for path in files_below(&root(), ending) {
            let name = name_of(&path);
            if name == LIST {
                continue;
            }
            let text = std::fs::read_to_string(&path).expect("a text");
            for (line, word) in british_lines(&text, ending == "md") {
                found.push(format!("{name}:{line}: {word}"));
            }
        }
    }
    assert!(found.is_empty(), "{}", found.join("\n"));
}
