//! Indirect light that was baked: what stands still looks it up, what moves is lit as usual.

use super::layer::{Layer, Lit, Visible};
use super::macroblock::{by_macroblock, places};
use super::tolerance::Tolerance;
use crate::error::Result;
use crate::renderer::frame::Frame;
use crate::renderer::texels::BakedTexels;
use crate::settings::Aov;
use plane::Plane;
use render_core::Busy;
use std::sync::Arc;

/// Light of the texels of an atlas.
pub(super) struct Baked {
    texels: Arc<BakedTexels>,
    /// Light of the surfaces that are not in the atlas; none where there are none.
    others: Option<Box<dyn Layer>>,
}

impl Baked {
    /// Light of `texels`, and for all other surfaces that of the layer `others`.
    pub fn new(texels: Arc<BakedTexels>, others: Option<Box<dyn Layer>>) -> Self {
        Self { texels, others }
    }
}

impl Layer for Baked {
    fn light(&mut self, visible: &Visible<'_>, wanted: Option<&Plane<bool>>, tolerance: &Tolerance<'_>) -> Lit {
        let pixels = &visible.matte.pixels;
        let size = (pixels.width(), pixels.height());
        let is_lit = |x, y| pixels.get(x, y).reflects() && wanted.is_none_or(|wanted| wanted.get(x, y));

        // Surfaces of the atlas look their light up; a NaN marks the others.
        let (busy, surfaces) = (Busy::default(), &visible.frame.surfaces);
        let of_pixel = |(x, y): (usize, usize)| {
            if !is_lit(x, y) {
                return [0.0; 3];
            }
            let irradiance = self.texels.indirect_at(&pixels.get(x, y), surfaces);
            irradiance.map_or([f32::NAN; 3], Into::into)
        };
        let mut irradiance =
            by_macroblock(size, &busy, || (), |(), columns, rows| places(columns, rows).map(of_pixel).collect());
        let missing = irradiance.map(|light: [f32; 3]| light[0].is_nan());

        // The others are lit as usual. What is in nobody's reach stays dark.
        let mut lit = match &mut self.others {
            Some(others) if missing.samples().contains(&true) => others.light(visible, Some(&missing), tolerance),
            _ => Lit::default(),
        };
        let found = lit.irradiance.take();
        for (place, light) in irradiance.samples_mut().iter_mut().enumerate() {
            if light[0].is_nan() {
                *light = found.as_ref().map_or([0.0; 3], |found| found.samples()[place]);
            }
        }
        lit += Lit { seconds: busy.seconds(), ..Lit::of_irradiance(irradiance) };
        lit
    }

    fn channel(&self, aov: Aov, frame: &Frame<'_>) -> Option<Vec<f32>> {
        self.others.as_ref()?.channel(aov, frame)
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
