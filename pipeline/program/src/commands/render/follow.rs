//! `render2mpeg render` on a rank that follows: it shares the work, writes no file and says nothing that rank 0 says.

use super::Render;
use crate::print::single_line;
use crate::ranks::Ranks;
use anyhow::Result;
use pipeline::checkpoint::FilmJob;
use pipeline::team::{Present, muster};
use render_core::scene::Scene;
use render2mpeg::job::job_of;
use render2mpeg::settings::Settings;
use render2mpeg::{Error, Render as Film};
use renderer::plan::Plan;
use std::process::ExitCode;

/// Follows rank 0 through its film, if it makes any.
///
/// # Errors
/// Options that rank 0 has, too, and tells of.
pub(super) fn run(arguments: Render, ranks: &Ranks) -> Result<ExitCode> {
    let film = film(arguments);
    let answer = match &film {
        Ok((.., job)) => Present::Ready(job.sum()),
        Err(error) => Present::Fails(format!("{error:#}")),
    };
    let is_made = muster(&*ranks.team().shade, &answer)?;
    let Some((scene, settings, _)) = film.ok().filter(|_| is_made) else { return Ok(ExitCode::SUCCESS) };

    let plan = Plan::new(&scene, &settings.render);
    match Film::follow(&scene, &settings, &plan, ranks.team()) {
        Ok(()) => Ok(ExitCode::SUCCESS),
        Err(error @ Error::Loop(pipeline::Error::Ranks(_))) => Err(error.into()),
        // Nobody else knows of this, and the others would wait.
        Err(error) => {
            tell!("render2mpeg: rank {}: {}", ranks.team().rank(), single_line(&error.chain()));
            ranks.fail(1);
            Err(error.into())
        }
    }
}

/// The film that the arguments describe, as rank 0 has it.
fn film(mut arguments: Render) -> Result<(Scene, Settings, FilmJob)> {
    let path = arguments.source.path();
    let scene = arguments.source.reading.load(&path)?;
    let settings = arguments.options.fill_in(path, &scene)?;
    arguments.memory.check(&scene, &settings)?;
    let job = job_of(&scene, &settings)?;
    Ok((scene, settings, job))
}
