//! Sentences of documents are short enough to read.

use super::{files_below, name_of, root};

/// Words of a sentence at most.
const MOST_WORDS: usize = 40;
/// Documents with longer sentences, and how many of these each has at most.
const KNOWN: [(&str, usize); 0] = [];

/// The paragraphs of a document, each of one line: lists are taken apart, tables, headings and code left out.
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

/// `text` with code as one word, and links without their targets.
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

/// The sentences of a paragraph.
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
    // The history is a list of changes; the sweeps' page is made by a program.
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
