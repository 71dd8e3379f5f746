//! Recipe of a record: lightcut and final gather, stored so that an update is cheap.

use crate::shade::gradient_sum::GradientSum;
use glam::Vec3A;
use lighttree::Cluster;
use render_core::cache::Site;
use render_core::{Gathered, PACKET};

/// Lightcut and final gather of a record.
#[derive(Clone, serde::Serialize, serde::Deserialize)]
pub(super) struct Recipe {
    /// Number of clusters in the lightcut.
    pub size: u32,
    /// Clusters of the lightcut; empty in static scenes, because they would fill most of a film's memory.
    pub clusters: Box<[Cluster]>,
    /// Visibility of the clusters, with one bit per cluster and one word per [`PACKET`].
    pub visible: Box<[u64]>,
    pub surroundings: Gathered,
    /// Reflected light that is not in the lightcut, in films with known light.
    pub reflected: GradientSum,
    /// Whether a moving object was near when the final gather was traced.
    pub near_moving: bool,
    /// Position and normal of the record when its lightcut was computed.
    pub position: Vec3A,
    pub normal: Vec3A,
    /// Permitted error of a cluster's irradiance, as luminance \[W·m⁻²\].
    pub threshold: f32,
}

impl Recipe {
    /// Returns the recipe of a record in the open without light.
    pub fn dark(site: &Site) -> Self {
        Self {
            size: 0,
            clusters: Box::default(),
            visible: Box::default(),
            surroundings: Gathered::of_distances(f32::INFINITY, f32::INFINITY),
            reflected: GradientSum::ZERO,
            near_moving: false,
            position: site.position,
            normal: site.normal,
            threshold: 0.0,
        }
    }

    /// Discards all data that a static record does not need. The distances of the record's surroundings remain.
    pub fn forget_light(&mut self) {
        (self.clusters, self.visible) = Default::default();
        self.surroundings.forget_light();
    }

    /// Returns whether the clusters were discarded.
    pub fn has_forgotten(&self) -> bool {
        self.clusters.len() != self.size as usize
    }

    /// Returns the clusters in groups of [`PACKET`], each with the bits of the visible clusters.
    pub fn packets(&mut self) -> impl Iterator<Item = (&[Cluster], &mut u64)> {
        self.clusters.chunks(PACKET).zip(&mut self.visible)
    }

    /// Returns the visible clusters.
    pub fn seen_clusters(&self) -> impl Iterator<Item = Cluster> {
        let seen = |&(i, _): &(usize, &Cluster)| self.visible[i / PACKET] >> (i % PACKET) & 1 == 1;
        self.clusters.iter().enumerate().filter(seen).map(|(_, &cluster)| cluster)
    }
}
