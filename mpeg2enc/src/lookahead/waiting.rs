//! A waiting frame and its measurements.

use super::{cost::halved, weights};
use crate::{
    Config, Picture, RestoreError,
    motion::{Candidates, quarter},
    restore::{ensure, is_whole},
    vector::HalfSample,
};
use plane::Plane;
use std::{
    collections::BTreeMap,
    sync::{Arc, OnceLock},
};

/// Upper bound on the sum of absolute differences of a block, transformed or plain.
const COST_MAX: u32 = 1 << 20;

/// A frame waiting to be coded.
#[derive(Clone)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Waiting {
    /// The frame extended to whole macroblocks.
    pub source: Arc<Picture>,
    /// Luma at half and a quarter of the width and height, computed on demand.
    #[cfg_attr(feature = "serde", serde(skip))]
    pub half: OnceLock<Plane<u8>>,
    #[cfg_attr(feature = "serde", serde(skip))]
    pub quarter: OnceLock<Plane<u8>>,
    /// Given candidate vectors of every macroblock, to the previous frame and to the next frame.
    pub known: [Option<Arc<[Candidates]>>; 2],
    /// Cost of every macroblock without prediction.
    #[cfg_attr(feature = "serde", serde(skip))]
    pub intra_costs: OnceLock<Arc<[u32]>>,
    /// Whether the frame is the I picture of a group.
    pub begins_group: bool,
    /// Factors of quantiser_scale of the macroblocks in 256ths, unless all are equal.
    pub weights: Option<Vec<u32>>,
    /// Match of every macroblock, for each distance to a reference frame.
    pub matches: BTreeMap<isize, Arc<[Match]>>,
    /// Best prediction of every macroblock in a B picture, for each pair of distances to the reference frames.
    pub two_sided: BTreeMap<(isize, isize), Arc<[TwoSided]>>,
}

impl Waiting {
    /// Checks that this frame is valid for an encoder with these settings.
    pub fn check(&self, config: &Config) -> Result<(), RestoreError> {
        let (columns, rows) = config.macroblock_counts();
        let count = columns * rows;
        ensure(is_whole(&self.source, columns, rows), "size of a waiting frame")?;
        let known = self.known.iter().flatten();
        ensure(known.clone().all(|known| known.len() == count), "number of given vectors")?;
        ensure(known.flat_map(|known| known.iter()).all(Candidates::is_plausible), "given vectors")?;
        let weights = self.weights.as_ref();
        ensure(weights.is_none() || config.varies(), "weights")?;
        ensure(
            weights.is_none_or(|weights| weights.len() == count && weights.iter().all(weights::is_plausible)),
            "weights",
        )?;
        // Reject vectors and costs that no measurement produces.
        let plausible = |found: &Match| found.vector.is_plausible() && found.cost <= COST_MAX;
        let matches = |matches: &Arc<[Match]>| matches.len() == count && matches.iter().all(plausible);
        ensure(self.matches.values().all(matches), "vectors between waiting frames")?;
        let plausible = |found: &TwoSided| found.cost <= COST_MAX && found.shares.iter().all(|&share| share <= 2);
        let two_sided = |found: &Arc<[TwoSided]>| found.len() == count && found.iter().all(plausible);
        ensure(self.two_sided.values().all(two_sided), "predictions between waiting frames")
    }

    pub fn half(&self) -> &Plane<u8> {
        self.half.get_or_init(|| halved(self.source.luma()))
    }

    pub fn quarter(&self) -> &Plane<u8> {
        self.quarter.get_or_init(|| quarter(self.source.luma()))
    }
}

/// Best vector of a block, and its cost.
#[derive(Clone, Copy)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Match {
    /// Vector in half samples of the half-size picture.
    pub vector: HalfSample,
    /// Sum of absolute differences, transformed or plain.
    pub cost: u32,
}

/// Best of three predictions of a B picture's macroblock.
#[derive(Clone, Copy)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct TwoSided {
    pub cost: u32,
    /// Fractions that are predicted forward and backward, in halves.
    pub shares: [u32; 2],
}
