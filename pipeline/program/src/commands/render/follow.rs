//! Command `render2mpeg render` on the ranks other than rank 0. These ranks share the work, write no files, and print
//! only messages that rank 0 does not print.

use super::RenderArguments;
use crate::print::single_line;
use crate::ranks::Ranks;
use anyhow::Result;
use pipeline::checkpoint::FilmJob;
use pipeline::team::{Present, muster};
use render_core::scene::Scene;
use render2mpeg::job::job_of;
use render2mpeg::settings::Settings;
use render2mpeg::{Error, Render};
use renderer::plan::Plan;
use std::process::ExitCode;

/// Follows rank 0 until its film is finished. Returns at once if rank 0 makes no film.
///
/// # Errors
/// If the options are wrong on every rank. Rank 0 prints these errors.
pub(super) fn run(arguments: RenderArguments, ranks: &Ranks) -> Result<ExitCode> {
    let film = film(arguments);
    // Report to the other ranks whether this rank can make the film.
    let answer = match &film {
        Ok((.., job)) => Present::Ready(job.sum()),
        Err(error) => Present::Fails(format!("{error:#}")),
    };
    let is_made = muster(&*ranks.team().shade, &answer)?;
    let Some((scene, settings, _)) = film.ok().filter(|_| is_made) else { return Ok(ExitCode::SUCCESS) };

    // Compute this rank's share of each frame.
    let plan = Plan::new(&scene, &settings.render);
    match Render::follow(&scene, &settings, &plan, ranks.team()) {
        Ok(()) => Ok(ExitCode::SUCCESS),
        Err(error @ Error::Loop(pipeline::Error::Ranks(_))) => Err(error.into()),
        // End all ranks, because the others cannot see this error and would wait.
        Err(error) => {
            tell!("render2mpeg: rank {}: {}", ranks.team().rank(), single_line(&error.chain()));
            ranks.fail(1);
            Err(error.into())
        }
    }
}

/// Returns the film that the arguments describe, which is the same as on rank 0.
fn film(mut arguments: RenderArguments) -> Result<(Scene, Settings, FilmJob)> {
    let path = arguments.source.path();
    let scene = arguments.source.reading.load(&path)?;
    let settings = arguments.options.fill_in(path, &scene)?;
    arguments.memory.check(&scene, &settings)?;
    let job = job_of(&scene, &settings)?;
    Ok((scene, settings, job))
}
