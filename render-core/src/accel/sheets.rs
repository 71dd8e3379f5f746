//! List of all sheets (surfaces with holes or partial opacity) along a ray, front to back.
//!
//! Camera rays and shadow rays are not stochastic. The surfaces along them are listed, each with an opacity αᵢ:
//!
//! ```text
//! wᵢ = αᵢ Π_{j<i} (1 − αⱼ)        fraction of the pixel that layer i fills, front to back
//! T  = Π (1 − αᵢ)                 fraction of a light that arrives
//! ```

use super::cut_outs::Sheets;
use super::group::{Group, Met};
use super::ray::Ray;
use super::reach::Reach;
use super::tree::Visit;
use super::{Accelerator, Hit, PlacedGroup};
use crate::sampling::hash_unit;
use glam::Vec3A;
use lanes::{Kernel, Lanes};

/// Accelerators of subsets of a scene with sheets, each with a top-level tree over its groups.
#[derive(Debug)]
pub(super) struct Views {
    /// Accelerators of the groups without holes and of the groups with holes.
    solid: [Accelerator; 2],
    /// Accelerators of opaque surfaces with masks, and of blended surfaces. `None` without blended surfaces.
    blends: Option<[Accelerator; 2]>,
}

impl Views {
    /// Splits the groups of a scene, or returns `None` if it has no sheets. `build` creates the accelerator of a
    /// subset.
    pub fn of(groups: &[PlacedGroup], build: impl Fn(Vec<PlacedGroup>, Sheets) -> Accelerator) -> Option<Self> {
        // Build an accelerator of each subset of the groups.
        let part = |is_in: fn(&Group) -> bool, sheets| {
            let groups = groups.iter().filter(|placed| is_in(&placed.group));
            build(groups.cloned().collect(), sheets)
        };
        let has = |is: fn(&Group) -> bool| groups.iter().any(|placed| is(&placed.group));
        has(|group| group.cut_outs.is_some()).then(|| Self {
            solid: [
                part(|group| group.cut_outs.is_none(), Sheets::ByChance),
                part(|group| group.cut_outs.is_some(), Sheets::ByChance),
            ],
            blends: has(|group| group.is_blended).then(|| {
                let opaque = part(|group| !group.is_blended, Sheets::ByChance);
                [opaque, part(|group| group.is_blended, Sheets::AsWholes)]
            }),
        })
    }
}

/// Sheet hit by a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SheetHit {
    /// Intersection of the ray with the sheet.
    pub hit: Hit,
    /// Fraction of the ray's light that the sheet blocks, 0…1.
    pub opacity: f32,
}

/// Footprint of a camera ray, of width `at_origin + slope · distance` \[m\].
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct RayCone {
    pub at_origin: f32,
    pub slope: f32,
}

/// Minimum opacity of a layer. Layers with less opacity are ignored, and also layers behind a surface that transmits
/// less than this fraction.
const LEAST_SHARE: f32 = 1.0 / 512.0;

impl Accelerator {
    /// Returns whether a ray may pass through a triangle that it hits in a group.
    #[inline(always)]
    pub(super) fn may_pass(&self, placed: &PlacedGroup) -> bool {
        placed.group.cut_outs.is_some() && self.sheets != Sheets::AsWholes
    }

    /// Returns the scene without its sheets and the sheets alone, or `None` if the scene has no sheets. The scene
    /// without sheets stops rays only at fully opaque surfaces.
    pub(crate) fn without_sheets(&self) -> Option<&[Self; 2]> {
        self.views.as_ref().map(|views| &views.solid)
    }

    /// Returns the sheets along the ray from `origin` in the unit direction `direction` up to `distance` \[m\], front
    /// to back. The accelerator must contain only sheets. Opacity is filtered over the `cone`. Rays pass through the
    /// backs of single-sided surfaces. The list ends at the first opaque layer.
    pub(crate) fn layers(&self, origin: Vec3A, direction: Vec3A, distance: f32, cone: RayCone) -> Vec<SheetHit> {
        let origin = origin * self.scale;
        let reach = Reach::from(origin);
        // Collect all sheets along the ray, sorted by distance.
        let limit = if distance < f32::MAX { reach.of(distance * self.scale) } else { f32::MAX };
        let cone = RayCone { at_origin: cone.at_origin * self.scale, ..cone };
        let list = Listing { scene: self, origin, direction, limit, kind: SheetKind::Shown(cone) };
        let mut met = self.lanes.run(list);
        sort(&mut met, reach);

        // List layers front to back until a layer is opaque.
        let mut layers = Vec::new();
        for Passed { met, place, opacity, .. } in met {
            let placed = &self.groups[place];
            let owner = placed.group.owner(met.triangle, placed.instance);
            let (distance, instance, triangle) = (met.t / self.scale, owner.instance, owner.triangle);
            let is_whole = opacity > 1.0 - LEAST_SHARE;
            let hit = Hit { distance, instance, triangle, u: met.u, v: met.v };
            layers.push(SheetHit { hit, opacity: if is_whole { 1.0 } else { opacity } });
            if is_whole {
                break;
            }
        }
        layers
    }

    /// Returns the fraction of light that blended surfaces transmit from `origin` up to `limit` lengths of `direction`,
    /// in the scaled world.
    fn transmitted(&self, origin: Vec3A, direction: Vec3A, limit: f32) -> f32 {
        let mut met = self.lanes.run(Listing { scene: self, origin, direction, limit, kind: SheetKind::Blended });
        let length = direction.length().max(f32::MIN_POSITIVE);
        sort(&mut met, Reach::from(origin).of_length(length));
        met.iter().map(|passed| 1.0 - passed.opacity).product()
    }
}

/// Scene for shadow rays, in which blended surfaces transmit some light.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shadows<'a> {
    scene: &'a Accelerator,
    /// Accelerators of the scene without its blended surfaces, and of the blended surfaces alone. `None` without
    /// blended surfaces.
    apart: Option<&'a [Accelerator; 2]>,
}

impl<'a> Shadows<'a> {
    pub fn new(scene: &'a Accelerator) -> Self {
        Self { scene, apart: scene.views.as_ref().and_then(|views| views.blends.as_ref()) }
    }

    /// Returns the accelerator of the surfaces that block light completely.
    pub fn opaque(&self) -> &'a Accelerator {
        self.apart.map_or(self.scene, |[opaque, _]| opaque)
    }

    /// Returns the accelerator of the surfaces that block light partially, if the scene has any.
    pub fn blends(&self) -> Option<&'a Accelerator> {
        self.apart.map(|[_, blends]| blends)
    }

    /// Returns the fraction of light from `from` that blended surfaces transmit to `to`, 0…1. Ignores opaque surfaces.
    pub fn passed(&self, from: Vec3A, to: Vec3A) -> f32 {
        let Accelerator { scale, .. } = *self.scene;
        self.blends().map_or(1.0, |blends| blends.transmitted(from * scale, (to - from) * scale, 1.0))
    }

    /// Returns the fraction of light from `from` that arrives at `to`, 0…1.
    pub fn visible(&self, from: Vec3A, to: Vec3A) -> f32 {
        if self.opaque().occluded(from, to) { 0.0 } else { self.passed(from, to) }
    }

    /// Returns the fraction of light from infinity in the unit direction `towards` that arrives at `from`, 0…1.
    pub fn visible_towards(&self, from: Vec3A, towards: Vec3A) -> f32 {
        if self.opaque().occluded_towards(from, towards) {
            return 0.0;
        }
        self.blends().map_or(1.0, |blends| blends.transmitted(from * blends.scale, towards, f32::MAX))
    }
}

impl Accelerator {
    /// Tests the segments from `place` to `lamps`, and returns the mask of hidden lamps. Blended surfaces hide a lamp
    /// stochastically. The threshold depends only on the lamp's position, so that the light at adjacent points is
    /// consistent.
    #[must_use]
    pub fn hidden_lamps(&self, place: Vec3A, lamps: &[Vec3A], active: u64) -> u64 {
        self.hidden_by_chance(place, lamps, active, |end| lamps[end])
    }

    /// Tests one `lamp` from at most [`PACKET`](super::PACKET) `places`. Returns the mask of the places from which the
    /// lamp is hidden.
    #[must_use]
    pub fn lamp_hidden(&self, lamp: Vec3A, places: &[Vec3A], active: u64) -> u64 {
        self.hidden_by_chance(lamp, places, active, |_| lamp)
    }

    /// Returns whether one `lamp` is hidden from one `place`. Uses the threshold of [`Accelerator::hidden_lamps`].
    #[inline]
    #[must_use]
    pub fn hides_lamp(&self, lamp: Vec3A, place: Vec3A) -> bool {
        match Shadows::new(self).blends() {
            None => self.occluded(place, lamp),
            Some(_) => self.hidden_lamps(place, &[lamp], 1) == 1,
        }
    }

    #[inline]
    fn hidden_by_chance(&self, from: Vec3A, to: &[Vec3A], active: u64, lamp: impl Fn(usize) -> Vec3A) -> u64 {
        let shadows = Shadows::new(self);
        // Test opaque surfaces for all segments at once.
        let mut hidden = shadows.opaque().occluded_packet(from, to, active);
        if let Some(blends) = shadows.blends() {
            // Compare the transmission of the remaining segments with a threshold per lamp.
            let mut partly = blends.occluded_packet(from, to, active & !hidden);
            while partly != 0 {
                let end = partly.trailing_zeros() as usize;
                partly &= partly - 1;
                hidden |= u64::from(shadows.passed(from, to[end]) <= number_of(lamp(end))) << end;
            }
        }
        hidden
    }
}

/// Returns a pseudorandom number in 0…1 for a position.
fn number_of(place: Vec3A) -> f32 {
    let [x, y, z] = place.to_array().map(|c| u64::from(c.to_bits()));
    hash_unit(x, y, z)
}

/// Selection of the listed sheets, and the sampling method for opacity.
#[derive(Clone, Copy)]
enum SheetKind {
    /// Lists all sheets visible to a camera ray. Opacity is filtered over the ray's cone, in the scaled world.
    Shown(RayCone),
    /// Lists blended surfaces. Opacity is sampled at points.
    Blended,
}

/// Sheet that a ray passes through.
struct Passed {
    met: Met,
    place: usize,
    instance: u32,
    opacity: f32,
}

/// Sorts by distance. Keeps one of several hits of the same instance at the same distance, because triangles share
/// edges and large triangles are split.
fn sort(met: &mut Vec<Passed>, reach: Reach) {
    // Put the later instance first among hits at equal distances.
    met.sort_by(|a, b| {
        let by_place = || (b.instance, b.place, b.met.triangle).cmp(&(a.instance, a.place, a.met.triangle));
        a.met.t.total_cmp(&b.met.t).then_with(by_place)
    });
    met.dedup_by(|later, kept| later.instance == kept.instance && later.met.t <= reach.of(kept.met.t));
}

/// Query that lists the sheets along a ray.
struct Listing<'a> {
    scene: &'a Accelerator,
    /// Origin in the scaled world.
    origin: Vec3A,
    direction: Vec3A,
    /// Maximum distance, in lengths of the direction.
    limit: f32,
    kind: SheetKind,
}

impl Kernel for Listing<'_> {
    type Output = Vec<Passed>;

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) -> Vec<Passed> {
        let Self { scene, origin, direction, limit, .. } = self;
        let mut visitor = SheetGroups { listing: self, passed: Vec::new() };
        scene.top.walk(lanes, &Ray::new(origin, direction), limit, &mut visitor);
        visitor.passed
    }
}

struct SheetGroups<'a> {
    listing: Listing<'a>,
    passed: Vec<Passed>,
}

impl Visit for SheetGroups<'_> {
    #[inline(always)]
    fn leaf<L: Lanes>(&mut self, lanes: L, content: u32, _: f32, limit: f32) -> f32 {
        let Listing { scene, origin, direction, kind, .. } = self.listing;
        let place = content as usize;
        let placed = &scene.groups[place];
        let Some(cut_outs) = &placed.group.cut_outs else { return limit };
        let (from, along) = placed.local(origin, direction);
        let mut nearest = limit;
        placed.group.each_within(lanes, &Ray::new(from, along), limit, |leaf, lane, met| {
            let owner = placed.group.owner(met.triangle, placed.instance);
            let at = [met.u, met.v];
            // Filter opacity over the cone for camera rays; sample it for shadow rays.
            let opacity = match kind {
                SheetKind::Blended => cut_outs.blended_opacity(owner, at),
                SheetKind::Shown(_) if scene.is_back(met.triangle, place, leaf.corners(lane), direction) => 0.0,
                SheetKind::Shown(cone) => {
                    let [a, b, c] = placed.world_corners(leaf.corners(lane));
                    let area_vector = (b - a).cross(c - a);
                    cut_outs.opacity(owner, at, cone.share(met.t, direction, area_vector))
                }
            };
            if opacity >= LEAST_SHARE {
                let instance = owner.instance;
                self.passed.push(Passed { met, place, instance, opacity });
            }
            // Skip surfaces behind an opaque surface.
            if opacity > 1.0 - LEAST_SHARE {
                nearest = nearest.min(met.t);
            }
            nearest
        });
        nearest
    }
}

impl RayCone {
    /// Returns the area in which the cone intersects a triangle at the distance `t`, as a fraction of a parallelogram.
    /// Two sides of the triangle, with the cross product `area_vector`, span the parallelogram.
    fn share(self, t: f32, direction: Vec3A, area_vector: Vec3A) -> f32 {
        // The area is w² / cos θ, divided by |n|, where n · ω = |n| cos θ.
        let width = self.at_origin + self.slope * t;
        let facing = area_vector.dot(direction).abs();
        if facing > 0.0 { width * width / facing } else { 0.0 }
    }
}
