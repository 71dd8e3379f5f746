//! Indirect light without a cache: each pixel has its own cut.
//!
//! Where thresholds are known beforehand, neighbors share most of the walk through the light tree, and the shadow rays
//! between a light and all pixels of a block are cast together. A threshold that hangs on the light that is still being found
//! allows neither: cuts at 2 % of a pixel's own luminance go one by one, as \[Walter05\] has them. On `cornell` at quantiser 2,
//! where thresholds are 2 % too, that is 0.21 instead of 1.13 CPU s a frame of 256×256; 0.56 with thresholds known and
//! pixels one by one, 0.49 with shared walks alone.

use super::audits::{Audits, MadeCut, is_pixel_audited};
use super::counts::Counts;
use super::layer::{Layer, Lit, Visible};
use super::macroblock::{by_macroblock, places};
use super::pixel::{MattePixel, PixelLight, is_dark};
use super::tolerance::Tolerance;
use super::visibility::{GATHER_RAYS, Visibility};
use crate::frame::Frame;
use crate::settings::Aov;
use glam::{Vec3, Vec3A};
use lighttree::{Calibration, Cut, Lambert, Light, Receivers, Scratch, Stop};
use plane::Plane;
use render_core::ranks::{Portable, Ranks};
use std::ops::Range;

/// Side of the blocks of pixels whose cuts are made together. (`lighttree`'s `examples/measure.rs` has their gain.)
const BLOCK: usize = 8;

/// A cut for each pixel.
pub(super) struct PerPixel {
    /// Whether the light that softening takes is found by final gather.
    compensates: bool,
    /// Largest cut of each pixel of the last frame, if that is wanted.
    sizes: Option<Vec<u32>>,
}

impl PerPixel {
    /// With compensation, or without, and with the sizes of cuts if these are wanted.
    pub fn new(compensates: bool, keeps_sizes: bool) -> Self {
        Self { compensates, sizes: keeps_sizes.then(Vec::new) }
    }
}

impl Layer for PerPixel {
    fn light(&mut self, visible: &Visible<'_>, wanted: Option<&Plane<bool>>, tolerance: &Tolerance<'_>) -> Lit {
        let (width, height) = (visible.matte.pixels.width(), visible.matte.pixels.height());
        // Sizes are the largest over the samples of a pixel.
        let counts = match &mut self.sizes {
            None => Counts::default(),
            Some(sizes) if visible.sample > 0 => Counts::by_pixel(sizes),
            Some(_) => Counts::by_pixel(&vec![0; width * height]),
        };
        let visibility = Visibility::new(visible.frame, GATHER_RAYS);
        let light = PixelLight { visible, visibility, counts: &counts, compensates: self.compensates };
        let picture = LitPicture { light, wanted, tolerance };
        let block = || PixelBlock::new(tolerance);
        let make = |block: &mut PixelBlock, columns, rows| block.light(&picture, columns, rows);
        let radiance = by_macroblock(visible.ranks, width, height, block, make);
        let mut lit = Lit {
            radiance: Some(radiance.value),
            rays: counts.rays(),
            seconds: radiance.seconds,
            cuts: counts.cuts(),
            ..Lit::default()
        };
        let (sizes, cuts) = counts.into_parts();
        lit.audits = Audits { cuts, ..Audits::default() };
        if let Some(kept) = &mut self.sizes {
            *kept = largest_of_ranks(visible.ranks, sizes);
        }
        lit
    }

    fn is_dark(&self, frame: &Frame<'_>) -> bool {
        is_dark(frame)
    }

    fn keep(&mut self, aov: Aov) {
        if aov == Aov::CutSize {
            self.sizes.get_or_insert_with(Vec::new);
        }
    }

    fn channel(&self, aov: Aov, _: &Frame<'_>) -> Option<Vec<f32>> {
        let sizes = self.sizes.as_ref().filter(|_| aov == Aov::CutSize)?;
        Some(sizes.iter().map(|&size| size as f32).collect())
    }
}

/// The largest cut of each pixel, given those that each rank has made.
fn largest_of_ranks(ranks: &dyn Ranks, own: Vec<u32>) -> Vec<u32> {
    if ranks.count() == 1 {
        return own;
    }
    let mut bytes = Vec::new();
    own.put(&mut bytes);
    let mut largest = vec![0; own.len()];
    for bytes in ranks.all_gather(bytes) {
        let sizes = Vec::<u32>::take(&mut &bytes[..]).expect("every rank gives its sizes");
        largest.iter_mut().zip(sizes).for_each(|(largest, size)| *largest = size.max(*largest));
    }
    largest
}

/// A picture whose pixels are lit by many threads at once.
struct LitPicture<'a> {
    light: PixelLight<'a>,
    wanted: Option<&'a Plane<bool>>,
    tolerance: &'a Tolerance<'a>,
}

impl LitPicture<'_> {
    /// The surface of a pixel whose light is wanted; none where nothing reflects.
    fn pixel(&self, x: usize, y: usize) -> Option<MattePixel> {
        let is_wanted = self.wanted.is_none_or(|wanted| wanted.get(x, y));
        is_wanted.then(|| self.light.pixel(x, y)).flatten()
    }

    /// Counts a cut, and measures its error where its pixel is audited.
    fn finish(&self, pixel: &MattePixel, stop: Stop, cut: &Cut, scratch: &mut Scratch) {
        let &MattePixel { x, y, ref receiver, ref lambert } = pixel;
        let PixelLight { visible, ref visibility, counts, .. } = self.light;
        let width = visible.matte.pixels.width();
        let audits = self.tolerance.audits_per_macroblock();
        if audits.is_some_and(|audits| is_pixel_audited(x, y, width, visible.frame.index, audits)) {
            let class = self.tolerance.class_at(x, y);
            let made = MadeCut { tree: &visible.frame.tree, class, stop, radiance: cut.radiance };
            made.audit(lambert, |lamp, _| visibility.sees(receiver, lamp), scratch, counts);
        }
        counts.count(cut.size, cut.shadow_rays);
        counts.note(y * width + x, cut.size);
    }
}

/// Memory of a thread, and what the pixels that it is at are.
#[derive(Default)]
struct PixelBlock {
    scratch: Scratch,
    together: Vec<MattePixel>,
    positions: Vec<Vec3A>,
    /// When the cut of each of `together` ends; then their thresholds, receivers and cuts.
    stops: Vec<Stop>,
    thresholds: Vec<f32>,
    lamberts: Vec<Lambert>,
    cuts: Vec<Cut>,
}

impl PixelBlock {
    fn new(tolerance: &Tolerance) -> Self {
        // Calibrated cuts may need more clusters than the paper allows.
        let scratch = match tolerance.audits_per_macroblock() {
            Some(_) => Scratch::with_max_size(Calibration::LARGEST_CUT),
            None => Scratch::default(),
        };
        Self { scratch, ..Self::default() }
    }

    /// Radiance of a macroblock in raster order.
    fn light(&mut self, picture: &LitPicture, columns: Range<usize>, rows: Range<usize>) -> Vec<Vec3> {
        let mut radiance = vec![Vec3::ZERO; columns.len() * rows.len()];
        let (left, top, width) = (columns.start, rows.start, columns.len());
        let mut put = |pixel: &MattePixel, light: Vec3| {
            radiance[(pixel.y - top) * width + pixel.x - left] = light + picture.light.compensation(pixel);
        };
        for y in rows.clone().step_by(BLOCK) {
            for x in columns.clone().step_by(BLOCK) {
                let (across, down) = (x..columns.end.min(x + BLOCK), y..rows.end.min(y + BLOCK));
                self.light_block(picture, across, down, &mut put);
            }
        }
        radiance
    }

    /// Gives the radiance of each pixel of a block to `put`.
    fn light_block(
        &mut self,
        picture: &LitPicture,
        columns: Range<usize>,
        rows: Range<usize>,
        put: &mut impl FnMut(&MattePixel, Vec3),
    ) {
        self.clear();

        // A threshold that is known lets a pixel wait for its neighbors.
        for (x, y) in places(columns, rows) {
            let Some(pixel) = picture.pixel(x, y) else { continue };
            let stop = picture.tolerance.at_pixel(x, y, picture.light.visible.radiance.get(x, y));
            match picture.tolerance.calibrated(stop, picture.tolerance.class_at(x, y)) {
                Stop::Absolute(threshold) => self.wait(pixel, stop, threshold),
                relative => put(&pixel, self.cut_alone(picture, &pixel, stop, relative)),
            }
        }

        // The others are cut together.
        self.cut_together(picture);
        for ((pixel, cut), &stop) in self.together.iter().zip(&self.cuts).zip(&self.stops) {
            picture.finish(pixel, stop, cut, &mut self.scratch);
            put(pixel, cut.radiance);
        }
    }

    fn clear(&mut self) {
        self.together.clear();
        self.positions.clear();
        self.stops.clear();
        self.thresholds.clear();
        self.lamberts.clear();
    }

    /// Adds a pixel to those that are cut together, its cut to end at `threshold`.
    fn wait(&mut self, pixel: MattePixel, stop: Stop, threshold: f32) {
        self.thresholds.push(threshold);
        self.stops.push(stop);
        self.lamberts.push(pixel.lambert);
        self.positions.push(pixel.receiver.position);
        self.together.push(pixel);
    }

    /// Radiance of a pixel whose cut ends at a share of its own light; `stop` is that before calibration.
    fn cut_alone(&mut self, picture: &LitPicture, pixel: &MattePixel, stop: Stop, relative: Stop) -> Vec3 {
        let PixelLight { visible, ref visibility, .. } = picture.light;
        let sees = |lamp: &Light, _: usize| visibility.sees(&pixel.receiver, lamp);
        let cut = visible.frame.tree.lightcut(&pixel.lambert, relative, sees, &mut self.scratch);
        picture.finish(pixel, stop, &cut, &mut self.scratch);
        cut.radiance
    }

    /// The cuts of all that wait.
    fn cut_together(&mut self, picture: &LitPicture) {
        let Self { scratch, together, positions, thresholds, lamberts, cuts, .. } = self;
        let PixelLight { visible, ref visibility, .. } = picture.light;
        let sees = |lamp: &Light, _: usize, rays: u64| {
            visibility.lit_among(lamp, together.iter().map(|pixel| &pixel.receiver), positions, rays)
        };
        visible.frame.tree.lightcuts(Receivers { receivers: lamberts, thresholds }, sees, scratch, cuts);
    }
}
