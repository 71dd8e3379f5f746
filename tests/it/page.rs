//! `render --html`: content, privacy and valid HTML of a film's page.

use serde_json::Value;
use std::fs;
use std::path::Path;
use tests::{Moving, Rendered, checkered_room, decode_ffmpeg, render, show};

const SMALL: &str = "--size 64x64 --vpls 60 --photons 3000";

/// Renders a film of a room with its page.
fn film(folder: &Path, moving: Moving, options: &str) -> (Rendered, String) {
    checkered_room(moving).write(&folder.join("room.glb"));
    fs::write(folder.join("room.toml"), "[tone_mapping]\nexposure = 0.5\n").unwrap();
    let page = folder.join("film.html");
    let options = format!("{SMALL} --html {} {options}", page.display());
    let film = render(folder, "film", &folder.join("room.glb"), &options);
    (film, fs::read_to_string(page).unwrap())
}

/// Returns the decoded data URIs of this type.
fn data(html: &str, kind: &str) -> Vec<Vec<u8>> {
    let start = format!("data:{kind};base64,");
    html.split(&start).skip(1).map(|rest| from_base64(rest.split('"').next().unwrap_or(rest))).collect()
}

fn from_base64(text: &str) -> Vec<u8> {
    let digit = |c: u8| match c {
        b'A'..=b'Z' => c - b'A',
        b'a'..=b'z' => c - b'a' + 26,
        b'0'..=b'9' => c - b'0' + 52,
        b'+' => 62,
        _ => 63,
    };
    let (mut bytes, mut held, mut bits) = (Vec::new(), 0u32, 0);
    for c in text.bytes().filter(|&c| c != b'=') {
        held = (held << 6) | u32::from(digit(c));
        bits += 6;
        if bits >= 8 {
            bits -= 8;
            bytes.push((held >> bits) as u8);
        }
    }
    bytes
}

/// Returns the embedded stream.
fn embedded(html: &str) -> Vec<u8> {
    let text = html.split("\"base64\":\"").nth(1).expect("a stream");
    from_base64(text.split('"').next().unwrap())
}

/// Checks that every element is closed in order, each attribute is quoted, and no id repeats.
fn assert_sound(html: &str) {
    const EMPTY: [&str; 5] = ["meta", "link", "br", "img", "input"];
    let (mut open, mut names, mut rest) = (Vec::new(), Vec::new(), html);
    while let Some(start) = rest.find('<') {
        let end = start + rest[start..].find('>').expect("a tag ends");
        let tag = &rest[start + 1..end];
        rest = &rest[end + 1..];
        if tag.starts_with('!') {
            continue;
        }
        assert!(!tag.contains('<') && tag.matches('"').count().is_multiple_of(2), "<{tag}>");
        if let Some(name) = tag.strip_prefix('/') {
            assert_eq!(open.pop(), Some(name), "</{name}>");
            continue;
        }
        let name = tag.split([' ', '\n', '/']).next().unwrap();
        names.extend(tag.split(" id=\"").nth(1).map(|id| id.split('"').next().unwrap()));
        if !EMPTY.contains(&name) && !tag.ends_with('/') {
            open.push(name);
        }
        // The contents of style sheets and scripts are not parsed.
        if name == "style" || name == "script" {
            rest = &rest[rest.find(&format!("</{name}>")).expect("it ends")..];
        }
    }
    assert_eq!(open, [""; 0]);

    // No id repeats.
    let count = names.len();
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.len(), count, "{names:?}");
}

#[test]
fn it_shows_the_film_and_names_no_folder() {
    let folder = tempfile::tempdir().unwrap();
    let (film, html) = film(folder.path(), Moving::Box, "--frames 5 --qscale 16");
    assert_sound(&html);

    // The film, its middle frame as a poster, and maps of that frame.
    assert!(html.contains("alt=\"Frame 2 of the film\"") && data(&html, "image/jpeg").len() == 1);
    assert_eq!(embedded(&html), film.stream[..film.stream.len() - 4], "all but sequence_end_code");
    for words in ["<canvas", ">Play</button>", "Thresholds of frame 2", "Cut sizes of frame 2"] {
        assert!(html.contains(words), "{words}");
    }
    assert!(html.contains("Shading of frame 2") && data(&html, "image/png").len() == 3, "three maps");

    // The page contains the command and its options, but no folder, even in embedded files, and loads no external resource.
    let command = html.split("<pre>").nth(1).and_then(|rest| rest.split("</pre>").next()).expect("the command");
    assert!(command.contains(" render room.glb --output film.m2v ") && !command.contains('/'), "{command}");
    assert!(command.contains(" --html film.html --frames 5 --qscale 16"), "{command}");
    assert!(html.contains("<td>qscale</td><td>16</td><td>8</td>"), "the option next to its default");
    assert!(!html.contains("<td>bframes</td><td>0</td><td>"), "a default is no choice");
    assert!(!html.contains("http:") && !html.contains("https:"), "a page loads nothing");
    assert!(html.contains("content=\"default-src 'none'; script-src"), "and browsers enforce this");
    let folders = folder.path().display().to_string();
    let json = String::from_utf8(data(&html, "application/json").remove(0)).unwrap();
    assert!(!html.contains(&folders) && !html.contains(">/"), "the page names a folder");
    assert!(!json.contains(&folders) && !json.contains("\"/"), "the report in it names a folder");

    // The embedded files agree with the report.
    let held: Value = serde_json::from_str(&json).unwrap();
    assert_eq!(held["frames"], film.report["frames"]);
    let csv = String::from_utf8(data(&html, "text/csv").remove(0)).unwrap();
    let rows: Vec<Vec<&str>> = csv.lines().map(|line| line.split(',').collect()).collect();
    let bits = rows[0].iter().position(|name| *name == "bits").unwrap();
    let told: Vec<f64> = rows[1..].iter().map(|row| row[bits].parse().unwrap()).collect();
    assert_eq!(told, film.figures(&["bits"]));
    assert!(rows.iter().all(|row| row.len() == rows[0].len()) && rows[0][0] == "index");
    let drawings = data(&html, "image/svg+xml");
    assert_eq!(drawings.len(), html.matches("<svg class=\"plot\"").count());
    assert!(drawings.iter().all(|drawing| drawing.starts_with(b"<svg xmlns")));
    assert!(html.len() < 400_000, "{} bytes", html.len());
}

/// A page does not change the film: the stream stays the same, and frame files get no additional layers.
#[test]
fn it_changes_neither_the_film_nor_its_frames() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    for options in ["--frames 3 --cache off", "--frames 4 --bframes 2"] {
        let frames = folder.join("frames/frame_00002.exr");
        let (with, html) = film(folder, Moving::Camera, &format!("{options} --exr frames"));
        let watched = fs::read(&frames).unwrap();
        let plain = render(folder, "plain", &folder.join("room.glb"), &format!("{SMALL} {options} --exr frames"));
        assert!(with.stream == plain.stream, "{options}: another film");
        assert!(watched == fs::read(&frames).unwrap(), "{options}: other layers");
        assert_sound(&html);
        assert!(html.contains("Cut sizes of frame "), "{options}");
        // Only sequence_end_code is missing.
        assert!(with.stream.starts_with(&embedded(&html)) && with.stream.len() - embedded(&html).len() == 4);
    }
}

/// The page of a resumed film plays the whole film.
#[test]
fn a_resumed_film_is_played_from_its_start() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    film(folder, Moving::Box, "--frames 3 --keep-checkpoint --checkpoint 0");
    let (film, html) = film(folder, Moving::Box, "--frames 5 --resume");
    assert_eq!(film.report["frames"].as_array().unwrap().len(), 5);
    assert_eq!(embedded(&html), film.stream[..film.stream.len() - 4]);
    assert!(!html.contains("The player has frames"));
}

#[test]
fn what_never_changes_has_no_plot() {
    let folder = tempfile::tempdir().unwrap();
    let options = "--frames 3 --gop 1 --thresholds fixed:0.02 --lighting all-lights";
    let (film, html) = film(folder.path(), Moving::Nothing, options);
    assert_sound(&html);
    let bits = film.figures(&["bits"]);
    assert!(bits.iter().all(|&size| size == bits[0]), "{bits:?}");
    // A number in the list, and no drawing.
    assert!(html.contains("<dt>Bits per picture</dt>") && !html.contains("aria-label=\"Bits per picture\""));
    assert!(html.contains("<dt>Thresholds</dt><dd>2 % of luminance</dd>"), "of thresholds");
    assert!(html.contains("aria-label=\"CPU seconds of the stages\""));
    // It has no thresholds and no cuts: no maps of them.
    assert!(!html.contains("Thresholds of frame") && !html.contains("Cut sizes of frame"));
    // A film of one frame has no plots.
    let one =
        render(folder.path(), "one", &folder.path().join("room.glb"), &format!("{SMALL} --frames 1 --html one.html"));
    let html = fs::read_to_string(folder.path().join("one.html")).unwrap();
    assert_sound(&html);
    assert!(html.matches("<svg").count() == 0 && one.figures(&["bits"]).len() == 1);
}

/// Reads the canvas at the frames `FRAMES`, then presses keys. The samples of each frame become the title of an element,
/// and the frames after each key become the title of the page's body.
const READ: &str = "<script>
const until = async (isTrue) => { while (!isTrue()) await new Promise(end => setTimeout(end, 5)); };
const press = async (key) => {
  document.body.dispatchEvent(new KeyboardEvent('keydown', { key, bubbles: true }));
  await until(() => !player.isBusy);
  return player.shown;
};
const read = async () => {
  await until(() => document.documentElement.dataset.ready === 'yes');
  player.play(false);
  await until(() => !player.isBusy);
  const canvas = document.querySelector('canvas');
  for (const frame of FRAMES) {
    await player.seek(frame);
    const copy = document.createElement('canvas');
    [copy.width, copy.height] = [canvas.width, canvas.height];
    const context = copy.getContext('2d');
    context.drawImage(canvas, 0, 0);
    const samples = context.getImageData(0, 0, copy.width, copy.height).data;
    const mark = document.body.appendChild(document.createElement('i'));
    mark.title = [...samples].map(code => code.toString(16).padStart(2, '0')).join('');
  }
  const keys = [];
  for (const key of ['End', 'ArrowLeft', 'Home', 'ArrowLeft', 'ArrowRight']) keys.push(await press(key));
  await press(' ');
  document.body.title = `${keys} ${player.clock !== null}`;
};
read();
</script></body>";

/// Returns the R′G′B′ samples of the canvas at several frames, in this order.
fn canvas_at(page: &Path, frames: &[usize], options: &[&str]) -> Option<Vec<Vec<u8>>> {
    let script = READ.replace("FRAMES", &format!("{frames:?}"));
    let reading = page.with_extension("reading.html");
    fs::write(&reading, fs::read_to_string(page).unwrap().replace("</body>", &script)).unwrap();
    let dom = show(&reading, options)?.dom;
    assert!(dom.contains("title=\"6,5,0,6,0 true\""), "frames after keys: {:?}", dom.split("<body").nth(1));
    let mut pictures = Vec::new();
    for text in dom.split("<i title=\"").skip(1) {
        let digits = text.split('"').next().unwrap().as_bytes();
        let codes = digits.chunks(2).map(|pair| u8::from_str_radix(std::str::from_utf8(pair).unwrap(), 16).unwrap());
        pictures.push(codes.collect());
    }
    Some(pictures)
}

/// The canvas shows the frames that ffmpeg decodes, in any order, by WebGL and without it.
#[test]
fn the_player_shows_each_frame() {
    let folder = tempfile::tempdir().unwrap();
    film(folder.path(), Moving::Camera, "--frames 7 --gop 4 --bframes 2");
    let expected = decode_ffmpeg(&folder.path().join("film.m2v"), (64, 64));
    let frames = [6, 0, 3, 2, 1, 4, 5];
    for options in [["--disable-3d-apis"], ["--enable-unsafe-swiftshader"]] {
        let Some(shown) = canvas_at(&folder.path().join("film.html"), &frames, &options) else { return };
        assert_eq!(shown.len(), frames.len());
        for (samples, frame) in shown.iter().zip(frames) {
            // Chroma is interpolated in several ways, which do not change luma unless a color is clipped.
            let (mut count, mut largest) = (0, 0.0f32);
            for (color, &luma) in samples.chunks(4).zip(expected[frame].luma().samples()) {
                if color[..3].iter().all(|code| (1..255).contains(code)) {
                    let [r, g, b] = [0, 1, 2].map(|c| f32::from(color[c]) * 219.0 / 255.0);
                    largest = largest.max((16.0 + 0.2126 * r + 0.7152 * g + 0.0722 * b - f32::from(luma)).abs());
                    count += 1;
                }
            }
            assert!(count > 2000 && largest < 2.6, "frame {frame}: {largest} in {count} pixels, {options:?}");
        }
    }
}
