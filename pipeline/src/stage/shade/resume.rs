//! What shading carries from frame to frame, for checkpoints.

use super::cache::{Cache, Recipe};
use super::{Sample, Still};
use crate::checkpoint::{Checkpoints, Part};
use crate::error::Result;
use crate::message::Prepared;
use lighttree::Calibration;
use render_core::cache::IrradianceCache;
use serde::{Deserialize, Serialize};

/// As it is written.
#[derive(Serialize)]
struct Carried<'a> {
    records: Option<&'a IrradianceCache<Recipe>>,
    /// A still frame's light, and the records that it was taken from.
    still: Option<(&'a [Sample], u64)>,
    calibration: Option<&'a Calibration>,
}

/// As it is read.
#[derive(Deserialize)]
struct Known {
    records: Option<IrradianceCache<Recipe>>,
    still: Option<(Vec<Sample>, u64)>,
    calibration: Option<Calibration>,
}

fn known(checkpoints: &Checkpoints) -> Result<Option<Known>> {
    checkpoints.part(Part::Shade)
}

/// Whether [`take_up`] can read what was left.
pub fn check(checkpoints: &Checkpoints) -> Result<()> {
    known(checkpoints).map(|_| ())
}

pub(super) fn leave(
    checkpoints: &Checkpoints,
    frame: u32,
    cache: Option<&Cache>,
    still: Option<&Still>,
    calibration: Option<&Calibration>,
) -> Result<()> {
    let still = still.map(|still| (&still.samples[..], still.cache_records));
    checkpoints.leave(frame, Part::Shade, &Carried { records: cache.map(Cache::carried), still, calibration })
}

/// What [`take_up`] gives.
type TakenUp = (Option<Cache>, Option<Still>, Option<Calibration>);

/// Cache, still light and calibration as they were behind the frame `done`.
pub(super) fn take_up(checkpoints: &Checkpoints, done: &Prepared) -> Result<TakenUp> {
    let Some(Known { records, still, calibration }) = known(checkpoints)? else {
        return Ok((None, None, None));
    };
    let still = still.map(|(samples, cache_records)| Still::new(done, samples, cache_records));
    Ok((records.map(|records| Cache::resumed(records, done)).transpose()?, still, calibration))
}
