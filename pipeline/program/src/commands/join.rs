//! Command `render2mpeg join`.

use crate::overwrite::Overwrite;
use crate::print::counted;
use anyhow::Result;
use clap::Args;
use pipeline::output::Output;
use pipeline::streams::is_standard_output;
use render2mpeg::join::{join, places};
use render2mpeg::report::path_beside;
use render2mpeg::settings::{container_of, unknown_ending};
use std::path::PathBuf;
use std::process::ExitCode;

/// Parts of a film, and the files to write.
#[derive(Args)]
pub(crate) struct Join {
    /// Parts in the order of their frames, .m2v; each part's report is next to it
    #[arg(required = true, value_name = "PART.m2v")]
    parts: Vec<PathBuf>,
    /// Film file: .mpg, .mp4, .mkv, .ts, .vob, or .m2v without timestamps; - is standard output
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// JSON report of the film [default: the film's path with .report.json]
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
    /// Permission to replace files.
    #[command(flatten)]
    overwrite: Overwrite,
    /// Print no summary, only errors
    #[arg(short, long)]
    quiet: bool,
}

/// Joins the parts of a film, and prints a summary.
pub fn run(arguments: &Join) -> Result<ExitCode> {
    let Join { parts, output, report, overwrite, quiet } = arguments;
    // Report an invalid file name before asking whether the file may be replaced.
    container_of(output, None).ok_or_else(|| unknown_ending(output))?;
    // Write the report next to the film, except for a film on standard output.
    let beside = || (!is_standard_output(output)).then(|| path_beside(output));
    let report_path = report.clone().or_else(beside);
    places(parts).writes("-o", Some(output)).writes("--report", report_path.as_deref()).check()?;
    overwrite.check(output)?;
    // Report an unwritable path before joining begins.
    report_path.as_deref().map(Output::create).transpose()?;
    let report = join(parts, output)?;
    report_path.as_deref().map_or(Ok(()), |path| report.write(path))?;

    // Print the numbers of frames and parts, and the paths.
    if !quiet {
        tell!("{} of {}", counted(report.summary.frames as usize, "frame"), counted(parts.len(), "part"));
        tell!("video:  {}", output.display());
        if let Some(path) = &report_path {
            tell!("report: {}", path.display());
        }
    }
    Ok(ExitCode::SUCCESS)
}
