//! Anchor lights: virtual point lights at fixed positions on surfaces.
//!
//! Fixed anchors are distributed evenly by area over static surfaces, dynamic anchors over moving surfaces. Photons
//! determine the flux of anchors in each frame ([`crate::photon`]). An anchor has the flux of the surfels that it owns
//! ([`surfels`]).

mod exposure;
mod grid;
mod patches;
mod sight;
mod surfels;
mod zones;

use exposure::Eye;
use grid::Grid;
pub(crate) use grid::{SplatScratch, Spot};
use patches::Patches;
pub(crate) use sight::Sight;
pub use surfels::Moved;
pub(crate) use surfels::{SurfelMap, Surfels};
use zones::Shares;
pub use zones::{ZoneSearch, Zones};

use crate::accel::Geometry;
use crate::luminance;
use crate::ranks::Ranks;
use crate::scene::Scene;
use crate::surface::Surfaces;
use crate::swept::SweptVolume;
use crate::{PosedScene, Units};
use glam::{Vec3, Vec3A};
use std::f32::consts::PI;
use std::sync::Arc;

/// Number of area shares in the bound of an anchor's geometry term, if bias compensation is on.
///
/// The light near an anchor depends on the random position of the anchor. Final gathering does not depend on it, and
/// uses the denser surfels. The table shows the relative MSE against path tracing, for all lights at 128×128 pixels.
/// Lightcut sizes and frame times are the same in all rows.
///
/// | shares | `cornell` | `atrium` | `nave` |
/// |---|---|---|---|
/// | 1 | 3.8e-4 | 1.8e-3 | 2.8e-3 |
/// | 4 | 2.8e-4 | 1.4e-3 | 1.6e-3 |
/// | 8 | 2.6e-4 | 1.3e-3 | 1.4e-3 |
pub(crate) const SHARES: f32 = 8.0;

/// Number of rays that measure the exposure of an anchor. With 16 rays, pictures are as close to Mitsuba's as with 32.
const OUTLOOK_RAYS: u8 = 16;
/// Number of anchors that estimate the exposed fraction of a scene.
const PROBES: usize = 4000;

/// Minimum flux of an anchor that is split, relative to the mean of all anchors. Measured in an office with a 60 W desk
/// lamp under a shade as large as an anchor's area share. The light reflected twice is 1.9 % too dark without splitting
/// and 0.2 % too bright with a threshold of 8. A threshold of 4 is no better and adds six times as many lights.
const BRIGHT: f32 = 8.0;

/// Seed of the positions of points on their patches. The positions affect the fraction of pixels within the error
/// threshold of lightcuts. In `cornell`, 99.984 % of the pixels are within three times the threshold of 2 % with seed
/// 4. Seeds 5 to 22 yield 99.953 to 99.989 %.
const PLACEMENT: u64 = 4;

/// Minimum factor by which zones must increase the number of anchors. Below this factor, a picture improves less than
/// it may degrade at the border of a zone.
const GAIN: f32 = 2.0;

/// Minimum length of a ray from an anchor that counts as free, as a multiple of the side of an anchor's area share.
/// Nearer surfaces separate the anchor from the neighbors with which it shares energy.
const NEAR: f32 = 0.1;

/// Virtual point light that represents the light reflected by its area share of the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Anchor {
    /// Position slightly off the surface, in world space.
    pub position: Vec3A,
    /// Unit normal of the reflecting side.
    pub normal: Vec3A,
    /// Index into [`Scene::instances`].
    pub instance: u32,
}

/// Dynamic anchor, attached to a point of a triangle while the mesh moves or deforms.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct DynamicAnchor {
    /// Index into [`Scene::instances`].
    pub instance: u32,
    /// Index into the mesh's triangles.
    pub triangle: u32,
    /// Barycentric weights of the second and third corner.
    pub barycentric: (f32, f32),
    /// Whether the anchor reflects on the front side.
    pub front: bool,
    /// Offset of the anchor from the surface \[m\].
    pub offset: f32,
}

/// Fixed and dynamic anchors of a scene.
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Anchors {
    /// Anchors on static surfaces, in world space.
    pub fixed: Vec<Anchor>,
    /// Anchors on moving or deforming surfaces.
    pub dynamic: Vec<DynamicAnchor>,
    /// Area represented by each fixed anchor in zone 0 \[m²\].
    pub area_share: f32,
    /// Area represented by each dynamic anchor \[m²\].
    pub dynamic_area_share: f32,
    pub(crate) zones: Zones,
    /// Surfels that receive the flux of photons.
    pub(crate) surfels: Surfels,
}

/// Numbers of anchors, and the zones and ranks of their placement.
#[derive(Clone, Copy, Debug)]
pub struct AnchorSpread<'a> {
    /// Zones with larger area shares.
    pub zones: &'a Zones,
    /// Number of fixed anchors.
    pub fixed: usize,
    /// Number of dynamic anchors.
    pub dynamic: usize,
    /// Ranks that share the rays.
    pub ranks: &'a dyn Ranks,
}

impl Anchor {
    /// Placeholder for a list slot.
    const NOWHERE: Self = Self { position: Vec3A::ZERO, normal: Vec3A::ZERO, instance: 0 };
}

impl Anchors {
    /// Distributes `fixed` anchors over static surfaces and `dynamic` anchors over moving surfaces.
    #[must_use]
    pub fn spread(surfaces: &Surfaces, units: &Units, fixed: usize, dynamic: usize) -> Self {
        let anchors = Self::without_surfels(surfaces, units, &Zones::default(), [fixed, dynamic]);
        Self { surfels: Surfels::of(&anchors, surfaces, units), ..anchors }
    }

    /// Distributes anchors like [`Anchors::spread`], but places fixed anchors only on exposed static surfaces. There
    /// are about `fixed` of them, each with an equal share of the exposed area. Dynamic geometry does not affect
    /// exposure, because the surfaces that it covers now will receive light later. The `ranks` share the rays, and must
    /// call this function together.
    #[must_use]
    pub fn spread_exposed(
        surfaces: &Surfaces,
        geometry: &Geometry,
        units: &Units,
        &AnchorSpread { zones, fixed, dynamic, ranks }: &AnchorSpread,
    ) -> Self {
        // Measure exposure in the static geometry only.
        let accelerator = &geometry.place_still();
        let outlooks_of = |anchors: &Self, places: &[Anchor]| {
            Eye::of(anchors, surfaces, accelerator, NEAR, OUTLOOK_RAYS).outlooks(places, ranks)
        };

        // Distribute anchors over all surfaces first, as probes that measure the exposed fraction.
        let zones = &worth_it(zones, surfaces);
        let mut anchors = Self::without_surfels(surfaces, units, zones, [fixed, dynamic]);
        // Use an odd step, because points within a triangle follow a sequence of base 2.
        let every = (anchors.fixed.len() / PROBES) | 1;
        let probes: Vec<Anchor> = anchors.fixed.iter().step_by(every).copied().collect();
        let exposed = outlooks_of(&anchors, &probes).iter().filter(|outlook| outlook.exposed).count();

        // Divide the count by this fraction, so that about the requested number of anchors remains.
        if exposed > 0 && exposed < probes.len() {
            let count = (fixed as f64 * probes.len() as f64 / exposed as f64).round();
            anchors = Self::without_surfels(surfaces, units, zones, [count as usize, dynamic]);
        }

        // Drop anchors that are not exposed: they would receive energy from their neighbors and lose it.
        let outlooks = outlooks_of(&anchors, &anchors.fixed);
        let (places, outlooks) = exposure::exposed(&anchors.fixed, outlooks);
        anchors.fixed = places;
        anchors.surfels =
            Surfels::of_exposed(&mut anchors, &outlooks, PosedScene::new(accelerator, surfaces), units, ranks);
        anchors
    }

    /// Returns no anchors, but the area share for `count` fixed anchors. This area share bounds the geometry terms of
    /// lamps that are also virtual lights.
    #[must_use]
    pub fn none(surfaces: &Surfaces, count: usize) -> Self {
        let area = Patches::of(surfaces, false, &Zones::default()).map_or(0.0, |patches| patches.area());
        Self { area_share: area / count.max(1) as f32, ..Self::default() }
    }

    /// Splits fixed anchors with a `flux` of at least `BRIGHT` (8) times the mean into the surfels that they own. A
    /// lampshade or a sunlit patch then has lights in proportion to its brightness. By area alone, it would have one or
    /// two. The number of anchors grows by at most three eighths.
    pub fn split_bright(&mut self, flux: &[Vec3]) {
        // Sum in f64: a few bright anchors are added to tens of thousands of dark anchors.
        let total: f64 = flux.iter().map(|&flux| f64::from(luminance(flux))).sum();
        let least = f64::from(BRIGHT) * total / flux.len().max(1) as f64;
        let is_bright: Vec<bool> =
            flux.iter().map(|&flux| total > 0.0 && f64::from(luminance(flux)) >= least).collect();
        Arc::make_mut(&mut self.surfels.fixed).promote(&mut self.fixed, &is_bright);
    }

    /// Prepares for moving geometry within the `swept` space: light near this space is distributed by visibility in
    /// each frame.
    pub fn expect_movement(&mut self, swept: &SweptVolume) {
        let shares = self.shares();
        Arc::make_mut(&mut self.surfels.fixed).expect_movement(swept, &self.fixed, &shares);
    }

    /// Returns the flux of the fixed anchors \[W\], from the flux of the fixed surfels in a frame and the changes in
    /// `moved`.
    #[must_use]
    pub fn fixed_flux(&self, of_surfels: &[Vec3], moved: &Moved) -> Vec<Vec3> {
        self.surfels.fixed.anchor_flux(of_surfels, moved, self.fixed.len())
    }

    /// Returns the area shares of fixed anchors.
    pub(crate) fn shares(&self) -> Shares {
        Shares::new(self.area_share, &self.zones)
    }

    fn without_surfels(surfaces: &Surfaces, units: &Units, zones: &Zones, [fixed, dynamic]: [usize; 2]) -> Self {
        let mut anchors = Anchors { zones: zones.clone(), ..Anchors::default() };
        // Fix static anchors in world space.
        if let Some(patches) = Patches::of(surfaces, false, &anchors.zones) {
            anchors.fixed = patches.spread(fixed, units).iter().map(|anchor| anchor.in_world(surfaces)).collect();
            anchors.area_share = patches.area() / fixed.max(1) as f32;
        }
        // Attach dynamic anchors to triangles, so that they follow the surface. They ignore zones.
        if let Some(patches) = Patches::of(surfaces, true, &Zones::default()) {
            anchors.dynamic = patches.spread(dynamic, units);
            anchors.dynamic_area_share = patches.area() / dynamic.max(1) as f32;
        }
        anchors
    }

    /// Returns the bound s of the geometry term of fixed anchors \[m²\]. The term is `cos θ cos θ_l / (r² + s)` instead
    /// of `cos θ cos θ_l / r²`.
    ///
    /// The bound belongs to a disc of eight area shares with bias compensation ([`crate::FinalGather`]), otherwise to a
    /// disc of one area share.
    #[must_use]
    pub fn geometry_term_bound(&self, compensated: bool) -> f32 {
        self.area_share / PI * if compensated { SHARES } else { 1.0 }
    }

    /// Returns the bound of the geometry term of dynamic anchors \[m²\]. It always belongs to a disc of one area share,
    /// because few surfaces are near dynamic anchors.
    #[must_use]
    pub fn dynamic_geometry_term_bound(&self) -> f32 {
        self.dynamic_area_share / PI
    }

    /// Returns the dynamic anchors in world space, at the pose of `surfaces`.
    #[must_use]
    pub fn dynamic_in_world(&self, surfaces: &Surfaces) -> Vec<Anchor> {
        self.dynamic.iter().map(|anchor| anchor.in_world(surfaces)).collect()
    }

    /// Returns the default number of fixed anchors for a scene: 4000 for a box, 40 000 for a building.
    ///
    /// Table 1 of \[Herzog08\] lists 2000 and 9000. The error (FLIP) against converged paths by Mitsuba was measured in
    /// matte scenes at 256×256. With 40 000 anchors, it falls from 0.17 to 0.15 on Sponza. On the conference room of
    /// McGuire's archive, it falls from 0.08 to 0.06. Four times as many lights make lightcuts only a seventh to a half
    /// larger, because most lights are far away.
    #[must_use]
    pub fn default_count(scene: &Scene) -> usize {
        // A studio lights its scene directly, so reflected light is a small fraction.
        if scene.ground.is_some() {
            return STUDIO_ANCHORS;
        }
        let triangles = scene.triangle_count().max(1) as f64;
        // Map 1000 triangles to 4000 anchors, and 64 000 or more to 40 000: a factor of ten in six doublings.
        let doublings = (triangles / 1000.0).log2().clamp(0.0, 6.0);
        (4000.0 * 10f64.powf(doublings / 6.0)).round() as usize
    }
}

/// Returns the `zones` if they increase the number of anchors in zone 0 more than `GAIN`-fold (2); otherwise a single
/// zone.
fn worth_it(zones: &Zones, surfaces: &Surfaces) -> Zones {
    let area = |zones| Patches::of(surfaces, false, zones).map_or(0.0, |patches| patches.area());
    let is_worth_it = !zones.is_one() && area(&Zones::default()) > GAIN * area(zones);
    if is_worth_it { zones.clone() } else { Zones::default() }
}

/// Number of anchors in a studio.
const STUDIO_ANCHORS: usize = 1000;

impl DynamicAnchor {
    /// Returns the anchor in world space, at the pose of `surfaces`.
    fn in_world(&self, surfaces: &Surfaces) -> Anchor {
        // Compute the normal of the reflecting side. A mirrored instance reverses the order of corners.
        let [a, b, c] = surfaces.corners(self.instance as usize, self.triangle as usize);
        let mirrored = surfaces.world(self.instance as usize).matrix3.determinant() < 0.0;
        let turn = if self.front != mirrored { 1.0 } else { -1.0 };
        let normal = ((b - a).cross(c - a) * turn).normalize_or_zero();

        // Compute x = a + u (b − a) + v (c − a), slightly off the surface.
        let (u, v) = self.barycentric;
        let position = a + (b - a) * u + (c - a) * v + normal * self.offset;
        Anchor { position, normal, instance: self.instance }
    }
}
