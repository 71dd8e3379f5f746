//! The irradiance cache against a cut for every pixel, as a table: error, cuts, CPU time, and how still a film stands.
//!
//! ```sh
//! cargo run --release -p tests --example cache_ab -- scenes/cornell/cornell.glb 512x512 20
//! ```
//!
//! The arguments are scene, size and frames. Errors are those of frame 0 against cuts for every pixel; the change from frame
//! to frame is that of luma before compression, in code values, over the 8×8 blocks that change least (the quieter half).

use pipeline::Run;
use pipeline::observe::OnFrame;
use render2mpeg::settings::Switch;
use render2mpeg::{Options, Report, Settings};
use renderer::plan::Plan;
use renderer::settings::{Lighting, Size};
use std::path::{Path, PathBuf};
use tests::read_y4m;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [scene, size, frames] = &arguments[..] else {
        eprintln!("usage: cache_ab SCENE WxH FRAMES");
        std::process::exit(2);
    };
    let size: Size = size.parse().expect("a size such as 512x512");
    let frames = frames.parse().expect("a number of frames");
    let folder = tempfile::tempdir().expect("a folder for films");
    println!(
        "| indirect light | cuts in frame 0 | cuts in a later frame | CPU s of frame 0 | of a later one | relative MSE | change |"
    );
    println!("|---|---|---|---|---|---|---|");
    let mut reference = None;
    for (name, cache) in [("a cut for every pixel", Switch::Off), ("irradiance cache", Switch::On)] {
        let exr = folder.path().join(name);
        let y4m = folder.path().join("film.y4m");
        let options = Options {
            output: Some(folder.path().join("film.m2v")),
            frames: Some(frames),
            size: Some(size),
            lighting: Some(Lighting::Lightcuts),
            cache: Some(cache),
            exr: Some(exr.clone()),
            y4m: Some(y4m.clone()),
            ..Options::default()
        };
        let report = render(Path::new(scene), options);
        let first = render_core::image_file::read_exr(&exr.join("frame_00000.exr")).expect("a linear frame");
        let first = first.map(|radiance| radiance.to_array());
        let error = perceptual::relative_mse(&first, reference.get_or_insert_with(|| first.clone()));
        let later = &report.frames[1..];
        let mean = |f: &dyn Fn(&pipeline::report::FrameReport) -> f64| {
            later.iter().map(f).sum::<f64>() / later.len().max(1) as f64
        };
        let pixels = (size.width * size.height) as f64;
        let cuts = |frame: &pipeline::report::FrameReport| if cache.is_on() { frame.cache_new as f64 } else { pixels };
        println!(
            "| {name} | {:.0} | {:.0} | {:.3} | {:.3} | {error:.2e} | {:.3} |",
            cuts(&report.frames[0]),
            mean(&cuts),
            report.frames[0].seconds.indirect,
            mean(&|frame| frame.seconds.indirect),
            stillness(&y4m, size),
        );
    }
}

fn render(scene: &Path, options: Options) -> Report {
    let loaded = render_core::scene::load(scene).expect("the scene loads");
    let settings = Settings::new(PathBuf::from(scene), &loaded, &options).expect("the settings are right");
    if let Some(folder) = &settings.exr {
        std::fs::create_dir_all(folder).expect("a folder for linear frames");
    }
    let plan = Plan::new(&loaded, &settings.renderer());
    let tell = |frame: &pipeline::report::FrameReport| eprint!("\rframe {}   ", frame.index);
    let run = Run { observer: &OnFrame::new(tell), ..Run::default() };
    let report = render2mpeg::render(&loaded, &settings, &plan, run);
    eprint!("\r             \r");
    report.expect("the run succeeds")
}

/// Mean absolute change of luma from frame to frame over the quieter half of the 8×8 blocks.
fn stillness(film: &Path, size: Size) -> f64 {
    let frames = read_y4m(film, (size.width, size.height));
    let mut changes = Vec::new();
    for pair in frames.windows(2) {
        let mut blocks = Vec::new();
        for top in (0..size.height / 8).map(|row| 8 * row) {
            for left in (0..size.width / 8).map(|column| 8 * column) {
                let places = (0..64).map(|k| (left + k % 8, top + k / 8));
                let change = |(x, y)| f64::from(pair[0].luma().get(x, y)) - f64::from(pair[1].luma().get(x, y));
                blocks.push(places.map(|place| change(place).abs()).sum::<f64>() / 64.0);
            }
        }
        blocks.sort_by(f64::total_cmp);
        blocks.truncate(blocks.len() / 2);
        changes.extend(blocks);
    }
    changes.iter().sum::<f64>() / changes.len().max(1) as f64
}
