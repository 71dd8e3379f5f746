//! `render2mpeg reference`.

use crate::overwrite::Overwrite;
use crate::source::Reading;
use crate::{parts, progress};
use anyhow::Result;
use clap::Args;
use perceptual::luminance_plane;
use pipeline::exposure::exposure_for;
use pipeline::output::Output;
use render_core::{PathOptions, PixelSampling};
use render2mpeg::picture_file::{PictureFormat, shown, write_shown};
use render2mpeg::places::FilePlaces;
use render2mpeg::settings::{Switch, parse_fps};
use render2mpeg::{Options, Settings};
use renderer::reference;
use renderer::reference::ReferenceMethod;
use renderer::settings::Size;
use std::path::PathBuf;
use std::process::ExitCode;

/// The frame, and its precision.
#[derive(Args)]
pub(crate) struct Reference {
    /// A glTF 2.0 scene, .glb or .gltf
    scene: PathBuf,
    /// Reading of the scene: folders, camera, animation, settings.
    #[command(flatten)]
    reading: Reading,
    /// The picture: .exr, with channels R, G, B and, for paths, variance.R, .G, .B of their means; .png or .jpg as a display shows
    /// it
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Number of the frame, counted from 0
    #[arg(long, value_name = "K", default_value_t = 0)]
    frame: u32,
    /// How light is computed
    #[arg(long, value_enum, default_value = "path")]
    method: ReferenceMethod,
    /// Paths for each pixel
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = clap::value_parser!(u32).range(1..=1 << 20))]
    spp: u32,
    /// Most reflections of a path: 0 shows what glows, 1 direct light [default: all]
    #[arg(long, value_name = "N")]
    bounces: Option<u32>,
    /// Sample the centers of the pixels alone: the picture of a film without anti-aliasing
    #[arg(long, alias = "centre")]
    center: bool,
    /// Size of the picture, in pixels [default: 512x512 pixels in the camera's shape, such as 682x384]
    #[arg(long, value_name = "WxH")]
    size: Option<Size>,
    /// Seed of paths and photons [default: 1]
    #[arg(long, value_name = "S")]
    seed: Option<u64>,
    /// Anchor lights, for all lights [default: as for films]
    #[arg(long, value_name = "N")]
    vpls: Option<usize>,
    /// Photons, for all lights [default: 36 for each anchor light]
    #[arg(long, value_name = "N")]
    photons: Option<u64>,
    /// Pictures a second, which say when the frame is [default: as the TOML file says, else 25]
    #[arg(long, value_parser = parse_fps)]
    fps: Option<f64>,
    /// Threads [default: one per processor]; the result is the same for any number
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Whether files may be replaced.
    #[command(flatten)]
    overwrite: Overwrite,
    /// No progress, no summary: only errors are shown
    #[arg(short, long)]
    quiet: bool,
}

/// Renders and writes.
pub fn run(arguments: Reference) -> Result<ExitCode> {
    let Reference {
        scene: path,
        reading,
        output,
        frame,
        method,
        spp,
        bounces,
        center,
        size,
        seed,
        vpls,
        photons,
        fps,
        overwrite,
        quiet,
        ..
    } = arguments;
    let format = PictureFormat::of(&output)?;
    parts::need("still", format != PictureFormat::Linear)?;
    let scene = reading.load(&path)?;
    FilePlaces::of(&scene).writes("-o", Some(&output)).check()?;
    overwrite.check(&output)?;
    // Settings are those of a film, which has a reflection at least; paths may show what glows alone.
    let film_bounces = bounces.filter(|&bounces| bounces > 0 || method == ReferenceMethod::AllLights);
    let antialiasing = center.then_some(Switch::Off);
    // The finest quantiser: as many photons as any film has.
    let qscale = Some(1);
    let options =
        Options { size, seed, bounces: film_bounces, vpls, photons, fps, antialiasing, qscale, ..Default::default() };
    let settings = Settings::new(path, &scene, &options)?;
    // An output that cannot be written is told of before the work, not after it.
    drop(Output::create(&output)?);
    let begin = std::time::Instant::now();
    let picture = match method {
        ReferenceMethod::AllLights => reference::by_all_lights(&scene, &settings.render, frame),
        ReferenceMethod::Path => {
            let pixel = if center { PixelSampling::Center } else { PixelSampling::Area };
            let options = PathOptions { samples: spp, seed: settings.render.seed, max_bounces: bounces, pixel };
            let bar = progress::of_work(quiet);
            let picture = reference::by_paths(&scene, &settings.render, frame, &options, |done, all| {
                bar.set_length(all as u64);
                bar.set_position(done as u64);
            });
            bar.finish_and_clear();
            picture
        }
    };
    match format {
        PictureFormat::Linear => picture.write(&output)?,
        PictureFormat::Shown(_) => {
            let exposure = settings.render.auto_exposure.then(|| exposure_for(&luminance_plane(&picture.radiance)));
            let tone_map =
                settings.render.tone_map.with_exposure(exposure.unwrap_or(settings.render.tone_map.exposure));
            write_shown(&output, &shown(&picture.radiance, &tone_map))?;
        }
    }
    if !quiet {
        super::tell_of_picture(&output, settings.render.size, begin);
    }
    Ok(ExitCode::SUCCESS)
}
