//! Joining of parts into a film: `render2mpeg join`.
//!
//! `part` reads a part with its report, `order` checks that the parts form a film, and this module writes the stream
//! and the report. Pictures are not recoded. A film made by one machine in the same chunks has the same bytes.

mod order;
mod part;

use crate::error::{Context, Error, Result};
use crate::places::FilePlaces;
use crate::report::{Ending, Summary, path_beside, write_json};
use crate::settings::{CodedRate, check_disc, container_of, unknown_ending};
use mpeg2enc::{AccessUnit, Container, ElementaryStream, Multiplexer};
use part::WholePart;
use pipeline::output::Output;
use pipeline::report::FrameReport;
use serde::Serialize;
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Report of a joined film, with the layout of [`Report`](crate::Report).
#[derive(Clone, Debug, Serialize)]
pub struct JoinedReport {
    schema: u32,
    program: String,
    scene: Value,
    settings: Value,
    plan: Value,
    /// Reports of all frames.
    pub frames: Vec<FrameReport>,
    /// Summary of all frames. Times are sums over the parts; memory is the maximum.
    pub summary: Summary,
    /// Parts of the film, in order.
    parts: Vec<JoinedPart>,
}

/// Part of a film, as listed in the film's report.
#[derive(Clone, Debug, Serialize)]
struct JoinedPart {
    file: PathBuf,
    /// First and last frame, as `A-B`.
    range: String,
    wall_seconds: f64,
    cpu_seconds: Option<f64>,
}

impl JoinedReport {
    /// Returns the report of a film at `output`.
    fn new(parts: Vec<WholePart>, output: &Path) -> Self {
        // Add up the times of all parts. Parts are made by separate runs, so the memory is a maximum.
        let summaries: Vec<&Summary> = parts.iter().map(|part| &part.report.summary).collect();
        let wall_seconds = summaries.iter().map(|summary| summary.wall_seconds).sum();
        let cpu_seconds = summaries.iter().map(|summary| summary.cpu_seconds).sum();
        let peak_memory_bytes = summaries.iter().filter_map(|summary| summary.peak_memory_bytes).max();

        // List each part with its cost.
        let joined = parts.iter().map(|part| JoinedPart {
            file: part.path.clone(),
            range: part.range.to_string(),
            wall_seconds: part.report.summary.wall_seconds,
            cpu_seconds: part.report.summary.cpu_seconds,
        });
        let joined = joined.collect();

        // List the settings of all parts once, without output and range, which belong to single parts.
        let first = &parts[0].report;
        let (schema, program) = (first.schema, first.program.clone());
        let (scene, mut settings, plan) = (first.scene.clone(), first.settings.clone(), first.plan.clone());
        settings.remove("range");
        settings.insert("output".into(), output.display().to_string().into());

        // Summarize all frames, but replace the time and memory of this process by the parts' own.
        let frames: Vec<FrameReport> = parts.into_iter().flat_map(|part| part.report.frames).collect();
        let summary = Summary::of(&frames, Ending { interrupted: false, wall_seconds });
        let summary = Summary { cpu_seconds, peak_memory_bytes, ..summary };
        Self { schema, program, scene, settings: settings.into(), plan, frames, summary, parts: joined }
    }

    /// Writes the report atomically.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<()> {
        write_json(self, path)
    }
}

/// Returns the input files of the parts at `paths`: streams and reports.
#[must_use]
pub fn places(paths: &[PathBuf]) -> FilePlaces {
    let mut places = FilePlaces::default();
    for path in paths {
        places = places.reads("a part", Some(path)).reads("a part", Some(&path_beside(path)));
    }
    places
}

/// Joins the elementary streams at `paths`, in the given order, into the film at `output`. The ending of `output`
/// determines the container. Each part's report must be next to the part. Nothing is written unless all parts are
/// complete, consecutive, and form a whole film.
///
/// # Errors
/// If a part is truncated, misplaced or belongs to another film, or a file cannot be read or written. The message names
/// the file.
pub fn join(paths: &[PathBuf], output: &Path) -> Result<JoinedReport> {
    // Check the paths and all parts before the output is created.
    let container = container_of(output, None).ok_or_else(|| unknown_ending(output))?;
    places(paths).writes("-o", Some(output)).check()?;
    let parts = paths.iter().map(|path| WholePart::read(path)).collect::<Result<Vec<WholePart>>>()?;
    order::check(&parts)?;
    if container == Container::Disc {
        check_disc(output, None, parts[0].fps)?;
        check_disc_part(&parts[0])?;
    }

    // Declare the length of the whole film, which some containers store at the beginning.
    let config = parts[0].encoder_config()?;
    let pictures = u64::from(parts[0].pictures);
    let all = u64::from(parts[0].film_frames) * pictures;
    let mut multiplexer = Multiplexer::new(container, &config).with_pictures(all);
    let mut film = Output::create(output)?;
    // Read each part again when it is written, because a film may exceed the memory.
    for part in &parts {
        let first = u64::from(part.range.first) * pictures;
        for unit in part.stream()?.units {
            film.write(&multiplexer.push(AccessUnit { display_index: first + unit.display_index, ..unit }))?;
        }
    }
    // End the film with one end code, in place of an end code per part.
    film.write(&multiplexer.finish(&ElementaryStream::END))?;
    film.finish().context("the joined film")?;
    Ok(JoinedReport::new(parts, output))
}

/// Checks that DVD-Video permits a part's pixels and rate, which an elementary stream does not signal.
///
/// # Errors
/// If the pixels are square, or the rate needs pulldown.
fn check_disc_part(part: &WholePart) -> Result<()> {
    let remedy = match CodedRate::of(part.fps)?.rate.fraction() {
        (24_000, 1001) => {
            "has no pulldown, which DVD-Video needs at 23.976 pictures per second: render the film in one run"
        }
        _ if part.aspect.is_square() => {
            "has square pixels, but DVD-Video pictures are 4:3 or 16:9: render parts with --aspect"
        }
        _ => return Ok(()),
    };
    Err(Error::content(&part.path, format!(" {remedy}, or name the output .mpg")))
}
