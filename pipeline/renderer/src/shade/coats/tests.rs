//! Tests of coats in scenes with known images: under uniform light, in front of a lamp, and without coats.

use super::*;
use crate::plan::{Plan, State};
use crate::settings::{RenderSettings, Size};
use crate::shade::movement::Movement;
use crate::{Preparation, Shading, plan};
use glam::{Quat, Vec3A};
use pipeline::stage::{LastThresholds, Shade};
use plane::Correspondence;
use render_core::Environment;
use render_core::sampling::{concentric_disc, frame, sobol_point};
use render_core::scene::{
    Alpha, Camera, Gradient, Instance, Material, Mesh, Node, Projection, PunctualKind, PunctualLight, Scene, Transform,
};
use std::f32::consts::PI;

const SIDE: usize = 16;

/// Scene seen by a camera at `eye`, which looks toward −z and down by `tilt` \[rad\].
struct Stage(Scene);

impl Stage {
    fn seen_from(eye: Vec3, tilt: f32) -> Self {
        let mut scene = Scene::default();
        let turned = Transform { translation: eye, rotation: Quat::from_rotation_x(-tilt), scale: Vec3::ONE };
        let still = Transform { translation: Vec3::ZERO, rotation: Quat::IDENTITY, scale: Vec3::ONE };
        for rest in [still, turned] {
            scene.nodes.push(Node { name: String::new(), parent: None, rest });
        }
        scene.cameras.push(Camera {
            name: String::new(),
            node: 1,
            projection: Projection::Perspective { yfov: 0.5 },
            ..Camera::default()
        });
        Self(scene)
    }

    /// Adds a parallelogram that faces `a` × `b`.
    fn with(mut self, [corner, a, b]: [Vec3; 3], material: Material) -> Self {
        let scene = &mut self.0;
        scene.instances.push(Instance { node: 0, mesh: scene.meshes.len() });
        scene.meshes.push(Mesh {
            positions: vec![corner, corner + a, corner + a + b, corner + b],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            material: scene.materials.len(),
            ..Mesh::default()
        });
        scene.materials.push(material);
        self
    }

    fn under_a_sky(mut self, radiance: f32) -> Self {
        self.0.sky = Environment::gradient(Gradient::constant([radiance; 3]));
        self
    }

    /// Returns the coat of a pixel.
    fn coated(&self, seen: &GBuffer, x: usize, y: usize) -> Option<Coated> {
        let pose = self.0.pose(0.0);
        Coated::of_pixel(&seen.pixels.get(x, y), seen, &Surfaces::new(&self.0, &pose), 0.0)
    }

    /// Returns the light that coats reflect to each pixel, and the first hits of the camera's rays.
    fn reflected(&self) -> (Plane<Vec3>, GBuffer) {
        let (settings, plan) = self.settings();
        assert!(plan.is_on(plan::Stage::Gloss));
        let prepared = Preparation::new(&self.0, &settings, &plan).frame(0).frame;
        let radiance = Plane::filled(SIDE, SIDE, Vec3::ZERO);
        let lit = Coats.light(&Visible::alone(&prepared, &radiance), None, &Tolerance::of_shares(SIDE, SIDE, 0.02));
        (lit.radiance.expect("coats send radiance"), (*prepared.seen).clone())
    }

    fn settings(&self) -> (RenderSettings, Plan) {
        let size = Size { width: SIDE, height: SIDE };
        let settings =
            RenderSettings { size, vpls: 100, photons: 2000, frames: 1, end: 1, ..RenderSettings::default() };
        let plan = Plan::new(&self.0, &settings);
        (settings, plan)
    }
}

/// Floor of 20 m × 20 m.
const FLOOR: [Vec3; 3] = [Vec3::new(-10.0, 0.0, -10.0), Vec3::new(0.0, 0.0, 20.0), Vec3::new(20.0, 0.0, 0.0)];

fn metal(color: Vec3, roughness: f32) -> Material {
    Material { base_color: color, metallic: 1.0, roughness, ..Material::default() }
}

fn glowing(radiance: f32) -> Material {
    Material { base_color: Vec3::ZERO, emission: Vec3::splat(radiance), ..Material::default() }
}

/// Checks a plate under a uniform sky: the coat and multiple scattering reflect their albedo, which is 1 for F₀ = 1 at
/// any roughness. With a color, the coat reflects its albedo times the sky.
#[test]
fn a_plate_in_even_light_shows_its_albedo() {
    for roughness in [0.0, 0.1, 0.25, 0.6, 1.0] {
        for color in [Vec3::ONE, Vec3::new(0.9, 0.5, 0.1)] {
            let stage = Stage::seen_from(Vec3::new(0.0, 3.0, 3.0), 0.8).with(FLOOR, metal(color, roughness));
            let stage = stage.under_a_sky(2.0);
            let (light, seen) = stage.reflected();
            let pose = stage.0.pose(0.0);
            let below = below_coats(&seen, &Surfaces::new(&stage.0, &pose));
            for (x, y) in places(0..SIDE, 0..SIDE) {
                let coated = stage.coated(&seen, x, y).expect("the plate fills the image");
                let albedo = coated.albedo();
                let got = light.get(x, y) / 2.0;
                assert!((got - albedo).abs().max_element() < 1e-3, "{got} is not {albedo} at roughness {roughness}");
                let whole = got + Vec3::from(below.pixels.get(x, y).albedo);
                assert!(color != Vec3::ONE || (whole - 1.0).abs().max_element() < 0.02, "{whole}, {roughness}");
            }
        }
    }
}

/// Checks that the mirror image of a lamp equals the lamp seen from the mirror image of the eye.
#[test]
fn a_mirror_shows_a_lamp_at_its_reflected_place() {
    let eye = Vec3::new(0.0, 3.0, 3.0);
    let (corner, a, b) = (Vec3::new(-0.6, 1.8, -2.2), Vec3::new(1.2, 0.0, 0.0), Vec3::new(0.0, 1.2, 0.0));
    let lamp = Stage::seen_from(eye, 0.8).with([corner, a, b], glowing(5.0));
    let (light, seen) = lamp.with(FLOOR, metal(Vec3::ONE, 0.0)).reflected();
    let image = eye * Vec3::new(1.0, -1.0, 1.0);
    let (mut inside, mut outside) = (0, 0);
    for (x, y) in places(0..SIDE, 0..SIDE) {
        let pixel = seen.pixels.get(x, y);
        if pixel.specular == [0.0; 3] {
            continue;
        }
        let way = Vec3::from(pixel.position) - image;
        let at = image + way * ((corner.z - image.z) / way.z) - corner;
        let depth = (at.x.min(a.x - at.x)).min(at.y.min(b.y - at.y));
        let got = light.get(x, y).x;
        if depth > 1e-3 {
            inside += 1;
            assert!((got - 5.0).abs() < 0.01, "{got} at {x}, {y}, {depth} m within the lamp");
        } else if depth < -1e-3 {
            outside += 1;
            assert!(got < 1e-3, "{got} at {x}, {y}, {depth} m next to the lamp");
        }
    }
    assert!(inside > 10 && outside > 30, "{inside} pixels show the lamp, {outside} do not");
}

/// Returns the BRDF without the uniform term that other layers reflect \[sr⁻¹\].
fn reflectance(coated: &Coated, direction: Vec3A) -> Vec3 {
    coated.bsdf.evaluate(coated.outgoing, coated.to_frame(direction)) - coated.diffuse_albedo() / PI
}

/// Compares a lamp above metal with the integral over the lamp's surface. Rough metal uses samples of the lamp's area.
/// Smooth metal uses few rays, so only the total light is compared.
#[test]
fn metal_shows_a_lamp_as_its_lobe_says() {
    for (roughness, single, whole) in [(0.12, 0.3, 0.05), (0.25, 0.03, 0.01), (0.5, 0.01, 0.01), (0.9, 0.01, 0.01)] {
        let [corner, a, b] = [Vec3::new(-0.5, 2.0, -2.5), Vec3::new(1.0, 0.0, 0.0), Vec3::new(0.0, 0.0, 1.0)];
        let stage = Stage::seen_from(Vec3::new(0.0, 3.0, 3.0), 0.8)
            .with(FLOOR, metal(Vec3::new(1.0, 0.7, 0.3), roughness))
            .with([corner, a, b], glowing(5.0));
        let (light, seen) = stage.reflected();
        let (mut off, mut sum, mut expected_sum) = (0.0, 0.0, 0.0);
        for (x, y) in places(0..SIDE, 0..SIDE) {
            let Some(coated) = stage.coated(&seen, x, y) else { continue };
            let steps = 40;
            let expected: Vec3 = places(0..steps, 0..steps)
                .map(|(i, j)| {
                    let share = |k: usize| (k as f32 + 0.5) / steps as f32;
                    let way = Vec3A::from(corner + a * share(i) + b * share(j)) - coated.receiver.position;
                    let direction = way.normalize();
                    let f = reflectance(&coated, direction);
                    // Lamp and floor are parallel: both cosines equal the y component of the direction.
                    f * (5.0 * direction.y * direction.y / way.length_squared() / (steps * steps) as f32)
                })
                .sum();
            off += (light.get(x, y) - expected).abs().max_element();
            sum += light.get(x, y).x;
            expected_sum += expected.x;
        }
        let (off, in_all) = (off / expected_sum, sum / expected_sum - 1.0);
        println!("roughness {roughness}: off by {off}, in all by {in_all}");
        assert!(expected_sum > 1.0 && off < single && in_all.abs() < whole, "{roughness}: {off}, in all {in_all}");
    }
}

/// Checks a point light, which has no size: a coat reflects intensity · f · cos θ / r².
#[test]
fn points_of_light_are_seen_by_their_lobe() {
    let mut stage = Stage::seen_from(Vec3::new(0.0, 3.0, 3.0), 0.8).with(FLOOR, metal(Vec3::ONE, 0.4));
    let place = Vec3::new(0.2, 2.0, -2.0);
    let rest = Transform { translation: place, rotation: Quat::IDENTITY, scale: Vec3::ONE };
    stage.0.nodes.push(Node { name: String::new(), parent: None, rest });
    stage.0.punctual_lights.push(PunctualLight { node: 2, color: Vec3::splat(7.0), kind: PunctualKind::Point });
    let (light, seen) = stage.reflected();
    for (x, y) in places(0..SIDE, 0..SIDE) {
        let coated = stage.coated(&seen, x, y).expect("the plate fills the image");
        let way = Vec3A::from(place) - coated.receiver.position;
        let direction = way.normalize();
        let f = reflectance(&coated, direction);
        let expected = f * (7.0 * direction.y / way.length_squared());
        assert!((light.get(x, y) - expected).abs().max_element() < 1e-3 * expected.x + 1e-6, "{x}, {y}");
    }
}

/// Checks that a coat reflects the mean over the sun's disc. In a narrower lobe, the edge of the disc is lost.
#[test]
fn the_sun_is_seen_as_a_disc() {
    for (roughness, single) in [(0.2, 0.1), (0.4, 0.02)] {
        let mut stage = Stage::seen_from(Vec3::new(0.0, 3.0, 3.0), 0.8).with(FLOOR, metal(Vec3::ONE, roughness));
        // Put the sun opposite to the viewer at equal elevation: the glint is then at the center of the image.
        let rest = Transform {
            translation: Vec3::ZERO,
            rotation: Quat::from_rotation_y(PI) * Quat::from_rotation_x(-0.8),
            scale: Vec3::ONE,
        };
        stage.0.nodes.push(Node { name: String::new(), parent: None, rest });
        let kind = PunctualKind::Directional;
        stage.0.punctual_lights.push(PunctualLight { node: 2, color: Vec3::splat(3.0), kind });
        stage.0.settings.sun.angular_diameter = 3.0;
        let (light, seen) = stage.reflected();
        let towards = rest.rotation * Vec3::Z;
        let (x, y) = frame(towards);
        let (mut off, mut sum) = (0.0, 0.0);
        for (column, row) in places(0..SIDE, 0..SIDE) {
            let coated = stage.coated(&seen, column, row).expect("the plate fills the image");
            let count = 512;
            let disc = (0..count).map(|i| {
                let p = concentric_disc(sobol_point(i)) * 1.5f32.to_radians().sin();
                let direction = Vec3A::from((towards + x * p.x + y * p.y).normalize());
                reflectance(&coated, direction).x * direction.y
            });
            let expected = 3.0 * disc.sum::<f32>() / count as f32;
            off += (light.get(column, row).x - expected).abs();
            sum += expected;
        }
        println!("roughness {roughness}: off by {} of {sum}", off / sum);
        assert!(sum > 1.0 && off < single * sum, "roughness {roughness}: off by {off} in {sum}");
    }
}

/// Checks a static picture of rough metal in front of a lamp: most pixels keep the light of the first frame, and
/// recomputed pixels receive nearly the same light. A restored layer continues with the same bits.
#[test]
fn reprojected_reflections_stay_and_continue_from_their_state() {
    let [corner, a, b] = [Vec3::new(-0.5, 2.0, -2.5), Vec3::new(1.0, 0.0, 0.0), Vec3::new(0.0, 0.0, 1.0)];
    let stage = Stage::seen_from(Vec3::new(0.0, 3.0, 3.0), 0.8)
        .with(FLOOR, metal(Vec3::new(1.0, 0.7, 0.3), 0.4))
        .with([corner, a, b], glowing(5.0))
        .under_a_sky(1.0);
    let (settings, plan) = stage.settings();
    let mut prepared = Preparation::new(&stage.0, &settings, &plan).frame(0).frame;
    let (radiance, still) = (Plane::filled(SIDE, SIDE, Vec3::ZERO), Correspondence::still(SIDE, SIDE));
    let tolerance = Tolerance::of_shares(SIDE, SIDE, 0.02);
    let movement = Movement::to(&prepared, &[]);

    // Choose frames in which the only macroblock is reused, audited and reused.
    let (mut layer, mut light) = (ReprojectedCoats::new(8), Vec::new());
    let mut restored = None;
    for index in [15, 15, 16, 17] {
        prepared.index = index;
        let motion = (!light.is_empty()).then_some(&still);
        let visible = Visible { motion, movement: &movement, ..Visible::alone(&prepared, &radiance) };
        if index == 17 {
            let mut other = ReprojectedCoats::new(8);
            other.restore(&layer.state(), &prepared).expect("the layer's own state");
            restored = other.light(&visible, None, &tolerance).radiance;
        }
        let lit = layer.light(&visible, None, &tolerance);
        let computed = lit.computed.expect("a mask").samples().iter().filter(|&&computed| computed).count();
        light.push((computed, lit.radiance.expect("coats send radiance")));
    }
    let [(first, traced), (second, same), (audited, again), (last, kept)] = &light[..] else { panic!("four frames") };
    assert_eq!([*first > 200, *second == 0, audited == first, *last == 0], [true; 4]);
    // Stored light is divided by the albedo, which rounds.
    for (traced, same) in traced.samples().iter().zip(same.samples()) {
        assert!((*traced - *same).abs().max_element() <= 4.0 * f32::EPSILON * traced.max_element());
    }
    assert_eq!(traced, again, "the same rays in the same picture");
    assert_eq!(restored.as_ref(), Some(kept));
}

/// Checks that the layer adds no light in scenes without coats, and that all other light is unchanged.
#[test]
fn matte_scenes_stay_as_they_are_to_the_last_bit() {
    let matte = Material { base_color: Vec3::new(0.7, 0.4, 0.2), ..Material::default() };
    let stage = Stage::seen_from(Vec3::new(0.0, 3.0, 3.0), 0.8).with(FLOOR, matte).under_a_sky(1.0);
    let (settings, plan) = stage.settings();
    assert!(plan.is_off(plan::Stage::Gloss));
    let lit = |gloss| {
        let plan = plan.clone().with(plan::Stage::Gloss, gloss).with(plan::Stage::Cache, State::Off);
        let prepared = Preparation::new(&stage.0, &settings, &plan).frame(0);
        let mut shading = Shading::new(&settings, &plan);
        shading.step(&prepared, LastThresholds::none()).radiance
    };
    let (without, with) = (lit(State::Off), lit(State::On));
    assert!(without.samples().iter().all(|rgb| rgb[0] > 0.0));
    assert_eq!(without, with);
}

/// A mirror below glowing sheets shows each sheet with its opacity, and the sky behind them with the rest. Every pixel has
/// the same light: α₁ L₁ + (1 − α₁) (α₂ L₂ + (1 − α₂) L_sky).
#[test]
fn a_mirror_shows_sheets_by_their_opacity() {
    let sheet = |height: f32, opacity: f32, radiance: f32| {
        let material = Material { alpha: Alpha::Blend, opacity, double_sided: true, ..glowing(radiance) };
        ([Vec3::new(-50.0, height, -50.0), Vec3::new(100.0, 0.0, 0.0), Vec3::new(0.0, 0.0, 100.0)], material)
    };
    for roughness in [0.0, 0.1] {
        let (near, far) = (sheet(4.0, 0.3, 5.0), sheet(6.0, 0.6, 0.5));
        let stage = Stage::seen_from(Vec3::new(0.0, 3.0, 3.0), 0.8).with(FLOOR, metal(Vec3::ONE, roughness));
        let stage = stage.with(near.0, near.1).with(far.0, far.1).under_a_sky(2.0);
        let (light, seen) = stage.reflected();
        let expected = 0.3 * 5.0 + 0.7 * (0.6 * 0.5 + 0.4 * 2.0);
        for (x, y) in places(0..SIDE, 0..SIDE) {
            let albedo = stage.coated(&seen, x, y).expect("the plate fills the image").albedo();
            let got = light.get(x, y);
            assert!(
                (got - expected * albedo).abs().max_element() < 1e-3,
                "{got} is not {} at {x} {y}",
                expected * albedo
            );
        }
    }
}
