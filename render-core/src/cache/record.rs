//! A record: its site, its light and its radius.

use super::illumination::{Computed, LocalIrradiance, Site};
use super::radius::radius;
use crate::ranks::{Ranks, Turn};
use ranks::portable;

/// A site with its light.
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Record<R> {
    pub site: Site,
    pub estimate: LocalIrradiance,
    /// Recipe of the light; `None` on ranks that do not own the record.
    pub recipe: Option<R>,
    /// [`Illumination::note`](super::Illumination::note) of the recipe.
    pub note: u32,
    /// Radius before limits by the picture \[m\].
    pub radius: f32,
    /// Maximum radius allowed by the neighbors when it was made \[m\].
    pub radius_by_neighbors: f32,
    /// Fraction of its radius that remains after contradictions by neighbors, 0…1 (`doubt.rs`).
    pub share: f32,
    /// `scale` of the last call of [`openness`](super::Illumination::openness) \[m\].
    pub scale: f32,
    /// Number in the order of creation.
    pub number: u32,
    /// Whether it has moved since its last update.
    pub carried: bool,
    /// Frame of its last update.
    pub current: u32,
    /// Frame in which it last lit a pixel.
    pub seen: u32,
}

/// The recipe of a record, for transfer between ranks.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct KeptRecipe<R> {
    /// Number of the record.
    pub number: u32,
    /// Recipe, see [`Illumination::Recipe`](super::Illumination::Recipe).
    pub recipe: R,
}

/// Light of a record, for transfer from its rank to all others.
#[derive(Clone, Copy)]
pub(super) struct RecordLight {
    pub estimate: LocalIrradiance,
    pub note: u32,
    /// Whether it was recomputed rather than relit.
    pub afresh: bool,
}

portable!(RecordLight { estimate, note, afresh });

impl<R> Record<R> {
    /// Returns a record needed in `frame`, with the `scale` of its openness. The rank that computed it adds the recipe.
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
            carried: false,
            current: frame,
            seen: frame,
        }
    }

    /// Sets new light and updates the radius. The limit by neighbors stays.
    pub fn relit(&mut self, estimate: LocalIrradiance) {
        self.radius = radius(&estimate).min(self.radius_by_neighbors);
        self.estimate = estimate;
    }

    /// Replaces everything except the site.
    pub fn computed_afresh(&mut self, Computed { light: estimate, recipe }: Computed<R>) {
        self.relit(estimate);
        self.recipe = Some(recipe);
    }

    /// Returns the rank that computes its light and stores its recipe.
    pub fn owner(&self, ranks: &dyn Ranks) -> usize {
        self.turn().owner(ranks.count())
    }

    /// Returns its owner assignment: a golden sequence over its number. It also spreads the records of one refresh
    /// frame (every 32nd) evenly over the ranks.
    pub fn turn(&self) -> Turn {
        Turn::Golden(self.number)
    }

    /// Returns its light for transfer to other ranks.
    pub fn light(&self, afresh: bool) -> RecordLight {
        RecordLight { estimate: self.estimate, note: self.note, afresh }
    }
}
