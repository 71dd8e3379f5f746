//! Cut and final gather of a record, kept so that it can be lit again for less.

use glam::Vec3A;
use lighttree::Cluster;
use render_core::{Gathered, PACKET};

/// Cut and final gather of a record.
#[derive(serde::Serialize, serde::Deserialize)]
pub(super) struct Recipe {
    /// Number of clusters of the cut.
    pub size: u32,
    /// The clusters; none where lights and things are at rest, as they would fill most of the memory of a film.
    pub clusters: Box<[Cluster]>,
    /// Visibility of the clusters: a bit for each, a word for each [`PACKET`] of them.
    pub visible: Box<[u64]>,
    pub surroundings: Gathered,
    /// Whether something that moves stood near at the final gather.
    pub near_moving: bool,
    /// Where the record was when the cut was made, and the way it faced.
    pub position: Vec3A,
    pub normal: Vec3A,
    /// Luminance of irradiance that a cluster of the cut may be wrong by \[W·m⁻²\].
    pub threshold: f32,
}

impl Recipe {
    /// Keeps what a record at rest still needs: the distances of its surroundings.
    pub fn forget_light(&mut self) {
        (self.clusters, self.visible) = Default::default();
        self.surroundings.forget_light();
    }

    /// Whether its clusters were forgotten.
    pub fn has_forgotten(&self) -> bool {
        self.clusters.len() != self.size as usize
    }

    /// The clusters, [`PACKET`] at a time, with the bits of those that are seen.
    pub fn packets(&mut self) -> impl Iterator<Item = (&[Cluster], &mut u64)> {
        self.clusters.chunks(PACKET).zip(&mut self.visible)
    }

    /// The clusters that are seen.
    pub fn seen_clusters(&self) -> impl Iterator<Item = Cluster> {
        let seen = |&(i, _): &(usize, &Cluster)| self.visible[i / PACKET] >> (i % PACKET) & 1 == 1;
        self.clusters.iter().enumerate().filter(seen).map(|(_, &cluster)| cluster)
    }
}
