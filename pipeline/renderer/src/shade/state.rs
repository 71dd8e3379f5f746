//! State of shading between two frames, as bytes for checkpoints.

use super::Shading;
use super::importance::Before;
use super::lit_frame::{LitFrame, Reused, StoredLight};
use super::movement::Movement;
use crate::frame::PreparedFrame;
use lighttree::Calibration;
use pipeline::error::{Error, Result};
use pipeline::state::{NONSENSE, decode, encode};
use serde::{Deserialize, Serialize};

/// State of shading with borrowed data, for serialization.
#[derive(Serialize)]
struct WrittenState<'a> {
    /// States of the layers, in order.
    layers: Vec<Vec<u8>>,
    still: Option<&'a StoredLight>,
    calibration: Option<&'a Calibration>,
    looking: Option<&'a Before>,
}

/// State of shading with owned data, for deserialization.
#[derive(Deserialize)]
struct Read {
    layers: Vec<Vec<u8>>,
    still: Option<StoredLight>,
    calibration: Option<Calibration>,
    looking: Option<Before>,
}

pub(super) fn of(shading: &Shading) -> Vec<u8> {
    let Shading { layers, still, calibration, looking, .. } = shading;
    let still = still.as_ref().map(|frame| &frame.light);
    let looking = looking.as_ref().and_then(|looking| looking.state());
    encode(&WrittenState { layers: layers.states(), still, calibration: calibration.as_ref(), looking })
}

/// Restores the state of shading after frame `last`.
pub(super) fn restore(shading: &mut Shading, state: &[u8], last: &PreparedFrame) -> Result<()> {
    let Read { layers, still, calibration, looking } = decode(state)?;
    shading.layers.restore(&layers, &last.frame)?;
    // Derive the previous poses from the scene: checkpoints do not contain them.
    shading.places = Movement::to(&last.frame, &[]).places;

    // Check the size: a forged state may have another number of pixels.
    let pixels = &last.frame.seen.pixels;
    let (width, height, count) = (pixels.width(), pixels.height(), pixels.samples().len());
    let fits = |light: &StoredLight| {
        light.coverage.as_ref().is_none_or(|coverage| coverage.fits(count))
            && light.fine.as_ref().is_none_or(|fine| fine.fits(count))
            && light.layers.iter().all(|layers| layers.fits(count))
            && light.importance.as_ref().is_none_or(|map| map.fits(width, height))
    };
    if !still.iter().all(fits) {
        return Err(Error::Checkpoint(NONSENSE.into()));
    }
    shading.still = still.map(|light| LitFrame::new(&last.frame, light, Reused::default()));
    shading.calibration = calibration;
    if let Some(own) = &mut shading.looking {
        own.restore(looking, (width, height))?;
    }
    Ok(())
}
