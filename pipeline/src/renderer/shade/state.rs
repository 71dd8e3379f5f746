//! The state of shading between two frames, for checkpoints.

use super::cache::around::Movement;
use super::cache::{Cache, Recipe};
use super::carry::{Carry, Light};
use super::{Sample, Shading, Still};
use crate::error::{Error, Result};
use crate::renderer::frame::PreparedFrame;
use crate::state::{NONSENSE, decode, encode};
use lighttree::Calibration;
use render_core::Coverage;
use render_core::cache::IrradianceCache;
use serde::{Deserialize, Serialize};

/// As it is written.
#[derive(Serialize)]
struct Written<'a> {
    records: Option<&'a IrradianceCache<Recipe>>,
    still: Option<WrittenStill<'a>>,
    calibration: Option<&'a Calibration>,
    carried: Option<&'a Light>,
}

/// A still frame's light.
#[derive(Serialize)]
struct WrittenStill<'a> {
    samples: &'a [Sample],
    coverage: &'a Option<Coverage>,
    cache_records: u64,
}

/// As it is read.
#[derive(Deserialize)]
struct Read {
    records: Option<IrradianceCache<Recipe>>,
    still: Option<ReadStill>,
    calibration: Option<Calibration>,
    carried: Option<Light>,
}

/// A still frame's light.
#[derive(Deserialize)]
struct ReadStill {
    samples: Vec<Sample>,
    coverage: Option<Coverage>,
    cache_records: u64,
}

pub(super) fn of(shading: &Shading) -> Vec<u8> {
    let Shading { cache, carry, still, calibration, .. } = shading;
    let still = still.as_ref().map(|Still { samples, coverage, cache_records, .. }| WrittenStill {
        samples,
        coverage,
        cache_records: *cache_records,
    });
    let carried = carry.as_ref().map(|carry| &carry.light);
    encode(&Written { records: cache.as_ref().map(Cache::carried), still, calibration: calibration.as_ref(), carried })
}

/// Brings cache, still light, calibration and carried light to where they were after the frame `last`.
pub(super) fn restore(shading: &mut Shading, state: &[u8], last: &PreparedFrame) -> Result<()> {
    let Read { records, still, calibration, carried } = decode(state)?;
    let plan = shading.plan;
    shading.cache = records.map(|records| Cache::resumed(records, plan, &last.frame)).transpose()?;
    shading.places = Movement::to(&last.frame, &[]).places;
    let pixels = last.frame.seen.pixels.samples().len();
    let fits = |still: &ReadStill| still.coverage.as_ref().is_none_or(|coverage| coverage.fits(pixels));
    if !still.iter().all(fits) {
        return Err(Error::Checkpoint(NONSENSE.into()));
    }
    shading.still = still.map(|ReadStill { samples, coverage, cache_records }| {
        Still::new(&last.frame, samples, coverage, cache_records)
    });
    shading.calibration = calibration;
    shading.carry = carried.map(|light| Carry::resumed(light, &last.frame));
    Ok(())
}
