//! Sentences of documents have a limited length.

use super::{files_below, name_of, root};

/// Maximum number of words in a sentence.
const MOST_WORDS: usize = 40;
/// Documents with longer sentences, and the maximum number of these.
const KNOWN: [(&str, usize); 0] = [];

/// Returns the paragraphs and list items of a document, each in one line, without tables, headings and code.
fn paragraphs(text: &str) -> Vec<String> {
    let (mut paragraphs, mut in_block) = (vec![String::new()], false);
    for line in text.lines().map(str::trim) {
        if line.starts_with("```") {
            in_block = !in_block;
        }
        let item = line.strip_prefix("- ").or(line.strip_prefix("* ")).or_else(|| {
            let (number, rest) = line.split_once(". ")?;
            number.parse::<u32>().is_ok().then_some(rest)
        });
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
fn plain(text: &str) -> String {
    let mut plain = String::new();
    for (number, piece) in text.split('`').enumerate() {
        plain.push_str(if number % 2 == 0 { piece } else { "code" });
    }
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
    // The changelog is a list of changes; the references are titles; the page of sweeps is generated.
    documents.retain(|path| !["CHANGELOG.md", "docs/REFERENCES.md", "docs/sweep/README.md"].contains(&&*name_of(path)));
    assert!(documents.len() > 8, "there are documents");
    let mut found = Vec::new();
    for path in documents {
        let (name, text) = (name_of(&path), std::fs::read_to_string(&path).expect("a text"));
        let mut long = Vec::new();
        for paragraph in paragraphs(&text) {
            let paragraph = plain(&paragraph);
            let sentences = sentences(&paragraph).into_iter().filter(|words| words.len() > MOST_WORDS);
            long.extend(sentences.map(|words| format!("{name}, {} words: {}", words.len(), words.join(" "))));
        }
        let known = KNOWN.iter().find(|(known, _)| *known == name).map_or(0, |(_, count)| *count);
        if long.len() > known {
            found.extend(long);
        }
    }
    assert!(found.is_empty(), "{}", found.join("\n"));
}
