//! `render2mpeg bake`.

use crate::bake;
use crate::command_line::progress;
use crate::output::Output;
use crate::{Options, Settings};
use anyhow::Result;
use clap::Args;
use render_core::scene;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

/// The scene, and how fine its light is to be.
#[derive(Args)]
pub(crate) struct Bake {
    /// A glTF 2.0 scene, .glb or .gltf
    scene: PathBuf,
    /// The baked light [default: the scene's name with .slf, beside it]
    #[arg(short, long, value_name = "FILE.slf")]
    output: Option<PathBuf>,
    /// Texels on the surfaces, those that their borders need included
    #[arg(long, value_name = "N", default_value_t = 400_000, value_parser = clap::value_parser!(u32).range(16..=16_000_000))]
    texels: u32,
    /// Anchor lights that carry the indirect light [default: as for films]
    #[arg(long, value_name = "N")]
    vpls: Option<usize>,
    /// Photons [default: 36 for each anchor light]
    #[arg(long, value_name = "N")]
    photons: Option<u64>,
    /// Reflections of light on its way to the eye, at most [default: no limit]
    #[arg(long, value_name = "N")]
    bounces: Option<u32>,
    /// Seed of photons and light tree [default: 1]
    #[arg(long, value_name = "S")]
    seed: Option<u64>,
    /// Threads [default: one per processor]; the result is the same for any number
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// No progress: only errors are shown
    #[arg(short, long)]
    quiet: bool,
}

/// Bakes and writes.
pub fn run(arguments: Bake) -> Result<ExitCode> {
    let Bake { scene: path, output, texels, vpls, photons, bounces, seed, quiet, .. } = arguments;
    let begin = Instant::now();
    let scene = scene::load(&path)?;
    let output = output.unwrap_or_else(|| path.with_extension("slf"));
    // The finest quantiser: as many photons as any film has.
    let options = Options { vpls, photons, bounces, seed, qscale: Some(1), ..Options::default() };
    let settings = Settings::new(path, &scene, &options)?;
    // An output that cannot be written is told of before the work, not after it.
    drop(Output::create(&output)?);
    let bar = progress::of_work(quiet);
    let baked = bake::bake(&scene, &settings, texels as usize, &|done, all| {
        bar.set_length(all as u64);
        bar.set_position(done as u64);
    })?;
    bar.finish_and_clear();
    let bytes = baked.write(&scene, &output)?;
    if !quiet {
        let atlas = &baked.texels.atlas;
        tell!("{}: {} bytes in {:.1} s", output.display(), bytes, begin.elapsed().as_secs_f64());
        tell!(
            "  {} texels, {} of them on surfaces and {} within something, {:.2} a meter, in {} charts and {} tiles",
            atlas.len(),
            atlas.covered(),
            baked.filled,
            atlas.texels_per_meter(),
            atlas.charts(),
            atlas.tiles(),
        );
        tell!("  render2mpeg render {} --lighting baked", settings.scene.display());
    }
    Ok(ExitCode::SUCCESS)
}
