//! Light that a single reflection ray brings in excess of the others, spread over the pixels around.
//!
//! Each pixel takes its share by a tent along rows, then along columns, from coats of the same instance:
//!
//! ```text
//! S(x, y) = Σ_v t(v − y) Σ_u t(u − x) s(u, v) / Σ_v t(v − y) Σ_u t(u − x)
//! ```

use crate::renderer::shade::macroblock::{by_macroblock, places};
use glam::Vec3;
use plane::Plane;
use render_core::{Busy, GBuffer, NOTHING};
use std::ops::Range;

/// Reach of the tent, in pixels.
const REACH: usize = 10;

/// Σ t s and Σ t.
#[derive(Clone, Copy, Debug, Default)]
struct Share {
    light: Vec3,
    weight: f32,
}

impl Share {
    fn plus(self, tent: f32, other: Self) -> Self {
        Self { light: self.light + tent * other.light, weight: self.weight + tent * other.weight }
    }
}

/// Share of each pixel in the `sparks` around it: radiance. Adds the work to `busy`.
pub(super) fn spread(sparks: &Plane<Vec3>, seen: &GBuffer, busy: &Busy) -> Plane<Vec3> {
    let size = (sparks.width(), sparks.height());
    let carriers = seen.pixels.map(|pixel| if pixel.specular == [0.0; 3] { NOTHING } else { pixel.instance });
    let pass = |line: &(dyn Fn(usize, usize, u32) -> Share + Sync)| {
        by_macroblock(
            size,
            busy,
            || (),
            |(), columns, rows| {
                let share = |(x, y)| match carriers.get(x, y) {
                    NOTHING => Share::default(),
                    own => line(x, y, own),
                };
                places(columns, rows).map(share).collect()
            },
        )
    };
    let in_rows = pass(&|x, y, own| {
        let alike = around(x, size.0).filter(|&u| carriers.get(u, y) == own);
        alike.fold(Share::default(), |sum, u| sum.plus(tent(u, x), Share { light: sparks.get(u, y), weight: 1.0 }))
    });
    let whole = pass(&|x, y, own| {
        let alike = around(y, size.1).filter(|&v| carriers.get(x, v) == own);
        alike.fold(Share::default(), |sum, v| sum.plus(tent(v, y), in_rows.get(x, v)))
    });
    whole.map(|share| if share.weight > 0.0 { share.light / share.weight } else { Vec3::ZERO })
}

fn around(center: usize, end: usize) -> Range<usize> {
    center.saturating_sub(REACH)..(center + REACH + 1).min(end)
}

fn tent(a: usize, b: usize) -> f32 {
    (REACH + 1 - a.abs_diff(b)) as f32
}
