//! Changes of names and URIs.

use super::places::put;
use super::{Draft, Mutation};
use crate::Random;
use crate::fuzz::draft::data_uri;
use serde_json::{Value, json};

/// Changes of this module.
pub(super) const MUTATIONS: [Mutation; 4] =
    [("name", name), ("buffer uri", buffer), ("image uri", image), ("text", text)];

/// Returns a text that terminals, files or people may misread.
fn odd_text(random: &mut Random) -> Value {
    let texts = [
        "",
        "two\nlines",
        "\u{1b}[31mred\u{7}\u{8}\r",
        "\0",
        "\u{202e}turned",
        "\u{9b}31m\u{85}\u{2028}",
        "a\"b\\c'd`e$f%n",
        "..",
        "/etc/passwd",
        "ü€😀",
        "\u{fffd}\u{feff}",
    ];
    // Draw huge texts less often than short ones.
    match random.below(14) {
        0 => json!("x".repeat(100_000)),
        1 => json!("\u{1b}".repeat(1000)),
        2 => Draft::raw(random),
        _ => json!(random.pick(&texts)),
    }
}

/// Returns a URI outside the folder, of a device, of no file, or of damaged data.
fn odd_address(draft: &Draft, random: &mut Random) -> Value {
    let addresses = [
        "../out/film.m2v",
        "../../x",
        "/etc/passwd",
        "/dev/zero",
        "/dev/stdin",
        "file:///etc/passwd",
        "http://127.0.0.1/x",
        "%2e%2e%2f%2e%2e%2fetc%2fpasswd",
        "%00",
        "%ff%fe",
        "a%",
        ".",
        "scene.glb",
        "scene.toml",
        "data:",
        "data:;base64,",
        "data:image/png;base64,%%%",
        "data:application/octet-stream;base64,AAA",
        "data:application/octet-stream;base64,AAAA====AAAA",
        "data:text/plain,hello",
    ];
    // Draw valid data, truncated data or an odd text in some cases.
    match random.below(8) {
        0 => json!(data_uri(&draft.bin)),
        1 => json!(data_uri(&draft.bin[..random.below(draft.bin.len() + 1)])),
        2 => odd_text(random),
        _ => json!(random.pick(&addresses)),
    }
}

/// Changes the name of any object.
fn name(draft: &mut Draft, random: &mut Random) -> Option<()> {
    let text = odd_text(random);
    let lists = ["nodes", "meshes", "materials", "animations", "cameras", "skins", "images", "textures", "scenes"];
    let list = *random.pick(&lists);
    let (_, thing) = draft.entry(list, random)?;
    put(thing, "name", text)
}

/// Changes the URI of a buffer.
fn buffer(draft: &mut Draft, random: &mut Random) -> Option<()> {
    let address = odd_address(draft, random);
    let (_, buffer) = draft.entry("buffers", random)?;
    put(buffer, "uri", address)
}

/// Changes the URI of an image, with or without its view.
fn image(draft: &mut Draft, random: &mut Random) -> Option<()> {
    let address = odd_address(draft, random);
    let alone = !random.one_in(4);
    let (_, image) = draft.entry("images", random)?;
    if alone {
        image.as_object_mut()?.remove("bufferView");
    }
    put(image, "uri", address)
}

/// Changes a text of the asset's metadata: generator, copyright or version.
fn text(draft: &mut Draft, random: &mut Random) -> Option<()> {
    let key = *random.pick(&["version", "minVersion", "generator", "copyright", "extras"]);
    let text = if random.one_in(2) { odd_text(random) } else { json!(random.pick(&["1.0", "2.1", "3.0", "-2", "2"])) };
    put(draft.json.get_mut("asset")?, key, text)
}
