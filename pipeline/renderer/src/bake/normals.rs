//! Baked light of normal-mapped surfaces, in spherical harmonics for each texel.
//!
//! ```text
//! E(n) = E_texel + H(n) − H(n_texel)        H  irradiance of the radiance around the texel
//! ```
//! H needs few rays, because only its dependence on the normal counts.

use super::coats::CoatBake;
use super::inside::Places;
use super::loops::{BakeLoops, LoopEnd};
use crate::normal_texels::NormalTexels;
use crate::{KnownScene, arriving_light};
use glam::Vec3;
use lightfield::Harmonics;
use lighttree::Scratch;
use rayon::prelude::*;
use render_core::{Hit, ShadingPoint, Surface};
use std::f32::consts::TAU;

/// Number of rays of a texel.
const RAYS: usize = 256;

/// Texels with normal maps, in the order of the atlas.
#[derive(Default)]
pub(super) struct MappedTexels(Vec<MappedTexel>);

/// A texel with a normal map.
struct MappedTexel {
    texel: u32,
    surface: Surface,
    point: ShadingPoint,
}

impl MappedTexels {
    /// Finds the texels with normal maps. `points` contains the shading points of the texels of `places`; a texel without
    /// a point is omitted.
    pub fn find(places: &Places, points: &[Option<ShadingPoint>]) -> Self {
        let mapped = (0..places.atlas.len()).into_par_iter().filter_map(|texel| {
            let point = points[texel]?;
            let site = *places.atlas.sites(texel, places.surfaces).first()?;
            places.surfaces.material(site.instance as usize).normal_texture.as_ref()?;
            let surface = places.atlas.surface(&site, places.surfaces);
            Some(MappedTexel { texel: texel as u32, surface, point })
        });
        Self(mapped.collect())
    }

    /// Returns the number of texels.
    pub fn len(&self) -> usize {
        self.0.len()
    }
}

impl CoatBake<'_> {
    /// Bakes the light of `mapped` texels. `done` is called with the number of texels completed since the previous call.
    pub fn normals(
        &self,
        mapped: &MappedTexels,
        loops: &mut BakeLoops,
        done: &dyn Fn(usize),
    ) -> Result<NormalTexels, LoopEnd> {
        let light_of = |scratch: &mut Scratch, place: usize| self.harmonics(&mapped.0[place], scratch).coefficients;
        let light: Vec<[Vec3; 9]> = loops.each(mapped.len(), Scratch::default, light_of, |_| done(1))?;
        let light: Vec<Harmonics> = light.into_iter().map(|coefficients| Harmonics { coefficients }).collect();
        Ok(NormalTexels::new(mapped.0.iter().map(|one| one.texel).collect(), &light))
    }

    /// Returns the light around a texel, with the texel's irradiance for the texel's own normal.
    fn harmonics(&self, mapped: &MappedTexel, scratch: &mut Scratch) -> Harmonics {
        let MappedTexel { texel, surface, point } = mapped;
        let known = |hit: &Hit, surface: &Surface| self.irradiance(hit, surface);
        let scene = KnownScene { frame: self.places.frame, known: &known };
        let mut light = Harmonics::default();
        for (direction, radiance) in arriving_light(scene, *point, surface, RAYS, scratch) {
            light.add(direction.into(), radiance, TAU / RAYS as f32);
        }
        // Only indirect light is projected: direct light is computed in each frame.
        let own = Vec3::from(self.light.indirect[*texel as usize]);
        light.add_irradiance(own - light.irradiance(point.normal.into()));
        light
    }
}
