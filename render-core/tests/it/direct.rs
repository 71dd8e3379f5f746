//! Tests that compare direct light at many receivers with one receiver at a time, and with a sum over very many light
//! points.

use crate::common::{add, material, quad, rest, room};
use glam::{Quat, Vec3, Vec3A, vec3};
use render_core::sampling::hash_unit;
use render_core::scene::{Channel, Interpolation, Node, PunctualKind, PunctualLight, Scene, Track, Transform};
use render_core::{
    Accelerator, Anchors, AreaSample, DirectLights, Emitters, Geometry, LightPoints, ShadingPoint, Surfaces, Units,
    luminance,
};

/// Builds a closed room with a panel under its ceiling, a box-shaped screen, and a small moving plate with anchors.
fn scene() -> Scene {
    let mut scene = Scene::default();
    add(&mut scene, rest(Vec3::ZERO), room(), material(Vec3::splat(0.5), Vec3::ZERO));
    let panel = quad(vec3(-0.3, 0.995, -0.2), Vec3::X * 0.6, Vec3::Z * 0.4);
    add(&mut scene, rest(Vec3::ZERO), panel, material(Vec3::ZERO, vec3(5.0, 4.0, 3.0)));
    let screen = quad(vec3(-0.5, -0.2, -0.6), vec3(0.7, 0.1, 0.0), vec3(0.0, 0.2, 0.6));
    add(&mut scene, rest(Vec3::ZERO), screen, material(Vec3::splat(0.7), Vec3::ZERO));
    let plate = quad(vec3(-0.2, 0.0, -0.2), Vec3::Z * 0.4, Vec3::X * 0.4);
    let node = add(&mut scene, rest(vec3(0.5, -0.5, 0.4)), plate, material(Vec3::splat(0.7), Vec3::ZERO));
    scene.channels.push(Channel {
        node,
        times: vec![0.0, 1.0],
        track: Track::Rotation(vec![Quat::IDENTITY, Quat::from_rotation_x(1.0)]),
        interpolation: Interpolation::Linear,
    });
    scene
}

struct Lit<'a> {
    scene: &'a Scene,
    accelerator: Accelerator,
    direct: DirectLights,
    emitters: Emitters,
}

fn light(scene: &Scene) -> Lit<'_> {
    let pose = scene.pose(0.0);
    let surfaces = Surfaces::new(scene, &pose);
    let units = Units::of(scene);
    let emitters = Emitters::new(&surfaces, &pose, &units);
    let anchors = Anchors::spread(&surfaces, &units, 10, 12);
    let anchor_flux = vec![Vec3::splat(0.02); anchors.dynamic.len()];
    let all: Vec<usize> = (0..emitters.areas.len()).collect();
    let direct = DirectLights::new(&emitters, &surfaces, &anchors, &anchor_flux, &all);
    Lit { scene, accelerator: Geometry::new(scene).place(&pose), direct, emitters }
}

/// Returns points on the walls, floor and ceiling that a camera in the center sees.
fn receivers(lit: &Lit, count: u64) -> Vec<ShadingPoint> {
    let pose = lit.scene.pose(0.0);
    let surfaces = Surfaces::new(lit.scene, &pose);
    (0..count)
        .filter_map(|k| {
            let direction = Vec3A::new(hash_unit(1, k, 0) - 0.5, hash_unit(1, k, 1) - 0.5, hash_unit(1, k, 2) - 0.5);
            let direction = direction.try_normalize()?;
            let surface = surfaces.at(&lit.accelerator.closest(Vec3A::new(0.0, 0.3, 0.7), direction)?, direction, 0.0);
            Some(ShadingPoint {
                position: surface.position + surface.geometric_normal * 1e-4,
                normal: surface.shading_normal,
                geometric_normal: surface.geometric_normal,
            })
        })
        .collect()
}

#[test]
fn a_tile_is_lit_as_its_receivers_are_alone() {
    let mut scene = scene();
    let lamp = |kind| PunctualLight { node: scene.nodes.len(), color: Vec3::ONE, kind };
    scene.punctual_lights = vec![
        lamp(PunctualKind::Point),
        lamp(PunctualKind::Directional),
        lamp(PunctualKind::Spot { inner: 0.3, outer: 0.9 }),
    ];
    scene.nodes.push(Node {
        name: String::new(),
        parent: None,
        rest: Transform { rotation: Quat::from_rotation_x(-1.2), ..rest(vec3(0.3, 0.6, 0.2)) },
    });
    let lit = light(&scene);
    let receivers = receivers(&lit, 200);
    let together = lit.direct.irradiance_tile(&lit.accelerator, &receivers);
    let mut rays_alone = 0;
    for (receiver, e) in receivers.iter().zip(&together.value) {
        let alone = lit.direct.irradiance(&lit.accelerator, receiver);
        assert_eq!(alone.value, *e);
        rays_alone += alone.shadow_rays;
    }
    assert_eq!(together.shadow_rays, rays_alone);
    assert!(lit.direct.irradiance_tile(&lit.accelerator, &[]).value.is_empty());
}

#[test]
fn penumbras_agree_with_a_thousand_points() {
    let scene = scene();
    let mut lit = light(&scene);
    let pose = scene.pose(0.0);
    let surfaces = Surfaces::new(&scene, &pose);
    // Sample only the panel.
    lit.direct = DirectLights::new(&lit.emitters, &surfaces, &Anchors::default(), &[], &[0]);
    let samples = lit.emitters.areas[0].samples(&surfaces, 1024);
    let receivers = receivers(&lit, 3000);
    let expected: Vec<Option<Expected>> =
        receivers.iter().map(|receiver| of_points(&lit.accelerator, &samples, receiver)).collect();
    let partial = expected.iter().flatten().filter(|expected| expected.is_partial).count();
    assert!(partial > 100, "only {partial} receivers lie in penumbra: too few for a test");

    // All points, then the mean of their quarters, which have twice the noise in penumbras.
    let by = |points| lit.direct.irradiance_by(points, &lit.accelerator, &receivers);
    let all = by(LightPoints::All);
    let quarters: Vec<_> = (0..4).map(|number| by(LightPoints::Quarter(number))).collect();
    assert!(quarters.iter().all(|quarter| quarter.shadow_rays < all.shadow_rays));
    assert_eq!(by(LightPoints::Quarter(5)), quarters[1]);
    let mean = |k: usize| quarters.iter().map(|quarter| quarter.value[k]).sum::<Vec3>() / 4.0;
    assert_near(&all.value, &expected, [0.015, 0.002, 0.1]);
    assert_near(&(0..receivers.len()).map(mean).collect::<Vec<_>>(), &expected, [0.015, 0.002, 0.1]);
    for quarter in &quarters {
        assert_near(&quarter.value, &expected, [0.015, 0.005, 0.25]);
    }
}

/// Irradiance of a receiver by very many points.
struct Expected {
    luminance: f32,
    /// Whether the receiver is in a penumbra.
    is_partial: bool,
}

/// Returns the irradiance by all `samples`; `None` within 10 cm of the light, where they are too few for a reference.
fn of_points(accelerator: &Accelerator, samples: &[AreaSample], receiver: &ShadingPoint) -> Option<Expected> {
    let (mut expected, mut all) = (Vec3::ZERO, Vec3::ZERO);
    for sample in samples {
        let way = sample.position - receiver.position;
        let (r2, cos_light, cos) = (way.length_squared(), -sample.normal.dot(way), receiver.normal.dot(way));
        if cos_light <= 0.0 || cos <= 0.0 {
            continue;
        }
        let given = sample.intensity * (cos_light * cos / (r2 * r2));
        all += given;
        if !accelerator.occluded(receiver.position, sample.position) {
            expected += given;
        }
    }
    let (luminance, all) = (luminance(expected), luminance(all));
    let is_far = samples.iter().all(|sample| sample.position.distance(receiver.position) >= 0.1);
    is_far.then_some(Expected { luminance, is_partial: luminance > 0.02 * all && luminance < 0.98 * all })
}

/// Checks root mean square, mean and maximum of the differences, each at most a fraction of the mean irradiance.
fn assert_near(found: &[Vec3], expected: &[Option<Expected>], [most_rms, most_bias, most]: [f32; 3]) {
    let mean = found.iter().map(|&e| luminance(e)).sum::<f32>() / found.len() as f32;
    let (mut squares, mut sum, mut worst) = (0.0, 0.0, 0.0f32);
    for (&e, expected) in found.iter().zip(expected) {
        let Some(expected) = expected else { continue };
        let apart = luminance(e) - expected.luminance;
        squares += apart.powi(2);
        sum += apart;
        worst = worst.max(apart.abs());
    }
    let count = found.len() as f32;
    let (rms, bias) = ((squares / count).sqrt() / mean, sum / count / mean);
    println!("rms {rms}, bias {bias}, worst {worst}, of a mean of {mean}");
    assert!(rms < most_rms && bias.abs() < most_bias, "rms {rms}, bias {bias}");
    assert!(worst < most * mean, "{worst} at the worst, of {mean} on the average");
}

/// A panel juts out of a wall right above the receiver and fills the upper half of the receiver's view. The irradiance
/// is E = π L / 2, at any distance below the panel.
#[test]
fn what_touches_a_lamp_is_lit_by_it() {
    let mut scene = Scene::default();
    add(
        &mut scene,
        rest(Vec3::ZERO),
        quad(vec3(-1.0, -1.0, 0.0), Vec3::X * 2.0, Vec3::Y * 2.0),
        material(Vec3::ONE, Vec3::ZERO),
    );
    let panel = quad(vec3(-0.3, 0.5, 0.0), Vec3::X * 0.6, Vec3::Z * 0.4);
    add(&mut scene, rest(Vec3::ZERO), panel, material(Vec3::ZERO, vec3(5.0, 4.0, 3.0)));
    let lit = light(&scene);
    for below in [1e-6, 2e-6, 4e-6, 8e-6, 1e-5, 1e-4] {
        let receivers: Vec<ShadingPoint> = (0..64)
            .map(|k| ShadingPoint {
                position: Vec3A::new(0.2 * hash_unit(2, k, 0) - 0.1, 0.5 - below, 2e-5),
                normal: Vec3A::Z,
                geometric_normal: Vec3A::Z,
            })
            .collect();
        for light in lit.direct.irradiance_tile(&lit.accelerator, &receivers).value {
            let expected = vec3(5.0, 4.0, 3.0) * std::f32::consts::PI / 2.0;
            assert!(light.abs_diff_eq(expected, 2e-3 * expected.x), "{below} m below: {light} in place of {expected}");
        }
    }
}
