//! Tests of the cache in environments with irradiance in closed form.

mod precision;
mod shared;
mod tiled;

use super::*;
use crate::PixelSurface;
use crate::ranks::Alone;
use crate::scene::{Projection, View};
use glam::{Mat3A, Vec3};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

const SIDE: usize = 64;
/// Height of the test lamp above the floor \[m\].
const HEIGHT: f32 = 1.0;

/// Returns gray light without derivatives, with all surfaces `distance` meters away.
fn even(irradiance: f32, distance: f32) -> LocalIrradiance {
    LocalIrradiance {
        irradiance: Vec3::splat(irradiance),
        by_normal: Mat3A::ZERO,
        by_position: Mat3A::ZERO,
        harmonic_mean: distance,
        nearest: distance,
        tolerance: 0.02,
    }
}

/// Returns the floor y = 0, 2 m wide, seen from straight above. `split` modifies the pixels beyond x = 0.
fn floor(split: impl Fn(&mut PixelSurface)) -> GBuffer {
    floor_from(Vec3::new(0.0, 5.0, 0.0), split)
}

/// Returns the floor seen from straight above, with the camera at `eye`.
fn floor_from(eye: Vec3, split: impl Fn(&mut PixelSurface)) -> GBuffer {
    let above = Affine3A::from_rotation_translation(glam::Quat::from_rotation_x(-std::f32::consts::FRAC_PI_2), eye);
    let view = View::new(above, Projection::Orthographic { ymag: 1.0 }, SIDE, SIDE);
    let pixels = Plane::from_fn(SIDE, SIDE, |x, y| {
        let (origin, direction) = view.ray(glam::Vec2::new(x as f32 + 0.5, y as f32 + 0.5));
        let mut pixel = PixelSurface {
            position: (origin + direction * origin.y).to_array(),
            geometric_normal: [0.0, 1.0, 0.0],
            shading_normal: [0.0, 1.0, 0.0],
            albedo: [1.0; 3],
            specular: [0.0; 3],
            roughness: 1.0,
            emission: [0.0; 3],
            depth: 5.0,
            instance: 0,
            triangle: 0,
        };
        if pixel.position[0] > 0.0 {
            split(&mut pixel);
        }
        pixel
    });
    GBuffer {
        pixels,
        view,
        world: vec![Affine3A::IDENTITY; 2],
        deformed: Vec::new(),
        layered: Arc::default(),
        through: Arc::default(),
    }
}

/// A lamp of intensity 1 W/sr above the middle of the floor. Its irradiance is E = cos θ / r².
#[derive(Default)]
struct Lamp {
    /// Factor on the lamp's light, or 1 if `None`.
    power: Option<f32>,
    /// Tolerable relative error of the lamp's light, or 3 % if `None`.
    tolerance: Option<f32>,
    /// Whether a thin wall at x = 0 darkens the far side. Rays of records may hit the wall.
    wall: bool,
    /// Whether updates may wait.
    waits: bool,
    computed: AtomicUsize,
    relit: AtomicUsize,
}

impl Lamp {
    fn irradiance(&self, position: Vec3A, normal: Vec3A) -> f32 {
        if self.wall && position.x > 0.0 {
            return 0.0;
        }
        let d = Vec3A::Y * HEIGHT - position;
        self.power.unwrap_or(1.0) * d.dot(normal).max(0.0) / d.length().powi(3)
    }

    fn estimate(&self, site: &Site) -> LocalIrradiance {
        let (d, power) = (Vec3A::Y * HEIGHT - site.position, self.power.unwrap_or(1.0));
        let lit = if self.wall && site.position.x > 0.0 { 0.0 } else { power };
        let r2 = d.length_squared();
        let by_normal = d * (lit / (r2 * r2.sqrt()));
        let by_position = (d * (3.0 * d.dot(site.normal) / r2) - site.normal) * (lit / (r2 * r2.sqrt()));
        let gray = |v: Vec3A| Mat3A::from_cols(Vec3A::splat(v.x), Vec3A::splat(v.y), Vec3A::splat(v.z));
        let wall = if self.wall { site.position.x.abs() } else { f32::INFINITY };
        LocalIrradiance {
            irradiance: Vec3::splat(self.irradiance(site.position, site.normal)),
            by_normal: gray(by_normal),
            by_position: gray(by_position),
            harmonic_mean: HEIGHT.min(2.0 * wall),
            nearest: HEIGHT.min(wall),
            tolerance: self.tolerance.unwrap_or(0.03) * self.irradiance(site.position, site.normal),
        }
    }
}

impl Illumination for Lamp {
    type Recipe = ();
    type Scratch = ();

    fn compute(&self, site: &Site, (): &mut ()) -> Computed<()> {
        self.computed.fetch_add(1, Ordering::Relaxed);
        Computed { light: self.estimate(site), recipe: () }
    }

    fn relight(&self, site: &Site, (): &mut (), _: LastUpdate) -> Option<LocalIrradiance> {
        self.relit.fetch_add(1, Ordering::Relaxed);
        Some(self.estimate(site))
    }

    fn may_wait(&self, _: &Site) -> bool {
        self.waits
    }
}

const NO_CHANGES: Changes = Changes { light: false, geometry: false };

fn light(cache: &mut IrradianceCache<()>, seen: &GBuffer, changes: Changes, lamp: &Lamp) -> CachedLight {
    cache.light(Request::whole(seen, &[false, true]), changes, lamp).value
}

/// Returns the largest error of the picture, relative to the lamp's maximum irradiance in closed form.
fn largest_error(lit: &CachedLight, seen: &GBuffer, lamp: &Lamp) -> f32 {
    let pairs = lit.irradiance.samples().iter().zip(seen.pixels.samples());
    let brightest = lamp.power.unwrap_or(1.0) / (HEIGHT * HEIGHT);
    pairs
        .map(|(e, pixel)| (e[0] - lamp.irradiance(pixel.position.into(), pixel.shading_normal.into())).abs())
        .fold(0.0, f32::max)
        / brightest
}

/// The error is of second order. Below the lamp, half of E″ is 1.5 E. A record of radius 0.6 m has an error of 0.05 E
/// at 0.18 m. At its border, where its weight is zero, the error is at most 0.5 E. The measured error is at most 4.7 %,
/// with 52 records.
#[test]
fn a_smooth_light_is_interpolated() {
    let (seen, lamp) = (floor(|_| ()), Lamp::default());
    let lit = light(&mut IrradianceCache::default(), &seen, NO_CHANGES, &lamp);
    let error = largest_error(&lit, &seen, &lamp);
    println!("{} records for {} pixels, largest error {error:.4}", lit.computed, SIDE * SIDE);
    assert!(error < 0.05, "{error}");
    assert!(lit.computed * 50 < SIDE * SIDE, "{} records", lit.computed);
    assert_eq!(lit.computed, lamp.computed.into_inner());
}

/// Light on a tilted normal follows from the vector irradiance, exactly if no light crosses the horizon. Records of the
/// flat floor stay in use. A few new records fill the gaps, where the tilt reduces the weights too much.
#[test]
fn turned_normals_are_exact() {
    let mut seen = floor(|_| ());
    let lamp = Lamp::default();
    let mut cache = IrradianceCache::default();
    let flat = light(&mut cache, &seen, NO_CHANGES, &lamp);
    for pixel in seen.pixels.samples_mut() {
        pixel.shading_normal = Vec3A::new(0.1, 1.0, 0.05).normalize().to_array();
    }
    let tilted = light(&mut cache, &seen, NO_CHANGES, &lamp);
    assert!(tilted.computed * 4 < flat.computed, "{} records, {} when flat", tilted.computed, flat.computed);
    let (before, after) = (largest_error(&flat, &floor(|_| ()), &lamp), largest_error(&tilted, &seen, &lamp));
    assert!(after < before + 0.01, "{before} became {after}");
}

/// A thin wall separates full light from darkness. Light may mix only within the least radius of a record.
#[test]
fn no_light_leaks_past_a_thin_wall() {
    let (seen, lamp) = (floor(|_| ()), Lamp { wall: true, ..Lamp::default() });
    let lit = light(&mut IrradianceCache::default(), &seen, NO_CHANGES, &lamp);
    for (e, pixel) in lit.irradiance.samples().iter().zip(seen.pixels.samples()) {
        let x = pixel.position[0];
        // Test points more than three pixels from the wall. A pixel is 1/32 m wide.
        if x > 3.0 / 32.0 {
            assert_eq!(e[0], 0.0, "light {x} m behind the wall");
        } else if x < -3.0 / 32.0 {
            let expected = lamp.irradiance(pixel.position.into(), Vec3A::Y);
            assert!((e[0] - expected).abs() < 0.05, "{} in place of {expected} {x} m before the wall", e[0]);
        }
    }
}

/// Surfaces are separate across a step of a few centimeters, on the underside of a sheet and on a moving instance.
#[test]
fn other_surfaces_have_records_of_their_own() {
    let changes: [fn(&mut PixelSurface); 3] =
        [|pixel| pixel.position[1] += 0.3, |pixel| pixel.shading_normal = [0.0, -1.0, 0.0], |pixel| pixel.instance = 1];
    for (k, change) in changes.into_iter().enumerate() {
        /// Light that depends only on the surface.
        struct BySurface;
        impl Illumination for BySurface {
            type Recipe = ();
            type Scratch = ();
            fn compute(&self, site: &Site, (): &mut ()) -> Computed<()> {
                let other = site.position.y > 0.1 || site.normal.y < 0.0 || site.carrier == 1;
                Computed { light: even(if other { 100.0 } else { 1.0 }, 1.0), recipe: () }
            }
            fn relight(&self, _: &Site, (): &mut (), _: LastUpdate) -> Option<LocalIrradiance> {
                None
            }
        }
        let seen = floor(change);
        let lit = IrradianceCache::default().light(Request::whole(&seen, &[false, true]), NO_CHANGES, &BySurface).value;
        for (e, pixel) in lit.irradiance.samples().iter().zip(seen.pixels.samples()) {
            let expected = if pixel.position[0] > 0.0 { 100.0 } else { 1.0 };
            assert!((e[0] / expected - 1.0f32).abs() < 1e-5, "change {k}: {} in place of {expected}", e[0]);
        }
    }
}

/// Light in a groove that position and normal do not distinguish from the floor.
struct Groove {
    openness: f32,
}

impl Groove {
    /// Depth of the groove \[m\]. The groove is one pixel wide, and so shallow that records next to it would be used in
    /// it.
    const DEPTH: f32 = 0.005;
    const LIGHT: f32 = 0.1;

    fn has(x: f32) -> bool {
        (0.0..2.0 / SIDE as f32).contains(&x)
    }
}

impl Illumination for Groove {
    type Recipe = ();
    type Scratch = ();

    fn compute(&self, site: &Site, (): &mut ()) -> Computed<()> {
        Computed { light: even(if site.position.y < 0.0 { Self::LIGHT } else { 1.0 }, 1.0), recipe: () }
    }

    fn relight(&self, _: &Site, (): &mut (), _: LastUpdate) -> Option<LocalIrradiance> {
        None
    }

    fn openness(&self, site: &Site, _: f32) -> f32 {
        assert!(site.position.y < 0.0, "nothing rises next to the rim: it is open without a ray");
        self.openness
    }
}

/// A dark groove stays dark if its openness differs from the floor's. Otherwise, the light next to the groove leaks
/// into it.
#[test]
fn a_groove_keeps_its_own_light() {
    let mut seen = floor(|_| ());
    for pixel in seen.pixels.samples_mut().iter_mut().filter(|pixel| Groove::has(pixel.position[0])) {
        pixel.position[1] -= Groove::DEPTH;
    }
    let wrong = |openness| {
        let groove = Groove { openness };
        let lit = IrradianceCache::default().light(Request::whole(&seen, &[false, true]), NO_CHANGES, &groove).value;
        let expected = |pixel: &PixelSurface| if Groove::has(pixel.position[0]) { Groove::LIGHT } else { 1.0 };
        let pairs = lit.irradiance.samples().iter().zip(seen.pixels.samples());
        pairs.filter(|(e, pixel)| (e[0] - expected(pixel)).abs() > 1e-5).count()
    };
    assert_eq!(wrong(0.5), 0);
    assert!(wrong(1.0) > SIDE / 2, "the same without openness");
}

/// Openness is measured again where surfaces are seen from a much smaller distance, but not on open floor.
#[test]
fn openness_follows_the_picture() {
    let mut seen = floor(|_| ());
    for pixel in seen.pixels.samples_mut().iter_mut().filter(|pixel| Groove::has(pixel.position[0])) {
        pixel.position[1] -= Groove::DEPTH;
    }
    let mut cache = IrradianceCache::default();
    let groove = Groove { openness: 0.5 };
    let _ = cache.light(Request::whole(&seen, &[false, true]), NO_CHANGES, &groove);
    let openness = |cache: &IrradianceCache<()>| -> Vec<f32> {
        cache.records.iter().filter(|record| record.site.position.y < 0.0).map(|record| record.site.openness).collect()
    };
    assert!(!openness(&cache).is_empty() && openness(&cache).iter().all(|&o| o == 0.5));
    let above = Affine3A::from_rotation_translation(
        glam::Quat::from_rotation_x(-std::f32::consts::FRAC_PI_2),
        Vec3::new(0.0, 5.0, 0.0),
    );
    seen.view = View::new(above, Projection::Orthographic { ymag: 0.5 }, SIDE, SIDE);
    openness::renew(&mut cache.records, &seen, &Groove { openness: 0.7 }, &Alone, &Busy::default());
    assert!(openness(&cache).iter().all(|&o| o == 0.7));
    assert!(cache.records.iter().filter(|r| r.site.position.y == 0.0).all(|r| r.site.openness == 1.0));
}

/// A lamp that becomes brighter by a fraction of a tolerance per frame needs few updates, and its light stays within a
/// quarter of a tolerance. A lamp that becomes brighter by more is followed at once.
#[test]
fn slow_changes_wait_within_a_quarter_of_the_tolerance() {
    let (seen, changes) = (floor(|_| ()), Changes { light: true, ..NO_CHANGES });
    const TOLERANCE: f32 = 0.03;
    for (speed, most_updates) in [(0.05, 0.3), (0.1, 0.55), (1.0, 1.0)] {
        let [mut waiting, mut prompt] = [(); 2].map(|()| IrradianceCache::default());
        let (mut relit, mut all) = (0, 0);
        for frame in 0..32 {
            let power = Some(1.0 + speed * TOLERANCE * frame as f32);
            let [patient, hasty] = [true, false].map(|waits| Lamp { power, waits, ..Lamp::default() });
            let shown = light(&mut waiting, &seen, changes, &patient).irradiance;
            let truth = light(&mut prompt, &seen, changes, &hasty).irradiance;
            for (shown, truth) in shown.samples().iter().zip(truth.samples()) {
                let error = (shown[0] - truth[0]).abs() / truth[0];
                assert!(error <= 0.25 * TOLERANCE + 1e-3, "speed {speed}, frame {frame}: {error}");
            }
            // The first update measures the speed.
            if frame > 1 {
                relit += patient.relit.load(Ordering::Relaxed);
                all += hasty.relit.load(Ordering::Relaxed);
            }
        }
        let share = relit as f32 / all as f32;
        assert!(share <= most_updates && (speed < 0.5 || share == 1.0), "speed {speed}: {share}");
    }
}

/// Without changes, no record is computed. After a change of light, all records are relit at once, exactly as if they
/// were new.
#[test]
fn light_that_changes_is_followed_at_once() {
    let (seen, lamp) = (floor(|_| ()), Lamp::default());
    let mut cache = IrradianceCache::default();
    let first = light(&mut cache, &seen, NO_CHANGES, &lamp);
    let again = light(&mut cache, &seen, NO_CHANGES, &lamp);
    assert_eq!((again.computed, &again.irradiance), (0, &first.irradiance));
    let brighter = Lamp { power: Some(10.0), ..Lamp::default() };
    let changes = Changes { light: true, geometry: false };
    let lit = light(&mut cache, &seen, changes, &brighter);
    assert_eq!(lit.computed, 0);
    assert!(brighter.relit.load(Ordering::Relaxed) >= first.in_use);
    for (now, before) in lit.irradiance.samples().iter().zip(first.irradiance.samples()) {
        assert!((now[0] - 10.0 * before[0]).abs() < 1e-3 * before[0], "{} after {}", now[0], before[0]);
    }
    // Require that every record is recomputed within TURN frames while geometry moves.
    let changes = Changes { light: true, geometry: true };
    let computed: usize = (0..TURN).map(|_| light(&mut cache, &seen, changes, &brighter).computed).sum();
    assert_eq!(computed, cache.records.len());
}

/// Records that light no pixel are not updated, and are relit when they are needed.
#[test]
fn only_what_is_needed_is_brought_up_to_date() {
    let seen = floor(|_| ());
    let half = floor(|pixel| pixel.instance = NOTHING);
    let mut cache = IrradianceCache::default();
    let all = light(&mut cache, &seen, NO_CHANGES, &Lamp::default()).in_use;
    let changes = Changes { light: true, geometry: false };
    let (dim, bright) = ([2.0, 4.0]).map(|power| Lamp { power: Some(power), ..Lamp::default() }).into();
    let lit = light(&mut cache, &half, changes, &dim);
    assert_eq!((lit.computed, dim.relit.load(Ordering::Relaxed)), (0, lit.in_use));
    assert!(lit.in_use * 5 < all * 4, "{} of {all} records for half of the picture", lit.in_use);
    let lit = light(&mut cache, &seen, changes, &bright);
    assert_eq!((lit.computed, lit.in_use), (0, all));
    assert!(largest_error(&lit, &seen, &bright) < 0.05);
}

/// A wall that appears and disappears shrinks the records next to it only while it exists.
#[test]
fn records_grow_again() {
    let (seen, open) = (floor(|_| ()), Lamp::default());
    let walled = Lamp { wall: true, ..Lamp::default() };
    let mut cache = IrradianceCache::default();
    light(&mut cache, &seen, NO_CHANGES, &open);
    let radii = |cache: &IrradianceCache<()>, count| -> Vec<f32> {
        cache.records[..count].iter().map(|record| record.radius).collect()
    };
    let count = cache.records.len();
    let before = radii(&cache, count);
    let changes = Changes { light: true, geometry: true };
    light(&mut cache, &seen, changes, &walled);
    let shrunk = radii(&cache, count).iter().zip(&before).filter(|(now, before)| *now < before).count();
    assert!(shrunk * 4 > count, "{shrunk} of {count} records are near the wall");
    light(&mut cache, &seen, changes, &open);
    assert_eq!(radii(&cache, count), before);
}

/// Records on moving geometry move with the geometry.
#[test]
fn records_are_carried() {
    let lamp = Lamp { tolerance: Some(0.02), ..Lamp::default() };
    let mut cache = IrradianceCache::default();
    let mut seen = floor(|pixel| pixel.instance = 1);
    light(&mut cache, &seen, NO_CHANGES, &lamp);
    let before: Vec<Site> = cache.records.iter().map(|record| record.site).collect();
    let step = Vec3A::new(0.0, 0.5, 0.0);
    seen.world[1] = Affine3A::from_translation(step.into());
    for pixel in seen.pixels.samples_mut().iter_mut().filter(|pixel| pixel.instance == 1) {
        pixel.position = (Vec3A::from(pixel.position) + step).to_array();
    }
    let lit = light(&mut cache, &seen, Changes { light: false, geometry: true }, &lamp);
    for (before, record) in before.iter().zip(&cache.records) {
        let expected = before.position + if before.carrier == 1 { step } else { Vec3A::ZERO };
        assert_eq!(record.site.position, expected);
    }
    let error = largest_error(&lit, &seen, &lamp);
    assert!(error < 0.2, "{error}: light half a meter higher, four times as bright");
}

/// The records and the picture are independent of the number of threads.
#[test]
fn threads_do_not_matter() {
    let film = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let (seen, mut cache) = (floor(|pixel| pixel.instance = 1), IrradianceCache::default());
            let powers = [1.0, 1.0, 2.0];
            let frames = powers.map(|power| {
                let changes = Changes { light: true, geometry: power == 1.0 };
                light(&mut cache, &seen, changes, &Lamp { power: Some(power), ..Lamp::default() }).irradiance
            });
            (frames, cache.records.len())
        })
    };
    let alone = film(1);
    assert!(alone == film(2) && alone == film(5));
}

/// Records that remain unseen are dropped.
#[test]
fn unseen_records_are_forgotten() {
    let (seen, lamp) = (floor(|_| ()), Lamp::default());
    let mut nothing = seen.clone();
    nothing.pixels.samples_mut().iter_mut().for_each(|pixel| pixel.instance = NOTHING);
    let mut cache = IrradianceCache::default();
    light(&mut cache, &seen, NO_CHANGES, &lamp);
    (0..PATIENCE).for_each(|_| drop(light(&mut cache, &nothing, NO_CHANGES, &lamp)));
    assert!(!cache.records.is_empty());
    light(&mut cache, &nothing, NO_CHANGES, &lamp);
    assert!(cache.records.is_empty());
}

/// Light that varies along x and that records cannot predict, because each record contains only its local value.
struct Unforeseen<F: Fn(f32) -> f32> {
    light: F,
}

impl<F: Fn(f32) -> f32 + Sync> Illumination for Unforeseen<F> {
    type Recipe = ();
    type Scratch = ();

    fn compute(&self, site: &Site, (): &mut ()) -> Computed<()> {
        Computed { light: even((self.light)(site.position.x), 0.8), recipe: () }
    }

    fn relight(&self, _: &Site, (): &mut (), _: LastUpdate) -> Option<LocalIrradiance> {
        None
    }
}

/// Irradiance is a ramp, but every record has a zero gradient. Slopes fitted to neighbors are three times as accurate
/// as the light of the nearest record.
#[test]
fn neighbors_teach_slopes() {
    let light = |x: f32| 1.0 + 0.3 * x;
    let seen = floor(|_| ());
    let mut cache = IrradianceCache::default();
    let lit = cache.light(Request::whole(&seen, &[false, true]), NO_CHANGES, &Unforeseen { light }).value;
    let nearest = |pixel: &PixelSurface| {
        let distance = |record: &&Record<()>| record.site.position.distance_squared(pixel.position.into());
        let record = cache.records.iter().min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap();
        record.estimate.irradiance.x
    };
    let (mut learnt, mut blind) = (0.0, 0.0);
    for (e, pixel) in lit.irradiance.samples().iter().zip(seen.pixels.samples()) {
        let truth = light(pixel.position[0]);
        learnt += (e[0] - truth).powi(2);
        blind += (nearest(pixel) - truth).powi(2);
    }
    println!("{} records, {} of the error", lit.computed, (learnt / blind).sqrt());
    assert!(learnt * 9.0 < blind, "{learnt} and {blind}");
}

/// A further picture that uses the known neighbors of its frame is identical to a picture after a new search for
/// neighbors. Slopes follow only from the light of the neighbors.
#[test]
fn known_neighbors_change_nothing() {
    let rising = Unforeseen { light: |x: f32| 1.0 + 0.3 * x + 0.1 * (9.0 * x).sin() };
    let first = floor(|_| ());
    let beside = floor_from(Vec3::new(0.006, 5.0, 0.006), |_| ());
    // Light only a region of the first picture, so that the second picture needs new records in the rest.
    let left = Plane::from_fn(SIDE, SIDE, |x, _| x < 40);
    let lit = |forgets: bool| {
        let mut cache = IrradianceCache::default();
        let request = Request { wanted: Some(&left), is_first_of_many: true, ..Request::whole(&first, &[false; 2]) };
        let _ = cache.light(request, NO_CHANGES, &rising);
        if forgets {
            cache.known = KnownNeighbors::default();
        }
        cache.light_more(Request::whole(&beside, &[false; 2]), &rising).value
    };
    let (known, anew) = (lit(false), lit(true));
    assert!(known.computed > 20, "{} new records", known.computed);
    assert_eq!((known.computed, known.in_use), (anew.computed, anew.in_use));
    for (a, b) in known.irradiance.samples().iter().zip(anew.irradiance.samples()) {
        assert!((a[0] - b[0]).abs() <= 1e-5, "{a:?} {b:?}");
    }
}

/// Where irradiance changes unpredictably, records are at least three times as dense as where irradiance is even.
#[test]
fn records_crowd_where_they_are_contradicted() {
    // Use a soft step with a width of a fifth of the floor.
    let light = |x: f32| 1.5 + (x / 0.1).tanh() / 2.0;
    let seen = floor(|_| ());
    let mut cache = IrradianceCache::default();
    let lit = cache.light(Request::whole(&seen, &[false, true]), NO_CHANGES, &Unforeseen { light }).value;
    let at_step = cache.records.iter().filter(|record| record.site.position.x.abs() < 0.2).count();
    let around = cache.records.iter().filter(|record| record.site.position.x.abs() > 0.6).count();
    assert!(2 * at_step > 3 * around, "{at_step} records at the step, {around} on twice as much floor around it");
    let pixels = lit.irradiance.samples().iter().zip(seen.pixels.samples());
    let worst = pixels.map(|(e, pixel)| (e[0] - light(pixel.position[0])).abs()).fold(0.0, f32::max);
    assert!(worst < 0.1, "{worst} of a step of 1");
}

/// The light is unpredictable and varies by five tolerances within a few centimeters. After a walk of 80 frames, a
/// picture uses hardly more records than after a few picture widths. The mean of the picture is as accurate.
#[test]
fn a_walk_does_not_gather_records() {
    let light = |x: f32| 1.0 + 0.1 * (x * 131.0).sin() * (x * 37.0).cos();
    let mut cache = IrradianceCache::default();
    let mut in_use = Vec::new();
    for frame in 0..80 {
        let way = 0.03 * frame as f32;
        let seen = floor_from(Vec3::new(way, 5.0, way / 3.0), |_| ());
        let lit = cache.light(Request::whole(&seen, &[false, true]), NO_CHANGES, &Unforeseen { light }).value;
        in_use.push(lit.in_use);
        let mean = lit.irradiance.samples().iter().map(|e| e[0]).sum::<f32>() / (SIDE * SIDE) as f32;
        assert!((mean - 1.0).abs() < 0.02, "frame {frame}: {mean}");
    }
    println!("records in use: {:?}", [in_use[0], in_use[10], in_use[40], in_use[79]]);
    assert!(in_use[79] as f32 <= 1.2 * in_use[40] as f32, "{in_use:?}");
    assert!(cache.records.len() <= KEPT_FOR_EACH_USED * in_use[79], "{} kept", cache.records.len());
}
