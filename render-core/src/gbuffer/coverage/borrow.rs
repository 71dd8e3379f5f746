//! Sources of light for surfaces that a pixel shows off its center.

use crate::gbuffer::{ALIKE_COSINE, GBuffer, NOTHING, PixelSurface, is_same_surface};
use glam::{Vec3, Vec3A};

/// Number of pixels in a 3×3 neighborhood.
const AROUND: usize = 9;
/// Search radius for light that none of the 3×3 centers has \[pixels\].
const REACH: usize = 6;
/// Minimum reflectance of a channel from which irradiance is derived. Below it, rounding and other types of light
/// dominate.
const LEAST_REFLECTANCE: f32 = 0.05;

/// Pixel with a center that provides the light of a region.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Lender {
    /// Index of the pixel in raster order.
    pub pixel: u32,
    /// Whether the center shows a different surface under similar light.
    pub is_borrowed: bool,
}

impl Lender {
    /// Returns the source of light for a pixel with a center that shows the region's own surface.
    pub fn center(pixel: u32) -> Self {
        Self { pixel, is_borrowed: false }
    }

    /// Returns the source of light for a pixel with a center that shows a different surface.
    pub fn borrowed(pixel: u32) -> Self {
        Self { pixel, is_borrowed: true }
    }
}

/// Returns the 3×3 pixels around (x, y) in raster order, with `None` for pixels outside the picture.
pub(super) fn around(x: usize, y: usize, width: usize, height: usize) -> impl Iterator<Item = Option<(usize, usize)>> {
    (0..AROUND).map(move |k| {
        let (u, v) = ((x + k % 3).checked_sub(1)?, (y + k / 3).checked_sub(1)?);
        (u < width && v < height).then_some((u, v))
    })
}

/// Returns whether `pixel` shows the same surface as `seen`.
pub(in crate::gbuffer) fn shows(pixel: &PixelSurface, seen: &PixelSurface) -> bool {
    if seen.instance == NOTHING || pixel.instance == NOTHING {
        return seen.instance == pixel.instance;
    }
    // The radiance of a lamp's pixel is emission. The radiance of the surface around the lamp is reflected light.
    (pixel.emission == [0.0; 3]) == (seen.emission == [0.0; 3])
        && is_same_surface(pixel, seen.instance, seen.position.into(), seen.geometric_normal.into())
}

impl PixelSurface {
    /// Returns the reflectance of base and coat.
    fn reflectance(&self) -> Vec3 {
        Vec3::from(self.albedo) + Vec3::from(self.specular)
    }

    /// Returns whether incident light has no effect on the surface's radiance.
    pub(super) fn is_unlit(&self) -> bool {
        self.instance == NOTHING || self.reflectance() == Vec3::ZERO
    }

    /// Returns the factor that converts reflected light of `lender` to reflected light of this surface.
    pub(super) fn tint(&self, lender: &Self) -> Vec3 {
        self.reflectance() / lender.reflectance().max(Vec3::splat(LEAST_REFLECTANCE))
    }

    fn distance_squared(&self, other: &Self) -> f32 {
        Vec3A::from(self.position).distance_squared(other.position.into())
    }
}

impl GBuffer {
    /// Returns the index of a pixel near (x, y) with irradiance for the surface `seen`: the nearest center with this
    /// surface among 3×3 pixels, otherwise the nearest ring of pixels with the same surface or a similar normal.
    #[must_use]
    pub fn irradiance_source(&self, x: usize, y: usize, seen: &PixelSurface) -> Option<usize> {
        let source = self.nearest_alike(x, y, seen, None).or_else(|| self.lender(x, y, seen));
        source.map(|lender| lender.pixel as usize)
    }

    /// Returns the pixel that shows the surface `seen` by a ray: (x, y) itself, or the pixel in its 3×3 neighborhood
    /// nearest to the hit. If neither shows the surface, returns `known`, if `known` shows it.
    pub(super) fn nearest_alike(
        &self,
        x: usize,
        y: usize,
        seen: &PixelSurface,
        known: Option<Lender>,
    ) -> Option<Lender> {
        let (width, height) = (self.pixels.width(), self.pixels.height());
        // Prefer the center of the pixel itself.
        if shows(&self.pixels.row(y)[x], seen) {
            return Some(Lender::center((y * width + x) as u32));
        }

        // Otherwise, choose the surrounding center nearest in world space.
        let mut nearest: Option<(f32, usize)> = None;
        for (u, v) in around(x, y, width, height).flatten() {
            let other = &self.pixels.row(v)[u];
            let apart = other.distance_squared(seen);
            if nearest.is_none_or(|(least, _)| apart < least) && shows(other, seen) {
                nearest = Some((apart, v * width + u));
            }
        }
        let center = nearest.map(|(_, index)| Lender::center(index as u32));
        center.or_else(|| known.filter(|known| shows(&self.pixels.samples()[known.pixel as usize], seen)))
    }

    /// Returns the number of 3×3 centers around (x, y) that show the same surface as pixel `index`.
    pub(super) fn centers_alike(&self, x: usize, y: usize, index: u32) -> usize {
        let seen = self.pixels.samples()[index as usize];
        let pixels = around(x, y, self.pixels.width(), self.pixels.height()).flatten();
        pixels.filter(|&(u, v)| shows(&self.pixels.get(u, v), &seen)).count()
    }

    /// Returns the pixel that lends its light to a surface missing from the 3×3 centers around (x, y).
    ///
    /// Searches the nearest ring of pixels that shows the surface, otherwise the nearest ring with a similar normal.
    /// Within the ring, selects the pixel nearest in world space.
    pub(super) fn lender(&self, x: usize, y: usize, seen: &PixelSurface) -> Option<Lender> {
        if seen.is_unlit() {
            return None;
        }
        let (width, height) = (self.pixels.width(), self.pixels.height());
        let mut alike: Option<Lender> = None;
        // Search ring by ring. The first ring with the surface itself ends the search.
        for reach in 1..=REACH {
            let mut same: Option<(f32, usize)> = None;
            let mut other: Option<(f32, usize)> = None;
            let rows = y.saturating_sub(reach)..height.min(y + reach + 1);
            for v in rows {
                let columns = x.saturating_sub(reach)..width.min(x + reach + 1);
                for u in columns.filter(|u| u.abs_diff(x).max(v.abs_diff(y)) == reach) {
                    let pixel = self.pixels.get(u, v);
                    let (apart, index) = (pixel.distance_squared(seen), v * width + u);
                    // An emissive lender would count its emission twice.
                    if seen.emission == [0.0; 3] && shows(&pixel, seen) {
                        let is_nearer = same.is_none_or(|(least, _)| apart < least);
                        same = if is_nearer { Some((apart, index)) } else { same };
                    } else if alike.is_none() && pixel.lends_to(seen) {
                        let is_nearer = other.is_none_or(|(least, _)| apart < least);
                        other = if is_nearer { Some((apart, index)) } else { other };
                    }
                }
            }

            // Otherwise, remember the first ring with a similar normal.
            if let Some((_, index)) = same {
                return Some(Lender::borrowed(index as u32));
            }
            alike = alike.or(other.map(|(_, index)| Lender::borrowed(index as u32)));
        }
        alike
    }
}

impl PixelSurface {
    /// Returns whether this pixel's reflected light reveals the irradiance of a surface with a similar normal.
    fn lends_to(&self, seen: &Self) -> bool {
        self.instance != NOTHING
            && self.emission == [0.0; 3]
            && self.reflectance().max_element() >= LEAST_REFLECTANCE
            && Vec3A::from(self.shading_normal).dot(seen.shading_normal.into()) >= ALIKE_COSINE
    }
}
