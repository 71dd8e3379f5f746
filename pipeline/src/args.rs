//! What was typed.

mod examples;

#[cfg(feature = "compare")]
use crate::command::compare::Compare;
#[cfg(feature = "exr")]
use crate::command::reference::Reference;
use crate::command::render::Render;
#[cfg(feature = "sweep")]
use crate::command::sweep::Sweep;
use clap::{Args, Parser, Subcommand};
use pipeline::Wishes;
use pipeline::settings::{BitRate, Effort, Lighting, Size, Stopping, Switch, Thresholds};
use std::path::PathBuf;

/// Renders an animated glTF scene with global illumination into an MPEG-2 video.
///
/// Renderer and encoder work for each other: the renderer gives the encoder exact motion vectors, and the encoder
/// gives the renderer, one frame later, the error that each pixel may have before anyone could see it.
#[derive(Parser)]
#[command(
    name = "render2mpeg",
    version,
    after_help = "Examples:
  render2mpeg render scenes/cornell/cornell.glb             a video and a report, in this folder
  render2mpeg plan scene.glb                                what the scene needs, before any ray
  render2mpeg compare film.m2v film.y4m                     what the codec has cost
  render2mpeg sweep scene.glb --qscale 2,16,48              error against run time, as a page

Each command has examples of its own: render2mpeg render --help"
)]
pub struct Arguments {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// What to do.
#[derive(Subcommand)]
pub enum Command {
    /// Render a scene into a video.
    #[command(args_override_self = true, after_help = examples::RENDER)]
    Render(Box<Render>),
    /// Render one frame as exactly as wanted into a linear OpenEXR picture, with the noise that is left in it.
    #[cfg(feature = "exr")]
    #[command(after_help = examples::REFERENCE)]
    Reference(Reference),
    /// Say how far pictures, sequences or videos are from a reference.
    #[cfg(feature = "compare")]
    #[command(after_help = examples::COMPARE)]
    Compare(Compare),
    /// Compare methods: error against run time, before and after decoding, with tables, plots and a page that shows it all.
    #[cfg(feature = "sweep")]
    #[command(after_help = examples::SWEEP)]
    Sweep(Sweep),
    /// Show what a scene needs, what is left out, and why; render nothing.
    #[command(args_override_self = true, after_help = examples::PLAN)]
    Plan {
        /// What and how.
        #[command(flatten)]
        job: Box<Job>,
    },
    /// Print what makes a shell complete this program's options.
    #[cfg(feature = "shell")]
    #[command(after_help = examples::COMPLETIONS)]
    Completions {
        /// Which shell
        shell: clap_complete::Shell,
    },
    /// Print the manual page of the program, or of one of its commands, as roff for man.
    #[cfg(feature = "shell")]
    #[command(after_help = examples::MAN)]
    Man {
        /// Such as render
        command: Option<String>,
    },
}

/// What to render and how.
#[derive(Args)]
pub struct Job {
    /// A glTF 2.0 scene, .glb or .gltf; a TOML file of the same name beside it says what glTF cannot
    #[arg(required_unless_present = "config")]
    pub scene: Option<PathBuf>,
    /// Take options from a TOML file, by their names here: qscale = 8, cache = "off"; what is typed overrides them
    #[arg(long, value_name = "FILE.toml")]
    pub config: Option<PathBuf>,
    /// Pictures to make [default: as the scene's TOML file says, else as long as its animation, else 100]
    #[arg(long, value_name = "N")]
    pub frames: Option<u32>,
    /// Pictures a second: 23.976, 24, 25, 29.97, 30, 50, 59.94 or 60 [default: as the TOML file says, else 25]
    #[arg(long)]
    pub fps: Option<f64>,
    /// Of the picture, in pixels [default: 512x512]
    #[arg(long, value_name = "WxH")]
    pub size: Option<Size>,
    /// MPEG-2's quantiser_scale, 1 (best) to 112 (smallest); ffmpeg's -q:v is half of it [default: 8]
    #[arg(long, value_name = "Q")]
    pub qscale: Option<u32>,
    /// Pictures from one I picture to the next, at most 132 [default: 15]
    #[arg(long, value_name = "N")]
    pub gop: Option<u32>,
    /// At most this many bits a second, such as 1500k or 2M: coarser than --qscale where that is too much [default: no bound]
    #[arg(long, value_name = "R")]
    pub bitrate: Option<BitRate>,
    /// Just as many bits a second as --bitrate says, all the time
    #[arg(long)]
    pub cbr: bool,
    /// The most B pictures in a row, 0 to 7: fewer bits, coded when later frames are there [default: 0]
    #[arg(long, value_name = "M")]
    pub bframes: Option<u32>,
    /// How much the encoder tries for few bits [default: balanced]
    #[arg(long, value_enum)]
    pub effort: Option<Effort>,
    /// Write MPEG-1, for players that know nothing else
    #[arg(long)]
    pub mpeg1: bool,
    /// The error a pixel may have: "codec", by what the encoder really did; "perceptual", by the masking model, or "quantised",
    /// by it from the decoded picture; "fixed:SHARE" of its luminance, or "uniform:SHARE" of what that was one frame before
    /// [default: codec]
    #[arg(long, value_name = "KIND")]
    pub thresholds: Option<Thresholds>,
    /// Multiplier on what is allowed beyond 2 %: smaller is finer, 1 is the paper's [default: 1; 0.25 of "perceptual" and "quantised"]
    #[arg(long, value_name = "K")]
    pub kappa: Option<f32>,
    /// When a cut ends [default: bound]
    #[arg(long, value_enum, value_name = "WHEN")]
    pub stopping: Option<Stopping>,
    /// Share of pixels that calibrated stopping keeps within their thresholds, 0.5 to 0.999 [default: 0.95]
    #[arg(long, value_name = "SHARE")]
    pub within: Option<f64>,
    /// Samples of visibility and direct light to the pixel: 1 is fast, 4 smooths edges [default: 1]
    #[arg(long, value_name = "N")]
    pub samples: Option<u32>,
    /// Reflections of light on its way to the eye, at most [default: no limit]
    #[arg(long, value_name = "N")]
    pub bounces: Option<u32>,
    /// How indirect light is computed [default: lightcuts]
    #[arg(long, value_enum)]
    pub lighting: Option<Lighting>,
    /// Compute indirect light at few places and interpolate; off: a lightcut for each pixel [default: on]
    #[arg(long, value_enum, value_name = "on|off", hide_possible_values = true)]
    pub cache: Option<Switch>,
    /// Give back the light from close by that softened virtual lights lose [default: on]
    #[arg(long, value_enum, value_name = "on|off", hide_possible_values = true)]
    pub compensation: Option<Switch>,
    /// Anchor lights that carry the indirect light [default: 2000 for a box, up to 9000 for a building]
    #[arg(long, value_name = "N")]
    pub vpls: Option<usize>,
    /// Photons a frame [default: 150 for each anchor light]
    #[arg(long, value_name = "N")]
    pub photons: Option<u64>,
    /// Seed of photons and light tree [default: 1]
    #[arg(long, value_name = "S")]
    pub seed: Option<u64>,
    /// Run every stage for every frame, needed or not; the bits are the same
    #[arg(long)]
    pub run_everything: bool,
    /// Keep the renderer's motion from the encoder, which then searches
    #[arg(long)]
    pub no_motion: bool,
}

impl Job {
    /// The scene's path, and what was asked for.
    pub fn wishes(self) -> (PathBuf, Wishes) {
        let scene = crate::config_file::scene_of(&self);
        let Job {
            scene: _,
            config: _,
            frames,
            fps,
            size,
            qscale,
            gop,
            bitrate,
            cbr,
            bframes,
            effort,
            mpeg1,
            thresholds,
            kappa,
            stopping,
            within,
            samples,
            bounces,
            lighting,
            cache,
            compensation,
            vpls,
            photons,
            seed,
            run_everything,
            no_motion,
        } = self;
        let wishes = Wishes {
            frames,
            fps,
            size,
            qscale,
            gop,
            bitrate,
            cbr,
            bframes,
            effort,
            mpeg1,
            thresholds,
            kappa,
            stopping,
            within,
            samples,
            bounces,
            lighting,
            cache,
            compensation,
            vpls,
            photons,
            seed,
            run_everything,
            no_motion,
            ..Wishes::default()
        };
        (scene, wishes)
    }
}
