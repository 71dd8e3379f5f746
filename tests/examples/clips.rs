//! Renders clips of the shipped scenes with their exact motion, for `python3 bench encoders`:
//!
//! ```sh
//! cargo run --release -p tests --example clips -- out/clips
//! cargo run --release -p tests --example clips -- out/clips 512x512 60
//! ```
//!
//! The arguments are a folder, a size (default 352x288) and a number of frames (default 30). NAME.y4m contains the encoder's
//! input, NAME.mvp the motion to the previous frame. Motion is a pair of little-endian i16 in 1/64 pixel, −32768 for
//! disoccluded pixels, and zero in the first frame.

use pipeline::Run;
use pipeline::observe::OnFrame;
use plane::NO_MATCH;
use render2mpeg::Options;
use renderer::plan::Plan;
use renderer::settings::Size;
use std::io::Write;
use std::path::{Path, PathBuf};

const SCENES: [&str; 3] = ["cornell", "conference", "atrium"];

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let Some(folder) = arguments.first().map(PathBuf::from) else {
        eprintln!("usage: clips FOLDER [WxH [FRAMES]]");
        std::process::exit(2);
    };
    let size = arguments.get(1).map_or("352x288", |size| size).parse().expect("a size such as 352x288");
    let frames = arguments.get(2).map_or(30, |frames| frames.parse().expect("a number of frames"));
    std::fs::create_dir_all(&folder).expect("the folder can be made");
    for scene in SCENES {
        write_clip(scene, &folder.join(scene), size, frames);
    }
}

fn write_clip(name: &str, base: &Path, size: Size, frames: u32) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../scenes/{name}/{name}.glb"));
    let options = Options {
        output: Some(base.with_extension("m2v")),
        y4m: Some(base.with_extension("y4m")),
        size: Some(size),
        frames: Some(frames),
        qscale: Some(2),
        ..Options::default()
    };
    let (scene, settings) = tests::load(&path, options);
    let plan = Plan::new(&scene, &settings.render);
    let tell = |frame: &pipeline::report::FrameReport| eprint!("\r{name}: frame {}   ", frame.index);
    let run = Run { observer: &OnFrame::new(tell), ..Run::default() };
    render2mpeg::render(&scene, &settings, &plan, run).expect("the run succeeds");

    // The motion file: zeros for a frame without correspondence.
    let mut bytes = Vec::new();
    for known in tests::correspondences(&scene, &settings) {
        let Some(known) = known else {
            bytes.resize(bytes.len() + 4 * size.width * size.height, 0);
            continue;
        };
        for (&vector, &index) in known.motion().samples().iter().zip(known.matches().samples()) {
            let is_known = index != NO_MATCH && vector.iter().all(|component| component.abs() < 500.0);
            let parts = vector.map(|component| if is_known { (64.0 * component).round() as i16 } else { i16::MIN });
            bytes.extend(parts.iter().flat_map(|part| part.to_le_bytes()));
        }
    }
    let mut file = std::fs::File::create(base.with_extension("mvp")).expect("the folder can be written to");
    file.write_all(&bytes).expect("the motion can be written");
    eprintln!();
}
