//! The pictures, and parts of pictures, that a cache is requested to light.

use super::illumination::Site;
use crate::gbuffer::{GBuffer, NOTHING};
use crate::ranks::{Alone, Ranks};
use plane::Plane;

/// Openness of a place with nothing around.
pub(super) const OPEN: f32 = 1.0;

/// A picture to be lit.
#[derive(Clone, Copy, Debug)]
pub struct Request<'a> {
    /// Its surfaces.
    pub seen: &'a GBuffer,
    /// By instance, whether it ever moves.
    pub moving: &'a [bool],
    /// The pixels whose light is wanted; all if there is none.
    pub wanted: Option<&'a Plane<bool>>,
    /// Whether further pictures of the frame may follow, by [`light_more`](super::IrradianceCache::light_more): records that only
    /// those needed in the frame before are brought up to date, too.
    pub is_first_of_many: bool,
    /// Who shares the work. Each rank requests the same.
    pub ranks: &'a dyn Ranks,
}

impl<'a> Request<'a> {
    /// All of a picture, lit by this process alone.
    #[must_use]
    pub fn whole(seen: &'a GBuffer, moving: &'a [bool]) -> Self {
        Self { seen, moving, wanted: None, is_first_of_many: false, ranks: &Alone }
    }

    /// Where light is wanted at a pixel, open whatever is around; none if nothing there reflects.
    pub(super) fn bare_site(&self, x: usize, y: usize) -> Option<Site> {
        self.wanted.is_none_or(|wanted| wanted.get(x, y)).then(|| self.surface(x, y)).flatten()
    }

    /// The surface of a pixel, wanted or not, open whatever is around; none if nothing there reflects.
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
