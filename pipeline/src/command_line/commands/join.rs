//! `render2mpeg join`.

use crate::command_line::overwrite::Overwrite;
use crate::join::{join, places};
use crate::output::Output;
use crate::report::path_beside;
use anyhow::Result;
use clap::Args;
use std::path::PathBuf;
use std::process::ExitCode;

/// Parts, and the film that they make.
#[derive(Args)]
pub(crate) struct Join {
    /// The parts in the order of their frames, .m2v; the report of each is beside it
    #[arg(required = true, value_name = "PART.m2v")]
    parts: Vec<PathBuf>,
    /// The film: .m2v (elementary stream), .mpg (program stream) or .ts (transport stream)
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
    let report_path = report.clone().unwrap_or_else(|| path_beside(output));
    places(parts).writes("-o", Some(output)).writes("--report", Some(&report_path)).check()?;
    overwrite.check(output)?;
    drop(Output::create(&report_path)?);
    let report = join(parts, output)?;
    report.write(&report_path)?;
    if !quiet {
        tell!("{} frames of {} parts", report.summary.frames, parts.len());
        tell!("video:  {}", output.display());
        tell!("report: {}", report_path.display());
    }
    Ok(ExitCode::SUCCESS)
}
