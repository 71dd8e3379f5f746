//! Command `render2mpeg compare`.

use crate::overwrite::Overwrite;
use crate::print::counted;
use anyhow::Result;
use clap::Args;
use laboratory::compare;
use laboratory::compare::{Comparison, HEAT_MAP_RANGE, HeatMap, png_file};
use pipeline::output::Output;
use render2mpeg::places::FilePlaces;
use std::path::PathBuf;
use std::process::ExitCode;

/// Options of a comparison.
#[derive(Args)]
pub struct Compare {
    /// Picture to measure: a picture (.exr, .png), a folder of pictures, or a video (.y4m, .m2v, .mpg, .vob, .ts; .mp4 and .mkv by ffmpeg)
    picture: PathBuf,
    /// Reference, of the same kind; variance stored in it is subtracted as noise
    reference: PathBuf,
    /// Write the mean difference of luma as a heat map: dark below 1/4 of a code value, bright at 64
    #[arg(long, value_name = "FILE.png")]
    heatmap: Option<PathBuf>,
    /// Permission to replace the heat map.
    #[command(flatten)]
    overwrite: Overwrite,
    /// Print JSON: the measures of a picture, or "frames" and their "mean" for a sequence
    #[arg(long)]
    json: bool,
}

/// Compares the pictures, and prints the measures.
pub fn run(arguments: &Compare) -> Result<ExitCode> {
    let Compare { picture, reference, heatmap, overwrite, json } = arguments;
    // Report unwritable outputs before the comparison begins.
    let places = FilePlaces::default().reads("the comparison", Some(picture)).reads("the comparison", Some(reference));
    places.writes("--heatmap", heatmap.as_deref()).check()?;
    heatmap.iter().try_for_each(|path| overwrite.check(path))?;
    let output = heatmap.as_deref().map(Output::create).transpose()?;

    // Print each picture as soon as it is measured, then the mean.
    let single = compare::is_single(picture);
    let mut map = HeatMap::default();
    let found =
        compare::compare_paths(picture, reference, output.is_some().then_some(&mut map), |index, comparison| {
            if !single && !json {
                say!("{}", line(&format!("frame {index:5}"), comparison));
            }
        })?;
    match (single, json) {
        (true, true) => say!("{}", serde_json::to_string_pretty(&found.mean)?),
        (false, true) => say!("{}", serde_json::to_string_pretty(&found)?),
        (true, false) => say!("{}", found.mean),
        (false, false) => say!("\nmean of {}\n{}", counted(found.frames.len(), "picture"), found.mean),
    }

    // Write the heat map, which covers all pictures.
    if let Some(mut output) = output {
        output.write(&png_file::encode(&map.picture()))?;
        output.finish()?;
        if !json {
            let (low, high) = HEAT_MAP_RANGE;
            say!("heat map              dark at {low} code values of luma, bright at {high}");
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// Formats the measures of a picture in one line.
fn line(name: &str, found: &Comparison) -> String {
    let psnr = found.psnr_y.map_or("equal".into(), |psnr| format!("{psnr:.2} dB"));
    let score = found.ssimulacra2.map_or(String::new(), |score| format!("   SSIMULACRA 2 {score:.2}"));
    format!(
        "{name}   RMSE {:.4e}   relative MSE {:.4e}   PSNR {psnr}   SSIM {:.5}{score}",
        found.rmse, found.relative_mse, found.ssim
    )
}
