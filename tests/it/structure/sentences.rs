//! Sentences of documents have a limited length.

use super::{files_below, name_of, root};

/// Maximum number of words in a sentence.
const MOST_WORDS: usize = 30;
/// Maximum mean number of words in the sentences of a document.
const MOST_ON_AVERAGE: f64 = 16.0;

/// Returns the paragraphs and list items of a document, each in one line, without tables, headings and code.
pub(super) fn paragraphs(text: &str) -> Vec<String> {
    let (mut paragraphs, mut in_block) = (vec![String::new()], false);
    for line in text.lines().map(str::trim) {
        if line.starts_with("```") {
            in_block = !in_block;
        }
        // Recognize items of bulleted and numbered lists.
        let item = line.strip_prefix("- ").or(line.strip_prefix("* ")).or_else(|| {
            let (number, rest) = line.split_once(". ")?;
            number.parse::<u32>().is_ok().then_some(rest)
        });
        // Empty lines, tables, headings, code and HTML end a paragraph.
        let is_apart = line.is_empty() || ["|", "#", "```", "<"].iter().any(|first| line.starts_with(first));
        if in_block || is_apart {
            paragraphs.push(String::new());
        } else if let Some(item) = item {
            paragraphs.push(item.to_owned());
        } else if let Some(paragraph) = paragraphs.last_mut() {
            paragraph.push(' ');
            paragraph.push_str(line);
        }
    }
    paragraphs
}

/// Replaces code by one word, and removes the targets of links.
pub(super) fn plain(text: &str) -> String {
    let mut plain = String::new();
    // Text between pairs of backticks is code.
    for (number, piece) in text.split('`').enumerate() {
        plain.push_str(if number % 2 == 0 { piece } else { "code" });
    }
    // Remove the targets of links.
    while let Some(start) = plain.find("](") {
        let end = plain[start..].find(')').map_or(plain.len(), |end| start + end + 1);
        plain.replace_range(start..end, "");
    }
    plain
}

/// Splits a paragraph into sentences.
fn sentences(paragraph: &str) -> Vec<Vec<&str>> {
    let mut sentences = vec![Vec::new()];
    for word in paragraph.split_whitespace() {
        let last = sentences.last_mut().expect("one to begin with");
        // Words without letters or digits do not count.
        if word.contains(char::is_alphanumeric) {
            last.push(word);
        }
        if word.trim_end_matches(['*', ')', '"', '_', ']']).ends_with(['.', '!', '?']) {
            sentences.push(Vec::new());
        }
    }
    sentences
}

#[test]
fn sentences_of_documents_are_short() {
    let mut documents = files_below(&root(), "md");
    // Omit the references, which are titles.
    documents.retain(|path| name_of(path) != "docs/REFERENCES.md");
    assert!(documents.len() > 8, "there are documents");
    let mut found = Vec::new();
    for path in documents {
        let (name, text) = (name_of(&path), std::fs::read_to_string(&path).expect("a text"));
        let (mut count, mut all_words) = (0, 0);
        // Report each sentence that is too long.
        for paragraph in paragraphs(&text) {
            for words in sentences(&plain(&paragraph)).into_iter().filter(|words| !words.is_empty()) {
                if words.len() > MOST_WORDS {
                    found.push(format!("{name}, {} words: {}", words.len(), words.join(" ")));
                }
                count += 1;
                all_words += words.len();
            }
        }
        // Compare the mean length over the document with the limit.
        let mean = all_words as f64 / f64::from(count.max(1));
        if mean > MOST_ON_AVERAGE {
            found.push(format!("{name}: {mean:.1} words in a sentence on average"));
        }
    }
    assert!(found.is_empty(), "{}", found.join("\n"));
}
