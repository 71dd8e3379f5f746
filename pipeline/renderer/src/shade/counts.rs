//! Counts of the work of a layer. Sums and maxima of integers: the same in any order.

use std::ops::AddAssign;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};

/// Counts that many threads add to while a layer is computed.
#[derive(Debug, Default)]
pub(super) struct Counts {
    cuts: AtomicU64,
    clusters: AtomicU64,
    largest: AtomicU32,
    rays: AtomicU64,
    /// Errors of cuts that were audited.
    pub audits: lighttree::Audits,
    /// Largest cut of each pixel, where that is requested.
    by_pixel: Vec<AtomicU32>,
}

/// Cuts of a layer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CutCounts {
    /// Cuts that were made.
    pub cuts: u64,
    /// Clusters of all of them.
    pub clusters: u64,
    /// Clusters of the largest.
    pub largest: u32,
}

/// Records of an irradiance cache.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RecordCounts {
    /// Records that pixels took light from: the most of any sample of the pixels.
    pub in_use: u64,
    /// Records that were made, or made anew.
    pub computed: u64,
}

impl Counts {
    /// Counts that also keep the largest cut of each pixel; `before` has those of other samples of the frame.
    pub fn by_pixel(before: &[u32]) -> Self {
        Self { by_pixel: before.iter().map(|&size| AtomicU32::new(size)).collect(), ..Self::default() }
    }

    /// A cut of `size` clusters for which `rays` shadow rays were cast.
    pub fn count(&self, size: u32, rays: u32) {
        self.cuts.fetch_add(1, Ordering::Relaxed);
        self.clusters.fetch_add(size.into(), Ordering::Relaxed);
        self.largest.fetch_max(size, Ordering::Relaxed);
        self.count_rays(rays);
    }

    /// A cut of `size` clusters was made for the pixel at `index`.
    pub fn note(&self, index: usize, size: u32) {
        if let Some(cell) = self.by_pixel.get(index) {
            cell.fetch_max(size, Ordering::Relaxed);
        }
    }

    /// Shadow rays besides.
    pub fn count_rays(&self, rays: u32) {
        self.rays.fetch_add(rays.into(), Ordering::Relaxed);
    }

    /// Cuts so far.
    pub fn cuts(&self) -> CutCounts {
        CutCounts {
            cuts: self.cuts.load(Ordering::Relaxed),
            clusters: self.clusters.load(Ordering::Relaxed),
            largest: self.largest.load(Ordering::Relaxed),
        }
    }

    /// Shadow rays so far.
    pub fn rays(&self) -> u64 {
        self.rays.load(Ordering::Relaxed)
    }

    /// Largest cut of each pixel, nothing unless that was requested, and the errors of audits.
    pub fn into_parts(self) -> (Vec<u32>, lighttree::Audits) {
        (self.by_pixel.into_iter().map(AtomicU32::into_inner).collect(), self.audits)
    }
}

impl AddAssign for CutCounts {
    fn add_assign(&mut self, other: Self) {
        self.cuts += other.cuts;
        self.clusters += other.clusters;
        self.largest = self.largest.max(other.largest);
    }
}

impl AddAssign for RecordCounts {
    /// Samples of a pixel share records: those in use are not summed.
    fn add_assign(&mut self, other: Self) {
        self.in_use = self.in_use.max(other.in_use);
        self.computed += other.computed;
    }
}
