//! What was typed.

use crate::command::compare::Compare;
use crate::command::sweep::Sweep;
use clap::{Args, Parser, Subcommand};
use pipeline::Wishes;
use pipeline::reference::Method;
use pipeline::settings::{Aov, BitRate, CheckpointEvery, Effort, Lighting, Size, Stopping, Switch, Thresholds};
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
  render2mpeg render scenes/cornell/cornell.glb
  render2mpeg render scene.glb -o film.m2v --size 1280x720 --frames 50 --qscale 16
  render2mpeg render scene.glb -o film.ts --bitrate 2M --cbr --bframes 2
  render2mpeg render scene.glb --thresholds fixed:0.02      the original Lightcuts, for comparison
  render2mpeg render --config job.toml --qscale 4
  render2mpeg plan scene.glb
  render2mpeg reference scene.glb --frame 10 --spp 256 -o truth.exr
  render2mpeg compare frame_00010.exr truth.exr
  render2mpeg compare film.m2v film.y4m --heatmap where.png
  render2mpeg sweep scene.glb --qscale 2,16,48              error against run time, as a page"
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
    #[command(args_override_self = true)]
    Render {
        /// What and how.
        #[command(flatten)]
        job: Job,
        /// The video: .m2v (elementary stream), .mpg (program stream) or .ts (transport stream) [default: the scene's name
        /// with .m2v, in this folder]
        #[arg(short, long, value_name = "FILE")]
        output: Option<PathBuf>,
        /// Where the JSON report goes [default: beside the video, .report.json]
        #[arg(long, value_name = "FILE")]
        report: Option<PathBuf>,
        /// Also write a page with plots of every frame's time, bits, PSNR and cut size
        #[arg(long, value_name = "FILE.html")]
        html: Option<PathBuf>,
        /// Also write every frame as linear OpenEXR into this folder
        #[arg(long, value_name = "DIR")]
        exr: Option<PathBuf>,
        /// What else goes into these files, as named layers: a list such as albedo,normal,depth
        #[arg(long, value_enum, value_delimiter = ',', value_name = "LIST")]
        aov: Vec<Aov>,
        /// Also write the frames before compression, as YUV4MPEG2
        #[arg(long, value_name = "FILE")]
        y4m: Option<PathBuf>,
        /// Go on where a killed run of the same film was, to the same bits; begin at the beginning if there was none
        #[arg(long)]
        resume: bool,
        /// Seconds between checkpoints, beside the video in .checkpoint, for --resume: 0 is each frame, off is none [default: 60]
        #[arg(long, value_name = "SECONDS")]
        checkpoint: Option<CheckpointEvery>,
        /// Threads [default: one per processor]; the result is the same for any number
        #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
        threads: Option<u16>,
        /// Write when each stage worked on which frame, for chrome://tracing or Perfetto
        #[arg(long, value_name = "FILE.json")]
        trace: Option<PathBuf>,
        /// Print the file for --config that makes the same film, every default filled in; render nothing
        #[arg(long)]
        print_config: bool,
        /// One line of JSON on standard output for the begin, each frame and the end, for other programs
        #[arg(long)]
        json_progress: bool,
        /// Say what happens, line by line: once for frames and checkpoints, twice for every stage
        #[arg(short, long, action = clap::ArgAction::Count, conflicts_with = "quiet")]
        verbose: u8,
        /// No progress, no summary: only errors are shown
        #[arg(short, long)]
        quiet: bool,
    },
    /// Render one frame as exactly as wanted into a linear OpenEXR picture, with the noise that is left in it.
    Reference {
        /// A glTF 2.0 scene, .glb or .gltf
        scene: PathBuf,
        /// The picture: .exr, with channels R, G, B and, for paths, variance.R, .G, .B of their means
        #[arg(short, long, value_name = "FILE")]
        output: PathBuf,
        /// Which frame, counted from 0
        #[arg(long, value_name = "K", default_value_t = 0)]
        frame: u32,
        /// How light is computed
        #[arg(long, value_enum, default_value = "path")]
        method: Method,
        /// Paths for each pixel
        #[arg(long, value_name = "N", default_value_t = 64, value_parser = clap::value_parser!(u32).range(1..=1 << 20))]
        spp: u32,
        /// Most reflections of a path: 0 shows what glows, 1 direct light [default: all]
        #[arg(long, value_name = "N")]
        bounces: Option<u32>,
        /// Start all paths at the centres of the pixels, as films are rendered, and not all over them
        #[arg(long)]
        centre: bool,
        /// Of the picture, in pixels [default: 512x512]
        #[arg(long, value_name = "WxH")]
        size: Option<Size>,
        /// Seed of paths and photons [default: 1]
        #[arg(long, value_name = "S")]
        seed: Option<u64>,
        /// Anchor lights, for all lights [default: as for films]
        #[arg(long, value_name = "N")]
        vpls: Option<usize>,
        /// Photons, for all lights [default: 150 for each anchor light]
        #[arg(long, value_name = "N")]
        photons: Option<u64>,
        /// Pictures a second, which say when the frame is [default: as the TOML file says, else 25]
        #[arg(long)]
        fps: Option<f64>,
        /// Threads [default: one per processor]; the result is the same for any number
        #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
        threads: Option<u16>,
        /// No progress: only errors are shown
        #[arg(short, long)]
        quiet: bool,
    },
    /// Say how far pictures, sequences or videos are from a reference.
    Compare(Compare),
    /// Compare methods: error against run time, before and after decoding, with tables, plots and a page that shows it all.
    Sweep(Sweep),
    /// Show what a scene needs, what is left out, and why; render nothing.
    #[command(args_override_self = true)]
    Plan {
        /// What and how.
        #[command(flatten)]
        job: Job,
    },
    /// Print what makes a shell complete this program's options.
    Completions {
        /// Which shell
        shell: clap_complete::Shell,
    },
    /// Print the manual page of the program, or of one of its commands, as roff for man.
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
    /// The error a pixel may have: "perceptual", or "fixed:SHARE" of its luminance [default: perceptual]
    #[arg(long, value_name = "KIND")]
    pub thresholds: Option<Thresholds>,
    /// Multiplier on what masking allows beyond 2 %: smaller is finer, 1 is the paper's [default: 0.25]
    #[arg(long, value_name = "K")]
    pub kappa: Option<f32>,
    /// When a cut ends [default: bound]
    #[arg(long, value_enum, value_name = "WHEN")]
    pub stopping: Option<Stopping>,
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
