//! The stages of the pipeline, in the order that a frame passes them. Each is a plain thread between channels.
//!
//! A stage ends when the channel it reads from is closed, or when nobody reads what it writes: then
//! someone behind it has failed, and the driver will report that.

pub mod display;
pub mod encode;
pub mod mask;
pub mod prepare;
pub mod shade;

use crate::checkpoint::Checkpoints;
use crate::error::{Context, Result};
use crate::settings::Settings;

/// Whether each stage can take up what it left in the checkpoint.
///
/// # Errors
/// What one of them left makes no sense.
pub(crate) fn check(settings: &Settings, checkpoints: &Checkpoints) -> Result<()> {
    prepare::known(checkpoints)?;
    shade::check(checkpoints)?;
    display::known(checkpoints)?;
    mask::known(checkpoints)?;
    encode::known(settings, checkpoints)?;
    Ok(())
}

/// A pool of one thread for a stage whose work is short: in the common pool it would queue behind a picture's worth of
/// macroblocks, and its time could not be told from theirs.
fn pool_of_one() -> Result<rayon::ThreadPool> {
    rayon::ThreadPoolBuilder::new().num_threads(1).build().context("a thread cannot be started")
}
