//! Picture to light, with the surface properties of each pixel that select records.

use super::illumination::Site;
use super::known::KnownNeighbors;
use super::openness::Openness;
use super::request::Request;
use crate::gbuffer::{GBuffer, NOTHING};
use crate::ranks::{Portable, Ranks, in_order, share_each};
use crate::{Busy, MACROBLOCK};
use glam::Vec3A;
use rayon::prelude::*;
use std::ops::Range;

/// Radius of the search for another layer of a pixel \[pixels\]. If a layer covers a sixteenth of each pixel, it is
/// visible at one in 4×4 pixel centers.
const LAYERED: usize = 3;
/// Maximum distance between a record and a pixel that counts as showing it \[pixels\].
const NEARBY: f32 = 8.0;

/// Picture to light.
pub(super) struct SurfacePicture<'a> {
    pub seen: &'a GBuffer,
    /// Timer that measures the work on the picture.
    pub busy: &'a Busy,
    request: Request<'a>,
    openness: &'a Openness,
    /// Neighbors of records, found by earlier pictures of the frame.
    pub known: &'a KnownNeighbors,
    /// Surfaces of all pixels, by macroblock and in raster order. They are read several times per frame, and the
    /// G-buffer uses three times as much memory per pixel.
    shown: Vec<ShownSurface>,
    /// Indices of the macroblocks that may contain wanted pixels, ascending.
    pub wanted_tiles: Vec<usize>,
}

/// Surface visible at a pixel.
#[derive(Clone, Copy)]
pub(super) struct ShownSurface {
    position: [f32; 3],
    pub openness: f32,
    normal: [f32; 3],
    pub carrier: u32,
}

impl ShownSurface {
    /// Placeholder without a reflecting surface. No record is near it.
    const NOTHING: Self = Self { position: [f32::NAN; 3], openness: 0.0, normal: [0.0; 3], carrier: NOTHING };

    pub fn is_something(&self) -> bool {
        !self.position[0].is_nan()
    }

    pub fn position(&self) -> Vec3A {
        self.position.into()
    }

    pub fn normal(&self) -> Vec3A {
        self.normal.into()
    }
}

impl From<&Site> for ShownSurface {
    fn from(site: &Site) -> Self {
        let Site { position, normal, carrier, openness, .. } = *site;
        Self { position: position.into(), normal: normal.into(), carrier, openness }
    }
}

impl<'a> SurfacePicture<'a> {
    pub fn new(request: Request<'a>, openness: &'a Openness, known: &'a KnownNeighbors, busy: &'a Busy) -> Self {
        let (shown, wanted_tiles) = (Vec::new(), Vec::new());
        let mut picture = Self { seen: request.seen, busy, request, openness, known, shown, wanted_tiles };
        picture.wanted_tiles = picture.tiles_around(0);

        // Allocate slots for all pixels of each macroblock, even if it is clipped at the right or lower border.
        let mut shown = vec![ShownSurface::NOTHING; picture.tiles() * MACROBLOCK * MACROBLOCK];
        let mut is_wanted = vec![false; picture.tiles()];
        for &tile in &picture.wanted_tiles {
            is_wanted[tile] = true;
        }

        // Copy the surfaces of the macroblocks that may contain wanted pixels.
        let show = |(tile, shown): (usize, &mut [ShownSurface])| {
            if !is_wanted[tile] {
                return;
            }
            busy.measure(|| {
                for (shown, (x, y)) in shown.iter_mut().zip(picture.pixels(tile)) {
                    *shown = picture.site(x, y).as_ref().map_or(ShownSurface::NOTHING, ShownSurface::from);
                }
            });
        };
        shown.par_chunks_mut(MACROBLOCK * MACROBLOCK).enumerate().for_each(show);
        picture.shown = shown;
        picture
    }

    /// Returns the ranks that share the work.
    pub fn ranks(&self) -> &'a dyn Ranks {
        self.request.ranks
    }

    pub fn size(&self) -> (usize, usize) {
        (self.seen.pixels.width(), self.seen.pixels.height())
    }

    /// Returns the number of macroblocks.
    pub fn tiles(&self) -> usize {
        let (width, height) = self.size();
        width.div_ceil(MACROBLOCK) * height.div_ceil(MACROBLOCK)
    }

    /// Returns the columns and rows of macroblock `tile`, an index in raster order.
    pub fn tile_area(&self, tile: usize) -> (Range<usize>, Range<usize>) {
        let (width, height) = self.size();
        let across = width.div_ceil(MACROBLOCK);
        let (left, top) = (tile % across * MACROBLOCK, tile / across * MACROBLOCK);
        (left..width.min(left + MACROBLOCK), top..height.min(top + MACROBLOCK))
    }

    /// Returns the pixels of a macroblock, in raster order.
    pub fn pixels(&self, tile: usize) -> impl Iterator<Item = (usize, usize)> + use<> {
        let (columns, rows) = self.tile_area(tile);
        rows.flat_map(move |y| columns.clone().map(move |x| (x, y)))
    }

    /// Shares the `chosen` macroblocks among the ranks. Returns the result of `compute` for each, in order.
    pub fn share_tiles<T: Portable + Send>(&self, chosen: &[usize], compute: impl Fn(usize) -> T + Sync) -> Vec<T> {
        let one = |(): &mut (), item: usize| compute(chosen[item]);
        self.busy.take(share_each(self.ranks(), &in_order(chosen.len()), 1, || (), one))
    }

    /// Returns the surfaces visible at the pixels of a macroblock, in raster order.
    pub fn shown(&self, tile: usize) -> &[ShownSurface] {
        let (columns, rows) = self.tile_area(tile);
        &self.shown[tile * MACROBLOCK * MACROBLOCK..][..columns.len() * rows.len()]
    }

    /// Returns whether the pixel of a site shows the site's surface, less than `apart` \[m\] from the site. Sites
    /// outside the picture count as shown. If the pixel shows several layers, the surrounding pixels are tested too.
    pub fn shows(&self, site: &Site, apart: f32) -> bool {
        let Some((x, y)) = self.pixel_of(site) else { return true };
        let (width, height) = self.size();
        let reach = if self.seen.is_layered(y * width + x) { LAYERED } else { 0 };
        // Search around layered pixels, because the dither shows each layer only at some pixel centers.
        let rows = y.saturating_sub(reach)..height.min(y + reach + 1);
        rows.into_iter().any(|v| {
            let mut columns = x.saturating_sub(reach)..width.min(x + reach + 1);
            columns.any(|u| self.shows_at(u, v, site, apart))
        })
    }

    fn shows_at(&self, x: usize, y: usize, site: &Site, apart: f32) -> bool {
        let shown = self.request.surface(x, y);
        shown.is_some_and(|shown| shown.carrier == site.carrier && shown.position.distance(site.position) < apart)
    }

    /// Returns whether the pixel of a site shows the site's surface within a few pixels of the site.
    pub fn has(&self, site: &Site) -> bool {
        self.pixel_of(site).is_some() && self.shows(site, NEARBY * site.pixel_width(&self.seen.view))
    }

    /// Returns the pixel to which a site projects, or `None` outside the picture.
    pub fn pixel_of(&self, site: &Site) -> Option<(usize, usize)> {
        let place = self.seen.view.project(site.position)?.pixel;
        let (width, height) = self.size();
        let inside = place.x >= 0.0 && place.y >= 0.0 && place.x < width as f32 && place.y < height as f32;
        inside.then_some((place.x as usize, place.y as usize))
    }

    /// Returns the surface of any pixel, whether wanted or not, with openness 1.
    pub fn surface(&self, x: usize, y: usize) -> Option<Site> {
        self.request.surface(x, y)
    }

    /// Returns the columns and rows of the bounding rectangle of all wanted pixels, extended by `margin` pixels.
    pub fn wanted_area(&self, margin: usize) -> (Range<usize>, Range<usize>) {
        let (width, height) = self.size();
        let Some(wanted) = self.request.wanted else { return (0..width, 0..height) };
        // Extend an empty rectangle by the first and last wanted pixel of each row.
        let (mut columns, mut rows) = (width..0, height..0);
        for y in 0..height {
            let row = wanted.row(y);
            if let (Some(first), Some(last)) = (row.iter().position(|&own| own), row.iter().rposition(|&own| own)) {
                columns = columns.start.min(first)..columns.end.max(last + 1);
                rows = rows.start.min(y)..y + 1;
            }
        }
        let widened = |range: Range<usize>, end: usize| range.start.saturating_sub(margin)..end.min(range.end + margin);
        (widened(columns, width), widened(rows, height))
    }

    /// Returns the macroblocks that overlap this rectangle, ascending.
    pub fn tiles_around(&self, margin: usize) -> Vec<usize> {
        let (columns, rows) = self.wanted_area(margin);
        let has_part = |&tile: &usize| {
            let (across, down) = self.tile_area(tile);
            across.start < columns.end && columns.start < across.end && down.start < rows.end && rows.start < down.end
        };
        (0..self.tiles()).filter(has_part).collect()
    }

    /// Returns the site at a wanted pixel, or `None` if no surface reflects at this pixel.
    pub fn site(&self, x: usize, y: usize) -> Option<Site> {
        self.request.bare_site(x, y).map(|site| Site { openness: self.openness.get(x, y), ..site })
    }
}
