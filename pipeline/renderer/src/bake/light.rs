//! Light of texels: direct irradiance, and indirect irradiance by lightcuts and final gather.
//!
//! ```text
//! 1  choose a point outside of geometry for each texel
//! 2  compute direct light, in blocks of texels
//! 3  light every fourth texel alone: the lightcut stops at 1 % of the texel's own light
//! 4  light the other texels in blocks: lightcuts stop at 1 % of the light between the texels of step 3
//! 5  light further points of texels that differ from their neighbors, as in step 4, and use the mean
//! 6  fill texels without a point from their neighbors
//! 7  correct texels at seams, so that both sides agree
//! ```
//!
//! Step 5 is antialiasing. On `nave`, the centers of a row of texels are in the gap behind a book rest. Without step 5,
//! the whole back of the pew would be as dark as the gap.
//!
//! Blocks are squares of 8×8 texels of one chart. They share a traversal of the light tree and packets of shadow rays.

use super::blocks::{TexelBlock, blocks};
use super::inside::Places;
use super::loops::{BakeLoops, LoopEnd};
use super::seams;
use crate::Visibility;
use crate::frame::Frame;
use glam::{Vec3, Vec3A};
use lighttree::{Lambert, Light, Lightcut, Receivers, Scratch, Stop};
use render_core::ranks::portable;
use render_core::{Atlas, ShadingPoint, luminance};
use std::cell::Cell;
use std::f32::consts::PI;

/// Number of passes over all texels, each counted in the progress.
pub(super) const PASSES: usize = 3;

/// Permitted error of a cluster in the lightcut of a texel that is lit alone, as a fraction of the texel's light. With
/// 2 %, a box under a uniform sky has up to 1.2 % error.
const ALONE: f32 = 0.01;
/// Permitted error of a cluster in the lightcut of texels that are lit together with known thresholds, as a fraction of
/// their light.
const TOGETHER: f32 = 0.01;

/// Maximum number of receivers that share a traversal of the light tree.
const TOGETHER_AT_MOST: usize = 64;

/// Minimum difference in luminance between a texel unlike its neighbors and their mean, as a fraction of the larger
/// value. Tuned on `nave`.
const UNLIKE: f32 = 0.3;
/// Maximum number of additional points of a texel unlike its neighbors.
const FURTHER: usize = 4;

/// Irradiance of the texels of an atlas \[W·m⁻²\], linear RGB.
pub(super) struct TexelLight {
    pub direct: Vec<[f32; 3]>,
    pub indirect: Vec<[f32; 3]>,
    /// Number of texels without a shading point.
    pub filled: usize,
}

impl TexelLight {
    /// Returns the total irradiance of a texel \[W·m⁻²\].
    pub fn irradiance(&self, texel: usize) -> Vec3 {
        Vec3::from(self.direct[texel]) + Vec3::from(self.indirect[texel])
    }

    /// Returns the mean luminance of the irradiance of all texels \[W·m⁻²\].
    pub fn mean(&self) -> f32 {
        let mut sum = 0.0;
        for texel in 0..self.direct.len() {
            sum += f64::from(luminance(self.irradiance(texel)));
        }
        (sum / self.direct.len().max(1) as f64) as f32
    }
}

/// Irradiance of the texels of an atlas \[W·m⁻²\]; indirect irradiance is `None` until it is computed.
struct KnownLight {
    direct: Vec<[f32; 3]>,
    indirect: Vec<Option<[f32; 3]>>,
}

/// Reusable memory of a thread for its blocks.
#[derive(Default)]
struct BlockScratch {
    walk: Scratch,
    cuts: Vec<Lightcut>,
}

/// Irradiance of a texel after the first pass \[W·m⁻²\].
struct FirstLight {
    texel: u32,
    direct: [f32; 3],
    indirect: Option<[f32; 3]>,
}

/// Direct and indirect irradiance of a texel \[W·m⁻²\].
#[derive(Clone, Copy)]
struct TwoLights {
    texel: u32,
    direct: Vec3,
    indirect: Vec3,
}

portable!(FirstLight { texel, direct, indirect });
portable!(TwoLights { texel, direct, indirect });

/// A texel and its shading point.
#[derive(Clone, Copy)]
struct Receiver {
    texel: usize,
    point: ShadingPoint,
}

/// The baked scene, and the shading points of its texels.
struct TexelBaker<'a> {
    atlas: &'a Atlas,
    frame: &'a Frame<'a>,
    visibility: &'a Visibility<'a>,
    points: &'a [Option<ShadingPoint>],
    /// Whether final gather restores the light lost by clamping virtual lights.
    compensates: bool,
}

/// Lights the texels of the atlas of `places` at `points`; `None` marks a texel without a point. `progress` is called
/// with the number of texels done, summed over all [`PASSES`] passes.
pub(super) fn light(
    places: &Places,
    points: &[Option<ShadingPoint>],
    compensates: bool,
    loops: &mut BakeLoops,
    progress: &dyn Fn(usize),
) -> Result<TexelLight, LoopEnd> {
    let &Places { atlas, frame, visibility, .. } = places;
    let bake = TexelBaker { atlas, frame, visibility, points, compensates };
    let blocks = blocks(atlas);
    let count = blocks.len();
    let done = Cell::new(0);
    let tell = |block: usize| {
        done.set(done.get() + blocks[block].texels.len());
        progress(done.get());
    };

    // Compute direct light, and indirect light of every fourth texel.
    let first = loops.each(count, Scratch::default, |scratch, block| bake.first(&blocks[block], scratch), tell)?;
    let mut known = KnownLight { direct: vec![[0.0; 3]; atlas.len()], indirect: vec![None; atlas.len()] };
    for lit in first.into_iter().flatten() {
        let texel = lit.texel as usize;
        (known.direct[texel], known.indirect[texel]) = (lit.direct, lit.indirect);
    }

    // Light the other texels, with thresholds from the light around them.
    let rest = |scratch: &mut BlockScratch, block: usize| bake.rest(&blocks[block], &known, scratch);
    let rest = loops.each(count, BlockScratch::default, rest, tell)?;
    for (texel, light) in rest.into_iter().flatten() {
        known.indirect[texel as usize] = Some(light);
    }

    // Light further points of texels that are unlike their neighbors, and use the mean.
    let finer = |scratch: &mut BlockScratch, block: usize| bake.finer(&blocks[block], places, &known, scratch);
    let finer = loops.each(count, BlockScratch::default, finer, tell)?;
    for lit in finer.into_iter().flatten() {
        let texel = lit.texel as usize;
        (known.direct[texel], known.indirect[texel]) = (lit.direct.to_array(), Some(lit.indirect.to_array()));
    }

    // Fill the texels inside geometry from their neighbors.
    let filled = points.iter().filter(|point| point.is_none()).count();
    let KnownLight { mut direct, mut indirect } = known;
    fill(atlas, points, &mut direct, &mut indirect);
    let mut indirect: Vec<[f32; 3]> = indirect.into_iter().map(Option::unwrap_or_default).collect();
    seams::close(places, points, [&mut direct, &mut indirect]);
    Ok(TexelLight { direct, indirect, filled })
}

impl TexelBaker<'_> {
    /// Returns the texels of a block that have a shading point.
    fn receivers(&self, block: &TexelBlock) -> Vec<Receiver> {
        let mut receivers = Vec::new();
        for &texel in &block.texels {
            if let Some(point) = self.points[texel] {
                receivers.push(Receiver { texel, point });
            }
        }
        receivers
    }

    /// Computes the direct light of a block, and the indirect light of every fourth texel.
    fn first(&self, block: &TexelBlock, scratch: &mut Scratch) -> Vec<FirstLight> {
        let receivers = self.receivers(block);
        let points: Vec<ShadingPoint> = receivers.iter().map(|receiver| receiver.point).collect();
        let direct = self.frame.direct.irradiance_tile(&self.frame.accelerator, &points).value;
        let mut lit = Vec::new();
        for (receiver, direct) in receivers.iter().zip(direct) {
            let (x, y) = self.atlas.place(receiver.texel);
            // Choose one texel of each 2×2 square: most other texels then have a lit neighbor.
            let is_first = x % 2 == 0 && y % 2 == 0;
            let indirect = is_first.then(|| self.alone(receiver, direct, scratch).to_array());
            lit.push(FirstLight { texel: receiver.texel as u32, direct: direct.to_array(), indirect });
        }
        lit
    }

    /// Computes the indirect light of a block's remaining texels.
    fn rest(&self, block: &TexelBlock, known: &KnownLight, scratch: &mut BlockScratch) -> Vec<(u32, [f32; 3])> {
        let KnownLight { direct, indirect } = known;
        let mut lit = Vec::new();

        // Derive thresholds from lit neighbors, and light texels without lit neighbors alone.
        let (mut waiting, mut thresholds) = (Vec::new(), Vec::new());
        for receiver in self.receivers(block) {
            let texel = receiver.texel;
            if indirect[texel].is_some() {
                continue;
            }
            let of_direct = Vec3::from(direct[texel]);
            match self.around(texel, indirect) {
                Some(expected) => {
                    thresholds.push(TOGETHER * luminance(expected + of_direct));
                    waiting.push(receiver);
                }
                None => lit.push((texel as u32, self.alone(&receiver, of_direct, &mut scratch.walk).to_array())),
            }
        }

        // Light the texels with thresholds in one traversal of the light tree.
        let lights = self.together(&waiting, &thresholds, scratch);
        lit.extend(waiting.iter().zip(lights).map(|(receiver, light)| (receiver.texel as u32, light.to_array())));
        lit
    }

    /// Computes the light of a block's texels that are unlike their neighbors, as the mean over further points.
    fn finer(
        &self,
        block: &TexelBlock,
        places: &Places,
        known: &KnownLight,
        scratch: &mut BlockScratch,
    ) -> Vec<TwoLights> {
        let KnownLight { direct, indirect } = known;
        // Collect the further points, and the light at the first point of each texel.
        let (mut receivers, mut owners, mut sums) = (Vec::new(), Vec::new(), Vec::new());
        for &texel in &block.texels {
            let Some(own) = self.unlike(texel, indirect) else { continue };
            for point in places.others(texel, FURTHER) {
                receivers.push(Receiver { texel, point });
                owners.push(sums.len());
            }
            sums.push((TwoLights { texel: texel as u32, direct: Vec3::from(direct[texel]), indirect: own }, 1.0));
        }

        // Light the further points. They are about as bright as the first point, which determines the thresholds.
        for (receivers, owners) in receivers.chunks(TOGETHER_AT_MOST).zip(owners.chunks(TOGETHER_AT_MOST)) {
            let points: Vec<ShadingPoint> = receivers.iter().map(|receiver| receiver.point).collect();
            let of_direct = self.frame.direct.irradiance_tile(&self.frame.accelerator, &points).value;
            let mut thresholds = Vec::new();
            for (receiver, &of_direct) in receivers.iter().zip(&of_direct) {
                let expected = indirect[receiver.texel].map_or(Vec3::ZERO, Vec3::from);
                thresholds.push(TOGETHER * luminance(expected + of_direct));
            }
            let of_indirect = self.together(receivers, &thresholds, scratch);
            for ((&owner, direct), indirect) in owners.iter().zip(of_direct).zip(of_indirect) {
                let (sum, count) = &mut sums[owner];
                (sum.direct, sum.indirect, *count) = (sum.direct + direct, sum.indirect + indirect, *count + 1.0);
            }
        }

        // Average over the first point and all further points of each texel.
        for (sum, count) in &mut sums {
            (sum.direct, sum.indirect) = (sum.direct / *count, sum.indirect / *count);
        }
        sums.into_iter().map(|(mean, _)| mean).collect()
    }

    /// Returns the indirect light of a texel unlike its neighbors, and `None` for other texels.
    fn unlike(&self, texel: usize, indirect: &[Option<[f32; 3]>]) -> Option<Vec3> {
        self.points[texel]?;
        let (own, around) = (Vec3::from(indirect[texel]?), self.around(texel, indirect)?);
        let (of_own, of_around) = (luminance(own), luminance(around));
        ((of_own - of_around).abs() > UNLIKE * of_own.max(of_around)).then_some(own)
    }

    /// Computes the indirect irradiance \[W·m⁻²\] of at most 64 nearby receivers with known thresholds.
    fn together(&self, waiting: &[Receiver], thresholds: &[f32], scratch: &mut BlockScratch) -> Vec<Vec3> {
        let BlockScratch { walk, cuts } = scratch;
        let whites: Vec<Lambert> = waiting.iter().map(|receiver| white(&receiver.point)).collect();
        let positions: Vec<Vec3A> = waiting.iter().map(|receiver| receiver.point.position).collect();
        let sees = |lamp: &Light, _: usize, rays: u64| {
            let points = waiting.iter().map(|receiver| &receiver.point);
            self.visibility.lit_among(lamp, points, &positions, rays)
        };
        self.frame.tree.lightcuts(Receivers { receivers: &whites, thresholds }, sees, walk, cuts);

        // Restore the light that clamping has removed, for each receiver alone.
        let mut lights = Vec::with_capacity(waiting.len());
        for (receiver, cut) in waiting.iter().zip(&*cuts) {
            lights.push(cut.radiance + self.compensation(receiver));
        }
        lights
    }

    /// Computes the indirect irradiance \[W·m⁻²\] of a single texel with the given `direct` irradiance.
    fn alone(&self, receiver: &Receiver, direct: Vec3, scratch: &mut Scratch) -> Vec3 {
        let stop = Stop::Relative { fraction: ALONE, known_luminance: luminance(direct) };
        let sees = |lamp: &Light, _: usize| self.visibility.sees(&receiver.point, lamp);
        let cut = self.frame.tree.lightcut(&white(&receiver.point), stop, sees, scratch);
        cut.radiance + self.compensation(receiver)
    }

    /// Returns the irradiance \[W·m⁻²\] from nearby surfaces that is lost by clamping virtual lights.
    fn compensation(&self, receiver: &Receiver) -> Vec3 {
        if !self.compensates {
            return Vec3::ZERO;
        }
        let found = self.visibility.final_gather(&receiver.point, receiver.texel as u64);
        self.frame.gather.compensation(&found).irradiance
    }

    /// Returns the mean indirect light of a texel's lit neighbors, `None` without lit neighbors.
    fn around(&self, texel: usize, indirect: &[Option<[f32; 3]>]) -> Option<Vec3> {
        let (mut sum, mut count) = (Vec3::ZERO, 0);
        for neighbor in self.atlas.neighbors(texel).into_iter().flatten() {
            if let Some(light) = indirect[neighbor as usize] {
                (sum, count) = (sum + Vec3::from(light), count + 1);
            }
        }
        (count > 0).then(|| sum / count as f32)
    }
}

/// Returns a receiver with reflectance π, for which radiance equals irradiance.
fn white(point: &ShadingPoint) -> Lambert {
    Lambert { position: point.position.into(), normal: point.normal.into(), reflectance: Vec3::splat(PI) }
}

/// Fills texels without a point with the mean of their neighbors in the chart, from the edges inward.
fn fill(atlas: &Atlas, points: &[Option<ShadingPoint>], direct: &mut [[f32; 3]], indirect: &mut [Option<[f32; 3]>]) {
    let mut missing: Vec<usize> = (0..atlas.len()).filter(|&texel| points[texel].is_none()).collect();
    while !missing.is_empty() {
        // Compute the means before any texel changes, so that texels are independent of order.
        let mut found = Vec::new();
        for &texel in &missing {
            let (mut sum, mut of_direct, mut count) = (Vec3::ZERO, Vec3::ZERO, 0);
            for neighbor in atlas.neighbors(texel).into_iter().flatten() {
                if let Some(light) = indirect[neighbor as usize] {
                    sum += Vec3::from(light);
                    of_direct += Vec3::from(direct[neighbor as usize]);
                    count += 1;
                }
            }
            if count > 0 {
                found.push((texel, sum / count as f32, of_direct / count as f32));
            }
        }
        // End if only charts without any point remain.
        if found.is_empty() {
            return;
        }
        for (texel, light, of_direct) in found {
            (indirect[texel], direct[texel]) = (Some(light.to_array()), of_direct.to_array());
        }
        missing.retain(|&texel| indirect[texel].is_none());
    }
}
