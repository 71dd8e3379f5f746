//! Command `render2mpeg still`.

use crate::display_server::{DisplayServer, ViewerAddress};
use crate::notes;
use crate::picture::{PictureArguments, set_plain_background};
use crate::print::single_line;
use crate::progress;
use anyhow::Result;
use clap::Args;
use pipeline::output::Output;
use render2mpeg::Options;
use render2mpeg::picture_file::PictureFormat;
use render2mpeg::places::FilePlaces;
use render2mpeg::settings::{FrameList, parse_fps};
use render2mpeg::still::Still;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::str::FromStr;

/// Frames to render, and the quality of their pictures.
#[derive(Args)]
pub(crate) struct StillArguments {
    /// A glTF 2.0 scene, .glb or .gltf
    scene: PathBuf,
    /// Picture file: .png, .webp or .jpg tone mapped for display, .exr with linear light [default: the scene's name
    /// with .png, in the current folder]
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Frame of the scene, counted from 0, or a list such as 2,4,10-20, or times such as 1.5s; file names of a list end
    /// in the frame's number
    #[arg(long, alias = "range", value_name = "K|LIST", default_value = "0")]
    frame: Moments,
    /// Frames per second, which determine the time of the frame [default: the scene's TOML file, else 25]
    #[arg(long, value_parser = parse_fps)]
    fps: Option<f64>,
    /// Number of anchor lights, the sources of indirect light [default: as for films]
    #[arg(long, value_name = "N")]
    vpls: Option<usize>,
    /// Show each finished picture as linear light in the image viewer tev, which listens at localhost:14158
    #[arg(long, value_name = "HOST:PORT")]
    display_server: Option<ViewerAddress>,
    /// Quality of the pictures, and options of their scene and run.
    #[command(flatten)]
    pub picture: PictureArguments,
}

/// Renders the frames, and writes them as pictures.
pub fn run(arguments: StillArguments) -> Result<ExitCode> {
    let StillArguments { scene: path, output, frame, fps, vpls, display_server, picture } = arguments;
    let PictureArguments { reading, memory, overwrite, quiet, .. } = &picture;
    let output = output.unwrap_or_else(|| PathBuf::from(path.file_stem().unwrap_or_default()).with_extension("png"));
    // Check paths and scene before rendering begins.
    let format = PictureFormat::of(&output)?;
    let mut scene = reading.load_bare(&path)?;
    scene.furnish();
    let is_transparent = reading.is_transparent();
    if is_transparent && !format.has_opacity() {
        return Err(PictureFormat::without_opacity(&output).into());
    }
    if is_transparent {
        set_plain_background(&mut scene);
    }
    FilePlaces::of(&scene).writes("-o", Some(&output)).check()?;
    let frame = frame.frames(fps.or(scene.settings.video.fps).unwrap_or(FPS))?;
    let pictures = named(&output, &frame);
    pictures.iter().try_for_each(|(_, path)| overwrite.check(path))?;

    // Fill in settings of a film that includes the last frame.
    let mut options = Options { fps, vpls, ..picture.film(frame.last() + 1) };
    let settings = options.fill_in(path, &scene)?;
    memory.check(&scene, &settings)?;
    // Report unwritable outputs before rendering begins.
    for (_, path) in &pictures {
        drop(Output::create(path)?);
    }
    if !*quiet {
        notes::before(&scene, &settings).iter().for_each(|note| tell!("note: {}", single_line(note)));
    }
    let frames: Vec<u32> = pictures.iter().map(|(frame, _)| *frame).collect();
    let mut begin = std::time::Instant::now();
    let bar = progress::of_pictures(frames.len(), *quiet);
    let viewer = display_server.map(|address| DisplayServer::start(&address, bar.warner()));
    Still::render_each(&scene, &settings, &frames, is_transparent, |frame, still| {
        let path = &pictures.iter().find(|(of, _)| *of == frame).expect("only these frames are rendered").1;
        if let Some(viewer) = &viewer {
            let radiance = still.transparent.as_ref().map_or(&still.radiance, |picture| &picture.radiance);
            viewer.show(&path.display().to_string(), radiance);
        }
        still.write(path)?;
        bar.inc(1);
        if !*quiet {
            // Convert display codes, which begin at 0, to video codes, which begin at 16.
            let bright = notes::bright_code(still.shown.samples().iter().flatten().copied()).saturating_add(16);
            let dimness = notes::on_dimness(notes::mean_luminance(&still.radiance), &scene);
            let alone = notes::on_lamps_alone(&still.shown, &scene);
            let notes = notes::on_darkness(Some(bright), &settings).into_iter().chain(dimness).chain(alone);
            bar.suspend(|| {
                notes.for_each(|note| tell!("note: {}", single_line(&note)));
                super::tell_of_picture(path, settings.render.size, begin);
            });
        }
        begin = std::time::Instant::now();
        Ok(())
    })?;
    viewer.into_iter().for_each(DisplayServer::finish);
    bar.finish_and_clear();
    Ok(ExitCode::SUCCESS)
}

/// Frames per second if neither the command line nor the scene's TOML file sets a rate.
const FPS: f64 = 25.0;

/// Frames by number, or by time.
#[derive(Clone, Debug)]
enum Moments {
    Frames(FrameList),
    /// Times from the start of the animation \[s\].
    Seconds(Vec<f64>),
}

impl FromStr for Moments {
    type Err = render2mpeg::Error;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        if !text.trim_end().ends_with('s') {
            return text.parse().map(Self::Frames);
        }
        let wrong = || render2mpeg::Error::Options(format!("\"{text}\" is not a list of times such as 1.5s or 0s,2s"));
        let seconds =
            |part: &str| part.trim().strip_suffix('s')?.parse::<f64>().ok().filter(|s| (0.0..=1e5).contains(s));
        let times: Option<Vec<f64>> = text.split(',').map(seconds).collect();
        times.map(Self::Seconds).ok_or_else(wrong)
    }
}

impl Moments {
    /// Returns the frames nearest to the times, at this rate.
    fn frames(self, fps: f64) -> Result<FrameList> {
        let times = match self {
            Self::Frames(frames) => return Ok(frames),
            Self::Seconds(times) => times,
        };
        let numbers: Vec<String> = times.iter().map(|time| format!("{:.0}", time * fps)).collect();
        Ok(numbers.join(",").parse()?)
    }
}

/// Returns the file of each frame: `output` for a single frame, or names with frame numbers of equal length for several
/// frames.
fn named(output: &Path, frames: &FrameList) -> Vec<(u32, PathBuf)> {
    if let [frame] = frames.frames() {
        return vec![(*frame, output.into())];
    }
    // Pad frame numbers with zeros, so that names sort by frame.
    let digits = frames.last().to_string().len();
    let stem = output.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let ending = output.extension().unwrap_or_default().to_string_lossy().into_owned();
    let name = |frame: &u32| output.with_file_name(format!("{stem}_{frame:0digits$}.{ending}"));
    frames.frames().iter().map(|frame| (*frame, name(frame))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_the_nearest_frames() {
        let frames = |text: &str, fps: f64| text.parse::<Moments>().unwrap().frames(fps).unwrap().frames().to_vec();
        assert_eq!(frames("1.5s", 24.0), [36]);
        assert_eq!(frames("0s, 2s,0.99s", 25.0), [0, 25, 50]);
        assert_eq!(frames("3,5-6", 25.0), [3, 5, 6]);
        for text in ["s", "-1s", "1s,2", "1,2s", "nans", "1e9s"] {
            assert!(text.parse::<Moments>().is_err(), "{text}");
        }
    }
}
