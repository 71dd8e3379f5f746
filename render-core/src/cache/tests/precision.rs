//! Comparison of the cache's weights, radii, fits and interpolation with definitions in `f64`. Distances range from
//! contact to 10⁶ m, and light from very faint to very bright. Neighbors along a needle make the fit ill-conditioned.

use crate::cache::group::weight_between;
use crate::cache::illumination::{LocalIrradiance, Site};
use crate::cache::predict::{Fit, Prediction};
use crate::cache::radius::radius;
use crate::cache::record::{Record, RecordLight};
use crate::cache::tolerance::{ACROSS, NORMAL_TOLERANCE, OPENNESS_TOLERANCE};
use crate::sampling::{hash_unit, uniform_sphere};
use crate::scene::{Projection, View};
use glam::{Affine3A, DMat3, DVec3, Mat3A, Quat, Vec2, Vec3, Vec3A};

/// Sequence of random numbers, 0…1, for a key.
struct Random(u64, u64);

impl Random {
    fn unit(&mut self) -> f32 {
        self.1 += 1;
        hash_unit(11, self.0, self.1)
    }

    /// Returns a random number, −1…1.
    fn signed(&mut self) -> f32 {
        2.0 * self.unit() - 1.0
    }

    /// Returns a unit vector at an angle of at most about `angle` from `axis`.
    fn near(&mut self, axis: Vec3A, angle: f32) -> Vec3A {
        let way = Vec3A::from(uniform_sphere(Vec2::new(self.unit(), self.unit())));
        (axis + way * (angle * self.unit())).normalize()
    }
}

fn luminance(light: DVec3) -> f64 {
    light.dot(DVec3::new(0.2126, 0.7152, 0.0722))
}

fn wide(v: Vec3A) -> DVec3 {
    v.as_dvec3()
}

fn matrix(m: &Mat3A) -> DMat3 {
    DMat3::from_cols(wide(m.x_axis), wide(m.y_axis), wide(m.z_axis))
}

/// Returns the weight at `to` of a record at `from`, by the formula above `RecordGroup::error2`. Openness may differ by
/// at most `tolerance`.
fn weight(from: &Site, radius: f64, tolerance: f64, to: &Site) -> f64 {
    let d = wide(to.position) - wide(from.position);
    let along = d.dot(wide(to.normal) + wide(from.normal)) / 2.0;
    let turn = (1.0 - wide(to.normal).dot(wide(from.normal))) / f64::from(NORMAL_TOLERANCE);
    let opener = (f64::from(to.openness) - f64::from(from.openness)) / tolerance;
    let e2 = (d.length_squared() + (f64::from(ACROSS) * along).powi(2)) / (radius * radius) + turn + opener * opener;
    (1.0 - e2).max(0.0).powi(2)
}

/// Returns a site at a distance of about `radius` from `around`. It is anywhere on the surface, or on a `needle` of
/// this thickness.
fn place(random: &mut Random, around: &Site, radius: f32, needle: Option<f32>) -> Site {
    let (x, y) = crate::sampling::frame(around.normal.into());
    let spread = Vec3::new(1.0, needle.unwrap_or(1.0), 0.1 * needle.unwrap_or(1.0));
    let way = spread * Vec3::new(random.signed(), random.signed(), random.signed()) * radius;
    Site {
        position: around.position + Vec3A::from(x * way.x + y * way.y) + around.normal * way.z,
        normal: random.near(around.normal, 0.3),
        openness: around.openness + 0.2 * random.signed(),
        ..*around
    }
}

/// Returns a site within a hundred radii of the origin.
fn somewhere(random: &mut Random, radius: f32) -> Site {
    let normal = random.near(Vec3A::Y, 2.0);
    let position = Vec3A::new(random.signed(), random.signed(), random.signed()) * (100.0 * radius);
    Site { position, normal, geometric_normal: normal, carrier: 0, openness: 0.5, key: 0 }
}

/// Returns light that varies by half between sites, with random derivatives. The derivative by the position is along
/// the surface of `site`.
fn estimate(random: &mut Random, site: &Site, light: f32, radius: f32) -> LocalIrradiance {
    let color = |random: &mut Random| {
        let color = Vec3::new(1.0 + 0.2 * random.unit(), 1.0, 0.7 + 0.3 * random.unit());
        Vec3A::from(color * light * random.signed())
    };
    // Sum c dᵀ over the directions d, along which the light changes by c.
    let slope = |directions: [Vec3A; 2], random: &mut Random| {
        let [c, d] = [color(random), color(random)];
        let by_axis = |k: usize| c * directions[0][k] + d * directions[1][k];
        Mat3A::from_cols(by_axis(0), by_axis(1), by_axis(2))
    };
    let (x, y) = crate::sampling::frame(site.normal.into());
    LocalIrradiance {
        irradiance: Vec3::new(1.0, 0.9, 0.8) * (light * (1.0 + 0.5 * random.signed())),
        by_normal: slope([x.into(), site.normal], random) * 0.5,
        by_position: slope([x.into(), y.into()], random) * (0.5 / radius),
        harmonic_mean: radius / 0.6,
        nearest: 2.0 * radius,
        tolerance: 0.02 * light,
    }
}

fn record(site: Site, estimate: LocalIrradiance, radius: f32) -> Record<()> {
    Record { radius, ..Record::new(site, 1.0, RecordLight { estimate, note: 0, afresh: true }, 0, 0) }
}

/// Returns the powers of ten in a range of exponents.
fn decades(from: i32, to: i32) -> impl Iterator<Item = f32> {
    (from..=to).map(|power| 10f32.powi(power))
}

#[test]
fn weights_are_those_of_f64_from_contact_to_far_away() {
    let mut worst = 0.0f64;
    for (key, r) in (0..).zip(decades(-12, 12)) {
        let mut random = Random(key, 0);
        for _ in 0..500 {
            let from = somewhere(&mut random, r);
            let needle = Some(10f32.powf(-6.0 * random.unit()));
            let to = place(&mut random, &from, r, needle);
            let error =
                f64::from(weight_between(&from, r, &to)) - weight(&from, r.into(), OPENNESS_TOLERANCE.into(), &to);
            worst = worst.max(error.abs());
        }
        let here = somewhere(&mut random, r);
        let itself = weight_between(&here, r, &here);
        assert!((itself - 1.0).abs() < 1e-5, "at a distance of 0: {itself}");
        assert!((weight_between(&here, 0.0, &here) - 1.0).abs() < 1e-5, "a radius of 0 still has its own place");
    }
    println!("farthest from f64: {worst:.1e}");
    // Allow the rounding error of 1 in 1 − n · n′, which division increases to five times its size.
    assert!(worst < 1e-5, "{worst:.1e}");
}

/// The radius is the minimum of three terms. Each term may be 0 or ∞, or 0/0 in the dark.
#[test]
fn radii_are_those_of_f64() {
    let mut worst = 0.0f64;
    for (key, length) in (0..).zip(decades(-12, 12)) {
        let mut random = Random(key, 1);
        // Keep the square of a derivative finite: above 10¹⁹ W/m³, the radius is 0.
        for light in decades(-12, 12).filter(|light| light / length < 1e18) {
            let site = somewhere(&mut random, length);
            let mut of = estimate(&mut random, &site, light, length);
            of.harmonic_mean = length * random.unit();
            of.nearest = length * random.unit();
            let columns = [of.by_position.x_axis, of.by_position.y_axis, of.by_position.z_axis];
            let slope = DVec3::from_array(columns.map(|column| luminance(wide(column)))).length();
            let by_gradient = 0.7 * luminance(of.irradiance.as_dvec3()) / slope;
            let exact = (0.6 * f64::from(of.harmonic_mean)).min(of.nearest.into()).min(by_gradient);
            worst = worst.max((f64::from(radius(&of)) / exact - 1.0).abs());
        }
    }
    println!("farthest from f64: {worst:.1e}");
    assert!(worst < 1e-6, "{worst:.1e}");
    let dark = LocalIrradiance {
        irradiance: Vec3::ZERO,
        by_normal: Mat3A::ZERO,
        by_position: Mat3A::ZERO,
        harmonic_mean: f32::INFINITY,
        nearest: 3.0,
        tolerance: 0.0,
    };
    assert_eq!(radius(&dark), 3.0, "0/0 says nothing");
    assert_eq!(radius(&LocalIrradiance { nearest: f32::INFINITY, ..dark }), f32::INFINITY);
    assert_eq!(radius(&LocalIrradiance { harmonic_mean: 0.0, ..dark }), 0.0, "contact");
}

/// Prediction of a record in `f64`: the minimum defined at the top of `predict.rs`. It is computed by elimination
/// instead of an inverse, and with different axes.
struct Exact {
    position: DVec3,
    normal: DVec3,
    openness: f64,
    irradiance: DVec3,
    by_normal: DMat3,
    axes: [DVec3; 2],
    /// Derivatives along both axes \[W·m⁻³\].
    along: [DVec3; 2],
    by_openness: DVec3,
}

impl Exact {
    /// Returns the prediction from the record's own derivatives.
    fn alone(record: &Record<()>, radius: f64) -> Self {
        // Limit the derivatives, which may change the light by a fraction of itself.
        let Record { site, estimate, .. } = record;
        let light = luminance(estimate.irradiance.as_dvec3());
        let length = |m: &DMat3| DVec3::new(luminance(m.x_axis), luminance(m.y_axis), luminance(m.z_axis)).length();
        let (by_position, by_normal) = (matrix(&estimate.by_position), matrix(&estimate.by_normal));
        let most = light * if radius > f64::from(record.radius) { 0.25 } else { 0.7 };
        let trust = (most / (length(&by_position) * radius).max(length(&by_normal) * 0.632)).min(1.0);

        // Use axes independent of the code under test.
        let normal = wide(site.normal).normalize();
        let x = normal.any_orthonormal_vector();
        let axes = [x, normal.cross(x)];
        Self {
            position: wide(site.position),
            normal: wide(site.normal),
            openness: site.openness.into(),
            irradiance: estimate.irradiance.as_dvec3(),
            by_normal: by_normal * trust,
            axes,
            along: axes.map(|axis| by_position * axis * trust),
            by_openness: DVec3::ZERO,
        }
    }

    /// Returns the prediction fitted to the `neighbors`.
    fn new<'r>(record: &Record<()>, radius: f64, pixel: f64, neighbors: impl Iterator<Item = &'r Record<()>>) -> Self {
        let Record { site, estimate, .. } = record;
        let light = luminance(estimate.irradiance.as_dvec3());
        let mut exact = Self::alone(record, radius);
        let (axes, own) = (exact.axes, exact.along.map(|slope| slope * radius));

        // Include neighbors within twelve pixels, clamped to 1.25…2 radii.
        let (widened, tolerance) = ((12.0 * pixel / radius).clamp(1.25, 2.0), f64::from(OPENNESS_TOLERANCE));
        // Build the left side of the normal equations, with the ridge, and the right side.
        let mut rows = [[0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0, 0.0, 0.5]];
        let mut right = [DVec3::ZERO; 3];
        let (mut weights, mut variance) = (0.0, 0.0);
        for neighbor in neighbors {
            let other = &neighbor.site;
            let way = wide(other.position) - exact.position;
            // Widen all tolerances with the reach.
            let w = weight(site, radius * widened, tolerance * widened, other);
            let opener = (f64::from(other.openness) - exact.openness) / tolerance;
            let f = [way.dot(axes[0]) / radius, way.dot(axes[1]) / radius, opener];

            // Reduce the weight of large residuals. r is the residual of the record's own prediction.
            let alone = exact.irradiance + exact.by_normal * (wide(other.normal) - exact.normal);
            let r = neighbor.estimate.irradiance.as_dvec3() - alone - own[0] * f[0] - own[1] * f[1];
            let taught = w * (1.0 - (luminance(r) / (0.7 * light)).powi(2)).max(0.0).powi(2);
            for i in 0..3 {
                for j in 0..3 {
                    rows[i][j] += taught * f[i] * f[j];
                }
                right[i] += r * (taught * f[i]);
            }
            weights += w;
            variance += w * luminance(r).powi(2);
        }
        if weights == 0.0 {
            return exact;
        }

        // Solve, and limit the slopes to a change of the light by half of itself.
        variance /= weights;
        let learns = variance / (variance + (0.5 * f64::from(estimate.tolerance)).powi(2));
        let learnt = eliminated(rows, right).map(|slope| slope * learns);
        let along = [own[0] + learnt[0], own[1] + learnt[1]];
        let change = luminance(along[0]).hypot(luminance(along[1]));
        let followed = (0.5 * light / change).min(1.0);
        exact.along = along.map(|slope| slope * followed / radius);
        exact.by_openness = learnt[2] / tolerance;
        exact
    }

    fn at(&self, site: &Site) -> DVec3 {
        let way = wide(site.position) - self.position;
        let light = self.irradiance
            + self.by_normal * (wide(site.normal) - self.normal)
            + self.along[0] * way.dot(self.axes[0])
            + self.along[1] * way.dot(self.axes[1])
            + self.by_openness * (f64::from(site.openness) - self.openness);
        light.max(DVec3::ZERO)
    }
}

/// Solves three equations with three right sides by Gaussian elimination with partial pivoting.
fn eliminated(mut rows: [[f64; 3]; 3], mut right: [DVec3; 3]) -> [DVec3; 3] {
    for k in 0..3 {
        // Use the largest remaining entry of column k as the pivot, so that no factor exceeds 1. Eliminate the other
        // entries.
        let pivot = (k..3).max_by(|&a, &b| rows[a][k].abs().total_cmp(&rows[b][k].abs())).expect("a row");
        rows.swap(k, pivot);
        right.swap(k, pivot);
        for i in 0..3 {
            if i != k {
                let factor = rows[i][k] / rows[k][k];
                (0..3).for_each(|j| rows[i][j] -= factor * rows[k][j]);
                right[i] -= right[k] * factor;
            }
        }
    }
    [0, 1, 2].map(|k| right[k] / rows[k][k])
}

/// Returns a view from above with pixels of width `pixel` at the origin.
fn view(pixel: f32) -> View {
    let above = Affine3A::from_rotation_translation(Quat::from_rotation_x(-std::f32::consts::FRAC_PI_2), Vec3::ZERO);
    View::new(above, Projection::Orthographic { ymag: 32.0 * pixel }, 64, 64)
}

/// Returns the prediction of a record by the code under test and in `f64`, with the other `records` as neighbors.
fn predicted(one: &Record<()>, records: &[Record<()>], radius: f32, view: &View) -> (Prediction, Exact) {
    // Add all records, because a fit ignores its own record.
    let mut fit = Fit::new(one, radius, view);
    records.iter().for_each(|other| fit.add(other));
    let others = records.iter().filter(|other| !std::ptr::eq(*other, one));
    let pixel = f64::from(one.site.pixel_width(view));
    (fit.solve().prediction, Exact::new(one, radius.into(), pixel, others))
}

/// Fits of up to sixty neighbors, and pixels interpolated from the fits. The neighbors surround the record, or lie on a
/// needle with a thickness down to a millionth of its length.
#[test]
fn predictions_and_what_is_interpolated_are_those_of_f64() {
    let tolerance = f64::from(OPENNESS_TOLERANCE);
    let (mut worst, mut worst_mean) = (0.0f64, 0.0f64);
    for (key, r) in (0..).zip(decades(-6, 6)) {
        for (needle, light) in [(None, 1e-12), (None, 1e12), (Some(1e-1), 1.0), (Some(1e-3), 1e-6), (Some(1e-6), 1e6)] {
            let mut random = Random(key, 2);
            for _ in 0..4 {
                let view = view(r / 8.0);
                let middle = somewhere(&mut random, r);
                let count = 2 + (58.0 * random.unit()) as usize;
                let mut records = Vec::new();
                for _ in 0..count {
                    let site = place(&mut random, &middle, r, needle);
                    records.push(record(site, estimate(&mut random, &site, light, r), r));
                }
                let predictions: Vec<_> = records.iter().map(|one| predicted(one, &records, r, &view)).collect();

                // Compute the weighted mean of the predictions at a few pixels, in f32 and in f64.
                for _ in 0..8 {
                    let pixel = place(&mut random, &middle, r, needle);
                    let (mut sum, mut whole) = (Vec3A::ZERO, 0.0);
                    let (mut exact_sum, mut exact_whole) = (DVec3::ZERO, 0.0);
                    for (record, (prediction, exact)) in records.iter().zip(&predictions) {
                        // Accumulate by the code under test.
                        let w = weight_between(&record.site, r, &pixel);
                        let found = prediction.at(&(&pixel).into());
                        (sum, whole) = (sum + found * w, whole + w);

                        // Accumulate in f64.
                        let w = weight(&record.site, r.into(), tolerance, &pixel);
                        let of = exact.at(&pixel);
                        (exact_sum, exact_whole) = (exact_sum + of * w, exact_whole + w);
                        if w > 0.0 {
                            worst = worst.max(((wide(found) - of) / f64::from(light)).abs().max_element());
                        }
                    }

                    // Skip pixels with less weight, which would receive their own record.
                    if exact_whole > 0.3 {
                        let error = wide(sum / whole) - exact_sum / exact_whole;
                        worst_mean = worst_mean.max((error / f64::from(light)).abs().max_element());
                    }
                }
            }
        }
    }
    println!("farthest from f64, by the light there is: {worst:.1e}, interpolated {worst_mean:.1e}");
    assert!(worst < 5e-6 && worst_mean < 5e-6, "{worst:.1e}, interpolated {worst_mean:.1e}");
}
