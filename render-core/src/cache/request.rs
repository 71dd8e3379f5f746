//! Requests to light pictures, or regions of pictures.

use super::illumination::Site;
use crate::gbuffer::{GBuffer, NOTHING};
use crate::ranks::{Alone, Ranks};
use plane::Plane;

/// Openness of a point without surrounding surfaces.
pub(super) const OPEN: f32 = 1.0;

/// Picture to light, with the conditions for lighting it.
#[derive(Clone, Copy, Debug)]
pub struct Request<'a> {
    /// Surfaces visible in the picture.
    pub seen: &'a GBuffer,
    /// Whether each instance ever moves, by instance.
    pub moving: &'a [bool],
    /// Mask of the wanted pixels, or `None` for all pixels.
    pub wanted: Option<&'a Plane<bool>>,
    /// Whether further pictures of the frame may follow, lit by [`light_more`](super::IrradianceCache::light_more). If
    /// true, records that only further pictures of the previous frame used are also updated.
    pub is_first_of_many: bool,
    /// Ranks that share the work. Each rank makes the same request.
    pub ranks: &'a dyn Ranks,
}

impl<'a> Request<'a> {
    /// Returns a request for a whole picture that this process lights alone.
    #[must_use]
    pub fn whole(seen: &'a GBuffer, moving: &'a [bool]) -> Self {
        Self { seen, moving, wanted: None, is_first_of_many: false, ranks: &Alone }
    }

    /// Returns the site at a wanted pixel with openness 1, or `None` if no surface reflects at this pixel.
    pub(super) fn bare_site(&self, x: usize, y: usize) -> Option<Site> {
        self.wanted.is_none_or(|wanted| wanted.get(x, y)).then(|| self.surface(x, y)).flatten()
    }

    /// Returns the site at any pixel, whether wanted or not, with openness 1. Returns `None` if no surface reflects at
    /// this pixel.
    pub(super) fn surface(&self, x: usize, y: usize) -> Option<Site> {
        let pixel = self.seen.pixels.get(x, y);
        pixel.reflects().then(|| Site {
            position: pixel.position.into(),
            normal: pixel.shading_normal.into(),
            geometric_normal: pixel.geometric_normal.into(),
            carrier: if self.moving[pixel.instance as usize] { pixel.instance } else { NOTHING },
            openness: OPEN,
            key: (y as u64) << 32 | x as u64,
        })
    }
}
