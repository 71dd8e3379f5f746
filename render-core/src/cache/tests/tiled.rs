//! Comparison of pictures lit in regions with the whole picture and with light in closed form.

use super::*;
use crate::ranks::Portable;
use glam::{Mat3A, Vec3};

/// Light of a lamp one meter above the floor: E = P cos θ / r², with the derivative by the position.
struct Lamp {
    power: f32,
}

impl Lamp {
    fn irradiance(&self, position: Vec3A) -> f32 {
        let to_lamp = Vec3A::Y - position;
        self.power * to_lamp.y / to_lamp.length().powi(3)
    }
}

impl Illumination for Lamp {
    /// Position and power at the computation.
    type Recipe = (Vec3A, f32);
    type Scratch = ();

    fn compute(&self, site: &Site, (): &mut ()) -> Computed<Self::Recipe> {
        let to_lamp = Vec3A::Y - site.position;
        let r2 = to_lamp.length_squared();
        let slope = (to_lamp * (3.0 * to_lamp.y / r2) - Vec3A::Y) * (self.power / (r2 * r2.sqrt()));
        let gray = Mat3A::from_cols(Vec3A::splat(slope.x), Vec3A::splat(slope.y), Vec3A::splat(slope.z));
        let irradiance = self.irradiance(site.position);
        let light = LocalIrradiance { by_position: gray, tolerance: 0.03 * irradiance, ..even(irradiance, 1.0) };
        Computed { light, recipe: (site.position, self.power) }
    }

    fn relight(&self, _: &Site, _: &mut Self::Recipe, _: LastUpdate) -> Option<LocalIrradiance> {
        None
    }
}

type Cache = IrradianceCache<(Vec3A, f32)>;

const STILL: Changes = Changes { light: false, geometry: false };
const BRIGHTER: Changes = Changes { light: true, geometry: false };

/// Returns the picture from a camera `aside` meters to the side of the middle.
fn seen(aside: f32) -> GBuffer {
    floor_from(Vec3::new(aside, 5.0, 0.0), |_| ())
}

/// Returns the mask of column `k` of `count` equal columns of a picture.
fn column(seen: &GBuffer, k: usize, count: usize) -> Plane<bool> {
    let width = seen.pixels.width();
    Plane::from_fn(width, seen.pixels.height(), |x, _| x * count / width == k)
}

/// Lights a picture in columns, each by the next cache in rotation. If `shares` is true, the caches share their new
/// records.
fn lit_in_columns(caches: &mut [Cache], shares: bool, seen: &GBuffer, changes: Changes, lamp: &Lamp) -> CachedLight {
    const COLUMNS: usize = 6;
    let mut whole = CachedLight {
        irradiance: Plane::filled(seen.pixels.width(), seen.pixels.height(), [0.0; 3]),
        in_use: 0,
        computed: 0,
    };
    for cache in &mut *caches {
        let _ = cache.begin_regions(seen, changes, lamp);
    }
    for k in 0..COLUMNS {
        let own = k % caches.len();
        let wanted = column(seen, k, COLUMNS);
        let request = Request { wanted: Some(&wanted), ..Request::whole(seen, &[false; 2]) };
        let part = caches[own].light_region(request, lamp).value;
        whole.computed += part.computed;
        for (index, &light) in part.irradiance.samples().iter().enumerate() {
            if wanted.samples()[index] {
                whole.irradiance.samples_mut()[index] = light;
            }
        }

        // Transfer records as bytes, as between processes.
        let mut bytes = Vec::new();
        caches[own].take_new().put(&mut bytes);
        for other in (0..caches.len()).filter(|&other| shares && other != own) {
            caches[other].adopt(Vec::take(&mut &bytes[..]).expect("the bytes of records"));
        }
    }
    for cache in caches {
        cache.end_regions(seen, &[false; 2]);
    }
    whole
}

/// Returns the root mean square relative error of a picture.
fn error(lit: &CachedLight, seen: &GBuffer, lamp: &Lamp) -> f32 {
    let mut sum = 0.0;
    for (pixel, light) in seen.pixels.samples().iter().zip(lit.irradiance.samples()) {
        let exact = lamp.irradiance(pixel.position.into());
        sum += (light[0] / exact - 1.0).powi(2);
    }
    (sum / seen.pixels.samples().len() as f32).sqrt()
}

#[test]
fn a_part_that_is_all_of_the_picture_is_lit_as_the_whole() {
    let (lamp, first, beside) = (Lamp { power: 1.0 }, seen(0.0), seen(0.01));
    let request = |seen| Request { is_first_of_many: true, ..Request::whole(seen, &[false; 2]) };
    let mut whole = Cache::default();
    let expected = [whole.light(request(&first), STILL, &lamp).value, whole.light_more(request(&beside), &lamp).value];
    let mut cache = Cache::default();
    let _ = cache.begin_regions(&first, STILL, &lamp);
    let lit =
        [cache.light_region(request(&first), &lamp).value, cache.light_more_of_region(request(&beside), &lamp).value];
    for (lit, expected) in lit.iter().zip(&expected) {
        assert!(expected.in_use > 10);
        assert_eq!(lit.irradiance.samples(), expected.irradiance.samples());
        assert_eq!((lit.in_use, lit.computed), (expected.in_use, expected.computed));
    }
}

/// Tests three frames of a walk. The lamp becomes brighter in the second frame.
#[test]
fn parts_are_as_exact_as_the_whole_whoever_lights_them() {
    let mut whole = Cache::default();
    let mut kinds = [(1, false), (3, false), (3, true)].map(|(count, shares)| {
        let caches: Vec<Cache> = (0..count).map(|_| Cache::default()).collect();
        (caches, shares, 0)
    });
    for (frame, changes) in [STILL, BRIGHTER, STILL].into_iter().enumerate() {
        let lamp = Lamp { power: if frame == 0 { 1.0 } else { 2.0 } };
        let seen = seen(0.1 * frame as f32);
        let expected = whole.light(Request::whole(&seen, &[false; 2]), changes, &lamp).value;
        let bound = error(&expected, &seen, &lamp);
        assert!(bound > 0.0 && bound < 0.03, "{bound}");
        for (caches, shares, computed) in &mut kinds {
            let lit = lit_in_columns(caches, *shares, &seen, changes, &lamp);
            let found = error(&lit, &seen, &lamp);
            assert!(found < 1.5 * bound, "frame {frame}, {} caches: {found}, bound {bound}", caches.len());
            *computed += lit.computed;
        }
    }
    // Require that caches that share records make fewer than separate caches, and that a single cache makes the fewest.
    let [alone, apart, together] = kinds.map(|(.., computed)| computed);
    assert!(alone <= together && together < apart, "{alone} {together} {apart}");
}

#[test]
fn records_that_come_too_late_are_left_out() {
    let (lamp, bright) = (Lamp { power: 1.0 }, Lamp { power: 3.0 });
    let picture = seen(0.0);
    let request = Request::whole(&picture, &[false; 2]);
    let [mut first, mut second] = [Cache::default(), Cache::default()];
    for cache in [&mut first, &mut second] {
        let _ = cache.begin_regions(&picture, STILL, &lamp);
    }
    let _ = first.light_region(request, &lamp);
    let made = first.take_new();
    assert!(made.len() > 10 && first.take_new().is_empty(), "each is taken once");

    // Require that no records are made if shared records arrive in time.
    let mut third = Cache::default();
    let _ = third.begin_regions(&picture, STILL, &lamp);
    third.adopt(made.clone());
    assert_eq!(third.light_region(request, &lamp).value.computed, 0);

    // Require that shared records are rejected after a change of light.
    let _ = second.begin_regions(&picture, BRIGHTER, &bright);
    second.adopt(made);
    assert_eq!(second.sites().count(), 0);
}
