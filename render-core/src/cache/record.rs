//! A record: where it is, what light was found there, and how far around it that holds.

use super::illumination::{Computed, LocalIrradiance, Site};
use super::radius::radius;
use crate::ranks::{Ranks, Turn};
use ranks::portable;

/// A site with its light.
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Record<R> {
    pub site: Site,
    pub estimate: LocalIrradiance,
    /// On other ranks than the record's own there is none.
    pub recipe: Option<R>,
    /// [`Illumination::note`](super::Illumination::note) of the recipe.
    pub note: u32,
    /// How far around it may be used, before the picture has a say \[m\].
    pub radius: f32,
    /// The most that its neighbors allowed when it was made \[m\].
    pub radius_by_neighbors: f32,
    /// How much of its radius remains, 0…1, since its neighbors contradict what it predicts (`doubt.rs`).
    pub share: f32,
    /// `scale` of the last call of [`openness`](super::Illumination::openness) \[m\].
    pub scale: f32,
    /// Number in the order in which records were made.
    pub number: u32,
    /// Whether it was carried along since it was last brought up to date.
    pub carried: bool,
    /// Frame it was last brought up to date in.
    pub current: u32,
    /// Frame in which a pixel last took light from it.
    pub seen: u32,
}

/// The recipe of a record, as it goes from one rank to another.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct KeptRecipe<R> {
    /// Number of the record.
    pub number: u32,
    /// See [`Illumination::Recipe`](super::Illumination::Recipe).
    pub recipe: R,
}

/// Light that a record was given by its rank, as all others get it.
#[derive(Clone, Copy)]
pub(super) struct RecordLight {
    pub estimate: LocalIrradiance,
    pub note: u32,
    /// Whether it was computed from nothing.
    pub afresh: bool,
}

portable!(RecordLight { estimate, note, afresh });

impl<R> Record<R> {
    /// A record that `frame` needs, with the `scale` of its openness; its recipe is added where it was computed.
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

    /// New light, and what else is known now of the surroundings. What neighbors knew of them holds on.
    pub fn relit(&mut self, estimate: LocalIrradiance) {
        self.radius = radius(&estimate).min(self.radius_by_neighbors);
        self.estimate = estimate;
    }

    /// Everything new but the place.
    pub fn computed_afresh(&mut self, Computed { light: estimate, recipe }: Computed<R>) {
        self.relit(estimate);
        self.recipe = Some(recipe);
    }

    /// The rank that computes its light, and has its recipe.
    pub fn owner(&self, ranks: &dyn Ranks) -> usize {
        self.turn().owner(ranks.count())
    }

    /// By its number, golden: records are computed afresh in turns of 32, which these spread, too.
    pub fn turn(&self) -> Turn {
        Turn::Golden(self.number)
    }

    /// Its light as other ranks get it.
    pub fn light(&self, afresh: bool) -> RecordLight {
        RecordLight { estimate: self.estimate, note: self.note, afresh }
    }
}
