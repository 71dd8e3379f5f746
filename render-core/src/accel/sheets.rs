//! Sheets, surfaces with holes or that hide a share of what is behind them: all that a ray passes, in their order.
//!
//! A camera ray and a shadow ray need no chance: the surfaces along them are listed, each with its opacity αᵢ.
//!
//! ```text
//! wᵢ = αᵢ Π_{j<i} (1 − αⱼ)        share of the pixel that layer i fills, front to back
//! T  = Π (1 − αᵢ)                 share of a light that arrives
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

/// Parts of a scene with sheets, each with a tree of its own over its groups.
#[derive(Debug)]
pub(super) struct Views {
    /// All but the sheets, and these alone.
    solid: [Accelerator; 2],
    /// All but blended surfaces, and these alone, if there are any.
    blends: Option<[Accelerator; 2]>,
}

impl Views {
    /// The parts of a scene of these groups; `None` without sheets. `build` makes the accelerator of a part.
    pub fn of(groups: &[PlacedGroup], build: impl Fn(Vec<PlacedGroup>, Sheets) -> Accelerator) -> Option<Self> {
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

/// A sheet that a ray meets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SheetHit {
    /// Where it is met.
    pub hit: Hit,
    /// Share of the ray's light that it hides, 0…1.
    pub opacity: f32,
}

/// The part of the world that a camera ray stands for: its width is `at_origin + slope · distance` \[m\].
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct RayCone {
    pub at_origin: f32,
    pub slope: f32,
}

/// Layers that hide less than this are left out, and what is behind those that let no more than this through.
const LEAST_SHARE: f32 = 1.0 / 512.0;

impl Accelerator {
    /// Whether a ray may pass through a triangle that it meets in a group.
    #[inline(always)]
    pub(super) fn may_pass(&self, placed: &PlacedGroup) -> bool {
        placed.group.cut_outs.is_some() && self.sheets != Sheets::AsWholes
    }

    /// The same scene without its sheets, and these alone, if it has any. Without them, a ray is stopped by the surfaces that are
    /// opaque as a whole.
    pub(crate) fn without_sheets(&self) -> Option<&[Self; 2]> {
        self.views.as_ref().map(|views| &views.solid)
    }

    /// The surfaces of an accelerator of sheets alone, along the ray from `origin` in the unit `direction` up to `distance` \[m\], front to back, their opacity
    /// filtered over the `cone`. Backs of single-sided surfaces are passed; nothing follows what hides all behind it.
    pub(crate) fn layers(&self, origin: Vec3A, direction: Vec3A, distance: f32, cone: RayCone) -> Vec<SheetHit> {
        let origin = origin * self.scale;
        let reach = Reach::from(origin);
        let limit = if distance < f32::MAX { reach.of(distance * self.scale) } else { f32::MAX };
        let cone = RayCone { at_origin: cone.at_origin * self.scale, ..cone };
        let list = Listing { scene: self, origin, direction, limit, kind: SheetKind::Shown(cone) };
        let mut met = self.lanes.run(list);
        sort(&mut met, reach);

        // Front to back, until all is hidden.
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

    /// Share of light that blended surfaces let through, in the scaled world, within `limit` lengths of `direction`.
    fn transmitted(&self, origin: Vec3A, direction: Vec3A, limit: f32) -> f32 {
        let mut met = self.lanes.run(Listing { scene: self, origin, direction, limit, kind: SheetKind::Blended });
        let length = direction.length().max(f32::MIN_POSITIVE);
        sort(&mut met, Reach::from(origin).of_length(length));
        met.iter().map(|passed| 1.0 - passed.opacity).product()
    }
}

/// A scene for shadow rays, of which blended surfaces let their share through.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shadows<'a> {
    scene: &'a Accelerator,
    /// The same scene without its blended surfaces, and these alone, if it has any.
    apart: Option<&'a [Accelerator; 2]>,
}

impl<'a> Shadows<'a> {
    pub fn new(scene: &'a Accelerator) -> Self {
        Self { scene, apart: scene.views.as_ref().and_then(|views| views.blends.as_ref()) }
    }

    /// All that hides a light as a whole.
    pub fn opaque(&self) -> &'a Accelerator {
        self.apart.map_or(self.scene, |[opaque, _]| opaque)
    }

    /// All that hides a light in part, if there is anything.
    pub fn blends(&self) -> Option<&'a Accelerator> {
        self.apart.map(|[_, blends]| blends)
    }

    /// Share of light that arrives from `from` at `to`, 0…1, where nothing opaque hides it.
    pub fn passed(&self, from: Vec3A, to: Vec3A) -> f32 {
        let Accelerator { scale, .. } = *self.scene;
        self.blends().map_or(1.0, |blends| blends.transmitted(from * scale, (to - from) * scale, 1.0))
    }

    /// Share of light that arrives from `from` at `to`, 0…1.
    pub fn visible(&self, from: Vec3A, to: Vec3A) -> f32 {
        if self.opaque().occluded(from, to) { 0.0 } else { self.passed(from, to) }
    }

    /// Share of light that arrives at `from` from far away in the unit direction `towards`, 0…1.
    pub fn visible_towards(&self, from: Vec3A, towards: Vec3A) -> f32 {
        if self.opaque().occluded_towards(from, towards) {
            return 0.0;
        }
        self.blends().map_or(1.0, |blends| blends.transmitted(from * blends.scale, towards, f32::MAX))
    }
}

impl Accelerator {
    /// As [`Accelerator::occluded_packet`] for `lamps` seen from one `place`: bits of those that are hidden. Blended surfaces hide a
    /// lamp by chance, each lamp by its own number, so that what lies side by side is lit alike.
    #[must_use]
    pub fn hidden_lamps(&self, place: Vec3A, lamps: &[Vec3A], active: u64) -> u64 {
        self.hidden_by_chance(place, lamps, active, |end| lamps[end])
    }

    /// The same for one `lamp` seen from `places`, at most [`PACKET`](super::PACKET).
    #[must_use]
    pub fn lamp_hidden(&self, lamp: Vec3A, places: &[Vec3A], active: u64) -> u64 {
        self.hidden_by_chance(lamp, places, active, |_| lamp)
    }

    /// Whether one `lamp` is hidden from one `place`, by the same chance.
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
        let mut hidden = shadows.opaque().occluded_packet(from, to, active);
        if let Some(blends) = shadows.blends() {
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

/// A number in 0…1 for a place.
fn number_of(place: Vec3A) -> f32 {
    let [x, y, z] = place.to_array().map(|c| u64::from(c.to_bits()));
    hash_unit(x, y, z)
}

/// Which sheets are listed, and how their opacity is found.
#[derive(Clone, Copy)]
enum SheetKind {
    /// All that a camera ray shows, over its cone in the scaled world.
    Shown(RayCone),
    /// Blended surfaces, at points.
    Blended,
}

/// A sheet that a ray passes.
struct Passed {
    met: Met,
    place: usize,
    instance: u32,
    opacity: f32,
}

/// Sorts by distance; of one instance's triangles at the same distance, which meet at an edge or are parts of one that was
/// split, one is kept.
fn sort(met: &mut Vec<Passed>, reach: Reach) {
    met.sort_by(|a, b| {
        let by_place = || (b.instance, b.place, b.met.triangle).cmp(&(a.instance, a.place, a.met.triangle));
        a.met.t.total_cmp(&b.met.t).then_with(by_place)
    });
    met.dedup_by(|later, kept| later.instance == kept.instance && later.met.t <= reach.of(kept.met.t));
}

/// Lists the sheets along a ray.
struct Listing<'a> {
    scene: &'a Accelerator,
    /// In the scaled world.
    origin: Vec3A,
    direction: Vec3A,
    /// In lengths of the direction.
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
            // Nothing behind a surface that hides all is needed.
            if opacity > 1.0 - LEAST_SHARE {
                nearest = nearest.min(met.t);
            }
            nearest
        });
        nearest
    }
}

impl RayCone {
    /// Area in which it meets a triangle at the distance `t`, as a share of the parallelogram of two of its sides, whose product
    /// is `area_vector`.
    fn share(self, t: f32, direction: Vec3A, area_vector: Vec3A) -> f32 {
        // w² / cos θ / |n|, where n · ω = |n| cos θ
        let width = self.at_origin + self.slope * t;
        let facing = area_vector.dot(direction).abs();
        if facing > 0.0 { width * width / facing } else { 0.0 }
    }
}
