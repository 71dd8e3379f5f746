//! List of all sheets (surfaces with holes or partial opacity) along a ray, front to back.
//!
//! Camera rays and shadow rays are not stochastic. The surfaces along them are listed, each with an opacity αᵢ:
//!
//! ```text
//! wᵢ = αᵢ Π_{j<i} (1 − αⱼ)        fraction of the pixel that layer i fills, front to back
//! T  = Π (1 − αᵢ)                 fraction of a light that arrives
//! ```
//! Shadow rays also pass transparent surfaces (`panes.rs`), which all other rays hit.

use super::cut_outs::Sheets;
use super::group::{Group, Met};
use super::ray::Ray;
use super::reach::Reach;
use super::tree::Visit;
use super::triangles::Owner;
use super::{Accelerator, Hit, PlacedGroup};
use crate::luminance;
use crate::sampling::hash_unit;
use glam::{Vec3, Vec3A};
use lanes::{Kernel, Lanes};

/// Accelerators of subsets of a scene with sheets, each with a top-level tree over its groups.
#[derive(Debug)]
pub(super) struct Views {
    /// Accelerators of the groups without holes and of the groups with holes. `None` without holes.
    solid: Option<[Accelerator; 2]>,
    /// Accelerators of opaque surfaces with masks, and of blended and transparent surfaces. `None` without surfaces that
    /// pass light.
    blends: Option<[Accelerator; 2]>,
}

impl Views {
    /// Splits the groups of a scene, or returns `None` if it has neither sheets nor transparent surfaces. `build` creates the accelerator of a
    /// subset.
    pub fn of(groups: &[PlacedGroup], build: impl Fn(Vec<PlacedGroup>, Sheets) -> Accelerator) -> Option<Self> {
        // Build an accelerator of each subset of the groups.
        let part = |is_in: fn(&Group) -> bool, sheets| {
            let groups = groups.iter().filter(|placed| is_in(&placed.group));
            build(groups.cloned().collect(), sheets)
        };
        let has = |is: fn(&Group) -> bool| groups.iter().any(|placed| is(&placed.group));
        let solid = has(|group| group.cut_outs.is_some()).then(|| {
            [
                part(|group| group.cut_outs.is_none(), Sheets::ByChance),
                part(|group| group.cut_outs.is_some(), Sheets::ByChance),
            ]
        });
        let blends = has(Group::passes_light).then(|| {
            let opaque = part(|group| !group.passes_light(), Sheets::ByChance);
            [opaque, part(Group::passes_light, Sheets::AsWholes)]
        });
        (solid.is_some() || blends.is_some()).then_some(Self { solid, blends })
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

/// Surfaces along a ray through sheets.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Layered {
    /// Sheets with a partial opacity, front to back.
    pub sheets: Vec<SheetHit>,
    /// First opaque surface, or `None` for the sky.
    pub end: Option<Hit>,
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
        self.views.as_ref()?.solid.as_ref()
    }

    /// Returns all surfaces along a ray from `origin` in the unit direction `direction`, or `None` if the scene has no
    /// sheets. The ray's width is `width` at the origin \[m\] and grows by `slope` per meter.
    ///
    /// [`closest`](Self::closest) returns one of these surfaces, chosen by opacity: the noise of a few such rays is
    /// visible.
    #[must_use]
    pub fn layered(&self, origin: Vec3A, direction: Vec3A, width: f32, slope: f32) -> Option<Layered> {
        let [solid, sheets] = self.without_sheets()?;
        let mut end = solid.closest(origin, direction);
        let distance = end.map_or(f32::MAX, |hit| hit.distance);
        let mut sheets = sheets.layers(origin, direction, distance, RayCone { at_origin: width, slope });
        // An opaque sheet ends the ray.
        if let Some(last) = sheets.pop_if(|last| last.opacity >= 1.0) {
            end = Some(last.hit);
        }
        Some(Layered { sheets, end })
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

    /// Returns the fraction of light that blended and transparent surfaces transmit from `origin` up to `limit` lengths of
    /// `direction`, in the scaled world, linear RGB.
    fn transmitted(&self, origin: Vec3A, direction: Vec3A, limit: f32) -> Vec3 {
        let mut met = self.lanes.run(Listing { scene: self, origin, direction, limit, kind: SheetKind::Blended });
        let length = direction.length().max(f32::MIN_POSITIVE);
        sort(&mut met, Reach::from(origin).of_length(length));
        let surfaces: Vec3 = met.iter().fold(Vec3::ONE, |left, passed| left * passed.through);
        if surfaces == Vec3::ZERO { surfaces } else { surfaces * volumes(&met, limit, length / self.scale) }
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

    /// Returns the fraction of light from `from` that blended and transparent surfaces transmit to `to`, linear RGB.
    /// Ignores opaque surfaces.
    pub fn passed(&self, from: Vec3A, to: Vec3A) -> Vec3 {
        let Accelerator { scale, .. } = *self.scene;
        self.blends().map_or(Vec3::ONE, |blends| blends.transmitted(from * scale, (to - from) * scale, 1.0))
    }

    /// Returns the fraction of light from `from` that arrives at `to`, linear RGB.
    pub fn visible(&self, from: Vec3A, to: Vec3A) -> Vec3 {
        if self.opaque().occluded(from, to) { Vec3::ZERO } else { self.passed(from, to) }
    }

    /// Returns the fraction of light from infinity in the unit direction `towards` that arrives at `from`, linear RGB.
    pub fn visible_towards(&self, from: Vec3A, towards: Vec3A) -> Vec3 {
        if self.opaque().occluded_towards(from, towards) {
            return Vec3::ZERO;
        }
        self.blends().map_or(Vec3::ONE, |blends| blends.transmitted(from * blends.scale, towards, f32::MAX))
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
                hidden |= u64::from(luminance(shadows.passed(from, to[end])) <= number_of(lamp(end))) << end;
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
    /// Lists blended and transparent surfaces. Opacity is sampled at points.
    Blended,
}

/// Sheet that a ray passes through.
struct Passed {
    met: Met,
    place: usize,
    instance: u32,
    opacity: f32,
    /// Fraction of light that passes the surface, linear RGB.
    through: Vec3,
    /// Crossing of a volume's surface; `None` for all other surfaces.
    crossing: Option<Crossing>,
}

/// Crossing of the surface of a transparent volume.
#[derive(Clone, Copy)]
struct Crossing {
    /// Attenuation coefficient of the volume \[1/m\].
    attenuation: Vec3,
    /// Whether the ray leaves the volume.
    leaves: bool,
}

/// Returns the fraction of light that volumes transmit along a ray, given the surfaces on it in order. `limit` is the end
/// of the ray, and `unit` is the length of the ray's direction \[m\].
fn volumes(met: &[Passed], limit: f32, unit: f32) -> Vec3 {
    let mut depth = Vec3::ZERO;
    let mut entered: Vec<&Passed> = Vec::new();
    for passed in met {
        let Some(Crossing { attenuation, leaves }) = passed.crossing else { continue };
        if !leaves {
            entered.push(passed);
            continue;
        }
        // Without an entry, the ray starts inside.
        let place = entered.iter().rposition(|entry| entry.instance == passed.instance);
        let from = place.map_or(0.0, |place| entered.remove(place).met.t);
        depth += attenuation * (passed.met.t - from);
    }
    // The ray ends inside the volumes that it has not left.
    for entry in entered.iter().filter(|_| limit < f32::MAX) {
        depth += entry.crossing.map_or(Vec3::ZERO, |crossing| crossing.attenuation) * (limit - entry.met.t);
    }
    (depth * -unit).exp().min(Vec3::ONE)
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

impl Listing<'_> {
    /// Returns the surface of transparent geometry that a ray passes. The triangle has these `corners` in the local space
    /// of the group at index `place`.
    fn pane(&self, owner: Owner, met: Met, place: usize, corners: [Vec3A; 3]) -> Option<Passed> {
        let placed = &self.scene.groups[place];
        let panes = placed.group.panes.as_ref()?;
        let [a, b, c] = placed.world_corners(corners);
        let normal = (b - a).cross(c - a);
        let direction = self.direction;
        let cos = normal.normalize_or_zero().dot(direction.normalize_or_zero());
        // A mirroring transform reverses the corners.
        let mirrored = placed.to_world.is_some_and(|world| world.matrix3.determinant() < 0.0);
        let crossing = panes
            .attenuation(owner.instance)
            .map(|attenuation| Crossing { attenuation, leaves: (cos > 0.0) != mirrored });
        let through = panes.transmittance(owner, [met.u, met.v], cos.abs().min(1.0));
        Some(Passed { met, place, instance: owner.instance, opacity: 1.0 - luminance(through), through, crossing })
    }
}

impl Visit for SheetGroups<'_> {
    #[inline(always)]
    fn leaf<L: Lanes>(&mut self, lanes: L, content: u32, _: f32, limit: f32) -> f32 {
        let Listing { scene, origin, direction, kind, .. } = self.listing;
        let place = content as usize;
        let placed = &scene.groups[place];
        if placed.group.cut_outs.is_none() && placed.group.panes.is_none() {
            return limit;
        }
        let (from, along) = placed.local(origin, direction);
        let mut nearest = limit;
        placed.group.each_within(lanes, &Ray::new(from, along), limit, |leaf, lane, met| {
            let owner = placed.group.owner(met.triangle, placed.instance);
            let at = [met.u, met.v];
            let Some(cut_outs) = &placed.group.cut_outs else {
                let passed = self.listing.pane(owner, met, place, leaf.corners(lane));
                self.passed.extend(passed);
                return nearest;
            };
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
                let through = Vec3::splat(1.0 - opacity);
                self.passed.push(Passed { met, place, instance, opacity, through, crossing: None });
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
