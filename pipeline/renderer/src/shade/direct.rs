//! Direct light: light that reaches surfaces straight from its source.

use super::layer::{Layer, Lit, Visible};
use super::macroblock::{by_macroblock, places};
use super::movement::MovingBox;
use super::reprojected::{Holding, Reprojectable};
use super::tolerance::Tolerance;
use super::visibility::receiver;
use crate::frame::Frame;
use glam::Vec3A;
use pipeline::error::Result;
use plane::Plane;
use render_core::{DirectLights, GBuffer, PixelSurface, ShadingPoint, Source, Timed, Unseen};
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Distance from moving objects and their shadows within which light is not reprojected \[pixels\].
const BESIDE: f32 = 2.0;
/// Side of the squares of pixels that are lit together \[pixels\].
const SQUARE: usize = 8;

/// Light of directly sampled area lights, points, spots and suns.
#[derive(Clone, Default)]
pub(super) struct Direct {
    /// Lamps of the previous frame; `None` without reprojection.
    lamps: Option<Arc<DirectLights>>,
}

impl Layer for Direct {
    fn light(&mut self, visible: &Visible<'_>, wanted: Option<&Plane<bool>>, _: &Tolerance<'_>) -> Lit {
        let rays = AtomicU64::new(0);
        let pixels = &visible.matte.pixels;
        let Timed { value: irradiance, seconds } = by_macroblock(
            visible.ranks,
            pixels.width(),
            pixels.height(),
            || (),
            |(), columns, rows| {
                let (light, cast) = macroblock(visible, wanted, columns, rows);
                rays.fetch_add(cast, Ordering::Relaxed);
                light
            },
        );
        Lit { rays: rays.into_inner(), seconds, ..Lit::of_irradiance(irradiance) }
    }

    fn copy(&self) -> Option<Box<dyn Layer>> {
        Some(Box::new(self.clone()))
    }

    fn forget(&mut self) {
        self.lamps = None;
    }

    fn restore(&mut self, _: &[u8], last: &Frame<'_>) -> Result<()> {
        self.lamps = Some(last.direct.clone());
        Ok(())
    }
}

/// Returns the irradiance of a macroblock in raster order \[W·m⁻²\], zero for unwanted pixels. Also returns the number
/// of shadow rays.
fn macroblock(
    visible: &Visible,
    wanted: Option<&Plane<bool>>,
    columns: Range<usize>,
    rows: Range<usize>,
) -> (Vec<[f32; 3]>, u64) {
    let width = columns.len();
    let mut light = vec![[0.0; 3]; width * rows.len()];

    // Collect the pixels that reflect light: each lamp sends rays to all of them together.
    let mut reflects: Vec<(usize, PixelSurface)> = Vec::new();
    for (place, (x, y)) in places(columns, rows).enumerate() {
        let pixel = visible.matte.pixels.get(x, y);
        if pixel.reflects() && wanted.is_none_or(|wanted| wanted.get(x, y)) {
            reflects.push((place, pixel));
        }
    }
    if reflects.is_empty() || visible.has_stopped() {
        return (light, 0);
    }

    // Sort by squares: pixels in a square are closer together than pixels in a row.
    reflects.sort_by_key(|(place, _)| (place / width / SQUARE, place % width / SQUARE));
    let frame = visible.frame;
    let receivers: Vec<ShadingPoint> = reflects.iter().map(|(_, pixel)| receiver(pixel, frame.epsilon)).collect();
    let arriving = frame.direct.irradiance_by(visible.points, &frame.accelerator, &receivers);
    for ((place, _), arriving) in reflects.into_iter().zip(arriving.value) {
        light[place] = arriving.to_array();
    }
    (light, arriving.shadow_rays)
}

impl Reprojectable for Direct {
    /// Contrast of shadows: shadow edges may be anywhere.
    const UNSEEN: Unseen = Unseen::Shadows;

    /// Returns the static surfaces for which nothing has moved between them and the lamps. Returns none if the lamps
    /// have changed.
    fn holding<'a>(&mut self, visible: &Visible<'a>) -> Holding<'a> {
        let now = visible.frame.direct.clone();
        // Recompute all light if any lamp has changed.
        let before = self.lamps.replace(now.clone());
        if !before.is_some_and(|before| before.has_lamps_of(&now)) {
            return Holding::Nowhere;
        }

        let Visible { matte, movement, .. } = *visible;
        let (sources, swept) = (now.sources(), &movement.swept);
        // Mark moving instances: light on them changes with their own motion.
        let mut moves = vec![false; matte.world.len()];
        for thing in swept {
            moves[thing.instance as usize] = true;
        }
        Holding::Where(Box::new(move |x, y| {
            let pixel = matte.pixels.get(x, y);
            // Enlarge the boxes: reprojection may use an adjacent pixel's sample, whose light must be unchanged, too.
            let margin = margin(matte, &pixel);
            let is_shaded_by = |thing: &MovingBox| {
                let thing = thing.grown(margin);
                sources.iter().any(|source| shades(&thing, pixel.position.into(), source))
            };
            !moves[pixel.instance as usize] && !swept.iter().any(is_shaded_by)
        }))
    }
}

/// Returns the margin around movers within which the light of `pixel` is not reprojected \[m\].
pub(super) fn margin(seen: &GBuffer, pixel: &PixelSurface) -> f32 {
    BESIDE * seen.view.pixel_width(pixel.depth)
}

/// Returns whether `thing` may be between `point` and a light.
pub(super) fn shades(thing: &MovingBox, point: Vec3A, source: &Source) -> bool {
    match *source {
        Source::Lamp { low, high } => thing.is_between(point, low, high),
        Source::Disc { towards, angular_radius } => {
            // End the segments behind the box: nothing beyond it can be crossed.
            let far = thing.farthest(point);
            let (center, radius) = (point + towards * far, angular_radius.tan() * far);
            thing.is_between(point, center - radius, center + radius)
        }
    }
}
