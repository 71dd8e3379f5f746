//! A record: where it is, what light was found there, and how far around it that holds.

use super::illumination::{Computed, LocalIrradiance, Site};
use super::radius::radius;

/// A site with its light.
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Record<R> {
    pub site: Site,
    pub estimate: LocalIrradiance,
    pub recipe: R,
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

impl<R> Record<R> {
    pub fn new(
        site: Site,
        scale: f32,
        Computed { light: estimate, recipe }: Computed<R>,
        number: u32,
        frame: u32,
    ) -> Self {
        let radius = radius(&estimate);
        Self {
            site,
            estimate,
            recipe,
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
        self.recipe = recipe;
    }
}
