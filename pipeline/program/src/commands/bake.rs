//! Command `render2mpeg bake`.

use crate::interrupt::{Interrupt, Reactions};
use crate::overwrite::Overwrite;
use crate::progress;
use crate::ranks::Ranks;
use crate::source::Reading;
use anyhow::Result;
use clap::{ArgGroup, Args};
use pipeline::checkpoint::FilmJob;
use pipeline::output::Output;
use render_core::scene::Scene;
use render2mpeg::places::FilePlaces;
use render2mpeg::{Error, Options, Settings};
use renderer::bake::{self, Bake, BakeCheckpoint, BakeRun, KeyedBake, KeyedResolution, export, view};
use renderer::settings::RenderSettings;
use renderer::texels::BakedTexels;
use serde_json::json;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Scene to bake, and the resolution of its light.
#[derive(Args)]
#[command(group(ArgGroup::new("exports").args(["gltf", "view"]).multiple(true)))]
pub(crate) struct BakeArguments {
    /// A glTF 2.0 scene, .glb or .gltf
    scene: PathBuf,
    /// Options for reading the scene: folders, camera, animation and scene settings.
    #[command(flatten)]
    reading: Reading,
    /// File of the baked light [default: the scene's path with .slf; none with --gltf or --view]
    #[arg(short, long, value_name = "FILE.slf")]
    output: Option<PathBuf>,
    /// Also write the scene with the light in its textures, for any glTF viewer
    #[arg(long, value_name = "OUT.glb")]
    gltf: Option<PathBuf>,
    /// Also write a page that shows the scene with this light in a browser, in real time and without a network
    #[arg(long, value_name = "OUT.html")]
    view: Option<PathBuf>,
    /// Longer side of the light texture [default: 4 per texel of the light, 2048 to 4096]
    #[arg(long, value_name = "SIDE", requires = "gltf", value_parser = clap::value_parser!(u32).range(64..=16384))]
    texture: Option<u32>,
    /// Use this baked light for --gltf or --view
    #[arg(long, value_name = "FILE.slf", requires = "exports",
        conflicts_with_all = ["output", "texels", "vpls", "photons", "bounces", "seed"])]
    baked: Option<PathBuf>,
    /// Number of texels on surfaces, including the texels of chart borders [default: 20000 to 1000000, from the size of
    /// the scene and the width of its surfaces]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(16..=MOST_TEXELS))]
    texels: Option<u32>,
    /// Number of key times of moving or changing lamps, evenly spaced over the animation. Films interpolate between them.
    /// Exports have the light of the first key time
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u32).range(2..=MOST_KEYS), conflicts_with = "baked")]
    keys: Option<u32>,
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
    /// Continue a bake that was interrupted or killed, to the same bits; without a checkpoint, start at the beginning
    #[arg(long, conflicts_with = "baked")]
    resume: bool,
    /// Permission to replace files.
    #[command(flatten)]
    overwrite: Overwrite,
    /// Print errors only
    #[arg(short, long)]
    quiet: bool,
}

/// Maximum number of texels that can be requested.
const MOST_TEXELS: i64 = 16_000_000;

/// Maximum number of key times that can be requested.
const MOST_KEYS: i64 = 256;

/// Time between checkpoints: if the program is killed, about a minute of work is lost.
const CHECKPOINT_EVERY: Duration = Duration::from_secs(60);

/// Bakes the light among the `ranks`. Rank 0 writes the light file and the exports.
pub fn run(arguments: BakeArguments, ranks: &Ranks) -> Result<ExitCode> {
    let BakeArguments {
        scene: path,
        reading,
        output,
        gltf,
        view,
        texture,
        baked,
        texels,
        keys,
        vpls,
        photons,
        bounces,
        seed,
        resume,
        overwrite,
        quiet,
        ..
    } = arguments;
    let scene = reading.load(&path)?;
    // Report unwritable outputs before baking begins.
    let output = output.or_else(|| (gltf.is_none() && view.is_none()).then(|| path.with_extension("slf")));
    FilePlaces::of(&scene)
        .reads("--baked", baked.as_deref())
        .writes("-o", output.as_deref())
        .writes("--gltf", gltf.as_deref())
        .writes("--view", view.as_deref())
        .check()?;
    let is_first = ranks.team().rank() == 0;
    if is_first {
        for path in output.iter().chain(&gltf).chain(&view) {
            overwrite.check(path)?;
        }
        if let Some(output) = &output {
            drop(Output::create(output)?);
        }
        if let Some(gltf) = &gltf {
            export::check_path(gltf, &path)?;
        }
        if let Some(view) = &view {
            view::check_path(view)?;
        }
    }

    // Use the finest quantiser, which requires the most photons.
    let options = Options { vpls, photons, bounces, seed, qscale: Some(1), ..Options::default() };
    let settings = Settings::new(path, &scene, &options)?;
    let job = BakeJob { scene: &scene, settings: &settings, quiet: quiet || !is_first };
    let light = match baked {
        Some(path) => bake::read(&scene, &path)?.at(0.0),
        None => {
            let texels = texels.map(|texels| texels as usize);
            let work = BakeWork { texels, keys, output: output.as_deref(), resume, ranks };
            match job.bake(&work)? {
                Ok(light) => light,
                Err(code) => return Ok(code),
            }
        }
    };
    // Export the light that was read or baked.
    if let Some(gltf) = gltf.filter(|_| is_first) {
        job.export(&light, &gltf, texture)?;
    }
    if let Some(view) = view.filter(|_| is_first) {
        job.view(&light, &view)?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Scene to bake, with settings.
struct BakeJob<'a> {
    scene: &'a Scene,
    settings: &'a Settings,
    quiet: bool,
}

/// Resolution of a bake, its file, and the ranks that share it.
struct BakeWork<'a> {
    /// Requested number of texels.
    texels: Option<usize>,
    /// Number of key times; `None` for a scene without moving lamps.
    keys: Option<u32>,
    output: Option<&'a Path>,
    resume: bool,
    ranks: &'a Ranks,
}

impl BakeJob<'_> {
    /// Bakes the light, and writes it to the output, if given. Returns the exit code of an interrupted bake.
    fn bake(&self, work: &BakeWork) -> Result<Result<Arc<BakedTexels>, ExitCode>> {
        let begin = Instant::now();
        let BakeWork { texels, keys, output, resume, ranks } = *work;
        let is_first = ranks.team().rank() == 0;

        // Write checkpoints next to the light file. Rank 0 sends their content to the other ranks.
        let checkpoint = match output.filter(|_| is_first) {
            Some(output) => Some(BakeCheckpoint::new(&self.film_job(texels, keys, output)?, CHECKPOINT_EVERY, resume)?),
            None => None,
        };
        let bar = progress::of_work(self.quiet || !is_first);
        let interrupt = Interrupt::watch(Reactions::default())?;
        let run = BakeRun { ranks: ranks.team().prepare.clone(), checkpoint, stop: &interrupt.stop };
        let progress = |done: usize, all: usize| {
            bar.set_length(all as u64);
            bar.set_position(done as u64);
        };
        let (scene, settings) = (self.scene, &self.settings.render);
        let baked = match keys {
            Some(keys) => {
                let resolution = KeyedResolution { texels, keys };
                bake::bake_keys(scene, settings, resolution, &run, &progress)?.map(BakeResult::Keys)
            }
            None => bake::bake(scene, settings, texels, &run, &progress)?.map(BakeResult::Constant),
        };
        bar.finish_and_clear();
        let Some(baked) = baked else {
            if !self.quiet {
                match output {
                    Some(_) => tell!("ended early: the same command with --resume continues"),
                    None => tell!("ended early: without -o, a bake has no checkpoint"),
                }
            }
            return Ok(Err(interrupt.exit_code()));
        };
        let output = output.filter(|_| is_first);
        let written = output.map(|path| Ok::<_, Error>((path, baked.write(self.scene, path)?))).transpose()?;

        if !self.quiet {
            self.describe(&baked, written, begin.elapsed().as_secs_f64())?;
        }
        if let Some(checkpoint) = &run.checkpoint {
            checkpoint.remove()?;
        }
        Ok(Ok(Arc::new(baked.first().texels.clone())))
    }

    /// Prints size, resolution and cost of the light.
    fn describe(&self, baked: &BakeResult, written: Option<(&Path, u64)>, seconds: f64) -> Result<()> {
        match written {
            Some((path, bytes)) => tell!("{}: {bytes} bytes in {seconds:.1} s", path.display()),
            None => tell!("light baked in {seconds:.1} s"),
        }
        if let BakeResult::Keys(KeyedBake { light, error, .. }) = baked {
            let (count, last) = (light.times().len(), light.times().last().copied().unwrap_or_default());
            tell!("  {count} key times up to {last:.2} s, error of the interpolation {:.2} %", 100.0 * error);
        }
        let baked = baked.first();
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
        // Suggest more texels for narrow surfaces.
        let narrow = baked.narrow_charts(self.scene)?;
        if narrow.count > 0 {
            let remedy = match narrow.texels_for_half.filter(|&texels| texels <= MOST_TEXELS as usize) {
                Some(texels) => format!("--texels {} halves this number", rounded_up(texels)),
                None => "no possible number of texels halves this number".into(),
            };
            tell!("  {} charts are narrower than two texels; {remedy}", narrow.count);
        }
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
        Ok(())
    }

    /// Returns the job of baking the requested numbers of texels and key times into the file at `output`.
    fn film_job(&self, texels: Option<usize>, keys: Option<u32>, output: &Path) -> Result<FilmJob> {
        let RenderSettings { vpls, photons, bounces, seed, .. } = self.settings.render;
        let settings = json!({ "texels": texels, "keys": keys, "vpls": vpls, "photons": photons, "bounces": bounces, "seed": seed });
        let program = concat!("render2mpeg ", env!("CARGO_PKG_VERSION"));
        Ok(FilmJob::new(output, program, &settings.to_string(), self.scene.origin.sum))
    }

    /// Writes the scene with `light` in its textures to a glTF file.
    fn export(&self, light: &Arc<BakedTexels>, path: &Path, side: Option<u32>) -> Result<()> {
        let begin = Instant::now();
        let export = export::export(self.scene, &self.settings.scene, &self.settings.render, light, side)?;
        let bytes = export.write(path)?;
        if !self.quiet {
            let (width, height) = export.size;
            tell!("{}: {bytes} bytes in {:.1} s", path.display(), begin.elapsed().as_secs_f64());
            tell!("  {width}x{height} texels, exposure {:.3}", export.tone_map.exposure);
        }
        Ok(())
    }

    /// Writes a page that shows the scene with `light`.
    fn view(&self, light: &Arc<BakedTexels>, path: &Path) -> Result<()> {
        let begin = Instant::now();
        let page = view::view(self.scene, &self.settings.scene, &self.settings.render, light)?;
        let bytes = page.write(path)?;
        if !self.quiet {
            let seconds = begin.elapsed().as_secs_f64();
            let images = page.image_bytes;
            tell!("{}: {bytes} bytes in {seconds:.1} s, {images} of them in images", path.display());
            // Omit the line of coats if no surface has a coat.
            if page.coat_texels > 0 {
                let (texels, each, coarse) = (page.coat_texels, page.coat_bytes_per_texel, page.coarse_coats);
                let error = 100.0 * page.coat_error;
                tell!(
                    "  coats: {texels} texels of {each:.1} bytes, mean error {error:.1} %, {coarse} above the tolerance"
                );
            }
        }
        Ok(())
    }
}

/// Light that was baked.
enum BakeResult {
    /// Light that does not change.
    Constant(Bake),
    /// Light at key times.
    Keys(KeyedBake),
}

impl BakeResult {
    /// Returns the light at the first time.
    fn first(&self) -> &Bake {
        match self {
            Self::Constant(bake) => bake,
            Self::Keys(keys) => &keys.first,
        }
    }

    fn write(&self, scene: &Scene, path: &Path) -> pipeline::error::Result<u64> {
        match self {
            Self::Constant(bake) => bake.write(scene, path),
            Self::Keys(keys) => keys.write(scene, path),
        }
    }
}

/// Rounds a number up to two digits and zeros. The atlas has up to 1 % fewer texels than requested.
fn rounded_up(number: usize) -> usize {
    let more = number + number / 64;
    let unit = 10usize.pow(more.checked_ilog10().unwrap_or(0).saturating_sub(1));
    more.div_ceil(unit) * unit
}
