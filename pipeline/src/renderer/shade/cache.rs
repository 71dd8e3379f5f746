//! Cuts for the irradiance cache: how a record is computed, and lit again from the clusters it remembers.

pub(super) mod around;

use super::cuts::{LEAST_REFLECTANCE, LightTransport, MadeCut};
use crate::error::{Error, Result};
use crate::plan::{Plan, Stage};
use crate::renderer::frame::Frame;
use crate::state::NONSENSE;
use around::{Around, Movement, standing};
use glam::{Mat3A, Vec3, Vec3A};
use lighttree::{
    Calibration, Cluster, Emission, IrradianceTerm, KeptCluster, Lambert, Light, Scratch, Stop, irradiance_term,
};
use plane::Plane;
use render_core::cache::{
    CachedLight, Changes, Computed, Illumination, IrradianceCache, LastUpdate, LocalIrradiance, Request, Site,
    footprint,
};
use render_core::sampling::hash;
use render_core::scene::Projected;
use render_core::{Anchor, Busy, GBuffer, Gathered, Hit, NOTHING, PACKET, PixelSurface, ShadingPoint, luminance};
use std::f32::consts::PI;

/// A record answers for many pixels and its error is seen as a stain: its threshold is this share of theirs.
const FINENESS: f32 = 0.5;
/// An anchor on a moving thing that would add less than this share gets no shadow ray and counts as visible: two dozen
/// of them together stay below half a per cent.
const UNTRACED_SHARE: f32 = 2e-4;
/// A cut is made anew when its thresholds have become tighter than this share of what it was made for.
const TIGHTER: f32 = 0.5;
/// A cut goes with its record over this share of the harmonic mean distance of what is around, and through this turn of 8°:
/// what has come up over the horizon then would give 1 % of an even light.
const MOST_MOVED: f32 = 0.1;
const LEAST_TURNED_COSINE: f32 = 0.99;
/// One record in this number is audited with calibrated stopping; an audit takes some times as long as a record.
const AUDITED: u64 = 32;
/// Clusters are drawn anew for a record, where their shadow rays have been cast already, from this share of the threshold on.
///
/// In the first frame of `nave` at 96×96 the standard deviation of the mean over eight seeds is 0.53 % without new draws, and
/// that of blocks 1.4 %. With 0.75 they are 0.28 % and 1.0 %, and the frame takes 1.07 times as long; with 0, 0.09 %, 0.8 % and
/// 1.4 times.
const DRAWN_ANEW: f32 = 0.75;
/// Points across a record's footprint where thresholds are looked up.
const FOOTPRINT_POINTS: i32 = 5;

/// The cache, and the parts of the last frame that the next is compared with.
pub(super) struct Cache {
    records: IrradianceCache<Recipe>,
    /// Whether lights and things stay as they are for the whole film: no record is ever lit again.
    at_rest: bool,
    /// Intensities of the lights in the frame before; none before the first.
    intensities: Vec<Vec3>,
}

/// Cut and final gather of a record.
#[derive(serde::Serialize, serde::Deserialize)]
pub(super) struct Recipe {
    /// Number of clusters of the cut.
    size: u32,
    /// The clusters; none where lights and things are at rest, as they would fill most of the memory of a film.
    clusters: Box<[Cluster]>,
    /// Visibility of the clusters: a bit for each, a word for each [`PACKET`] of them.
    visible: Box<[u64]>,
    surroundings: Gathered,
    /// Whether something that moves stood near at the final gather.
    near_moving: bool,
    /// Where the record was when the cut was made, and the way it faced.
    position: Vec3A,
    normal: Vec3A,
    /// Luminance of irradiance that a cluster of the cut may be wrong by \[W·m⁻²\].
    threshold: f32,
}

impl Cache {
    /// A cache without records for a film of this plan.
    pub fn new(plan: &Plan) -> Self {
        let changing = [Stage::ObjectPlacing, Stage::Deformation, Stage::Photons, Stage::TreeUpdate];
        let at_rest = !changing.into_iter().any(|stage| plan.is_on(stage));
        Self { records: IrradianceCache::default(), at_rest, intensities: Vec::new() }
    }

    /// Whether the lights of the tree shine as in the frame before.
    pub fn is_lit_as_before(&self, frame: &Frame) -> bool {
        frame.tree.lights().iter().map(|light| light.intensity).eq(self.intensities.iter().copied())
    }

    /// Indirectly arriving irradiance at every pixel that is `wanted`, or at all; zero elsewhere. Adds the work to `busy`.
    pub fn light(
        &mut self,
        transport: &LightTransport,
        movement: &Movement,
        wanted: Option<&Plane<bool>>,
        busy: &Busy,
    ) -> CachedLight {
        let prepared = transport.prepared;
        let seen = transport.seen;
        let scene = prepared.surfaces.scene();
        let moving = scene.moving_instances();
        let changes = Changes { light: !self.is_lit_as_before(prepared), geometry: movement.is_any };
        let illumination = Cuts {
            transport,
            swept: &movement.swept,
            standing: standing(&movement.places),
            moving: &moving,
            at_rest: self.at_rest,
        };
        let lit = busy.take(self.records.light(Request { seen, moving: &moving, wanted }, changes, &illumination));
        self.intensities = prepared.tree.lights().iter().map(|light| light.intensity).collect();
        lit
    }

    /// The same for another picture of the last frame that [`Cache::light`] lit.
    pub fn light_more(&mut self, transport: &LightTransport, movement: &Movement, busy: &Busy) -> CachedLight {
        let moving = transport.prepared.surfaces.scene().moving_instances();
        let illumination = Cuts {
            transport,
            swept: &[],
            standing: standing(&movement.places),
            moving: &moving,
            at_rest: self.at_rest,
        };
        busy.take(self.records.light_more(Request::whole(transport.seen, &moving), &illumination))
    }

    /// State that does not follow from the last lit frame.
    pub fn carried(&self) -> &IrradianceCache<Recipe> {
        &self.records
    }

    /// The cache after frame `done`, from what it carried there.
    ///
    /// # Errors
    /// Records are of lights, surfels or instances that are not there.
    pub fn resumed(records: IrradianceCache<Recipe>, plan: &Plan, done: &Frame) -> Result<Self> {
        let scene = done.surfaces.scene();
        let intensities: Vec<Vec3> = done.tree.lights().iter().map(|light| light.intensity).collect();
        let is_of_frame = |(site, recipe): (&Site, &Recipe)| {
            (site.carrier == NOTHING || (site.carrier as usize) < scene.instances.len())
                && recipe.clusters.iter().all(|cluster| (cluster.light as usize) < intensities.len())
                && recipe.visible.len() == recipe.clusters.len().div_ceil(PACKET)
                && done.gather.is_complete(&recipe.surroundings)
        };
        if !records.recipes().all(is_of_frame) {
            return Err(Error::Checkpoint(NONSENSE.into()));
        }
        Ok(Self { records, intensities, ..Self::new(plan) })
    }

    /// Where the records in use are, and of how many clusters.
    pub fn records(&self) -> impl Iterator<Item = (Vec3A, usize)> {
        self.records.records_in_use().map(|(position, recipe)| (position, recipe.size as usize))
    }
}

/// Radiance that the surfaces of a picture reflect of the `irradiance`.
pub(super) fn reflected(seen: &GBuffer, irradiance: &Plane<[f32; 3]>) -> Plane<Vec3> {
    Plane::from_fn(seen.pixels.width(), seen.pixels.height(), |x, y| {
        Vec3::from(irradiance.get(x, y)) * Vec3::from(seen.pixels.get(x, y).albedo) / PI
    })
}

/// The light tree of a frame, for the cache.
struct Cuts<'a> {
    transport: &'a LightTransport<'a>,
    /// Around all that has moved since the frame before, where it was and where it is.
    swept: &'a [Around],
    /// Around all that ever moves, where it is.
    standing: Vec<Around>,
    /// By instance, whether it ever moves.
    moving: &'a [bool],
    /// [`Cache::at_rest`].
    at_rest: bool,
}

impl Illumination for Cuts<'_> {
    type Recipe = Recipe;
    /// For cuts, and for those of audits.
    type Scratch = (Scratch, Option<Scratch>);

    fn compute(&self, site: &Site, (scratch, finer): &mut Self::Scratch) -> Computed<Recipe> {
        let Self { transport, .. } = self;
        let receiver = self.receiver(site);
        let surroundings = transport.final_gather(&receiver, site.key);
        let white = Lambert {
            position: receiver.position.into(),
            normal: receiver.normal.into(),
            // Radiance reflected by π is irradiance.
            reflectance: Vec3::splat(PI),
        };
        let stop = self.stop(site, &surroundings);
        // Where estimates do not steer the cut, its rays wait until all are known.
        let later = matches!(stop, Stop::Absolute(_));
        let class = self.class_of(site);
        let sees = |lamp: &Light, _: usize| later || transport.visible(&receiver, lamp);
        let cut = transport.prepared.tree.lightcut_kept(&white, transport.calibrated(stop, class), sees, scratch);
        let threshold = stop.threshold_at(luminance(cut.radiance));
        let least_bound = if later { 0.0 } else { DRAWN_ANEW * threshold };
        let Drawn { clusters, visible, unknown } = self.drawn_anew(&white, scratch.kept(), site.key, least_bound);
        transport.figures.count(cut.size, cut.shadow_rays);
        let mut recipe = Recipe {
            size: clusters.len() as u32,
            clusters,
            visible,
            surroundings,
            near_moving: self.is_near(&self.standing, site),
            position: site.position,
            normal: site.normal,
            threshold,
        };
        let mut rays = 0;
        for ((clusters, visible), unknown) in recipe.packets().zip(unknown) {
            *visible = *visible & !unknown | self.seen_lights(&receiver, clusters, unknown);
            rays += if later { 0 } else { unknown.count_ones() };
        }
        transport.figures.count_rays(rays);
        if self.is_audited(site) {
            let finer = finer.get_or_insert_with(|| Scratch::with_max_size(Calibration::LARGEST_CUT));
            let visible = |lamp: &Light, _| transport.visible(&receiver, lamp);
            let made = MadeCut { class, stop, radiance: self.cut_irradiance(&receiver, &recipe) };
            transport.audit(made, &white, visible, finer);
        }
        let estimate = self.estimate(&receiver, &recipe);
        if self.at_rest {
            recipe.forget_light();
        }
        Computed { light: estimate, recipe }
    }

    fn relight(&self, site: &Site, recipe: &mut Recipe, known: LastUpdate) -> Option<LocalIrradiance> {
        let Recipe { position, normal, threshold, .. } = *recipe;
        let moved = site.position.distance(position) / recipe.surroundings.harmonic_mean;
        let forgotten = recipe.clusters.len() != recipe.size as usize;
        if forgotten || moved > MOST_MOVED || site.normal.dot(normal) < LEAST_TURNED_COSINE {
            return None;
        }
        if matches!(self.stop(site, &recipe.surroundings), Stop::Absolute(now) if now < TIGHTER * threshold) {
            return None;
        }
        let receiver = self.receiver(site);
        let gathers_again = match known {
            LastUpdate::LastFrame => self.is_near(self.swept, site),
            LastUpdate::Earlier => recipe.near_moving || self.is_near(&self.standing, site),
        };
        if gathers_again {
            recipe.surroundings = self.transport.final_gather(&receiver, site.key);
            recipe.near_moving = self.is_near(&self.standing, site);
        }
        let lights = self.transport.prepared.tree.lights();
        let may_have_changed = |cluster: &Cluster| {
            let lamp = lights[cluster.light as usize].position.into();
            known == LastUpdate::Earlier || self.swept.iter().any(|swept| swept.is_crossed(receiver.position, lamp))
        };
        let mut rays = 0;
        for (clusters, visible) in recipe.packets() {
            let active =
                clusters.iter().enumerate().fold(0, |active, (i, c)| active | u64::from(may_have_changed(c)) << i);
            *visible = *visible & !active | self.seen_lights(&receiver, clusters, active);
            rays += active.count_ones();
        }
        self.transport.figures.count_rays(rays);
        Some(self.estimate(&receiver, recipe))
    }

    fn openness(&self, site: &Site, scale: f32) -> f32 {
        // What has moved over a record has taken it in: near its walls it would seem as open within as it is outside.
        let encloses = |hit: &Hit, direction| {
            let may_have_moved_over = site.carrier != NOTHING || self.moving[hit.instance as usize];
            may_have_moved_over
                && hit.instance != site.carrier
                && !self.transport.prepared.surfaces.is_front(hit, direction)
        };
        self.transport.openness(&self.receiver(site), scale, encloses)
    }

    fn is_undisturbed(&self, site: &Site, scale: f32) -> bool {
        site.carrier == NOTHING && self.swept.iter().all(|thing| thing.distance2(site.position) > scale * scale)
    }
}

impl Recipe {
    /// Keeps what a record at rest still needs: the distances of its surroundings.
    fn forget_light(&mut self) {
        (self.clusters, self.visible) = Default::default();
        self.surroundings.forget_light();
    }

    /// The clusters, [`PACKET`] at a time, with the bits of those that are seen.
    fn packets(&mut self) -> impl Iterator<Item = (&[Cluster], &mut u64)> {
        self.clusters.chunks(PACKET).zip(&mut self.visible)
    }

    /// The clusters that are seen.
    fn seen_clusters(&self) -> impl Iterator<Item = Cluster> {
        let seen = |&(i, _): &(usize, &Cluster)| self.visible[i / PACKET] >> (i % PACKET) & 1 == 1;
        self.clusters.iter().enumerate().filter(seen).map(|(_, &cluster)| cluster)
    }
}

/// Clusters by draws of a record's own: a bit for each, a word for each [`PACKET`] of them.
struct Drawn {
    clusters: Box<[Cluster]>,
    /// Those that are known to be seen.
    visible: Box<[u64]>,
    /// Those that shadow rays have to tell.
    unknown: Vec<u64>,
}

impl Cuts<'_> {
    fn receiver(&self, site: &Site) -> ShadingPoint {
        let Site { position, normal, geometric_normal, .. } = *site;
        ShadingPoint {
            position: position + geometric_normal * self.transport.prepared.epsilon,
            normal,
            geometric_normal,
        }
    }

    /// Whether any of these things is so near that its own light has lost much by softening; a record's own carrier, which is
    /// always as near as it is, does not count.
    fn is_near(&self, things: &[Around], site: &Site) -> bool {
        let nearby = self.transport.prepared.gather.dynamic_reach();
        let near = |thing: &Around| thing.instance != site.carrier && thing.distance2(site.position) < nearby * nearby;
        things.iter().any(near)
    }

    /// The clusters of a cut by draws of their record's own: one draw for all would move the light of the whole picture.
    ///
    /// Those whose error bound is not above `least_bound` keep their lights, and what the cut found of their visibility; with 0
    /// it found nothing.
    fn drawn_anew(&self, receiver: &Lambert, kept: &[KeptCluster], key: u64, least_bound: f32) -> Drawn {
        let tree = &self.transport.prepared.tree;
        let is_drawn = |cluster| least_bound == 0.0 || tree.cluster_bound(receiver, cluster) > least_bound;
        let of_record = |kept: &KeptCluster| {
            if is_drawn(kept.cluster) { tree.drawn_anew(kept.cluster, key) } else { kept.cluster }
        };
        let gives = |cluster: &Cluster| {
            let light = &tree.lights()[cluster.light as usize];
            irradiance_term(receiver.position, receiver.normal, light, tree.geometry_term_bound()).value > 0.0
        };
        let clusters: Box<[Cluster]> = kept.iter().map(of_record).collect();
        let mut visible = vec![0u64; clusters.len().div_ceil(PACKET)];
        let mut unknown = visible.clone();
        for (k, (kept, cluster)) in kept.iter().zip(&clusters).enumerate() {
            let bit = 1 << (k % PACKET);
            let is_known = least_bound != 0.0 && cluster.light == kept.cluster.light;
            if is_known && kept.transport != Vec3::ZERO {
                visible[k / PACKET] |= bit;
            } else if !is_known && gives(cluster) {
                unknown[k / PACKET] |= bit;
            }
        }
        Drawn { clusters, visible: visible.into(), unknown }
    }

    /// Finds, among the clusters whose bits are set in `active`, those whose light arrives.
    fn seen_lights(&self, receiver: &ShadingPoint, clusters: &[Cluster], active: u64) -> u64 {
        let lights = self.transport.prepared.tree.lights();
        self.transport.visible_among(receiver, clusters, |c| lights[c.light as usize].position.into(), active)
    }

    /// The sum over the visible clusters with the intensities that they have now, and what softening took from it.
    fn estimate(&self, receiver: &ShadingPoint, recipe: &Recipe) -> LocalIrradiance {
        let tree = &self.transport.prepared.tree;
        let (position, normal) = (receiver.position.into(), receiver.normal.into());
        let (mut irradiance, mut by_normal, mut by_position) = (Vec3::ZERO, Mat3A::ZERO, Mat3A::ZERO);
        for cluster in recipe.seen_clusters() {
            let light = &tree.lights()[cluster.light as usize];
            let intensity = tree.cluster_intensity(cluster);
            let term = irradiance_term(position, normal, light, tree.geometry_term_bound());
            irradiance += intensity * term.value;
            by_normal += outer(intensity, term.by_normal);
            by_position += outer(intensity, term.by_position);
        }
        let dynamic = self.transport.prepared.direct.dynamic();
        // What would give next to nothing counts as seen.
        let untraced = UNTRACED_SHARE * luminance(irradiance);
        let mut rays = 0;
        for anchors in dynamic.anchors.chunks(PACKET) {
            let mut terms = [IrradianceTerm::default(); PACKET];
            let (mut active, mut gives) = (0, 0);
            for (i, (anchor, intensity)) in anchors.iter().enumerate() {
                let emission = Emission::Cosine(anchor.normal.into());
                let lamp = Light { position: anchor.position.into(), emission, intensity: *intensity };
                terms[i] = irradiance_term(position, normal, &lamp, dynamic.geometry_term_bound);
                gives |= u64::from(terms[i].value > 0.0) << i;
                active |= u64::from(luminance(*intensity * terms[i].value) > untraced) << i;
            }
            rays += active.count_ones();
            let place = |(anchor, _): &(Anchor, Vec3)| anchor.position;
            let seen = gives & !active | self.transport.visible_among(receiver, anchors, place, active);
            for (i, (_, intensity)) in anchors.iter().enumerate().filter(|(i, _)| seen >> i & 1 == 1) {
                irradiance += *intensity * terms[i].value;
                by_normal += outer(*intensity, terms[i].by_normal);
                by_position += outer(*intensity, terms[i].by_position);
            }
        }
        self.transport.figures.count_rays(rays);
        let Gathered { harmonic_mean, nearest, .. } = recipe.surroundings;
        if self.transport.compensates {
            let missing = self.transport.prepared.gather.compensation(&recipe.surroundings);
            irradiance += missing.irradiance;
            by_position += missing.by_position;
        }
        let tolerance = recipe.threshold / FINENESS;
        LocalIrradiance { irradiance, by_normal, by_position, harmonic_mean, nearest, tolerance }
    }

    /// The part of [`Cuts::estimate`] that comes by the cut alone.
    fn cut_irradiance(&self, receiver: &ShadingPoint, recipe: &Recipe) -> Vec3 {
        let tree = &self.transport.prepared.tree;
        let (position, normal) = (receiver.position.into(), receiver.normal.into());
        let of = |cluster: Cluster| {
            let light = &tree.lights()[cluster.light as usize];
            tree.cluster_intensity(cluster) * irradiance_term(position, normal, light, tree.geometry_term_bound()).value
        };
        recipe.seen_clusters().map(of).sum()
    }

    /// Whether the cut of a new record is made again to see how wrong it is: in a frame, for one in [`AUDITED`] for each pixel
    /// that would be of a macroblock.
    fn is_audited(&self, site: &Site) -> bool {
        let frame = self.transport.prepared.index;
        let calibration = self.transport.allowance.calibration.as_ref();
        let chance = hash(site.key, u64::from(frame), 0) % AUDITED;
        calibration.is_some_and(|of| chance < of.audits_per_macroblock() as u64)
    }

    /// [`LightTransport::class_at`] the pixel that shows a site; the first class out of sight.
    fn class_of(&self, site: &Site) -> usize {
        let seen = self.transport.seen;
        let Some(Projected { pixel: place, .. }) = seen.view.project(site.position) else { return 0 };
        let inside = place.x >= 0.0
            && place.y >= 0.0
            && place.x < seen.pixels.width() as f32
            && place.y < seen.pixels.height() as f32;
        if inside { self.transport.class_at(place.x as usize, place.y as usize) } else { 0 }
    }

    /// When the cut of a record ends: at the Gaussian average of the thresholds over its footprint \[Herzog08, 4.3\], made
    /// ones of irradiance by each pixel's reflectance.
    fn stop(&self, site: &Site, surroundings: &Gathered) -> Stop {
        let Self { transport, .. } = self;
        let seen = transport.seen;
        let relative =
            |known_luminance| Stop::Relative { fraction: FINENESS * transport.relative_threshold(), known_luminance };
        let Some(Projected { pixel: center, .. }) = seen.view.project(site.position) else { return relative(0.0) };
        let (width, height) = (seen.pixels.width() as i32, seen.pixels.height() as i32);
        let radius = footprint(site, surroundings.harmonic_mean, surroundings.nearest, &seen.view);
        let alike = |place: glam::Vec2| {
            let place = place.floor();
            let (x, y) = (place.x as i32, place.y as i32);
            let inside = x >= 0 && y >= 0 && x < width && y < height;
            let (x, y) = inside.then_some((x as usize, y as usize))?;
            let pixel = seen.pixels.get(x, y);
            let alike = pixel.instance != NOTHING && site.normal.dot(pixel.shading_normal.into()) >= ALIKE_COSINE;
            alike.then_some((x, y, pixel))
        };
        let glows = |pixel: &PixelSurface| pixel.emission != [0.0; 3];
        // What glows says nothing about what is lit beside it, and outshines what it reflects itself.
        let glows_here = alike(center).is_some_and(|(.., pixel)| glows(&pixel));
        let (mut sum, mut weights, mut known, mut known_weights) = (0.0, 0.0, 0.0, 0.0);
        let half = FOOTPRINT_POINTS / 2;
        for (i, j) in (-half..=half).flat_map(|j| (-half..=half).map(move |i| (i, j))) {
            let offset = glam::Vec2::new(i as f32, j as f32) / half as f32;
            let Some((x, y, pixel)) = alike(center + offset * radius) else { continue };
            if glows(&pixel) != glows_here {
                continue;
            }
            let per_radiance = PI / luminance(pixel.albedo.into()).max(LEAST_REFLECTANCE);
            let weight = (-2.0 * offset.length_squared()).exp();
            match transport.threshold(x, y) {
                Some(threshold) => {
                    sum += weight * threshold * per_radiance;
                    weights += weight;
                }
                None => {
                    known += weight * luminance(transport.direct.get(x, y)) * per_radiance;
                    known_weights += weight;
                }
            }
        }
        if weights > known_weights {
            Stop::Absolute(FINENESS * sum / weights)
        } else {
            relative(known / known_weights.max(f32::MIN_POSITIVE))
        }
    }
}

/// Cosine between normals from which on two pixels are taken to be lit alike.
const ALIKE_COSINE: f32 = 0.9;

/// `a · bᵀ`.
fn outer(a: Vec3, b: Vec3) -> Mat3A {
    let a = Vec3A::from(a);
    Mat3A::from_cols(a * b.x, a * b.y, a * b.z)
}

#[cfg(test)]
mod tests;
