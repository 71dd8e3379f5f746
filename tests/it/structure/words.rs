//! Sources and documents have American spelling.
//!
//! Terms of the MPEG-2 standard, such as `quantiser_scale`, keep its spelling.

use super::{files_below, name_of, root};

/// Fragments of words in British spelling.
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
/// Accepted words: similar words, syntax elements of MPEG-2, and an option that is still accepted.
const KEPT: [&str; 5] = ["optimistic", "colour_description", "colour_primaries", "alias = \"centre\"", "`--centre`"];
/// Path of the file with this list.
const LIST: &str = "tests/it/structure/words.rs";

/// Returns the lines of `text` in British spelling, by number. Skips output blocks in documents, because other programs
/// write them.
fn british_lines(text: &str, is_document: bool) -> Vec<(usize, &'static str)> {
    let (mut found, mut in_block) = (Vec::new(), false);
    for (number, line) in text.lines().enumerate() {
        if is_document && line.trim_start().starts_with("```") {
            in_block = !in_block;
        }
        if in_block {
            continue;
        }
        // Append a space, because some fragments end with a space. Remove accepted words.
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
