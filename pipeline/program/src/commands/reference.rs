//! Command `render2mpeg reference`.

use crate::overwrite::Overwrite;
use crate::source::Reading;
use crate::{features, progress};
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

/// Frame to render, and its precision.
#[derive(Args)]
pub(crate) struct Reference {
    /// A glTF 2.0 scene, .glb or .gltf
    scene: PathBuf,
    /// Options for reading the scene: folders, camera, animation and scene settings.
    #[command(flatten)]
    reading: Reading,
    /// Picture file: .exr with channels R, G, B and, from paths, their variance as variance.R, .G, .B; .png, .webp
    /// or .jpg tone mapped for display
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Frame of the scene, counted from 0
    #[arg(long, value_name = "K", default_value_t = 0)]
    frame: u32,
    /// Method for light
    #[arg(long, value_enum, default_value = "path")]
    method: ReferenceMethod,
    /// Number of paths per pixel
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = clap::value_parser!(u32).range(1..=1 << 20))]
    spp: u32,
    /// Maximum number of reflections of a path: 0 shows emission only, 1 direct light [default: no limit]
    #[arg(long, value_name = "N")]
    bounces: Option<u32>,
    /// Sample pixel centers only, as a film with --antialiasing off does
    #[arg(long, alias = "centre")]
    center: bool,
    /// Picture size in pixels [default: 512x512 pixels in the camera's shape, such as 682x384]
    #[arg(long, value_name = "WxH")]
    size: Option<Size>,
    /// Random seed of paths and photons [default: 1]
    #[arg(long, value_name = "S")]
    seed: Option<u64>,
    /// Number of anchor lights, for the method all-lights [default: as for films]
    #[arg(long, value_name = "N")]
    vpls: Option<usize>,
    /// Number of photons, for the method all-lights [default: 36 per anchor light]
    #[arg(long, value_name = "N")]
    photons: Option<u64>,
    /// Frames per second, which determine the time of the frame [default: the scene's TOML file, else 25]
    #[arg(long, value_parser = parse_fps)]
    fps: Option<f64>,
    /// Number of threads; the result does not depend on it [default: one per processor]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Permission to replace files.
    #[command(flatten)]
    overwrite: Overwrite,
    /// Print no progress and no summary, only errors
    #[arg(short, long)]
    quiet: bool,
}

/// Renders the frame, and writes it as a picture.
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
    // Check the request before loading the scene.
    let format = PictureFormat::of(&output)?;
    features::need("still", format != PictureFormat::Linear)?;
    let scene = reading.load(&path)?;
    FilePlaces::of(&scene).writes("-o", Some(&output)).check()?;
    overwrite.check(&output)?;

    // Omit 0 bounces from the film's settings, which require at least one reflection. Path tracing supports 0.
    let film_bounces = bounces.filter(|&bounces| bounces > 0 || method == ReferenceMethod::AllLights);
    let antialiasing = center.then_some(Switch::Off);
    // Use the finest quantiser, which requires the most photons.
    let qscale = Some(1);
    let options =
        Options { size, seed, bounces: film_bounces, vpls, photons, fps, antialiasing, qscale, ..Default::default() };
    let settings = Settings::new(path, &scene, &options)?;
    // Report unwritable outputs before rendering begins.
    drop(Output::create(&output)?);

    // Render the frame with the chosen method.
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

    // Pictures for display need an exposure, chosen as for films.
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
