//! `render2mpeg join`.

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

/// Parts, and the film that they make.
#[derive(Args)]
pub(crate) struct Join {
    /// The parts in the order of their frames, .m2v; the report of each is beside it
    #[arg(required = true, value_name = "PART.m2v")]
    parts: Vec<PathBuf>,
    /// The film: .mpg, .mp4, .mkv, .ts, .vob, or .m2v without times; - is standard output
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Where the JSON report of the film goes [default: beside the film, .report.json]
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
    /// Whether the film may take the place of another.
    #[command(flatten)]
    overwrite: Overwrite,
    /// No summary: only errors are shown
    #[arg(short, long)]
    quiet: bool,
}

/// Joins parts, and reports.
pub fn run(arguments: &Join) -> Result<ExitCode> {
    let Join { parts, output, report, overwrite, quiet } = arguments;
    // A name that no film can have is no question of replacing what is there.
    container_of(output, None).ok_or_else(|| unknown_ending(output))?;
    let beside = || (!is_standard_output(output)).then(|| path_beside(output));
    let report_path = report.clone().or_else(beside);
    places(parts).writes("-o", Some(output)).writes("--report", report_path.as_deref()).check()?;
    overwrite.check(output)?;
    report_path.as_deref().map(Output::create).transpose()?;
    let report = join(parts, output)?;
    report_path.as_deref().map_or(Ok(()), |path| report.write(path))?;
    if !quiet {
        tell!("{} of {}", counted(report.summary.frames as usize, "frame"), counted(parts.len(), "part"));
        tell!("video:  {}", output.display());
        if let Some(path) = &report_path {
            tell!("report: {}", path.display());
        }
    }
    Ok(ExitCode::SUCCESS)
}
