//! Figures of the README as data in the documentation page: `docs/figures.md`.

/// Returns the bytes of a percent-encoded URI.
fn decoded(uri: &str) -> Vec<u8> {
    let mut parts = uri.split('%');
    let mut bytes = parts.next().unwrap_or_default().as_bytes().to_vec();
    for part in parts {
        let (code, rest) = part.split_at(2);
        bytes.push(u8::from_str_radix(code, 16).expect("a hexadecimal code"));
        bytes.extend(rest.bytes());
    }
    bytes
}

#[test]
fn the_page_embeds_the_figures_of_the_readme() {
    let readme = include_str!("../../README.md");
    assert!(!readme.contains("](docs/"), "images of the README need labels, which docs/figures.md defines as data");
    let embedded: Vec<&str> = include_str!("../../docs/figures.md").lines().collect();
    let mut count = 0;
    for (label, path) in readme.lines().filter(|line| line.starts_with("[figure-")).filter_map(|l| l.split_once(": ")) {
        assert!(readme.contains(&format!("]{label}")), "{label} is not used");
        let start = format!("{label}: data:image/svg+xml,");
        let uri = embedded.iter().find_map(|line| line.strip_prefix(&start)).expect(label);
        let file = std::fs::read(format!("{}/{path}", env!("CARGO_MANIFEST_DIR"))).expect(path);
        assert!(decoded(uri) == file, "{path}: run `cargo run --release -p lighttree --example figures`");
        count += 1;
    }
    assert_eq!((count, embedded.len()), (readme.matches("![").count(), count));
}
