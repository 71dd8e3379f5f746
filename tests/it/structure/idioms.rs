//! Idioms that make a text hard to read are rare in documents, doc lines, comments and messages.

use super::sentences::{paragraphs, plain};
use super::{CRATES, files_below, name_of, root};

/// Rare idioms, with the number of uses allowed in 1000 words.
const RARE: [(&[&str], f64); 3] = [
    (&["what", "whatever"], 2.0),
    (&["tell", "tells", "told", "say", "says", "said", "know", "knows", "knew"], 1.0),
    (&["those of", "that of"], 0.5),
];
/// Forbidden idioms.
const NEVER: [&str; 22] = [
    "anew",
    "afresh",
    "once more",
    "beside",
    "besides",
    "stand still",
    "stands still",
    "stood still",
    "at rest",
    "the frame before",
    "the picture before",
    "of others",
    "so many",
    "let go",
    "lets go",
    "behind in time",
    "no number",
    "held against",
    "stands in",
    "stands for",
    "likewise",
    "thereby",
];
/// Prepositions that, as first words, mark a doc line of at most three words as incomplete.
const PREPOSITIONS: [&str; 14] =
    ["of", "in", "on", "at", "for", "from", "to", "by", "with", "as", "before", "after", "between", "without"];
/// Minimum number of words of a message; shorter strings are names.
const MESSAGE_WORDS: usize = 4;

/// Paragraph with its file and line.
struct Passage {
    place: String,
    is_doc: bool,
    /// Words in lower case, without punctuation; code counts as one word.
    words: Vec<String>,
}

impl Passage {
    fn new(name: &str, line: usize, is_doc: bool, text: &str) -> Self {
        let plain = plain(text).to_lowercase();
        // Split words at punctuation, except apostrophes.
        let is_sign = |c: char| !c.is_alphanumeric() && c != '’' && c != '\'';
        let words = plain.split(is_sign).filter(|word| word.chars().any(char::is_alphabetic)).map(str::to_owned);
        Self { place: format!("{name}:{line}"), is_doc, words: words.collect() }
    }

    /// Returns the number of positions at which the words of `idiom` follow each other.
    fn count(&self, idiom: &str) -> usize {
        let idiom: Vec<&str> = idiom.split(' ').collect();
        self.words.windows(idiom.len()).filter(|words| words.iter().eq(idiom.iter())).count()
    }

    /// Returns whether this is a doc line that is incomprehensible without its neighbors.
    fn leans(&self) -> bool {
        self.is_doc && self.words.len() <= 3 && self.words.first().is_some_and(|w| PREPOSITIONS.contains(&w.as_str()))
    }
}

/// Returns the sign of a doc line or comment, and the text after the sign.
fn commented(line: &str) -> Option<(&'static str, &str)> {
    let line = line.trim_start();
    let sign = ["///", "//!", "//"].into_iter().find(|sign| line.starts_with(sign))?;
    Some((sign, line[sign.len()..].trim()))
}

/// Returns the strings of a line that are long enough to be messages.
fn messages(line: &str) -> Vec<String> {
    // Remove escaped quotes, which do not end a string.
    let line = line.replace("\\\\", "").replace("\\\"", "");
    let strings = line.split('"').skip(1).step_by(2);
    strings.filter(|text| text.split_whitespace().count() >= MESSAGE_WORDS).map(str::to_owned).collect()
}

/// Returns the doc lines, comments and messages of a source, by paragraphs.
fn passages_of_source(name: &str, text: &str) -> Vec<Passage> {
    let (mut passages, mut open): (_, Option<(&str, usize, String)>) = (Vec::new(), None);
    let mut in_block = false;
    for (number, line) in text.lines().chain([""]).enumerate() {
        // Skip code blocks, tables and headings.
        let comment = commented(line);
        let starts_block = comment.is_some_and(|(_, text)| text.starts_with("```"));
        let text = match comment {
            Some((sign, text)) if !starts_block && !in_block && !text.is_empty() && !text.starts_with(['|', '#']) => {
                Some((sign, text))
            }
            _ => None,
        };
        in_block ^= starts_block;

        // End a paragraph where the sign changes, and before each item of a list.
        let begins_item = text.is_some_and(|(_, text)| text.starts_with("- ") || text.starts_with("* "));
        let goes_on = matches!((&open, text), (Some((sign, ..)), Some((next, _))) if *sign == next) && !begins_item;
        if !goes_on && let Some((sign, first, paragraph)) = open.take() {
            passages.push(Passage::new(name, first, sign != "//", &paragraph));
        }
        match (&mut open, text) {
            (Some((_, _, paragraph)), Some((_, text))) => *paragraph += &format!(" {text}"),
            (None, Some((sign, text))) => open = Some((sign, number + 1, text.to_owned())),
            _ => {}
        }
        // Check the messages of lines without comments.
        if comment.is_none() {
            passages.extend(messages(line).iter().map(|text| Passage::new(name, number + 1, false, text)));
        }
    }
    passages
}

/// Returns the paragraphs and table rows of a document.
fn passages_of_document(name: &str, text: &str) -> Vec<Passage> {
    let rows = text.lines().filter(|line| line.starts_with('|')).map(str::to_owned);
    paragraphs(text).into_iter().chain(rows).map(|text| Passage::new(name, 0, false, &text)).collect()
}

/// Returns the broken rules in texts that belong together.
fn breaks(group: &str, passages: &[Passage]) -> Vec<String> {
    let mut found = Vec::new();
    let words: usize = passages.iter().map(|passage| passage.words.len()).sum();
    // Compare the density of rare idioms with the allowed density.
    for (idioms, allowed) in RARE {
        let count: usize = idioms.iter().flat_map(|idiom| passages.iter().map(|passage| passage.count(idiom))).sum();
        let density = 1000.0 * count as f64 / words.max(1) as f64;
        if density > allowed {
            found.push(format!("{group}: {idioms:?} {density:.1} times in 1000 words, allowed are {allowed}"));
        }
    }
    // Report every forbidden idiom.
    for passage in passages {
        found.extend(
            NEVER.iter().filter(|idiom| passage.count(idiom) > 0).map(|idiom| format!("{}: {idiom}", passage.place)),
        );
        if passage.leans() {
            found.push(format!("{}: a doc line without a noun: {}", passage.place, passage.words.join(" ")));
        }
    }
    found
}

#[test]
fn idioms_are_rare() {
    let read = |path: &std::path::Path| std::fs::read_to_string(path).expect("a text");
    let mut found = Vec::new();
    for name in CRATES {
        let mut passages = Vec::new();
        for path in files_below(&root().join(name).join("src"), "rs") {
            passages.extend(passages_of_source(&name_of(&path), &read(&path)));
        }
        found.extend(breaks(name, &passages));
    }
    let mut passages = Vec::new();
    for path in files_below(&root(), "md") {
        passages.extend(passages_of_document(&name_of(&path), &read(&path)));
    }
    found.extend(breaks("documents", &passages));
    assert!(found.is_empty(), "{}", found.join("\n"));
}

#[test]
fn each_idiom_is_found() {
    let breaks_of = |text: &str| breaks("text", &passages_of_source("text.rs", text));
    assert_eq!(breaks_of("/// Number of records.\nlet a = \"one two\";"), [""; 0]);
    let broken = [
        "/// What is left.",
        "// It knows the rest.",
        "let a = format!(\"the light that says {x} here\");",
        "/// The colors are\n/// those of the map.",
        "// Begins anew.",
        "/// Of the picture.",
    ];
    for text in broken {
        assert_eq!(breaks_of(text).len(), 1, "{text}: {:?}", breaks_of(text));
    }
    assert_eq!(
        breaks("text", &passages_of_document("text.md", "# What\n\n```\nwhat\n```\nIt stands\nstill.")).len(),
        1
    );
}
