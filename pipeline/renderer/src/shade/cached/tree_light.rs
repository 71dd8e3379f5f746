//! The light tree as the source of cache records: computes records, and updates them from their stored clusters.

use super::recent::RecentChanges;
use super::recipe::Recipe;
use crate::shade::audits::{MadeLightcut, is_record_audited};
use crate::shade::counts::Counts;
use crate::shade::gradient_sum::GradientSum;
use crate::shade::layer::GatheredLight;
use crate::shade::layer::Visible;
use crate::shade::movement::MovingBox;
use crate::shade::tolerance::{FootprintPixel, Tolerance};
use crate::shade::visibility::Visibility;
use glam::{Vec2, Vec3};
use lighttree::{Calibration, Cluster, KeptCluster, Lambert, Light, Scratch, Stop, irradiance_term};
use render_core::cache::{Computed, Illumination, LastUpdate, LocalIrradiance, Site, footprint};
use render_core::scene::Projected;
use render_core::{Gathered, Hit, NOTHING, PACKET, PixelSurface, ShadingPoint, luminance};
use std::f32::consts::PI;

/// Threshold of a record as a fraction of its pixels' threshold. A record lights many pixels, so its error would be
/// visible as a stain.
pub(super) const FINENESS: f32 = 0.5;
/// Fraction of a lightcut's original threshold; if the threshold falls below it, the lightcut is recomputed.
const TIGHTER: f32 = 0.5;
/// Maximum motion of a record since its lightcut, as a fraction of the harmonic mean distance of its surroundings.
const MOST_MOVED: f32 = 0.1;
/// Minimum cosine of a record's rotation since its lightcut: 8°. The light newly above the horizon would add 1 % of a
/// uniform light.
const LEAST_TURNED_COSINE: f32 = 0.99;
/// Minimum error bound, as a fraction of the threshold, of clusters that are redrawn for a record after their shadow
/// rays were traced.
///
/// Standard deviation over eight seeds in the first frame of `nave` at 96×96:
///
/// | value | frame mean | blocks | relative time |
/// |---|---|---|---|
/// | no redraws | 0.53 % | 1.4 % | 1 |
/// | 0.75 | 0.28 % | 1.0 % | 1.07 |
/// | 0 | 0.09 % | 0.8 % | 1.4 |
const DRAWN_ANEW: f32 = 0.75;
/// Distance within which an object changes the known light that records gather, in radii of its bounding sphere. At
/// this distance, it covers 1 % of the hemisphere.
const KNOWN_REACH: f32 = 10.0;
/// Number of points at which thresholds are read, along each axis of a record's footprint.
const FOOTPRINT_POINTS: i32 = 5;
/// Minimum cosine between the normals of a record and of pixels that are assumed to be lit alike.
const ALIKE_COSINE: f32 = 0.9;

/// Light tree of a frame, as the source of cache records.
pub(super) struct TreeLight<'a> {
    pub visible: &'a Visible<'a>,
    pub tolerance: &'a Tolerance<'a>,
    pub visibility: Visibility<'a>,
    pub counts: &'a Counts,
    /// Boxes around old and new poses of all objects that have moved since the previous frame.
    pub swept: &'a [MovingBox],
    /// Motion and light of the last frames.
    pub recent: RecentChanges,
    /// Whether updates of records may wait.
    pub waits: bool,
    /// Boxes around the current poses of all moving objects.
    pub standing: Vec<MovingBox>,
    /// Whether each instance moves during the film.
    pub moving: &'a [bool],
    /// Whether final gather restores the light lost by clamping virtual lights.
    pub compensates: bool,
    /// Whether lights and geometry are static for the whole film.
    pub at_rest: bool,
}

/// Clusters with random draws of their own record. Masks have one bit per cluster, and one word per [`PACKET`].
struct DrawnClusters {
    clusters: Box<[Cluster]>,
    /// Bits of the clusters known to be visible.
    visible: Box<[u64]>,
    /// Bits of the clusters that need shadow rays.
    unknown: Vec<u64>,
}

/// Reusable memory of a thread for its records.
#[derive(Default)]
pub(super) struct CutScratch {
    cuts: Scratch,
    /// Memory for the larger lightcuts of audits; `None` before the first audit.
    audits: Option<Scratch>,
}

impl Illumination for TreeLight<'_> {
    type Recipe = Recipe;
    type Scratch = CutScratch;

    fn compute(&self, site: &Site, scratch: &mut CutScratch) -> Computed<Recipe> {
        // Light the record like a white surface.
        let CutScratch { cuts, audits } = scratch;
        let tree = &self.visible.frame.tree;
        let receiver = self.receiver(site);
        if self.visible.has_stopped() {
            let recipe = Recipe::dark(site);
            return Computed { light: self.estimate(&receiver, &recipe), recipe };
        }
        let (surroundings, reflected) = self.surroundings(&receiver, site.key);
        let white = Lambert {
            position: receiver.position.into(),
            normal: receiver.normal.into(),
            // With reflectance π, reflected radiance equals irradiance.
            reflectance: Vec3::splat(PI),
        };

        // Postpone shadow rays until all clusters are known, unless estimates steer the lightcut.
        let stop = self.stop(site, &surroundings);
        let class = self.class_of(site);
        let later = matches!(stop, Stop::Absolute(_));
        let sees = |lamp: &Light, _: usize| later || self.visibility.sees(&receiver, lamp);
        let cut = tree.lightcut_kept(&white, self.tolerance.calibrated(stop, class), sees, cuts);
        self.counts.count(cut.size, cut.shadow_rays);

        // Draw the lights of the clusters for this record.
        let threshold = stop.threshold_at(luminance(cut.radiance));
        let least_bound = if later { 0.0 } else { DRAWN_ANEW * threshold };
        let DrawnClusters { clusters, visible, unknown } = self.redrawn(&white, cuts.kept(), site.key, least_bound);
        let mut recipe = Recipe {
            size: clusters.len() as u32,
            clusters,
            visible,
            surroundings,
            reflected,
            near_moving: self.is_near(&self.standing, site),
            position: site.position,
            normal: site.normal,
            threshold,
        };

        // Trace the shadow rays of the clusters.
        let mut rays = 0;
        for ((clusters, visible), unknown) in recipe.packets().zip(unknown) {
            *visible = *visible & !unknown | self.seen_lights(&receiver, clusters, unknown);
            rays += if later { 0 } else { unknown.count_ones() };
        }
        self.counts.count_rays(rays);

        // Compare some records with a finer lightcut.
        if self.is_audited(site) {
            let finer = audits.get_or_insert_with(|| Scratch::with_max_size(Calibration::LARGEST_CUT));
            let sees = |lamp: &Light, _| self.visibility.sees(&receiver, lamp);
            let made = MadeLightcut { tree, class, stop, radiance: self.cut_irradiance(&receiver, &recipe) };
            made.audit(&white, sees, finer, self.counts);
        }

        // Discard the clusters of records that are never updated, as in static scenes.
        let light = self.estimate(&receiver, &recipe);
        if self.at_rest {
            recipe.forget_light();
        }
        Computed { light, recipe }
    }

    fn relight(&self, site: &Site, recipe: &mut Recipe, known: LastUpdate) -> Option<LocalIrradiance> {
        // Reject a record that has moved too far or now needs a finer lightcut: it must be recomputed.
        let Recipe { position, normal, threshold, .. } = *recipe;
        let moved = site.position.distance(position) / recipe.surroundings.harmonic_mean;
        if recipe.has_forgotten() || moved > MOST_MOVED || site.normal.dot(normal) < LEAST_TURNED_COSINE {
            return None;
        }
        if matches!(self.stop(site, &recipe.surroundings), Stop::Absolute(now) if now < TIGHTER * threshold) {
            return None;
        }

        // Repeat the final gather near moving objects, which have changed the surroundings.
        let receiver = self.receiver(site);
        let swept = match known {
            LastUpdate::FramesAgo(1) => Some(self.swept),
            LastUpdate::FramesAgo(frames) => self.recent.since(frames),
            LastUpdate::Earlier => None,
        };
        let gathers_again = match swept {
            Some(swept) => self.is_near(swept, site),
            None => recipe.near_moving || self.is_near(&self.standing, site),
        };
        let known_changes = self.visible.known.is_some_and(|known| site.carrier != NOTHING || known.changes());
        if gathers_again || known_changes {
            (recipe.surroundings, recipe.reflected) = self.surroundings(&receiver, site.key);
            recipe.near_moving = self.is_near(&self.standing, site);
        }

        // Trace the shadow rays that a moving object may have crossed.
        let lights = self.visible.frame.tree.lights();
        let may_have_changed = |cluster: &Cluster| {
            let lamp = lights[cluster.light as usize].position.into();
            swept.is_none_or(|swept| swept.iter().any(|swept| swept.is_crossed(receiver.position, lamp)))
        };
        let mut rays = 0;
        for (clusters, visible) in recipe.packets() {
            let mut active = 0;
            for (i, cluster) in clusters.iter().enumerate() {
                active |= u64::from(may_have_changed(cluster)) << i;
            }
            *visible = *visible & !active | self.seen_lights(&receiver, clusters, active);
            rays += active.count_ones();
        }
        self.counts.count_rays(rays);
        Some(self.estimate(&receiver, recipe))
    }

    /// Returns the number of clusters in the lightcut.
    fn note(&self, recipe: &Recipe) -> u32 {
        recipe.size
    }

    fn may_wait(&self, site: &Site) -> bool {
        // Light that a mover carries, or that it blocks nearby, changes unevenly.
        self.waits && site.carrier == NOTHING && !self.is_near(self.swept, site)
    }

    fn is_discarded(&self) -> bool {
        self.visible.has_stopped()
    }

    fn openness(&self, site: &Site, scale: f32) -> f32 {
        // Treat inner walls of a moving instance as closed: the instance may enclose the record. Otherwise, the record
        // would be as open as a record next to the instance.
        let encloses = |hit: &Hit, direction| {
            let may_have_moved_over = site.carrier != NOTHING || self.moving[hit.instance as usize];
            may_have_moved_over && hit.instance != site.carrier && !self.visible.frame.surfaces.is_front(hit, direction)
        };
        self.visibility.openness(&self.receiver(site), scale, encloses)
    }

    fn is_undisturbed(&self, site: &Site, scale: f32) -> bool {
        site.carrier == NOTHING && self.swept.iter().all(|thing| thing.distance2(site.position) > scale * scale)
    }
}

impl TreeLight<'_> {
    /// Returns the origin of a record's rays.
    pub fn receiver(&self, site: &Site) -> ShadingPoint {
        let Site { position, normal, geometric_normal, .. } = *site;
        ShadingPoint::off_surface(position, [normal, geometric_normal], self.visible.frame.epsilon)
    }

    /// Traces rays into the surroundings of a record. Returns the surroundings, and the light that they reflect if it is
    /// known.
    fn surroundings(&self, receiver: &ShadingPoint, key: u64) -> (Gathered, GradientSum) {
        match self.visible.known {
            Some(known) => {
                let GatheredLight { light, harmonic_mean, nearest } = known.gather(receiver, key);
                (Gathered::of_distances(harmonic_mean, nearest), light)
            }
            None => (self.visibility.final_gather(receiver, key), GradientSum::ZERO),
        }
    }

    /// Returns whether any of the objects `things` is so near that it changes the final gather. The object to which the
    /// record is attached is excluded, because it is always near.
    fn is_near(&self, things: &[MovingBox], site: &Site) -> bool {
        // Clamping removes much light of near objects; known light is gathered from farther ones, too.
        if self.visible.known.is_some() {
            let near = |thing: &MovingBox| {
                let sphere = thing.sphere();
                sphere.center.distance(site.position) < KNOWN_REACH * sphere.radius
            };
            return things.iter().any(|thing| thing.instance != site.carrier && near(thing));
        }
        let nearby = self.visible.frame.gather.dynamic_reach();
        let near =
            |thing: &MovingBox| thing.instance != site.carrier && thing.distance2(site.position) < nearby * nearby;
        things.iter().any(near)
    }

    /// Draws the clusters of a lightcut for one record. A common draw for all records would shift the light of the
    /// whole frame.
    ///
    /// Clusters with error bounds up to `least_bound` keep the lights and the visibility of the lightcut. If
    /// `least_bound` is 0, no visibility is known yet.
    fn redrawn(&self, receiver: &Lambert, kept: &[KeptCluster], key: u64, least_bound: f32) -> DrawnClusters {
        let tree = &self.visible.frame.tree;
        // Keep clusters with a small error bound: each redrawn light needs a new shadow ray.
        let is_drawn = |cluster| least_bound == 0.0 || tree.cluster_bound(receiver, cluster) > least_bound;
        let of_record = |kept: &KeptCluster| {
            if is_drawn(kept.cluster) { tree.redrawn(kept.cluster, key) } else { kept.cluster }
        };
        let gives = |cluster: &Cluster| {
            let light = &tree.lights()[cluster.light as usize];
            irradiance_term(receiver.position, receiver.normal, light, tree.geometry_term_bound()).value > 0.0
        };

        // Keep the visibility that the lightcut found for unchanged lights. Other lights need a ray if they light the
        // record.
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
        DrawnClusters { clusters, visible: visible.into(), unknown }
    }

    /// Returns the bits in `active` of the clusters visible from `receiver`.
    fn seen_lights(&self, receiver: &ShadingPoint, clusters: &[Cluster], active: u64) -> u64 {
        let lights = self.visible.frame.tree.lights();
        self.visibility.seen_among(receiver, clusters, |c| lights[c.light as usize].position.into(), active)
    }

    /// Returns whether the lightcut of a new record is audited.
    fn is_audited(&self, site: &Site) -> bool {
        let audits = self.tolerance.audits_per_macroblock();
        audits.is_some_and(|audits| is_record_audited(site.key, self.visible.frame.index, audits))
    }

    /// Returns [`Tolerance::class_at`] for the pixel that shows `site`, and 0 outside of the frame.
    fn class_of(&self, site: &Site) -> usize {
        let projected = self.visible.matte.view.project(site.position);
        let place = projected.and_then(|Projected { pixel, .. }| self.pixel_at(pixel));
        place.map_or(0, |(x, y)| self.tolerance.class_at(x, y))
    }

    /// Returns the column and the row of a point; `None` if the point is outside of the frame.
    fn pixel_at(&self, place: Vec2) -> Option<(usize, usize)> {
        let pixels = &self.visible.matte.pixels;
        let (x, y) = (place.x.floor(), place.y.floor());
        let inside = x >= 0.0 && y >= 0.0 && x < pixels.width() as f32 && y < pixels.height() as f32;
        inside.then_some((x as usize, y as usize))
    }

    /// Returns the stopping criterion of a record's lightcut: the Gaussian mean of the thresholds over the record's
    /// footprint \[Herzog08, 4.3\].
    fn stop(&self, site: &Site, surroundings: &Gathered) -> Stop {
        let Visible { matte, radiance, .. } = *self.visible;
        let mut footprint_pixels = [None; (FOOTPRINT_POINTS * FOOTPRINT_POINTS) as usize];
        if let Some(Projected { pixel: center, .. }) = matte.view.project(site.position) {
            let radius = footprint(site, surroundings.harmonic_mean, surroundings.nearest, &matte.view);

            // Use only pixels that are lit alike.
            let alike = |place: Vec2| {
                let (x, y) = self.pixel_at(place)?;
                let pixel = matte.pixels.get(x, y);
                let alike = pixel.instance != NOTHING && site.normal.dot(pixel.shading_normal.into()) >= ALIKE_COSINE;
                alike.then_some((x, y, pixel))
            };
            // Separate emissive and lit pixels: emission outshines reflected light.
            let glows = |pixel: &PixelSurface| pixel.emission != [0.0; 3];
            let glows_here = alike(center).is_some_and(|(.., pixel)| glows(&pixel));

            // Weight a square of points by a Gaussian.
            let half = FOOTPRINT_POINTS / 2;
            for (k, found) in footprint_pixels.iter_mut().enumerate() {
                let (i, j) = (k as i32 % FOOTPRINT_POINTS - half, k as i32 / FOOTPRINT_POINTS - half);
                let offset = Vec2::new(i as f32, j as f32) / half as f32;
                let Some((x, y, pixel)) = alike(center + offset * radius) else { continue };
                if glows(&pixel) == glows_here {
                    let weight = (-2.0 * offset.length_squared()).exp();
                    let (albedo, radiance) = (pixel.albedo.into(), radiance.get(x, y));
                    *found = Some(FootprintPixel { place: (x, y), weight, albedo, radiance });
                }
            }
        }
        self.tolerance.over_footprint(footprint_pixels.into_iter().flatten()).scaled(FINENESS)
    }
}
