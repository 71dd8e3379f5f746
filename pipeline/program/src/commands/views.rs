//! Command `render2mpeg views`: pictures from many sides with their cameras.

use crate::notes;
use crate::picture::{PictureArguments, set_plain_background};
use crate::print::single_line;
use crate::progress;
use anyhow::{Context, Result};
use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use pipeline::output::Output;
use pipeline::streams::make_folder;
use render_core::glam::{Mat4, Vec3A};
use render_core::scene::{Orbit, Scene, View};
use render2mpeg::Options;
use render2mpeg::settings::Settings;
use render2mpeg::still::Still;
use renderer::settings::{Aov, Size};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Scene, number of views, and files.
#[derive(Args)]
pub(crate) struct ViewsArguments {
    /// A glTF 2.0 scene, .glb or .gltf
    scene: PathBuf,
    /// Folder of the pictures and of transforms.json [default: the scene's name, in the current folder]
    #[arg(short, long, alias = "png", value_name = "DIR")]
    output: Option<PathBuf>,
    /// Number of views, spread evenly around the scene and above it
    #[arg(long, value_name = "N", default_value_t = 16, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    count: u32,
    /// Also write OpenEXR files with these channels: depth (meters along the camera's axis), normal or position (world
    /// space)
    #[arg(long, value_name = "NAME", value_delimiter = ',', value_parser = aov())]
    aov: Vec<Aov>,
    /// Quality of the pictures, and options of their scene and run. The background is transparent unless a color is
    /// given.
    #[command(flatten)]
    pub picture: PictureArguments,
}

/// Parses the names of channels that describe surfaces.
fn aov() -> impl TypedValueParser<Value = Aov> {
    PossibleValuesParser::new(["depth", "normal", "position"]).map(|name| match name.as_str() {
        "depth" => Aov::Depth,
        "normal" => Aov::Normal,
        _ => Aov::Position,
    })
}

/// Cosines of the angles from the up axis between which cameras are: 26° and 100°.
const HEIGHTS: [f32; 2] = [0.9, -0.17];

/// Frames per second of the views, one view per frame. It has no effect on pictures.
const FPS: f64 = 25.0;

/// Renders the views, and writes them with their cameras.
pub fn run(arguments: ViewsArguments) -> Result<ExitCode> {
    let ViewsArguments { scene: path, output, count, aov, picture } = arguments;
    let PictureArguments { reading, memory, overwrite, quiet, .. } = &picture;
    let folder = output.unwrap_or_else(|| path.file_stem().unwrap_or_default().into());
    // Views show the pose at time 0, so studio and cameras are placed for this pose.
    let mut scene = reading.load_bare(&path)?;
    scene.stop();
    scene.furnish();
    let is_transparent = !reading.has_background();
    if is_transparent {
        set_plain_background(&mut scene);
    }
    scene.set_views(&orbits(count), FPS);

    // Check all files before rendering begins.
    let mut options = Options { fps: Some(FPS), ..picture.film(count) };
    let mut settings = options.fill_in(path, &scene)?;
    settings.render.aov.clone_from(&aov);
    memory.check(&scene, &settings)?;
    let digits = (count - 1).to_string().len().max(3);
    let file = |frame: u32, ending: &str| format!("{frame:0digits$}.{ending}");
    let table = folder.join("transforms.json");
    for path in (0..count).map(|frame| folder.join(file(frame, "png"))).chain([table.clone()]) {
        overwrite.check(&path)?;
    }
    make_folder(&folder)?;
    if !*quiet {
        notes::before(&scene, &settings).iter().for_each(|note| tell!("note: {}", single_line(note)));
    }

    // Render the views, which share the scene's light.
    let begin = std::time::Instant::now();
    let bar = progress::of_pictures(count as usize, *quiet);
    let mut frames = Vec::new();
    Still::render_each(&scene, &settings, &(0..count).collect::<Vec<_>>(), is_transparent, |frame, still| {
        still.write(&folder.join(file(frame, "png")))?;
        let mut entry = entry(&scene, &settings, frame);
        entry["file_path"] = json!(file(frame, "png"));
        if !aov.is_empty() {
            still.write(&folder.join(file(frame, "exr")))?;
            entry["channels_path"] = json!(file(frame, "exr"));
        }
        frames.push(entry);
        bar.inc(1);
        Ok(())
    })?;
    bar.finish_and_clear();
    write_table(&table, &scene, &settings, frames)?;
    if !*quiet {
        tell!("{}: {count} views in {:.1} s", folder.display(), begin.elapsed().as_secs_f64());
    }
    Ok(ExitCode::SUCCESS)
}

/// Returns evenly spread positions on a sphere between the two heights: a golden spiral.
fn orbits(count: u32) -> Vec<Orbit> {
    let position = |k: u32| {
        let height = HEIGHTS[0] + (HEIGHTS[1] - HEIGHTS[0]) * (k as f32 + 0.5) / count as f32;
        let azimuth = (k as f32 * 137.507_76).rem_euclid(360.0);
        Orbit { azimuth, polar: height.acos().to_degrees(), distance: None }
    };
    (0..count).map(position).collect()
}

fn view(scene: &Scene, settings: &Settings, frame: u32) -> View {
    let Size { width, height } = settings.render.size;
    scene.view(&scene.pose(settings.render.time(frame)), width, height)
}

/// Returns the camera of a view: the matrix from camera space to the coordinates of the file, by rows, with x to the right, y up and −z along
/// the view.
fn entry(scene: &Scene, settings: &Settings, frame: u32) -> Value {
    let mut camera = view(scene, settings, frame).world_from_camera();
    camera.translation -= Vec3A::from(scene.displacement);
    let matrix = Mat4::from(camera);
    let rows: Vec<[f32; 4]> = (0..4).map(|row| matrix.row(row).to_array()).collect();
    json!({ "transform_matrix": rows })
}

/// Writes the cameras of all views, with the lens in pixels.
fn write_table(path: &Path, scene: &Scene, settings: &Settings, frames: Vec<Value>) -> Result<()> {
    let Size { width, height } = settings.render.size;
    let focal = 1.0 / f64::from(view(scene, settings, 0).pixel_width(1.0));
    let angle = |side: usize| 2.0 * (side as f64 / 2.0 / focal).atan();
    let table = json!({
        "camera_model": "OPENCV",
        "w": width,
        "h": height,
        "fl_x": focal,
        "fl_y": focal,
        "cx": width as f64 / 2.0,
        "cy": height as f64 / 2.0,
        "camera_angle_x": angle(width),
        "camera_angle_y": angle(height),
        "frames": frames,
    });
    let mut file = Output::create(path)?;
    file.write(serde_json::to_string_pretty(&table).context("the cameras are numbers")?.as_bytes())?;
    Ok(file.finish()?)
}
