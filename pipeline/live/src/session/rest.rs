//! Refinement of a static view: light that motion left out, then finer quantisers and samples, then light within finer
//! thresholds, then nothing.

use crate::picture::{Detail, LivePicture};

/// Ratio of thresholds above which light is computed again: finer light would be visible.
const VISIBLE: f64 = 1.5;
/// Minimum number of fine pictures of a static view. The second one has the thresholds of the first.
const LEAST: u32 = 2;
/// Fraction of open pixels below which all of them are lit in one picture.
const FEW_OPEN: f64 = 0.02;
/// Maximum number of limited pictures of a static view. In each, light is computed for some pixels.
const MOST_LIMITED: u32 = 40;

/// Progress of a static view.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Rest {
    /// Largest mean threshold at which light in use was computed, relative to luminance.
    coarsest: f64,
    /// Mean threshold that follows from the last picture.
    newest: f64,
    /// Finest quantiser of the pictures of this view; `None` before the first fine one.
    finest: Option<u32>,
    /// Number of fine pictures of this view.
    pictures: u32,
    /// Fraction of open pixels in the last picture, which its budget left with larger errors than permitted.
    open_share: f64,
    /// Number of limited pictures of this view.
    limited: u32,
}

/// Next picture of a static view.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RestStep {
    /// quantiser_scale.
    pub quantiser_scale: u32,
    /// Whether all light is computed again.
    pub is_fresh: bool,
    /// Whether light is computed for some of the open pixels only, without further samples.
    pub is_limited: bool,
}

impl Rest {
    /// Notes a picture of a moving view: the refinement starts again.
    pub fn moved(&mut self, picture: &LivePicture) {
        self.coarsest = self.coarsest.max(picture.threshold_mean_relative);
        (self.newest, self.finest, self.pictures) = (picture.threshold_mean_relative, None, 0);
        (self.open_share, self.limited) = (picture.open_share, 0);
    }

    /// Notes a picture of a static view.
    pub fn refined(&mut self, picture: &LivePicture, detail: Detail, is_fresh: bool) {
        self.newest = picture.threshold_mean_relative;
        self.coarsest = if is_fresh { self.newest } else { self.coarsest.max(self.newest) };
        self.open_share = picture.open_share;
        self.limited += u32::from(detail == Detail::Plain);
        if detail == Detail::Fine {
            let quantiser = picture.packet.quantiser_scale;
            self.finest = Some(self.finest.map_or(quantiser, |finest| finest.min(quantiser)));
            self.pictures += 1;
        }
    }

    /// Returns the next step towards quantiser_scale `best`; `None` if the view is finished. `affordable` is the finest
    /// quantiser that the line permits for this picture.
    #[must_use]
    pub fn next(&self, best: u32, affordable: u32) -> Option<RestStep> {
        let is_coarse = self.coarsest > VISIBLE * self.newest;
        if self.open_share > FEW_OPEN && self.limited < MOST_LIMITED {
            return Some(RestStep { quantiser_scale: affordable.max(best), is_fresh: false, is_limited: true });
        }
        match self.finest {
            // Light is computed again only with the thresholds of a fine picture.
            Some(finest) if finest <= best && self.pictures >= LEAST => {
                is_coarse.then_some(RestStep { quantiser_scale: best, is_fresh: true, is_limited: false })
            }
            // Quantisers become finer with each picture, even on a thin line.
            finest => {
                let finer = finest.map_or(affordable, |finest| affordable.min((finest * 3 / 4).max(1)));
                Some(RestStep { quantiser_scale: finer.max(best), is_fresh: false, is_limited: false })
            }
        }
    }
}
