//! Pixels with several layers at their centers: each layer covers a fraction of the pixel.

use super::borrow::Lender;
use super::search::{Area, Search, SearchedPixel, Shown, Wanted};
use crate::gbuffer::layers::Layer;
use crate::gbuffer::{CameraRay, GBuffer, NOTHING, PixelSurface, is_same_surface, see};
use crate::{Busy, PixelSample, PosedScene};
use glam::{Vec2, Vec3};
use rayon::prelude::*;

/// Constant added to both reflectances in the ratio of a tint, so that black lenders yield finite tints.
const LEAST_TINT: f32 = 0.02;
/// Number of pixels that a thread processes in sequence.
const TOGETHER: usize = 256;

impl Search<'_> {
    /// Returns whether an outline separates two pixels, at least one of which has several layers.
    pub(super) fn layers_differ(&self, a: usize, b: usize) -> bool {
        let (first, second) = (self.seen.layers(a), self.seen.layers(b));
        first.len() != second.len() || first.iter().zip(second).any(|(p, q)| !self.are_alike(a, p, b, q))
    }

    /// Returns whether layer p of pixel a and layer q of pixel b show the same surface.
    fn are_alike(&self, a: usize, p: &Layer, b: usize, q: &Layer) -> bool {
        let (Some(first), Some(second)) = (p.hit, q.hit) else { return p.hit == q.hit };
        // Decide without evaluating the surfaces where possible.
        if first.instance != second.instance || first.triangle == second.triangle {
            return first.instance == second.instance;
        }

        // Compare positions and normals of different triangles of one instance.
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

    /// Searches the layered pixels that are not yet `known`. Uses the layers at their centers, traced with rays through
    /// `offset`.
    pub(super) fn by_centers(&self, known: &[bool], offset: Vec2, busy: &Busy) -> Vec<SearchedPixel> {
        // Search chunks of pixels in parallel, and concatenate the results in raster order.
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

    /// Returns the light of a surface that shares a ray with other surfaces: the light of the nearest center that shows
    /// the surface, scaled by the ratio of their colors. Textures keep their detail even if only every other pixel has
    /// light.
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
    /// Returns the ratio of this reflectance to the reflectance of `lender`, a center that shows the same surface.
    fn layer_tint(&self, lender: &Self) -> Vec3 {
        let of = |surface: &Self| Vec3::from(surface.albedo) + Vec3::from(surface.specular) + LEAST_TINT;
        of(self) / of(lender)
    }
}

impl Area<'_> {
    /// Adds a `layer` that a `ray` shows.
    pub(super) fn add_layer(&mut self, ray: CameraRay, layer: &Layer) {
        let Search { seen, shown, .. } = self.search;
        let width = |depth| seen.view.pixel_width(depth);
        let surface = see(layer.hit, ray, shown.solid(), &width, &seen.view);
        // Use the light of a center that shows the layer, otherwise borrow light.
        let light = match self.search.layer_light(self.x, self.y, &surface) {
            Some((source, tint, emission)) => Some(Shown { part: self.part(source), tint, emission }),
            None => self.borrow(&surface),
        };
        if let Some(light) = light {
            self.count(&light, layer.share);
        }
    }
}

/// Returns the coverage of the layers only, for one sample of each pixel.
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
