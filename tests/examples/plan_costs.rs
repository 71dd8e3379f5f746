//! Accuracy of the plan's estimates: for each scene, a run in which every stage runs for every frame, and beside the share
//! of time that each stage took there what the plan says of it.
//!
//! ```sh
//! cargo run --release -p tests --example plan_costs -- 256x256 scenes/cornell/cornell.glb scenes/nave/nave.glb
//! ```
//!
//! Prices of the units, which `pipeline/src/plan/estimate.rs` holds, are the seconds here by the work there: pixels, photons,
//! lights.

use pipeline::Run;
use render_core::scene;
use render2mpeg::{Options, Report, Settings};
use renderer::plan::{Plan, Stage};

/// Stages of the plan whose time stands alone in the report, with their seconds there.
type Timed = (Stage, fn(&pipeline::figures::Seconds) -> f64);
const STAGES: [Timed; 6] = [
    (Stage::ObjectPlacing, |s| s.update),
    (Stage::Photons, |s| s.photons),
    (Stage::TreeUpdate, |s| s.tree),
    (Stage::PrimaryRays, |s| s.visibility),
    (Stage::Indirect, |s| s.indirect),
    (Stage::Masking, |s| s.thresholds),
];

fn main() -> anyhow::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let Some((size, scenes)) = arguments.split_first() else { anyhow::bail!("usage: plan_costs WxH SCENE…") };
    println!("| Scene | stage | CPU ms a frame | share | estimated |\n|---|---|---|---|---|");
    for path in scenes {
        let folder = tempfile::tempdir()?;
        let scene = scene::load(path.as_ref())?;
        let options = Options {
            output: Some(folder.path().join("film.m2v")),
            size: Some(size.parse().map_err(anyhow::Error::msg)?),
            frames: Some(4),
            run_everything: true,
            ..Options::default()
        };
        let settings = Settings::new(path.into(), &scene, &options)?;
        let plan = Plan::new(&scene, &settings.renderer());
        let Report { frames, .. } = render2mpeg::render(&scene, &settings, &plan, Run::default())?;
        let mean = |seconds: fn(&pipeline::figures::Seconds) -> f64| {
            frames[1..].iter().map(|frame| seconds(&frame.seconds)).sum::<f64>() / (frames.len() - 1) as f64
        };
        let whole = mean(|s| s.total);
        for (stage, seconds) in STAGES {
            let estimated = plan.share_of(stage).map_or("–".into(), |share| format!("{:.1} %", 100.0 * share));
            let stage = stage.name();
            let (took, share) = (1e3 * mean(seconds), 100.0 * mean(seconds) / whole);
            println!("| {path} | {stage} | {took:.2} | {share:.1} % | {estimated} |");
        }
    }
    Ok(())
}
