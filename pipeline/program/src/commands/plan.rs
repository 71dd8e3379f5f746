//! Command `render2mpeg plan`.

use crate::notes;
use crate::print::{counted, rough_time, single_line};
use crate::source::SceneSource;
use anyhow::Result;
use clap::Args;
#[cfg(feature = "bake")]
use render_core::scene::Scene;
use render2mpeg::places::FilePlaces;
use render2mpeg::settings::MemorySize;
use render2mpeg::{Options, Settings, make_light, memory};
#[cfg(feature = "bake")]
use renderer::bake::{self, BakeEstimate};
use std::process::ExitCode;

/// Prints the estimated time of a bake.
#[cfg(feature = "bake")]
fn say_bake(scene: &Scene, settings: &Settings) {
    // Bakes use the photons of the finest quantiser.
    let options = Options { qscale: Some(1), vpls: Some(settings.render.vpls), ..Options::default() };
    let Ok(finest) = Settings::new(settings.scene.clone(), scene, &options) else { return };
    if let Some(BakeEstimate { texels, seconds }) = bake::estimate(scene, &finest.render) {
        let all = rough_time(seconds / rayon::current_num_threads() as f64);
        say!("bake:   about {texels} texels in {all}");
    }
}

/// Options of a plan.
#[derive(Args)]
pub(crate) struct Plan {
    /// Scene of the film.
    #[command(flatten)]
    source: SceneSource,
    /// Settings of the film.
    #[command(flatten)]
    options: Options,
}

/// Prints the plan of a film.
pub fn run(arguments: Plan) -> Result<ExitCode> {
    let path = arguments.source.path();
    let scene = arguments.source.reading.load(&path)?;
    let settings = Settings::new(path, &scene, &arguments.options)?;
    // Reject settings that the encoder does not support.
    let _ = settings.encoder_config()?;
    let plan = renderer::plan::Plan::new(&scene, &settings.render);
    say!("{}", plan.table().trim_end());

    // Estimate the time on all threads, and the memory.
    let (seconds, frames) = (plan.seconds_a_frame(), settings.frame_range().len());
    let all = frames as f64 * seconds / rayon::current_num_threads() as f64;
    let frames = counted(frames, "frame");
    say!("time:   about {seconds:.2} CPU s per frame after the first; {frames} in about {}", rough_time(all));
    let (needed, size) = (MemorySize(memory::estimate(&scene, settings.render.size)), settings.render.size);
    say!("memory: about {needed} for {}x{} pixels", size.width, size.height);
    #[cfg(feature = "bake")]
    say_bake(&scene, &settings);
    if let Some(path) = &settings.files.light {
        FilePlaces::of(&scene).writes("--light", Some(path)).check()?;
        let is_new = make_light(&scene, &settings, &plan, path)?;
        let made = if is_new { "made" } else { "already made" };
        say!("light:  {}, {made} for all parts of the film", path.display());
    }
    let exposure = match settings.render.auto_exposure {
        true => "set by the first frame; by the film's lit frames if that is dark or lamps move".to_owned(),
        false => format!("{}, as set", settings.render.tone_map.exposure),
    };
    say!("exposure: {exposure}");
    // Print the notes that `render` would print.
    notes::before(&scene, &settings).iter().for_each(|note| say!("note: {}", single_line(note)));
    Ok(ExitCode::SUCCESS)
}
