//! The state of shading between two frames, for checkpoints.

use super::cache::around::Movement;
use super::cache::{Cache, Recipe};
use super::carry::{Carry, Light};
use super::{Sample, Shading, Still};
use crate::error::Result;
use crate::renderer::frame::PreparedFrame;
use crate::state::{decode, encode};
use lighttree::Calibration;
use render_core::cache::IrradianceCache;
use serde::{Deserialize, Serialize};

/// As it is written.
#[derive(Serialize)]
struct Written<'a> {
    records: Option<&'a IrradianceCache<Recipe>>,
    /// A still frame's light, and the number of records that it was taken from.
    still: Option<(&'a [Sample], u64)>,
    calibration: Option<&'a Calibration>,
    carried: Option<&'a Light>,
}

/// As it is read.
#[derive(Deserialize)]
struct Read {
    records: Option<IrradianceCache<Recipe>>,
    still: Option<(Vec<Sample>, u64)>,
    calibration: Option<Calibration>,
    carried: Option<Light>,
}

pub(super) fn of(shading: &Shading) -> Vec<u8> {
    let Shading { cache, carry, still, calibration, .. } = shading;
    let still = still.as_ref().map(|still| (&still.samples[..], still.cache_records));
    let carried = carry.as_ref().map(|carry| &carry.light);
    encode(&Written { records: cache.as_ref().map(Cache::carried), still, calibration: calibration.as_ref(), carried })
}

/// Brings cache, still light, calibration and carried light to where they were after the frame `last`.
pub(super) fn restore(shading: &mut Shading, state: &[u8], last: &PreparedFrame) -> Result<()> {
    let Read { records, still, calibration, carried } = decode(state)?;
    let plan = shading.plan;
    shading.cache = records.map(|records| Cache::resumed(records, plan, &last.frame)).transpose()?;
    shading.places = Movement::to(&last.frame, &[]).places;
    shading.still = still.map(|(samples, cache_records)| Still::new(&last.frame, samples, cache_records));
    shading.calibration = calibration;
    shading.carry = carried.map(|light| Carry::resumed(light, &last.frame));
    Ok(())
}
