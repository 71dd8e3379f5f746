//! Layer of baked indirect light.
//!
//! | surfaces | light |
//! |---|---|
//! | static, with valid texels | texels, plus the change by dynamic objects (`change.rs`) |
//! | dynamic, or without valid texels | a second layer, which gathers light from the texels (`gather.rs`) |

mod change;
mod gather;
mod lattice;
mod mover_points;
mod movers;
mod probe;
mod texel_blocks;
mod texel_light;

use super::layer::{Layer, Lit, Visible};
use super::macroblock::{by_macroblock, places};
use super::tolerance::Tolerance;
use crate::frame::Frame;
use crate::settings::Aov;
use glam::Vec3;
use pipeline::error::Result;
use plane::Plane;
use render_core::Busy;
use render_core::ranks::Alone;
pub(super) use texel_light::{TexelLight, TexelsOfFrame};

/// Minimum fraction of the texels' light that dynamic objects leave. In dark corners, errors of the change would make
/// single pixels black.
const LEAST_LEFT: f32 = 0.15;

/// Layer of baked indirect light.
pub(super) struct Baked {
    /// Layer for surfaces without valid texels.
    others: Option<Box<dyn Layer>>,
}

impl Baked {
    /// Creates a layer. The layer `others` lights surfaces without valid texels.
    pub fn new(others: Option<Box<dyn Layer>>) -> Self {
        Self { others }
    }
}

impl Layer for Baked {
    fn light(&mut self, visible: &Visible<'_>, wanted: Option<&Plane<bool>>, tolerance: &Tolerance<'_>) -> Lit {
        let pixels = &visible.matte.pixels;
        let (width, height) = (pixels.width(), pixels.height());
        let is_lit = |x, y| pixels.get(x, y).reflects() && wanted.is_none_or(|wanted| wanted.get(x, y));

        // Sample the baked light of surfaces with valid texels.
        let texels = visible.known.expect("a film with baked light has texels").texels();
        let (busy, surfaces) = (Busy::default(), &visible.frame.surfaces);
        let of_pixel = |(x, y): (usize, usize)| match is_lit(x, y) {
            true => texels.indirect_at(&pixels.get(x, y), surfaces).map(Into::into),
            false => Some([0.0; 3]),
        };
        let block = |(): &mut (), columns, rows| places(columns, rows).map(of_pixel).collect();
        let looked_up: Plane<Option<[f32; 3]>> = busy.take(by_macroblock(&Alone, width, height, || (), block));
        let still = Plane::from_fn(width, height, |x, y| looked_up.get(x, y).filter(|_| is_lit(x, y)));
        let change = visible.known.and_then(|known| known.change(visible, &still));
        let change = change.map(|change| busy.take(change));

        // Light the other surfaces by the second layer; without it, they stay black.
        let missing = looked_up.map(|light| light.is_none());
        let mut lit = match &mut self.others {
            Some(others) if missing.samples().contains(&true) => others.light(visible, Some(&missing), tolerance),
            _ => Lit::default(),
        };
        let found = lit.irradiance.take();
        let irradiance = Plane::from_fn(width, height, |x, y| match looked_up.get(x, y) {
            Some(light) => {
                let change = change.as_ref().map_or([0.0; 3], |change| change.get(x, y));
                let still = Vec3::from(light);
                (still + Vec3::from(change)).max(LEAST_LEFT * still).to_array()
            }
            None => found.as_ref().map_or([0.0; 3], |found| found.get(x, y)),
        });
        lit += Lit { seconds: busy.seconds(), ..Lit::of_irradiance(irradiance) };
        lit
    }

    fn keep(&mut self, aov: Aov) {
        if let Some(others) = &mut self.others {
            others.keep(aov);
        }
    }

    fn channel(&self, aov: Aov, frame: &Frame<'_>) -> Option<Vec<f32>> {
        self.others.as_ref()?.channel(aov, frame)
    }

    fn copy(&self) -> Option<Box<dyn Layer>> {
        let others = match &self.others {
            Some(others) => Some(others.copy()?),
            None => None,
        };
        Some(Box::new(Self { others }))
    }

    fn forget(&mut self) {
        if let Some(others) = &mut self.others {
            others.forget();
        }
    }

    fn state(&self) -> Vec<u8> {
        self.others.as_ref().map_or_else(Vec::new, |others| others.state())
    }

    fn restore(&mut self, state: &[u8], last: &Frame<'_>) -> Result<()> {
        match &mut self.others {
            Some(others) => others.restore(state, last),
            None => Ok(()),
        }
    }
}
