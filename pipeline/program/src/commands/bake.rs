//! Command `render2mpeg bake`.

use crate::overwrite::Overwrite;
use crate::progress;
use crate::source::Reading;
use anyhow::Result;
use clap::Args;
use pipeline::output::Output;
use render_core::scene::Scene;
use render2mpeg::places::FilePlaces;
use render2mpeg::{Error, Options, Settings};
use renderer::bake;
use renderer::bake::export::check_path;
use renderer::texels::BakedTexels;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Instant;

/// Scene to bake, and the resolution of its light.
#[derive(Args)]
pub(crate) struct BakeArguments {
    /// A glTF 2.0 scene, .glb or .gltf
    scene: PathBuf,
    /// Options for reading the scene: folders, camera, animation and scene settings.
    #[command(flatten)]
    reading: Reading,
    /// File of the baked light [default: the scene's path with .slf; none with --gltf]
    #[arg(short, long, value_name = "FILE.slf")]
    output: Option<PathBuf>,
    /// Also write the scene with the light in its textures, for any glTF viewer
    #[arg(long, value_name = "OUT.glb")]
    gltf: Option<PathBuf>,
    /// Longer side of the light texture [default: 4 per texel of the light, 2048 to 4096]
    #[arg(long, value_name = "SIDE", requires = "gltf", value_parser = clap::value_parser!(u32).range(64..=16384))]
    texture: Option<u32>,
    /// Use this baked light for --gltf
    #[arg(long, value_name = "FILE.slf", requires = "gltf",
        conflicts_with_all = ["output", "texels", "vpls", "photons", "bounces", "seed"])]
    baked: Option<PathBuf>,
    /// Number of texels on surfaces, including the texels of chart borders
    #[arg(long, value_name = "N", default_value_t = 400_000, value_parser = clap::value_parser!(u32).range(16..=16_000_000))]
    texels: u32,
    /// Number of anchor lights, the sources of indirect light [default: as for films]
    #[arg(long, value_name = "N")]
    vpls: Option<usize>,
    /// Number of photons [default: 36 per anchor light]
    #[arg(long, value_name = "N")]
    photons: Option<u64>,
    /// Maximum number of reflections [default: no limit]
    #[arg(long, value_name = "N")]
    bounces: Option<u32>,
    /// Random seed of photons and light tree [default: 1]
    #[arg(long, value_name = "S")]
    seed: Option<u64>,
    /// Number of threads; the result does not depend on it [default: one per processor]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Permission to replace files.
    #[command(flatten)]
    overwrite: Overwrite,
    /// Print errors only
    #[arg(short, long)]
    quiet: bool,
}

/// Bakes the light, and writes the light file, the glTF export, or both.
pub fn run(arguments: BakeArguments) -> Result<ExitCode> {
    let BakeArguments {
        scene: path,
        reading,
        output,
        gltf,
        texture,
        baked,
        texels,
        vpls,
        photons,
        bounces,
        seed,
        overwrite,
        quiet,
        ..
    } = arguments;
    let scene = reading.load(&path)?;
    // Report unwritable outputs before baking begins.
    let output = output.or_else(|| gltf.is_none().then(|| path.with_extension("slf")));
    FilePlaces::of(&scene)
        .reads("--baked", baked.as_deref())
        .writes("-o", output.as_deref())
        .writes("--gltf", gltf.as_deref())
        .check()?;
    for path in output.iter().chain(&gltf) {
        overwrite.check(path)?;
    }
    if let Some(output) = &output {
        drop(Output::create(output)?);
    }
    if let Some(gltf) = &gltf {
        check_path(gltf, &path)?;
    }

    // Use the finest quantiser, which requires the most photons.
    let options = Options { vpls, photons, bounces, seed, qscale: Some(1), ..Options::default() };
    let settings = Settings::new(path, &scene, &options)?;
    let job = BakeJob { scene: &scene, settings: &settings, quiet };
    let light = match baked {
        Some(path) => bake::read(&scene, &path)?,
        None => job.bake(texels as usize, output.as_deref())?,
    };
    // Export the light that was read or baked.
    if let Some(gltf) = gltf {
        job.export(light, &gltf, texture)?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Scene to bake, with settings.
struct BakeJob<'a> {
    scene: &'a Scene,
    settings: &'a Settings,
    quiet: bool,
}

impl BakeJob<'_> {
    /// Bakes the light, and writes it to `output`, if given.
    fn bake(&self, texels: usize, output: Option<&Path>) -> Result<BakedTexels> {
        let begin = Instant::now();
        let bar = progress::of_work(self.quiet);
        let baked = bake::bake(self.scene, &self.settings.render, texels, &|done, all| {
            bar.set_length(all as u64);
            bar.set_position(done as u64);
        })?;
        bar.finish_and_clear();
        let written = output.map(|path| Ok::<_, Error>((path, baked.write(self.scene, path)?))).transpose()?;

        // Print size, resolution and cost of the light.
        if !self.quiet {
            let seconds = begin.elapsed().as_secs_f64();
            match written {
                Some((path, bytes)) => tell!("{}: {bytes} bytes in {seconds:.1} s", path.display()),
                None => tell!("light baked in {seconds:.1} s"),
            }
            let atlas = &baked.texels.atlas;
            tell!(
                "  {} texels, {} on surfaces and {} inside other geometry, {:.2} per meter, in {} charts and {} tiles",
                atlas.len(),
                atlas.covered(),
                baked.filled,
                atlas.texels_per_meter(),
                atlas.charts(),
                atlas.tiles(),
            );
            let coats = &baked.texels.coats;
            // Omit the line of coats if no surface has a coat.
            if !coats.is_empty() {
                let (texels, samples, bytes) = (coats.texels(), coats.samples(), coats.stored_bytes());
                let seconds = baked.coat_seconds;
                tell!("  coats: {texels} texels, {samples} directions in total, {bytes} bytes in {seconds:.1} s");
            }
            // Suggest the command that renders with this light.
            if written.is_some() {
                tell!("  render2mpeg render {} --lighting baked", self.settings.scene.display());
            }
        }
        Ok(baked.texels)
    }

    /// Writes the scene with `light` in its textures to a glTF file.
    fn export(&self, light: BakedTexels, path: &Path, side: Option<u32>) -> Result<()> {
        let begin = Instant::now();
        let export =
            bake::export::export(self.scene, &self.settings.scene, &self.settings.render, &Arc::new(light), side)?;
        let bytes = export.write(path)?;
        if !self.quiet {
            let (width, height) = export.size;
            tell!("{}: {bytes} bytes in {:.1} s", path.display(), begin.elapsed().as_secs_f64());
            tell!("  {width}x{height} texels, exposure {:.3}", export.tone_map.exposure);
        }
        Ok(())
    }
}
