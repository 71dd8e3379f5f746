//! Pixels whose centers are one of several layers: each layer has its share of the pixel.

use super::borrow::Lender;
use super::search::{Area, Search, SearchedPixel, Shown, Wanted};
use crate::gbuffer::layers::Layer;
use crate::gbuffer::{CameraRay, GBuffer, NOTHING, PixelSurface, is_same_surface, see};
use crate::{Busy, PixelSample, PosedScene};
use glam::{Vec2, Vec3};
use rayon::prelude::*;

/// Added to reflectances whose ratio is a tint, so that black lenders stay finite.
const LEAST_TINT: f32 = 0.02;
/// Pixels that a thread works on in a row.
const TOGETHER: usize = 256;

impl Search<'_> {
    /// Whether an outline runs between two pixels, where one or both show several layers.
    pub(super) fn layers_differ(&self, a: usize, b: usize) -> bool {
        let (first, second) = (self.seen.layers(a), self.seen.layers(b));
        first.len() != second.len() || first.iter().zip(second).any(|(p, q)| !self.are_alike(a, p, b, q))
    }

    /// Whether layer p of pixel a and layer q of pixel b show the same surface.
    fn are_alike(&self, a: usize, p: &Layer, b: usize, q: &Layer) -> bool {
        let (Some(first), Some(second)) = (p.hit, q.hit) else { return p.hit == q.hit };
        if first.instance != second.instance || first.triangle == second.triangle {
            return first.instance == second.instance;
        }
        let view = &self.seen.view;
        let surface = |pixel, hit| {
            let ray = self.ray(pixel, PixelSample::WHOLE.offset);
            see(Some(hit), ray, self.shown.solid(), &|_| 0.0, view)
        };
        let (first, second) = (surface(a, first), surface(b, second));
        is_same_surface(&first, second.instance, second.position.into(), second.geometric_normal.into())
    }

    fn ray(&self, pixel: usize, offset: Vec2) -> CameraRay {
        let (x, y) = self.place(pixel as u32);
        CameraRay::through(Vec2::new(x as f32, y as f32) + offset, &self.seen.view)
    }

    /// The layered pixels that are not yet `known`, by the layers of their centers, which rays through `offset` have met.
    pub(super) fn by_centers(&self, known: &[bool], offset: Vec2, busy: &Busy) -> Vec<SearchedPixel> {
        let chunks = self.seen.layered.par_chunks(TOGETHER).map(|pixels| {
            busy.measure(|| {
                let mut found = Vec::new();
                for pixel in pixels.iter().filter(|pixel| !known[pixel.index as usize]) {
                    let mut area = Area::new(self, Wanted::layered(pixel.index));
                    let ray = self.ray(pixel.index as usize, offset);
                    for layer in &pixel.layers {
                        area.add_layer(ray, layer);
                    }
                    found.push(area.found());
                }
                found
            })
        });
        chunks.collect::<Vec<_>>().into_iter().flatten().collect()
    }

    /// Light of a surface that shares a ray with others: that of the nearest center that shows it, as far as their colors are
    /// alike. A texture keeps its texels where only every other pixel has found light.
    pub(super) fn layer_light(&self, x: usize, y: usize, surface: &PixelSurface) -> Option<(Lender, Vec3, Vec3)> {
        let emission = Vec3::from(surface.emission);
        if surface.instance == NOTHING {
            return None;
        }
        let source = self.seen.nearest_alike(x, y, surface, None)?;
        let lender = &self.seen.pixels.samples()[source.pixel as usize];
        // L = E + t (L(q) − E(q))
        let tint = surface.layer_tint(lender);
        Some((source, tint, emission - tint * Vec3::from(lender.emission)))
    }
}

impl PixelSurface {
    /// Reflectance compared with that of another center of the same surface.
    fn layer_tint(&self, lender: &Self) -> Vec3 {
        let of = |surface: &Self| Vec3::from(surface.albedo) + Vec3::from(surface.specular) + LEAST_TINT;
        of(self) / of(lender)
    }
}

impl Area<'_> {
    /// A `ray` shows this layer.
    pub(super) fn add_layer(&mut self, ray: CameraRay, layer: &Layer) {
        let Search { seen, shown, .. } = self.search;
        let width = |depth| seen.view.pixel_width(depth);
        let surface = see(layer.hit, ray, shown.solid(), &width, &seen.view);
        let light = match self.search.layer_light(self.x, self.y, &surface) {
            Some((source, tint, emission)) => Some(Shown { part: self.part(source), tint, emission }),
            None => self.borrow(&surface),
        };
        if let Some(light) = light {
            self.count(&light, layer.share);
        }
    }
}

/// Coverage of the layers alone, for a sample of each pixel.
pub(super) fn of_layers<'a>(
    seen: &'a GBuffer,
    scene: PosedScene<'a>,
    light: &'a plane::Plane<Vec3>,
    offset: Vec2,
    busy: &Busy,
) -> Vec<SearchedPixel> {
    let search = Search::new(seen, scene, light);
    search.by_centers(&vec![false; light.samples().len()], offset, busy)
}
