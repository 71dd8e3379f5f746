//! Gain by the loop from encoder to renderer, as a table: perceptual thresholds, as the paper has them (κ = 1) and as
//! is the default here, against the original Lightcuts (2 % of luminance), a cut for every pixel; all decoded and compared
//! with the frames of an all-lights rendering before compression.
//!
//! ```sh
//! cargo run --release -p tests --example closed_loop -- scenes/cornell/cornell.glb 512x512 16 2,16,48
//! ```
//!
//! The arguments are scene, size, frames and quantiser scales. Averages leave out frame 0, for which no thresholds are
//! known yet. The all-lights frames are kept in `out/closed_loop/`, since they take most of the time.

use mpeg2enc::Picture;
use pipeline::Run;
use pipeline::observe::OnFrame;
use render2mpeg::settings::Switch;
use render2mpeg::{Options, Report, Settings};
use renderer::plan::Plan;
use renderer::settings::{Lighting, Size, Thresholds};
use std::path::{Path, PathBuf};
use tests::{decode_ffmpeg, read_y4m};

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [scene, size, frames, qscales] = &arguments[..] else {
        eprintln!("usage: closed_loop SCENE WxH FRAMES QSCALE,QSCALE…");
        std::process::exit(2);
    };
    let job = Job {
        scene: scene.into(),
        size: size.parse().expect("a size such as 512x512"),
        frames: frames.parse().expect("a number of frames"),
    };
    let folder = PathBuf::from("out/closed_loop");
    std::fs::create_dir_all(&folder).expect("the folder out/closed_loop can be made");
    let stem = job.scene.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let reference = folder.join(format!("{stem}_{size}_{frames}.y4m"));
    if !reference.exists() {
        let part = reference.with_extension("part");
        let options =
            Options { lighting: Some(Lighting::AllLights), y4m: Some(part.clone()), ..job.options(&folder, 8) };
        let report = job.render(options);
        std::fs::rename(part, &reference).expect("the reference can be named");
        eprintln!("all lights: {:.1} CPU s of cuts a frame", report.summary.seconds.indirect);
    }
    let truth = read_y4m(&reference, (job.size.width, job.size.height));

    println!("{stem}, {size}, frames 1 to {} of {frames}\n", job.frames - 1);
    println!(
        "| qscale | thresholds | mean threshold | mean cut | cuts, CPU s | direct, CPU s | kbit a frame | decoded PSNR |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    for qscale in qscales.split(',').map(|q| q.parse().expect("a quantiser scale")) {
        for (name, thresholds, kappa) in [
            ("2 %", Thresholds::Fixed(0.02), None),
            ("perceptual, κ = 1", Thresholds::Perceptual, Some(1.0)),
            ("perceptual", Thresholds::Perceptual, None),
        ] {
            let options = Options { thresholds: Some(thresholds), kappa, ..job.options(&folder, qscale) };
            let video = options.output.clone().expect("set above");
            let report = job.render(options);
            let decoded = decode_ffmpeg(&video, (job.size.width, job.size.height));
            let later = &report.frames[1..];
            let mean = |f: &dyn Fn(&pipeline::report::FrameReport) -> f64| {
                later.iter().map(f).sum::<f64>() / later.len() as f64
            };
            println!(
                "| {qscale} | {name} | {:.1} % | {:.1} | {:.2} | {:.2} | {:.1} | {:.2} dB |",
                100.0 * mean(&|frame| frame.threshold_mean_relative),
                mean(&|frame| frame.cut_size_mean),
                mean(&|frame| frame.seconds.indirect),
                mean(&|frame| frame.seconds.direct),
                mean(&|frame| frame.bits as f64 / 1000.0),
                mean_psnr(&decoded[1..], &truth[1..]),
            );
        }
    }
}

struct Job {
    scene: PathBuf,
    size: Size,
    frames: u32,
}

impl Job {
    fn options(&self, folder: &Path, qscale: u32) -> Options {
        Options {
            output: Some(folder.join("run.m2v")),
            size: Some(self.size),
            frames: Some(self.frames),
            qscale: Some(qscale),
            // Thresholds act on cuts: here every pixel has its own, as in the paper's tables.
            cache: Some(Switch::Off),
            compensation: Some(Switch::Off),
            ..Options::default()
        }
    }

    fn render(&self, options: Options) -> Report {
        let scene = render_core::scene::load(&self.scene).expect("the scene loads");
        let settings = Settings::new(self.scene.clone(), &scene, &options).expect("the settings fit");
        let plan = Plan::new(&scene, &settings.renderer());
        let tell = |frame: &pipeline::report::FrameReport| eprint!("\rframe {}   ", frame.index);
        let run = Run { observer: &OnFrame::new(tell), ..Run::default() };
        let report = render2mpeg::render(&scene, &settings, &plan, run).expect("the run succeeds");
        eprint!("\r             \r");
        report
    }
}

/// Mean over frames of the luma PSNR \[dB\].
fn mean_psnr(decoded: &[Picture], truth: &[Picture]) -> f64 {
    let sum: f64 = decoded.iter().zip(truth).map(|(a, b)| perceptual::psnr(a.luma(), b.luma())).sum();
    sum / decoded.len() as f64
}
