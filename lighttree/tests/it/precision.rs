//! Tests of the precision loss of `f32`, compared with the same sums and kernels in `f64`. They cover a million lights,
//! whole lightcuts, and the singularities of the geometry term (contact, grazing angles) and of the GGX lobe (zero
//! roughness).

use glam::{DVec3, Vec3};
use lighttree::{BuildParams, Builder, Emission, Ggx, Lambert, Light, LightTree, Scratch, Stop, exhaustive};
use std::f64::consts::PI;

/// A fast, platform-independent random generator (xorshift).
struct Random(u64);

impl Random {
    /// Returns a random number in 0 … 1.
    fn unit(&mut self) -> f32 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 40) as f32 / (1u64 << 24) as f32
    }
}

/// Returns lights below the ceiling of a hall, with intensities over four decades.
fn hall(count: usize) -> Vec<Light> {
    let mut random = Random(0x2545_f491_4f6c_dd1d);
    (0..count)
        .map(|_| Light {
            position: Vec3::new(100.0 * random.unit(), 100.0 * random.unit(), 3.0 + random.unit()),
            emission: Emission::Cosine(Vec3::new(random.unit() - 0.5, random.unit() - 0.5, -1.0).normalize()),
            intensity: Vec3::new(1.0, 0.7, 0.4) * 10f32.powf(4.0 * random.unit() - 4.0),
        })
        .collect()
}

const FLOOR: Lambert =
    Lambert { position: Vec3::new(37.0, 61.0, 0.0), normal: Vec3::Z, reflectance: Vec3::new(0.5, 0.5, 0.5) };
const GEOMETRY_TERM_BOUND: f32 = 0.01;

/// Returns M·G·I, computed in `f64` from the kernel's `f32` inputs.
fn contribution(receiver: &Lambert, light: &Light, geometry_term_bound: f32) -> DVec3 {
    let way = light.position.as_dvec3() - receiver.position.as_dvec3();
    let r2 = way.length_squared();
    let direction = way / r2.sqrt();
    let Emission::Cosine(axis) = light.emission else { panic!("lights with an axis") };
    let cosines = receiver.normal.as_dvec3().dot(direction).max(0.0) * (-axis.as_dvec3().dot(direction)).max(0.0);
    receiver.reflectance.as_dvec3()
        * light.intensity.as_dvec3()
        * (cosines / (PI * (r2 + f64::from(geometry_term_bound))))
}

fn relative(found: f32, exact: f64) -> f64 {
    (f64::from(found) / exact - 1.0).abs()
}

/// The sum over a million lights uses `f64` and is exact to a few roundings of its terms. A simple sequential sum in
/// `f32` has a hundred times the error. Nodes add in pairs, level by level.
#[test]
fn a_million_lights_add_up() {
    let lights = hall(1_000_000);
    let exact: DVec3 = lights.iter().map(|light| contribution(&FLOOR, light, GEOMETRY_TERM_BOUND)).sum();
    let found = exhaustive(&lights, GEOMETRY_TERM_BOUND, &FLOOR, |_, _| true);
    let straight: f32 = lights.iter().map(|light| contribution(&FLOOR, light, GEOMETRY_TERM_BOUND).x as f32).sum();
    let [ours, naive] = [found.x, straight].map(|sum| relative(sum, exact.x));
    println!("a million terms: {ours:.1e} off, in f32 one after the other {naive:.1e}");
    assert!(ours < 2e-7, "{ours:.1e}");
    assert!(naive > 20.0 * ours.max(f64::from(f32::EPSILON) / 4.0), "the need for f64 shows: {naive:.1e}");

    let tree =
        LightTree::build_by(Builder::TopDown, &lights, BuildParams::bounded_by(GEOMETRY_TERM_BOUND).with_seed(1));
    let exact: DVec3 = lights.iter().map(|light| light.intensity.as_dvec3()).sum();
    let straight: f32 = lights.iter().map(|light| light.intensity.x).sum();
    let [ours, naive] = [tree.total_intensity().x, straight].map(|sum| relative(sum, exact.x));
    println!("a million intensities: {ours:.1e} off by the tree, in f32 one after the other {naive:.1e}");
    assert!(ours < 1e-6, "{ours:.1e}");
}

/// A lightcut with the maximum size for calibrated stopping adds its clusters sequentially in `f32`. The sum of 8000
/// terms of similar size loses at most 8000 / 2 roundings, and far fewer in practice.
#[test]
fn a_whole_cut_adds_up() {
    let lights = hall(8000);
    let exact: DVec3 = lights.iter().map(|light| contribution(&FLOOR, light, GEOMETRY_TERM_BOUND)).sum();
    for builder in [Builder::TopDown, Builder::BottomUp] {
        let tree = LightTree::build_by(builder, &lights, BuildParams::bounded_by(GEOMETRY_TERM_BOUND).with_seed(1));
        let cut = tree.lightcut(&FLOOR, Stop::Absolute(0.0), |_, _| true, &mut Scratch::with_max_size(8000));
        // All other lights are behind the receiver or face away.
        assert!(cut.size > 4000, "{cut:?}");
        let off = relative(cut.radiance.x, exact.x);
        println!("{builder:?}: a cut of {} lights is {off:.1e} off", cut.size);
        assert!(off < 1e-5, "{off:.1e}");
    }
}

/// Returns the sum over one light straight above the receiver at this distance, in `f32` and in `f64`.
fn facing(distance: f32, geometry_term_bound: f32) -> (f32, DVec3) {
    let receiver = Lambert { position: Vec3::ZERO, ..FLOOR };
    let light = Light { position: Vec3::Z * distance, emission: Emission::Cosine(Vec3::NEG_Z), intensity: Vec3::ONE };
    (
        exhaustive(&[light], geometry_term_bound, &receiver, |_, _| true).x,
        contribution(&receiver, &light, geometry_term_bound),
    )
}

/// For r → 0, L tends to ρ I / (π s²). For r → ∞, L tends to ρ I / (π r²). Between these limits L is ρ I / (π (r² +
/// s²)), over forty decades. Below 10⁻¹⁵ m the direction is undefined and L is zero.
#[test]
fn the_geometric_term_has_its_limits() {
    for geometry_term_bound in [1e-12f32, 1e-4, 0.01, 100.0, 1e10] {
        for exponent in -140..140 {
            let distance = 10f32.powf(exponent as f32 / 10.0);
            let (found, exact) = facing(distance, geometry_term_bound);
            let off = relative(found, exact.x);
            assert!(off < 6e-7, "r = {distance}, s² = {geometry_term_bound}: {found} for {}", exact.x);
        }
        let limit = 0.5 / (PI * f64::from(geometry_term_bound));
        let (nearest, _) = facing(1.1e-15, geometry_term_bound);
        assert!(
            relative(nearest, limit) < 1e-6,
            "s² = {geometry_term_bound}: {nearest} at contact, {limit} is the limit"
        );
        assert_eq!(facing(0.9e-15, geometry_term_bound).0, 0.0);
        assert_eq!(facing(0.0, geometry_term_bound).0, 0.0);
    }
}

/// For cos θ → 0 the cosine is a difference of products. It keeps its absolute precision, not its relative precision.
/// The relative error is an `f32` rounding divided by the cosine. Lights behind the receiver contribute nothing.
#[test]
fn grazing_light_is_right_to_a_rounding_of_the_cosine() {
    for exponent in 0..60 {
        let cosine = 10f64.powf(-f64::from(exponent) / 10.0);
        let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
        for turn in 0..16 {
            let angle = f64::from(turn) * 0.4;
            // The receiver's normal is tilted, so that the cosine is a sum of three products.
            let normal = DVec3::new(angle.cos(), angle.sin(), 1.3).normalize();
            let along = normal.any_orthonormal_vector();
            let position = (along * sine + normal * cosine).as_vec3();
            let receiver = Lambert { position: Vec3::ZERO, normal: normal.as_vec3(), ..FLOOR };
            let light = Light { position, emission: Emission::Cosine(-position.normalize()), intensity: Vec3::ONE };
            let found = exhaustive(&[light], GEOMETRY_TERM_BOUND, &receiver, |_, _| true).x;
            let exact = contribution(&receiver, &light, GEOMETRY_TERM_BOUND).x;
            let allowed = 4.0 * f64::from(f32::EPSILON) * (0.5 / PI / 1.01) + 1e-6 * exact;
            assert!((f64::from(found) - exact).abs() <= allowed, "cosine {cosine:e}: {found} for {exact}");
        }
    }
}

/// Returns the lobe of a rough metal by definition, in `f64`. α is at least 0.02, where the peak is 1/(4 π α²) = 199.
fn lobe(receiver: &Ggx, direction: DVec3) -> f64 {
    let alpha2 = f64::from(receiver.alpha.clamp(0.02, 1.0)).powi(2);
    let (n, view) = (receiver.normal.as_dvec3(), receiver.view.as_dvec3());
    let h = (direction + view).normalize();
    let (cos_i, cos_o, cos_h) = (n.dot(direction), n.dot(view), n.dot(h));
    if cos_i <= 0.0 {
        return 0.0;
    }
    let d = alpha2 / (PI * (cos_h * cos_h * (alpha2 - 1.0) + 1.0).powi(2));
    let s = |cosine: f64| (cosine * cosine * (1.0 - alpha2) + alpha2).sqrt();
    let v = 1.0 / (2.0 * (cos_o * s(cos_i) + cos_i * s(cos_o)));
    let f = 1.0 + 0.0 * view.dot(h);
    f64::from(receiver.diffuse.x) * cos_i / PI + f * d * v * cos_i
}

/// At zero roughness the lobe is narrowest. At and around the mirror direction, the kernel is within 2 % of the
/// definition. The reason is that α² = 4·10⁻⁴ of a squared cosine near 1 spans enough `f32` roundings.
#[test]
fn the_narrowest_lobe_keeps_its_peak() {
    let mut worst = 0.0f64;
    for alpha in [0.0, 1e-6, 0.02, 0.05, 0.3, 1.0] {
        for tilt in [0.0f64, 0.3, 0.8, 1.2] {
            let view = DVec3::new(tilt.sin(), 0.0, tilt.cos());
            let receiver = Ggx {
                position: Vec3::ZERO,
                normal: Vec3::Z,
                view: view.as_vec3(),
                diffuse: Vec3::ZERO,
                specular: Vec3::ONE,
                alpha,
            };
            for step in -40..=40 {
                let angle = -tilt + 0.002 * f64::from(step);
                if angle.cos() < 0.1 {
                    continue;
                }
                let position = DVec3::new(angle.sin(), 0.0, angle.cos()).as_vec3();
                let light = Light { position, emission: Emission::Cosine(-position.normalize()), intensity: Vec3::ONE };
                let found = exhaustive(&[light], 0.0, &receiver, |_, _| true).x;
                let exact = lobe(&receiver, position.as_dvec3().normalize()) / position.as_dvec3().length_squared();
                worst = worst.max(relative(found, exact));
                assert!(relative(found, exact) < 0.02, "α {alpha}, view {tilt}, {step}: {found} for {exact}");
            }
        }
    }
    println!("farthest from the definition: {worst:.1e}");
}
