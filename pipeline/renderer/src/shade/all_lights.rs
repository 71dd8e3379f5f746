//! Layer that evaluates every light at every pixel: the reference for lightcuts.

use super::counts::Counts;
use super::layer::{Layer, Lit, Visible};
use super::macroblock::{by_macroblock, places};
use super::pixel::{MattePixel, PixelLight, is_dark};
use super::tolerance::Tolerance;
use super::visibility::Visibility;
use crate::frame::Frame;
use glam::Vec3;
use plane::Plane;
use std::cell::Cell;

/// Number of rays per final gather. The noise of 64 rays, as in films, would be 10 % of a reference's error. The
/// additional rays cost little compared with the lights.
const GATHER_RAYS: usize = 256;

/// Layer of the exhaustive sum over all lights of the tree.
#[derive(Clone)]
pub(super) struct AllLights {
    /// Whether final gather restores the light lost by clamping virtual lights.
    compensates: bool,
}

impl AllLights {
    /// Creates the layer; `compensates` enables bias compensation.
    pub fn new(compensates: bool) -> Self {
        Self { compensates }
    }
}

impl Layer for AllLights {
    fn light(&mut self, visible: &Visible<'_>, wanted: Option<&Plane<bool>>, _: &Tolerance<'_>) -> Lit {
        let (counts, pixels) = (Counts::default(), &visible.matte.pixels);
        let visibility = Visibility::new(visible.frame, GATHER_RAYS);
        let light = PixelLight { visible, visibility, counts: &counts, compensates: self.compensates };
        // Sum all lights at each wanted pixel, regardless of thresholds.
        let radiance = |(x, y): (usize, usize)| {
            let is_wanted = wanted.is_none_or(|wanted| wanted.get(x, y));
            match is_wanted.then(|| light.pixel(x, y)).flatten() {
                Some(pixel) => exhaustive(&light, &pixel) + light.compensation(&pixel),
                None => Vec3::ZERO,
            }
        };
        let block = |(): &mut (), columns, rows| places(columns, rows).map(radiance).collect();
        let radiance = by_macroblock(visible.ranks, pixels.width(), pixels.height(), || (), block);
        Lit {
            radiance: Some(radiance.value),
            rays: counts.rays(),
            seconds: radiance.seconds,
            cuts: counts.cuts(),
            ..Lit::default()
        }
    }

    fn copy(&self) -> Option<Box<dyn Layer>> {
        Some(Box::new(self.clone()))
    }

    fn is_dark(&self, frame: &Frame<'_>) -> bool {
        is_dark(frame)
    }
}

/// Returns the radiance that a pixel reflects from all lights \[W·m⁻²·sr⁻¹\].
fn exhaustive(light: &PixelLight, pixel: &MattePixel) -> Vec3 {
    let tree = &light.visible.frame.tree;
    let rays = Cell::new(0);
    let radiance = tree.exhaustive(&pixel.lambert, |lamp, _| {
        rays.set(rays.get() + 1);
        light.visibility.sees(&pixel.receiver, lamp)
    });
    light.counts.count(tree.len() as u32, rays.get());
    radiance
}
