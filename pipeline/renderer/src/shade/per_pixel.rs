//! Indirect light without a cache: a lightcut for each pixel.
//!
//! With absolute thresholds, neighboring pixels share most of the traversal of the light tree. Shadow rays between a
//! light and all pixels of a block are then traced together. A threshold relative to the pixel's own luminance, as in
//! \[Walter05\], allows neither.
//!
//! CPU time per frame of `cornell` at 256×256 and quantiser 2, for which absolute thresholds are also about 2 % of
//! luminance:
//!
//! | thresholds | traversal | shadow rays | CPU s |
//! |---|---|---|---|
//! | 2 % of own luminance | by pixel | by pixel | 1.13 |
//! | known | by pixel | by pixel | 0.56 |
//! | known | shared | by pixel | 0.49 |
//! | known | shared | by block | 0.21 |

use super::audits::{Audits, MadeLightcut, is_pixel_audited};
use super::counts::Counts;
use super::layer::{Layer, Lit, Visible};
use super::macroblock::{by_macroblock, places};
use super::pixel::{MattePixel, PixelLight, is_dark};
use super::tolerance::Tolerance;
use super::visibility::{GATHER_RAYS, Visibility};
use crate::frame::Frame;
use crate::settings::Aov;
use glam::{Vec3, Vec3A};
use lighttree::{Calibration, Lambert, Light, Lightcut, Receivers, Scratch, Stop};
use plane::Plane;
use render_core::ranks::{Portable, Ranks};
use std::ops::Range;

/// Side of the pixel blocks with shared lightcuts \[pixels\]. `examples/measure.rs` of `lighttree` measures the gain of
/// sharing.
const BLOCK: usize = 8;

/// Layer with a lightcut for each pixel.
#[derive(Clone)]
pub(super) struct PerPixel {
    /// Whether final gather restores the light lost by clamping virtual lights.
    compensates: bool,
    /// Size of each pixel's largest lightcut in the last frame \[clusters\]; `None` unless requested.
    sizes: Option<Vec<u32>>,
}

impl PerPixel {
    /// Creates the layer. `compensates` enables bias compensation; `keeps_sizes` stores the sizes of lightcuts.
    pub fn new(compensates: bool, keeps_sizes: bool) -> Self {
        Self { compensates, sizes: keeps_sizes.then(Vec::new) }
    }
}

impl Layer for PerPixel {
    fn light(&mut self, visible: &Visible<'_>, wanted: Option<&Plane<bool>>, tolerance: &Tolerance<'_>) -> Lit {
        let (width, height) = (visible.matte.pixels.width(), visible.matte.pixels.height());
        // Keep the maximum size over all samples of a pixel.
        let counts = match &mut self.sizes {
            None => Counts::default(),
            Some(sizes) if visible.sample > 0 => Counts::by_pixel(sizes),
            Some(_) => Counts::by_pixel(&vec![0; width * height]),
        };

        // Light the frame by macroblock.
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

        // Read audits and sizes of lightcuts only after all threads are done.
        let (sizes, cuts) = counts.into_parts();
        lit.audits = Audits { cuts, ..Audits::default() };
        if let Some(kept) = &mut self.sizes {
            *kept = largest_of_ranks(visible.ranks, sizes);
        }
        lit
    }

    fn copy(&self) -> Option<Box<dyn Layer>> {
        Some(Box::new(self.clone()))
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

/// Returns the size of each pixel's largest lightcut over all ranks \[clusters\].
fn largest_of_ranks(ranks: &dyn Ranks, own: Vec<u32>) -> Vec<u32> {
    if ranks.count() == 1 {
        return own;
    }
    // Combine the sizes of all ranks: each rank lights only its own macroblocks.
    let mut bytes = Vec::new();
    own.put(&mut bytes);
    let mut largest = vec![0; own.len()];
    for bytes in ranks.all_gather(bytes) {
        let sizes = Vec::<u32>::take(&mut &bytes[..]).expect("every rank sends its sizes");
        largest.iter_mut().zip(sizes).for_each(|(largest, size)| *largest = size.max(*largest));
    }
    largest
}

/// Frame with pixels lit by several threads.
struct LitPicture<'a> {
    light: PixelLight<'a>,
    wanted: Option<&'a Plane<bool>>,
    tolerance: &'a Tolerance<'a>,
}

impl LitPicture<'_> {
    /// Returns the surface of a wanted pixel; `None` if the pixel is unwanted or reflects no light.
    fn pixel(&self, x: usize, y: usize) -> Option<MattePixel> {
        let is_wanted = self.wanted.is_none_or(|wanted| wanted.get(x, y));
        is_wanted.then(|| self.light.pixel(x, y)).flatten()
    }

    /// Counts a lightcut, and measures the lightcut's error if its pixel is audited.
    fn finish(&self, pixel: &MattePixel, stop: Stop, cut: &Lightcut, scratch: &mut Scratch) {
        let &MattePixel { x, y, ref receiver, ref lambert } = pixel;
        let PixelLight { visible, ref visibility, counts, .. } = self.light;
        let width = visible.matte.pixels.width();
        // Compare the lightcuts of audited pixels with finer ones.
        let audits = self.tolerance.audits_per_macroblock();
        if audits.is_some_and(|audits| is_pixel_audited(x, y, width, visible.frame.index, audits)) {
            let class = self.tolerance.class_at(x, y);
            let made = MadeLightcut { tree: &visible.frame.tree, class, stop, radiance: cut.radiance };
            made.audit(lambert, |lamp, _| visibility.sees(receiver, lamp), scratch, counts);
        }
        counts.count(cut.size, cut.shadow_rays);
        counts.note(y * width + x, cut.size);
    }
}

/// Memory of a thread, and the pixels of its current block.
#[derive(Default)]
struct PixelBlock {
    scratch: Scratch,
    together: Vec<MattePixel>,
    positions: Vec<Vec3A>,
    /// Stopping criteria of the lightcuts in `together`. The next fields contain their thresholds, receivers and
    /// results.
    stops: Vec<Stop>,
    thresholds: Vec<f32>,
    lamberts: Vec<Lambert>,
    cuts: Vec<Lightcut>,
}

impl PixelBlock {
    fn new(tolerance: &Tolerance) -> Self {
        // Allow more clusters than the Lightcuts paper: calibrated lightcuts may need them.
        let scratch = match tolerance.audits_per_macroblock() {
            Some(_) => Scratch::with_max_size(Calibration::LARGEST_CUT),
            None => Scratch::default(),
        };
        Self { scratch, ..Self::default() }
    }

    /// Returns the radiance of a macroblock in raster order \[W·m⁻²·sr⁻¹\].
    fn light(&mut self, picture: &LitPicture, columns: Range<usize>, rows: Range<usize>) -> Vec<Vec3> {
        let mut radiance = vec![Vec3::ZERO; columns.len() * rows.len()];
        let (left, top, width) = (columns.start, rows.start, columns.len());
        let mut put = |pixel: &MattePixel, light: Vec3| {
            radiance[(pixel.y - top) * width + pixel.x - left] = light + picture.light.compensation(pixel);
        };
        // Share lightcuts within blocks: nearby pixels need similar clusters.
        for y in rows.clone().step_by(BLOCK) {
            for x in columns.clone().step_by(BLOCK) {
                let (across, down) = (x..columns.end.min(x + BLOCK), y..rows.end.min(y + BLOCK));
                self.light_block(picture, across, down, &mut put);
            }
        }
        radiance
    }

    /// Passes the radiance of each pixel of a block to `put`.
    fn light_block(
        &mut self,
        picture: &LitPicture,
        columns: Range<usize>,
        rows: Range<usize>,
        put: &mut impl FnMut(&MattePixel, Vec3),
    ) {
        self.clear();

        // Collect pixels with absolute thresholds for the block, and light the other pixels immediately.
        for (x, y) in places(columns, rows) {
            let Some(pixel) = picture.pixel(x, y) else { continue };
            let stop = picture.tolerance.at_pixel(x, y, picture.light.visible.radiance.get(x, y));
            match picture.tolerance.calibrated(stop, picture.tolerance.class_at(x, y)) {
                Stop::Absolute(threshold) => self.wait(pixel, stop, threshold),
                relative => put(&pixel, self.cut_alone(picture, &pixel, stop, relative)),
            }
        }

        // Compute the lightcuts of the collected pixels together.
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

    /// Adds a pixel with an absolute `threshold` to the shared lightcuts.
    fn wait(&mut self, pixel: MattePixel, stop: Stop, threshold: f32) {
        self.thresholds.push(threshold);
        self.stops.push(stop);
        self.lamberts.push(pixel.lambert);
        self.positions.push(pixel.receiver.position);
        self.together.push(pixel);
    }

    /// Returns the radiance of a pixel with a relative threshold \[W·m⁻²·sr⁻¹\]; `stop` is the criterion before
    /// calibration.
    fn cut_alone(&mut self, picture: &LitPicture, pixel: &MattePixel, stop: Stop, relative: Stop) -> Vec3 {
        let PixelLight { visible, ref visibility, .. } = picture.light;
        let sees = |lamp: &Light, _: usize| visibility.sees(&pixel.receiver, lamp);
        let cut = visible.frame.tree.lightcut(&pixel.lambert, relative, sees, &mut self.scratch);
        picture.finish(pixel, stop, &cut, &mut self.scratch);
        cut.radiance
    }

    /// Computes the lightcuts of all collected pixels.
    fn cut_together(&mut self, picture: &LitPicture) {
        let Self { scratch, together, positions, thresholds, lamberts, cuts, .. } = self;
        let PixelLight { visible, ref visibility, .. } = picture.light;
        let sees = |lamp: &Light, _: usize, rays: u64| {
            visibility.lit_among(lamp, together.iter().map(|pixel| &pixel.receiver), positions, rays)
        };
        visible.frame.tree.lightcuts(Receivers { receivers: lamberts, thresholds }, sees, scratch, cuts);
    }
}
