use super::tree_light::TreeLight;
use super::*;
use crate::Preparation;
use crate::plan::Plan;
use crate::settings::{RenderSettings, Size};
use glam::{Quat, Vec3A, vec3};
use lighttree::irradiance_term;
use render_core::cache::Illumination;
use render_core::luminance;
use render_core::scene::{
    Camera, Channel, Instance, Interpolation, Material, Mesh, Node, Projection, Scene, Track, Transform,
};

/// Returns the light tree of a static frame as a source of records, without bias compensation.
fn tree_light<'a>(
    visible: &'a Visible,
    tolerance: &'a Tolerance,
    counts: &'a Counts,
    moving: &'a [bool],
) -> TreeLight<'a> {
    let visibility = Visibility::new(visible.frame, GATHER_RAYS);
    let (swept, standing) = (&[][..], Vec::new());
    TreeLight {
        visible,
        tolerance,
        visibility,
        counts,
        swept,
        recent: RecentChanges::default(),
        waits: false,
        standing,
        moving,
        compensates: false,
        at_rest: false,
    }
}

/// Adds parallelograms that face a × b.
fn add(scene: &mut Scene, node: usize, faces: &[[Vec3; 3]]) {
    let mut mesh = Mesh { material: scene.materials.len(), ..Mesh::default() };
    for &[corner, a, b] in faces {
        let first = mesh.positions.len() as u32;
        mesh.positions.extend([corner, corner + a, corner + a + b, corner + b]);
        mesh.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
    }
    scene.instances.push(Instance { node, mesh: scene.meshes.len() });
    scene.meshes.push(mesh);
    // Make the material double-sided, as exporters do for solid objects: backs must still be recognized.
    scene.materials.push(Material { double_sided: true, ..Material::default() });
}

/// Returns a floor, and a block of 2 m that moves over it from x = 10 to x = 0 within one second.
fn floor_with_a_block() -> Scene {
    let mut scene = Scene::default();
    let still = Transform { translation: Vec3::ZERO, rotation: Quat::IDENTITY, scale: Vec3::ONE };
    let eye = Transform { translation: vec3(0.0, 3.0, 8.0), ..still };
    for rest in [still, Transform { translation: Vec3::X * 10.0, ..still }, eye] {
        scene.nodes.push(Node { name: String::new(), parent: None, rest });
    }
    let (x, y, z) = (Vec3::X * 2.0, Vec3::Y * 2.0, Vec3::Z * 2.0);
    add(&mut scene, 0, &[[vec3(-20.0, 0.0, -20.0), z * 20.0, x * 20.0]]);
    let (near, far) = (vec3(-1.0, 0.0, -1.0), vec3(1.0, 2.0, 1.0));
    add(&mut scene, 1, &[[near, y, x], [near, x, z], [near, z, y], [far, -x, -y], [far, -z, -x], [far, -y, -z]]);
    scene.channels.push(Channel {
        node: 1,
        times: vec![0.0, 1.0],
        track: Track::Translation(vec![Vec3::X * 10.0, Vec3::ZERO]),
        interpolation: Interpolation::Linear,
    });
    scene.cameras.push(Camera {
        name: String::new(),
        node: 2,
        projection: Projection::Perspective { yfov: 0.8 },
        ..Camera::default()
    });
    scene
}

/// Checks the openness inside a block. A point next to a wall is as open inside as outside, but receives light from one
/// side only. A record inside the block must serve no pixel next to the block.
#[test]
fn what_something_has_moved_over_is_closed_in() {
    let scene = floor_with_a_block();
    let size = Size { width: 16, height: 16 };
    let settings = RenderSettings { size, vpls: 100, photons: 1000, frames: 26, end: 26, ..RenderSettings::default() };
    let plan = Plan::new(&scene, &settings);
    let moving = scene.moving_instances();
    let openness = |frame, x: f32| {
        let prepared = Preparation::new(&scene, &settings, &plan).frame(frame).frame;
        let direct = Plane::filled(16, 16, Vec3::ZERO);
        let visible = Visible::alone(&prepared, &direct);
        let (tolerance, counts) = (Tolerance::of_shares(16, 16, 0.02), Counts::default());
        let source = tree_light(&visible, &tolerance, &counts, &moving);
        let site = Site {
            position: Vec3A::X * x,
            normal: Vec3A::Y,
            geometric_normal: Vec3A::Y,
            carrier: NOTHING,
            openness: 1.0,
            key: 1,
        };
        source.openness(&site, 0.2)
    };
    assert_eq!(openness(0, 0.98), 1.0, "the block is far away");
    assert_eq!(openness(25, 0.98), 0.0, "within it");
    assert!((0.4..0.8).contains(&openness(25, 1.02)), "beside it: {}", openness(25, 1.02));
}

/// Checks that records at one position with independent draws are unbiased: their mean is the sum over all lights.
#[test]
fn records_draw_the_lights_of_their_clusters_anew() {
    let mut scene = floor_with_a_block();
    // Add a wall, lit by a lamp in front of it that is not in the tree.
    add(&mut scene, 0, &[[vec3(-6.0, 0.0, -4.0), Vec3::X * 12.0, Vec3::Y * 6.0]]);
    add(&mut scene, 0, &[[vec3(-1.0, 5.0, -3.0), Vec3::X * 2.0, Vec3::Z]]);
    scene.materials[3].emission = Vec3::splat(50.0);
    let size = Size { width: 16, height: 16 };
    let settings =
        RenderSettings { size, vpls: 2000, photons: 20_000, frames: 26, end: 26, ..RenderSettings::default() };
    let plan = Plan::new(&scene, &settings);
    let prepared = Preparation::new(&scene, &settings, &plan).frame(25).frame;
    let direct = Plane::filled(16, 16, Vec3::ZERO);
    let visible = Visible::alone(&prepared, &direct);
    let (tolerance, counts) = (Tolerance::of_thresholds(&Plane::filled(16, 16, 0.02)), Counts::default());
    let moving = scene.moving_instances();
    let source = tree_light(&visible, &tolerance, &counts, &moving);
    let site = |key| Site {
        position: vec3(2.0, 0.0, 0.5).into(),
        normal: Vec3A::Y,
        geometric_normal: Vec3A::Y,
        carrier: NOTHING,
        openness: 1.0,
        key,
    };
    let receiver = source.receiver(&site(0));
    let tree = &prepared.tree;
    let mut all = 0.0;
    for light in tree.lights().iter().filter(|light| source.visibility.sees(&receiver, light)) {
        let term = irradiance_term(receiver.position.into(), Vec3::Y, light, tree.geometry_term_bound());
        all += f64::from(luminance(light.intensity * term.value));
    }
    let (count, mut scratch) = (400, <TreeLight as Illumination>::Scratch::default());
    let (mut sum, mut squares) = (0.0, 0.0);
    for key in 0..count {
        let recipe = source.compute(&site(key), &mut scratch).recipe;
        assert!(recipe.size < tree.lights().len() as u32 / 4, "{} clusters", recipe.size);
        let error = f64::from(luminance(source.cut_irradiance(&receiver, &recipe))) - all;
        (sum, squares) = (sum + error, squares + error * error);
    }
    let (mean, standard_error) = (sum / count as f64, squares.sqrt() / count as f64);
    assert!(mean.abs() < 3.5 * standard_error, "{mean} ± {standard_error} of {all}");
    assert!(standard_error < 0.01 * all, "{standard_error} of {all}");
}
