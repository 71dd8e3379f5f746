//! Tests that compare light through transparent surfaces with closed forms.

use crate::common::{add, material, quad, rest};
use glam::{Vec3, Vec3A, vec3};
use render_core::scene::{
    Camera, Gradient, Material, MaterialLobes, Mesh, Node, Projection, PunctualKind, PunctualLight, Scene,
    Transmission, Volume,
};
use render_core::{
    Anchors, DirectLights, Emitters, Environment, Geometry, PathOptions, ShadingPoint, Still, Surfaces, Units,
    path_traced,
};

/// Returns glass of an index of refraction, as a thin wall or with an interior.
fn glass(base_color: Vec3, roughness: f32, ior: f32, volume: Option<Volume>) -> Material {
    let f0 = ((ior - 1.0) / (ior + 1.0)).powi(2);
    let transmission = Transmission { factor: 1.0, volume, ..Transmission::default() };
    Material {
        base_color,
        roughness,
        dielectric_f0: Vec3::splat(f0),
        double_sided: true,
        lobes: Some(Box::new(MaterialLobes { ior, transmission, ..MaterialLobes::default() })),
        ..Material::default()
    }
}

/// Returns a box between two corners with its fronts outside.
fn block(low: Vec3, high: Vec3) -> Mesh {
    let size = high - low;
    let [x, y, z] = [Vec3::X * size.x, Vec3::Y * size.y, Vec3::Z * size.z];
    let mut mesh = Mesh::default();
    for (corner, u, v) in [(low, y, x), (low, z, y), (low, x, z), (low + z, x, y), (low + x, y, z), (low + y, z, x)] {
        let side = quad(corner, u, v);
        let first = mesh.positions.len() as u32;
        mesh.positions.extend(side.positions);
        mesh.triangles.extend(side.triangles.iter().map(|t| t.map(|vertex| first + vertex)));
    }
    mesh
}

/// Returns the mean radiance of a small picture along −z, in a scene with uniform light of radiance 1.
fn seen(scene: &mut Scene, samples: u32) -> Vec3 {
    scene.sky = Environment::gradient(Gradient::constant([1.0; 3]));
    scene.nodes.push(Node { name: String::new(), parent: None, rest: rest(vec3(0.013, 0.021, 5.0)) });
    let projection = Projection::Orthographic { ymag: 0.05 };
    scene.cameras = vec![Camera { name: String::new(), node: scene.nodes.len() - 1, projection, ..Camera::default() }];
    let options = PathOptions { samples, ..PathOptions::default() };
    let picture = path_traced(scene, Still { time: 0.0, width: 8, height: 8 }, &options, |_, _| ()).mean;
    picture.samples().iter().map(|&c| Vec3::from(c)).sum::<Vec3>() / 64.0
}

/// White glass of any shape cannot be seen in uniform light: radiance changes by 1/η² and back.
#[test]
fn glass_in_a_furnace_is_invisible() {
    for (roughness, ior) in [(0.0, 1.5), (0.3, 1.33), (0.7, 1.8), (0.0, 1.0)] {
        for volume in [None, Some(Volume::new(Vec3::ONE, 1.0))] {
            let mut scene = Scene::default();
            let slanted = glam::Quat::from_euler(glam::EulerRot::XYZ, 0.4, 0.3, 0.2);
            let place = render_core::scene::Transform { rotation: slanted, ..rest(Vec3::ZERO) };
            add(
                &mut scene,
                place,
                block(vec3(-0.7, -0.6, -0.5), vec3(0.6, 0.7, 0.5)),
                glass(Vec3::ONE, roughness, ior, volume),
            );
            let found = seen(&mut scene, 256);
            assert!(
                (found - 1.0).abs().max_element() < 0.02,
                "{found} for roughness {roughness}, index {ior}, {volume:?}"
            );
        }
    }
}

/// A thick slab at normal incidence: all orders of reflection sum to R + (1 − R)² a / (1 − R a), where a is the
/// transmittance of the interior.
#[test]
fn slabs_attenuate_by_their_thickness() {
    let (ior, thickness) = (1.5f32, 0.8);
    let attenuated = vec3(0.9, 0.5, 0.1);
    let mut scene = Scene::default();
    let volume = Volume::new(attenuated, thickness);
    let slab = block(vec3(-9.0, -9.0, -thickness), vec3(9.0, 9.0, 0.0));
    add(&mut scene, rest(Vec3::ZERO), slab, glass(Vec3::ONE, 0.0, ior, Some(volume)));
    let found = seen(&mut scene, 1024);
    let r = ((ior - 1.0) / (ior + 1.0)).powi(2);
    let expected = attenuated.map(|a| r + (1.0 - r) * (1.0 - r) * a / (1.0 - r * a));
    assert!((found / expected - 1.0).abs().max_element() < 0.01, "{found} for {expected}");
}

/// Returns a floor lit by a point light through a pane of colored glass, and the floor's point below the pane.
fn lit_through(pane: Material) -> (Scene, ShadingPoint) {
    let mut scene = Scene::default();
    add(
        &mut scene,
        rest(Vec3::ZERO),
        quad(vec3(-9.0, 0.0, -9.0), Vec3::Z * 18.0, Vec3::X * 18.0),
        material(Vec3::ONE, Vec3::ZERO),
    );
    add(&mut scene, rest(Vec3::ZERO), quad(vec3(-9.0, 1.0, -9.0), Vec3::Z * 18.0, Vec3::X * 18.0), pane);
    scene.nodes.push(Node { name: String::new(), parent: None, rest: rest(vec3(1.5, 2.0, 0.0)) });
    let node = scene.nodes.len() - 1;
    scene.punctual_lights = vec![PunctualLight { node, color: vec3(3.0, 2.0, 1.0), kind: PunctualKind::Point }];
    let normal = Vec3A::Y;
    (scene, ShadingPoint { position: Vec3A::new(0.0, 1e-4, 0.0), normal, geometric_normal: normal })
}

/// E = I cos θ / r² (1 − F(θ)) tint, with the Fresnel equations for a single interface.
#[test]
fn colored_panes_color_direct_light() {
    let tint = vec3(0.9, 0.4, 0.2);
    let (scene, receiver) = lit_through(glass(tint, 0.0, 1.5, None));
    let pose = scene.pose(0.0);
    let surfaces = Surfaces::new(&scene, &pose);
    let units = Units::of(&scene);
    let emitters = Emitters::new(&surfaces, &pose, &units);
    let direct = DirectLights::new(&emitters, &surfaces, &Anchors::spread(&surfaces, &units, 10, 12), &[], &[]);
    let found = direct.irradiance(&Geometry::new(&scene).place(&pose), &receiver).value;

    // Snell's law and Fresnel's equations at the pane.
    let (r2, cos) = (1.5f32 * 1.5 + 4.0, 2.0 / (1.5f32 * 1.5 + 4.0).sqrt());
    let refracted = (1.0 - (1.0 - cos * cos) / 2.25).sqrt();
    let s = ((cos - 1.5 * refracted) / (cos + 1.5 * refracted)).powi(2);
    let p = ((1.5 * cos - refracted) / (1.5 * cos + refracted)).powi(2);
    let expected = vec3(3.0, 2.0, 1.0) * tint * (cos / r2 * (1.0 - (s + p) / 2.0));
    assert!((found / expected - 1.0).abs().max_element() < 1e-3, "{found} for {expected}");
}
