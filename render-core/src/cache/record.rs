//! Record of the cache: a site with its light and radius.

use super::illumination::{Computed, LocalIrradiance, MOST_WAITED, Site};
use super::radius::radius;
use crate::luminance;
use crate::ranks::{Assignment, Ranks};
use ranks::portable;

/// Change of a record's light, in tolerances, that may wait for an update.
const WAITING: f32 = 0.25;
/// Fraction of a rate that remains after an update with less change.
const FADING: f32 = 0.7;

/// Record: a site with its light.
#[derive(Clone)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Record<R> {
    pub site: Site,
    pub estimate: LocalIrradiance,
    /// Recipe of the light, or `None` on ranks that do not own the record.
    pub recipe: Option<R>,
    /// Number of the recipe, see [`Illumination::note`](super::Illumination::note).
    pub note: u32,
    /// Radius before clamping by the view, in `radius_in_view` \[m\].
    pub radius: f32,
    /// Maximum radius that the neighbors allowed at the record's creation \[m\].
    pub radius_by_neighbors: f32,
    /// Fraction of the radius that remains after contradictions by neighbors, 0…1 (`doubt.rs`).
    pub share: f32,
    /// Value of `scale` in the last call of [`openness`](super::Illumination::openness) \[m\].
    pub scale: f32,
    /// Creation number of the record.
    pub number: u32,
    /// Whether the record has moved since its last update.
    pub moved: bool,
    /// Frame of the last update.
    pub current: u32,
    /// Last frame in which an update waited.
    pub waited: u32,
    /// Change of the irradiance's luminance per frame \[W·m⁻²\], from the last updates; infinite before the first.
    pub rate: f32,
    /// Frame in which the record last lit a pixel.
    pub seen: u32,
}

/// Recipe of a record, for transfer between ranks.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct KeptRecipe<R> {
    /// Creation number of the record.
    pub number: u32,
    /// Recipe, see [`Illumination::Recipe`](super::Illumination::Recipe).
    pub recipe: R,
}

/// Light of a record, for transfer from its rank to all other ranks.
#[derive(Clone, Copy)]
pub(super) struct RecordLight {
    pub estimate: LocalIrradiance,
    pub note: u32,
    /// Whether the light was recomputed rather than relit.
    pub afresh: bool,
}

portable!(RecordLight { estimate, note, afresh });

impl<R> Record<R> {
    /// Returns a record needed in `frame`, with the `scale` of its openness. The rank that computed the light adds the
    /// recipe.
    pub fn new(
        site: Site,
        scale: f32,
        RecordLight { estimate, note, .. }: RecordLight,
        number: u32,
        frame: u32,
    ) -> Self {
        let radius = radius(&estimate);
        Self {
            site,
            estimate,
            recipe: None,
            note,
            radius,
            radius_by_neighbors: f32::INFINITY,
            share: 1.0,
            scale,
            number,
            moved: false,
            current: frame,
            waited: 0,
            rate: f32::INFINITY,
            seen: frame,
        }
    }

    /// Returns whether the record may keep its light in `frame`, because the light changes slowly:
    ///
    /// ```text
    /// the update waits for up to k frames if k ρ ≤ WAITING T        ρ  rate        T  tolerance        k  2 or 4
    /// ```
    pub fn waits(&self, frame: u32) -> bool {
        let longest = WAITING * self.estimate.tolerance / self.rate;
        let Some(k) = [MOST_WAITED as u32, 2].into_iter().find(|&k| k as f32 <= longest) else { return false };
        // Numbers spread the updates evenly over the frames.
        !self.moved && frame - self.current < k && !self.number.wrapping_add(frame).is_multiple_of(k)
    }

    /// Sets the light of `frame` and updates the radius. The limit by neighbors is unchanged.
    pub fn relit(&mut self, frame: u32, estimate: LocalIrradiance) {
        // Long pauses between changes do not lower the rate.
        let change = luminance(estimate.irradiance - self.estimate.irradiance).abs();
        let rate = change / (frame - self.current).clamp(1, MOST_WAITED as u32) as f32;
        self.rate = if self.rate == f32::INFINITY { rate } else { rate.max(FADING * self.rate) };
        (self.current, self.moved) = (frame, false);

        self.radius = radius(&estimate).min(self.radius_by_neighbors);
        self.estimate = estimate;
    }

    /// Replaces everything except the site.
    pub fn computed_afresh(&mut self, frame: u32, Computed { light: estimate, recipe }: Computed<R>) {
        self.relit(frame, estimate);
        self.recipe = Some(recipe);
    }

    /// Returns the rank that computes the record's light and stores its recipe.
    pub fn owner(&self, ranks: &dyn Ranks) -> usize {
        self.assignment().owner(ranks.count())
    }

    /// Returns the owner assignment of the record: a golden sequence over creation numbers. The sequence also spreads
    /// the records of one refresh frame (every 32nd) evenly over the ranks.
    pub fn assignment(&self) -> Assignment {
        Assignment::Golden(self.number)
    }

    /// Returns the record's light for transfer to other ranks.
    pub fn light(&self, afresh: bool) -> RecordLight {
        RecordLight { estimate: self.estimate, note: self.note, afresh }
    }
}
