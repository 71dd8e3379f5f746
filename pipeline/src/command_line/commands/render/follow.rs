//! `render2mpeg render` on a rank that follows: it shares the work, writes no file and says nothing that rank 0 says.

use super::Render;
use crate::command_line::print::single_line;
use crate::command_line::ranks::Ranks;
use crate::feedback_loop::checkpoint::FilmJob;
use crate::ranks::{Present, muster};
use crate::settings::Settings;
use crate::{Error, Plan, Render as Film};
use anyhow::Result;
use render_core::scene::Scene;
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

    let plan = Plan::new(&scene, &settings.renderer());
    match Film::follow(&scene, &settings, &plan, ranks.team()) {
        Ok(()) => Ok(ExitCode::SUCCESS),
        Err(error @ Error::Ranks(_)) => Err(error.into()),
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
    let job = FilmJob::of(&scene, &settings)?;
    Ok((scene, settings, job))
}
