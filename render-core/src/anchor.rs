//! Anchor lights: virtual point lights that never move over the surface they sit on.
//!
//! Fixed anchors are spread evenly by area over static surfaces, and dynamic ones over those that move. Their flux comes from
//! photons, frame by frame ([`crate::photon`]): each anchor has that of the surfels that belong to it ([`surfels`]).

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

use crate::Units;
use crate::accel::Geometry;
use crate::luminance;
use crate::scene::Scene;
use crate::surface::Surfaces;
use crate::swept::SweptVolume;
use glam::{Vec3, Vec3A};
use std::f32::consts::PI;
use std::sync::Arc;

/// Shares of surface that the bound of an anchor's geometry term extends over where there is bias compensation.
///
/// Near an anchor the light depends on where it happens to lie; final gather does not, and surfels are denser.
/// `cornell`, `atrium` and `nave` by all lights, 128×128, relative MSE against paths: 3.8e-4, 1.8e-3 and 2.8e-3 with 1 share;
/// 2.8e-4, 1.4e-3 and 1.6e-3 with 4; 2.6e-4, 1.3e-3 and 1.4e-3 with 8. Cuts are as large, and frames take as long.
pub(crate) const SHARES: f32 = 8.0;

/// Rays from an anchor that measure how exposed it is. With 16 pictures are no farther from Mitsuba's than with 32.
const OUTLOOK_RAYS: u8 = 16;
/// Anchors that the exposed share of a scene is estimated from.
const PROBES: usize = 4000;

/// Flux of an anchor, in means of all, from which on it is split. In an office whose desk lamp holds 60 W in a shade of the
/// size of an anchor's share, the light reflected twice is 1.9 % too dark without, 0.2 % too bright with 8, and no better with
/// 4, which adds six times as many lights.
const BRIGHT: f32 = 8.0;

/// Number that the places of points on their patches are drawn with. Cuts keep their thresholds more or less well by where
/// anchors happen to lie: in `cornell`, 99.984 % of the pixels are within three times 2 % with 4, and 99.953 to 99.989 % with 5
/// to 22.
const PLACEMENT: u64 = 4;

/// Least gain of anchors by zones. Below it, a picture gains less than it may lose at the border of a zone.
const GAIN: f32 = 2.0;

/// Distance at which a ray from an anchor gets out, in sides of an anchor's share. Nearer things stand between the anchor and
/// the neighbors that it shares energy with.
const NEAR: f32 = 0.1;

/// A virtual point light: it stands for the light that its share of surface reflects.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Anchor {
    /// A little off the surface, world space.
    pub position: Vec3A,
    /// Unit normal of the reflecting side.
    pub normal: Vec3A,
    /// Index into [`Scene::instances`].
    pub instance: u32,
}

/// A dynamic anchor: bound to a point of a triangle, however its mesh moves or bends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DynamicAnchor {
    /// Index into [`Scene::instances`].
    pub instance: u32,
    /// Index into the mesh's triangles.
    pub triangle: u32,
    /// Barycentric weights of the second and the third corner.
    pub barycentric: (f32, f32),
    /// Whether it reflects on the front.
    pub front: bool,
    /// Meters off the surface.
    pub offset: f32,
}

/// The anchors of a scene.
#[derive(Clone, Debug, Default)]
pub struct Anchors {
    /// On static surfaces, in world space.
    pub fixed: Vec<Anchor>,
    /// On surfaces that move or bend.
    pub dynamic: Vec<DynamicAnchor>,
    /// Square meters that each fixed anchor stands for, in the first of the zones.
    pub area_share: f32,
    /// Square meters that each dynamic anchor stands for.
    pub dynamic_area_share: f32,
    pub(crate) zones: Zones,
    /// Photons leave their flux here.
    pub(crate) surfels: Surfels,
}

impl Anchor {
    /// Holds a place in a list until it is filled.
    const NOWHERE: Self = Self { position: Vec3A::ZERO, normal: Vec3A::ZERO, instance: 0 };
}

impl Anchors {
    /// Spreads `fixed` anchors over static surfaces and `dynamic` ones over those that move.
    #[must_use]
    pub fn spread(surfaces: &Surfaces, units: &Units, fixed: usize, dynamic: usize) -> Self {
        let anchors = Self::without_surfels(surfaces, units, &Zones::default(), [fixed, dynamic]);
        Self { surfels: Surfels::of(&anchors, surfaces, units), ..anchors }
    }

    /// As [`Anchors::spread`], over the exposed parts of what stands still: as many of the `fixed` anchors as can be, each
    /// standing for the same share of them. Things that move cover nothing: where one stands now, light will fall later.
    #[must_use]
    pub fn spread_exposed(
        surfaces: &Surfaces,
        geometry: &Geometry,
        units: &Units,
        zones: &Zones,
        [fixed, dynamic]: [usize; 2],
    ) -> Self {
        // Places are rated by the things at rest alone.
        let accelerator = &geometry.place_still();
        let outlooks_of = |anchors: &Self, places: &[Anchor]| {
            Eye::of(anchors, surfaces, accelerator, NEAR, OUTLOOK_RAYS).outlooks(places)
        };

        // A first spread over all surfaces tells by probes which share of them is exposed.
        let zones = &worth_it(zones, surfaces);
        let mut anchors = Self::without_surfels(surfaces, units, zones, [fixed, dynamic]);
        // Odd: points within a triangle lie on a sequence of base 2.
        let every = (anchors.fixed.len() / PROBES) | 1;
        let probes: Vec<Anchor> = anchors.fixed.iter().step_by(every).copied().collect();
        let exposed = outlooks_of(&anchors, &probes).iter().filter(|outlook| outlook.exposed).count();

        // Divided by this share, the count leaves about the number of anchors wanted.
        if exposed > 0 && exposed < probes.len() {
            let count = (fixed as f64 * probes.len() as f64 / exposed as f64).round();
            anchors = Self::without_surfels(surfaces, units, zones, [count as usize, dynamic]);
        }

        // Those that are not exposed would take energy from their neighbors, and lose it.
        let outlooks = outlooks_of(&anchors, &anchors.fixed);
        let (places, outlooks) = exposure::exposed(&anchors.fixed, outlooks);
        anchors.fixed = places;
        anchors.surfels = Surfels::of_exposed(&mut anchors, &outlooks, surfaces, accelerator, units);
        anchors
    }

    /// No anchors, with the share of surface that each of `count` fixed ones would have: it bounds the geometry terms of lamps
    /// that are virtual lights too.
    #[must_use]
    pub fn none(surfaces: &Surfaces, count: usize) -> Self {
        let area = Patches::of(surfaces, false, &Zones::default()).map_or(0.0, |patches| patches.area());
        Self { area_share: area / count.max(1) as f32, ..Self::default() }
    }

    /// Splits fixed anchors whose `flux` is `BRIGHT` (8) times the mean or more into the surfels that they shine for. So a
    /// lampshade or a sunlit patch has as many lights as it is bright, where area alone would give it one or two. At most three
    /// in eight are added.
    pub fn split_bright(&mut self, flux: &[Vec3]) {
        // In f64: a few bright anchors are added to tens of thousands of dark ones.
        let total: f64 = flux.iter().map(|&flux| f64::from(luminance(flux))).sum();
        let least = f64::from(BRIGHT) * total / flux.len().max(1) as f64;
        let is_bright: Vec<bool> =
            flux.iter().map(|&flux| total > 0.0 && f64::from(luminance(flux)) >= least).collect();
        Arc::make_mut(&mut self.surfels.fixed).promote(&mut self.fixed, &is_bright);
    }

    /// Expects moving things within the `swept` space: light that is left near it is shared out by what is in sight in each frame.
    pub fn expect_movement(&mut self, swept: &SweptVolume) {
        let shares = self.shares();
        Arc::make_mut(&mut self.surfels.fixed).expect_movement(swept, &self.fixed, &shares);
    }

    /// The flux of the fixed anchors, from that which photons left at the fixed surfels in a frame, and what has `moved` there \[W\].
    #[must_use]
    pub fn fixed_flux(&self, of_surfels: &[Vec3], moved: &Moved) -> Vec<Vec3> {
        self.surfels.fixed.anchor_flux(of_surfels, moved, self.fixed.len())
    }

    /// Square meters that fixed anchors stand for.
    pub(crate) fn shares(&self) -> Shares {
        Shares::new(self.area_share, &self.zones)
    }

    fn without_surfels(surfaces: &Surfaces, units: &Units, zones: &Zones, [fixed, dynamic]: [usize; 2]) -> Self {
        let mut anchors = Anchors { zones: zones.clone(), ..Anchors::default() };
        if let Some(patches) = Patches::of(surfaces, false, &anchors.zones) {
            anchors.fixed = patches.spread(fixed, units).iter().map(|anchor| anchor.in_world(surfaces)).collect();
            anchors.area_share = patches.area() / fixed.max(1) as f32;
        }
        if let Some(patches) = Patches::of(surfaces, true, &Zones::default()) {
            anchors.dynamic = patches.spread(dynamic, units);
            anchors.dynamic_area_share = patches.area() / dynamic.max(1) as f32;
        }
        anchors
    }

    /// Bound s of the geometry term of fixed anchors \[m²\]: it is `cos θ cos θ_l / (r² + s)` in place of `/ r²`.
    ///
    /// With bias compensation ([`crate::FinalGather`]) it is that of a disc of eight shares, without that of one.
    #[must_use]
    pub fn geometry_term_bound(&self, compensated: bool) -> f32 {
        self.area_share / PI * if compensated { SHARES } else { 1.0 }
    }

    /// The same bound for dynamic anchors \[m²\]: that of their own share, as little is near to them.
    #[must_use]
    pub fn dynamic_geometry_term_bound(&self) -> f32 {
        self.dynamic_area_share / PI
    }

    /// The dynamic anchors in world space at the pose that `surfaces` has.
    #[must_use]
    pub fn dynamic_in_world(&self, surfaces: &Surfaces) -> Vec<Anchor> {
        self.dynamic.iter().map(|anchor| anchor.in_world(surfaces)).collect()
    }

    /// A sensible number of fixed anchors for a scene: 4000 for a box, 40 000 for a building.
    ///
    /// Table 1 of \[Herzog08\] has 2000 and 9000. With 40 000, FLIP against converged paths by Mitsuba falls from 0.17 to 0.15 on
    /// Sponza and from 0.08 to 0.06 on the conference room of McGuire's archive (all matte, 256×256). Four times as many lights
    /// make cuts a seventh to a half larger, as most of them are far away.
    #[must_use]
    pub fn default_count(scene: &Scene) -> usize {
        let triangles = scene.triangle_count().max(1) as f64;
        // 1000 triangles → 4000, 64 000 and more → 40 000, tenfold in six doublings.
        let doublings = (triangles / 1000.0).log2().clamp(0.0, 6.0);
        (4000.0 * 10f64.powf(doublings / 6.0)).round() as usize
    }
}

/// The `zones`, if they leave the first more than `GAIN` (2) times as many anchors; else one zone.
fn worth_it(zones: &Zones, surfaces: &Surfaces) -> Zones {
    let area = |zones| Patches::of(surfaces, false, zones).map_or(0.0, |patches| patches.area());
    let is_worth_it = !zones.is_one() && area(&Zones::default()) > GAIN * area(zones);
    if is_worth_it { zones.clone() } else { Zones::default() }
}

impl DynamicAnchor {
    /// Where it is at the pose that `surfaces` has.
    fn in_world(&self, surfaces: &Surfaces) -> Anchor {
        // The normal of the side that reflects. An instance that is mirrored has its corners the other way round.
        let [a, b, c] = surfaces.corners(self.instance as usize, self.triangle as usize);
        let mirrored = surfaces.world(self.instance as usize).matrix3.determinant() < 0.0;
        let turn = if self.front != mirrored { 1.0 } else { -1.0 };
        let normal = ((b - a).cross(c - a) * turn).normalize_or_zero();

        // x = a + u (b − a) + v (c − a), and a little off the surface.
        let (u, v) = self.barycentric;
        let position = a + (b - a) * u + (c - a) * v + normal * self.offset;
        Anchor { position, normal, instance: self.instance }
    }
}
