//! Counts of a layer's work: sums and maxima of integers, which are independent of order.

use std::ops::AddAssign;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};

/// Counts to which several threads add while a layer is computed.
#[derive(Debug, Default)]
pub(super) struct Counts {
    cuts: AtomicU64,
    clusters: AtomicU64,
    largest: AtomicU32,
    rays: AtomicU64,
    /// Errors of audited lightcuts.
    pub audits: lighttree::Audits,
    /// Size of each pixel's largest lightcut \[clusters\]; empty unless requested.
    by_pixel: Vec<AtomicU32>,
}

/// Counts of a layer's lightcuts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LightcutCounts {
    /// Number of lightcuts.
    pub cuts: u64,
    /// Total number of clusters in all lightcuts.
    pub clusters: u64,
    /// Maximum number of clusters in a lightcut.
    pub largest: u32,
}

/// Counts of irradiance cache records.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RecordCounts {
    /// Number of records that the pixels use: the maximum over the samples of a pixel.
    pub in_use: u64,
    /// Number of records created or recomputed.
    pub computed: u64,
}

impl Counts {
    /// Returns counts that include the largest lightcut of each pixel. `before` contains its size after the frame's
    /// earlier samples.
    pub fn by_pixel(before: &[u32]) -> Self {
        Self { by_pixel: before.iter().map(|&size| AtomicU32::new(size)).collect(), ..Self::default() }
    }

    /// Adds a lightcut of `size` clusters that needed `rays` shadow rays.
    pub fn count(&self, size: u32, rays: u32) {
        self.cuts.fetch_add(1, Ordering::Relaxed);
        self.clusters.fetch_add(size.into(), Ordering::Relaxed);
        self.largest.fetch_max(size, Ordering::Relaxed);
        self.count_rays(rays);
    }

    /// Raises the size for the pixel at `index` to `size` clusters if it is smaller.
    pub fn note(&self, index: usize, size: u32) {
        if let Some(cell) = self.by_pixel.get(index) {
            cell.fetch_max(size, Ordering::Relaxed);
        }
    }

    /// Adds `rays` shadow rays.
    pub fn count_rays(&self, rays: u32) {
        self.rays.fetch_add(rays.into(), Ordering::Relaxed);
    }

    /// Returns the counts of lightcuts.
    pub fn cuts(&self) -> LightcutCounts {
        LightcutCounts {
            cuts: self.cuts.load(Ordering::Relaxed),
            clusters: self.clusters.load(Ordering::Relaxed),
            largest: self.largest.load(Ordering::Relaxed),
        }
    }

    /// Returns the number of shadow rays.
    pub fn rays(&self) -> u64 {
        self.rays.load(Ordering::Relaxed)
    }

    /// Returns the size of each pixel's largest lightcut (empty unless requested) and the errors of audits.
    pub fn into_parts(self) -> (Vec<u32>, lighttree::Audits) {
        (self.by_pixel.into_iter().map(AtomicU32::into_inner).collect(), self.audits)
    }
}

impl AddAssign for LightcutCounts {
    fn add_assign(&mut self, other: Self) {
        self.cuts += other.cuts;
        self.clusters += other.clusters;
        self.largest = self.largest.max(other.largest);
    }
}

impl AddAssign for RecordCounts {
    /// Adds the computed records and keeps the maximum of records in use: samples of a pixel share records.
    fn add_assign(&mut self, other: Self) {
        self.in_use = self.in_use.max(other.in_use);
        self.computed += other.computed;
    }
}
