//! The picture that is lit, and what of each pixel says which records serve it.

use super::illumination::Site;
use super::known::KnownNeighbors;
use super::openness::Openness;
use super::request::Request;
use crate::gbuffer::{GBuffer, NOTHING};
use crate::ranks::Ranks;
use crate::{Busy, MACROBLOCK};
use glam::Vec3A;
use rayon::prelude::*;
use std::ops::Range;

/// Centers so far to all sides may show another layer of a pixel: of 4×4 one is of a layer that has a sixteenth of each.
const LAYERED: usize = 3;
/// Distance from a record up to which a pixel counts as showing it \[pixels\].
const NEARBY: f32 = 8.0;

/// The picture that is lit.
pub(super) struct SurfacePicture<'a> {
    pub seen: &'a GBuffer,
    /// Counts the work on it.
    pub busy: &'a Busy,
    request: Request<'a>,
    openness: &'a Openness,
    /// Neighbors of records that earlier pictures of the frame have found.
    pub known: &'a KnownNeighbors,
    /// Surfaces of all pixels, by macroblock, in raster order: a whole frame's sites are looked through several times,
    /// and the G-buffer holds three times as much of each.
    shown: Vec<ShownSurface>,
    /// Macroblocks that may have wanted pixels, ascending.
    pub wanted_tiles: Vec<usize>,
}

/// The surface that a pixel shows.
#[derive(Clone, Copy)]
pub(super) struct ShownSurface {
    position: [f32; 3],
    pub openness: f32,
    normal: [f32; 3],
    pub carrier: u32,
}

impl ShownSurface {
    /// Nothing that reflects: no record is near it.
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

        // Each macroblock has places for all its pixels, though at the right and lower border it has fewer.
        let mut shown = vec![ShownSurface::NOTHING; picture.tiles() * MACROBLOCK * MACROBLOCK];
        let mut is_wanted = vec![false; picture.tiles()];
        for &tile in &picture.wanted_tiles {
            is_wanted[tile] = true;
        }
        shown.par_chunks_mut(MACROBLOCK * MACROBLOCK).enumerate().filter(|(tile, _)| is_wanted[*tile]).for_each(
            |(tile, shown)| {
                busy.measure(|| {
                    for (shown, (x, y)) in shown.iter_mut().zip(picture.pixels(tile)) {
                        *shown = picture.site(x, y).as_ref().map_or(ShownSurface::NOTHING, ShownSurface::from);
                    }
                });
            },
        );
        picture.shown = shown;
        picture
    }

    /// Who shares the work.
    pub fn ranks(&self) -> &'a dyn Ranks {
        self.request.ranks
    }

    pub fn size(&self) -> (usize, usize) {
        (self.seen.pixels.width(), self.seen.pixels.height())
    }

    /// How many macroblocks it has.
    pub fn tiles(&self) -> usize {
        let (width, height) = self.size();
        width.div_ceil(MACROBLOCK) * height.div_ceil(MACROBLOCK)
    }

    /// Columns and rows of macroblock `tile`, in raster order of macroblocks.
    pub fn tile_area(&self, tile: usize) -> (Range<usize>, Range<usize>) {
        let (width, height) = self.size();
        let across = width.div_ceil(MACROBLOCK);
        let (left, top) = (tile % across * MACROBLOCK, tile / across * MACROBLOCK);
        (left..width.min(left + MACROBLOCK), top..height.min(top + MACROBLOCK))
    }

    /// The pixels of a macroblock, in raster order.
    pub fn pixels(&self, tile: usize) -> impl Iterator<Item = (usize, usize)> + use<> {
        let (columns, rows) = self.tile_area(tile);
        rows.flat_map(move |y| columns.clone().map(move |x| (x, y)))
    }

    /// Surfaces that the pixels of a macroblock show, in raster order.
    pub fn shown(&self, tile: usize) -> &[ShownSurface] {
        let (columns, rows) = self.tile_area(tile);
        &self.shown[tile * MACROBLOCK * MACROBLOCK..][..columns.len() * rows.len()]
    }

    /// Whether the pixel that a place falls on shows the same surface, no farther than `apart` from it \[m\]; outside of the
    /// picture it counts as shown. Where the pixel shows several layers, the centers around it are asked too.
    pub fn shows(&self, site: &Site, apart: f32) -> bool {
        let Some((x, y)) = self.pixel_of(site) else { return true };
        let (width, height) = self.size();
        let reach = if self.seen.is_layered(y * width + x) { LAYERED } else { 0 };
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

    /// Whether the pixel that a place falls on shows it, or what is beside it within a few pixels.
    pub fn has(&self, site: &Site) -> bool {
        self.pixel_of(site).is_some() && self.shows(site, NEARBY * site.pixel_width(&self.seen.view))
    }

    /// The pixel that a place falls on, if the picture has it.
    pub fn pixel_of(&self, site: &Site) -> Option<(usize, usize)> {
        let place = self.seen.view.project(site.position)?.pixel;
        let (width, height) = self.size();
        let inside = place.x >= 0.0 && place.y >= 0.0 && place.x < width as f32 && place.y < height as f32;
        inside.then_some((place.x as usize, place.y as usize))
    }

    /// The surface of a pixel, wanted or not, open whatever is around.
    pub fn surface(&self, x: usize, y: usize) -> Option<Site> {
        self.request.surface(x, y)
    }

    /// Columns and rows of the smallest rectangle with all wanted pixels, and `margin` pixels around it.
    pub fn wanted_area(&self, margin: usize) -> (Range<usize>, Range<usize>) {
        let (width, height) = self.size();
        let Some(wanted) = self.request.wanted else { return (0..width, 0..height) };
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

    /// Macroblocks that have a part of that rectangle, ascending.
    pub fn tiles_around(&self, margin: usize) -> Vec<usize> {
        let (columns, rows) = self.wanted_area(margin);
        let has_part = |&tile: &usize| {
            let (across, down) = self.tile_area(tile);
            across.start < columns.end && columns.start < across.end && down.start < rows.end && rows.start < down.end
        };
        (0..self.tiles()).filter(has_part).collect()
    }

    /// Where light is wanted at a pixel, if it is and anything there reflects.
    pub fn site(&self, x: usize, y: usize) -> Option<Site> {
        self.request.bare_site(x, y).map(|site| Site { openness: self.openness.get(x, y), ..site })
    }
}
