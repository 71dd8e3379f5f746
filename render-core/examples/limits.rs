//! Plots the `f32` rounding errors of final gathers near contact and of narrow mirror lobes: `docs/limits.svg`.
//!
//! `cargo run --release -p render2mpeg-render-core --example limits`

use glam::{DVec3, Quat, Vec3, Vec3A};
use plot::{BLUE, Plot, RED};
use render_core::sampling::{concentric_disc, sobol_point};
use render_core::scene::{Instance, Material, Mesh, Node, Scene, Transform};
use render_core::{
    Anchors, Bsdf, Emitters, FinalGather, GatherDirections, Geometry, Photons, PosedScene, ShadingPoint, Surfaces,
    Units,
};
use std::f64::consts::PI;

/// Returns the relative error of `found` in units of `f32::EPSILON`, at least 0.1.
fn roundings(found: f32, exact: f64) -> f32 {
    ((f64::from(found) / exact - 1.0).abs() / f64::from(f32::EPSILON)).max(0.1) as f32
}

/// Builds a square plate with sides of 2 m in the plane y = 0, facing up.
fn plate() -> Scene {
    let positions = vec![
        Vec3::new(-1.0, 0.0, -1.0),
        Vec3::new(-1.0, 0.0, 1.0),
        Vec3::new(1.0, 0.0, 1.0),
        Vec3::new(1.0, 0.0, -1.0),
    ];
    let rest = Transform { translation: Vec3::ZERO, rotation: Quat::IDENTITY, scale: Vec3::ONE };
    Scene {
        materials: vec![Material::default()],
        nodes: vec![Node { name: String::new(), parent: None, rest }],
        meshes: vec![Mesh { positions, triangles: vec![[0, 1, 2], [0, 2, 3]], ..Mesh::default() }],
        instances: vec![Instance { node: 0, mesh: 0 }],
        ..Scene::default()
    }
}

const DIRECTIONS: usize = 256;

/// Returns the relative error of a final gather's harmonic mean distance for each height above the plate. The exact
/// value comes from the same rays in `f64`: a ray with cosine z has length h/z.
fn harmonic_means(heights: impl Iterator<Item = f32>) -> Vec<(f32, f32)> {
    let scene = plate();
    let pose = scene.pose(0.0);
    let (surfaces, units) = (Surfaces::new(&scene, &pose), Units::of(&scene));
    let anchors = Anchors::spread(&surfaces, &units, 100, 0);
    let accelerator = Geometry::new(&scene).place(&pose);
    let emitters = Emitters::new(&surfaces, &pose, &units);
    // The final gather measures distances only, so it needs no photons.
    let anchor_flux =
        Photons::new(0, 0).trace(PosedScene::new(&accelerator, &surfaces), &emitters, &anchors, &units).value;
    let gather = FinalGather::new(&surfaces, &anchors, &anchor_flux, &units);
    let directions = GatherDirections::new(DIRECTIONS);
    let cosines = (0..DIRECTIONS as u64).map(|i| {
        let p = concentric_disc(sobol_point(i)).as_dvec2();
        (1.0 - p.length_squared()).max(0.0).sqrt()
    });
    let sum: f64 = cosines.sum();
    let error = |height: f32| {
        let errors = (0..16).map(|k| {
            let height = height * (1.0 + k as f32 / 16.0);
            let receiver =
                ShadingPoint { position: Vec3A::Y * height, normal: Vec3A::NEG_Y, geometric_normal: Vec3A::NEG_Y };
            let found = gather.gather(PosedScene::new(&accelerator, &surfaces), &receiver, &directions, k);
            roundings(found.harmonic_mean, f64::from(height) * DIRECTIONS as f64 / sum)
        });
        (height.log10(), errors.fold(0.0, f32::max).log10())
    };
    heights.map(error).collect()
}

/// Evaluates the coat with a Fresnel reflectance of 1 by its definition, in `f64`.
fn lobe(alpha: f64, out: DVec3, way: DVec3) -> f64 {
    let h = (out + way).normalize();
    let t = (h.x * h.x + h.y * h.y) / (alpha * alpha) + h.z * h.z;
    let density = 1.0 / (PI * alpha * alpha * t * t);
    let lambda = |w: DVec3| ((1.0 + alpha * alpha * (w.x * w.x + w.y * w.y) / (w.z * w.z)).sqrt() - 1.0) / 2.0;
    density / (4.0 * out.z * way.z * (1.0 + lambda(out) + lambda(way)))
}

/// Returns the largest error of the coat's single scattering around the mirrored direction, within four half-widths of
/// the lobe.
fn mirrors(roughness: f32) -> (f32, f32) {
    let alpha = roughness * roughness;
    let bsdf = Bsdf::new(Vec3::ZERO, Vec3::ONE, roughness);
    let tilts = [0.0f64, 0.4, 0.9, 1.3];
    let errors = tilts.into_iter().flat_map(|tilt| (-32..=32).map(move |k| (tilt, k))).filter_map(|(tilt, k)| {
        let out = DVec3::new(tilt.sin(), 0.0, tilt.cos()).as_vec3();
        let angle = -tilt + f64::from(k) / 8.0 * f64::from(alpha);
        let way = DVec3::new(angle.sin(), 0.0, angle.cos()).as_vec3();
        (way.z > 0.05).then(|| {
            let exact = lobe(alpha.into(), out.as_dvec3(), way.as_dvec3());
            roundings(bsdf.evaluate_coat(out, way, 0.0).x, exact)
        })
    });
    (alpha.log10(), errors.fold(0.0, f32::max).log10())
}

fn main() {
    let mut plot = Plot::new(
        "Error in f32 against f64",
        "distance by side of the scene, or α of the lobe",
        "relative, in roundings of 1.2e-7",
    );
    plot.logarithmic();
    let decades = |from: i32| (4 * from..=-4).map(|k| 10f32.powf(k as f32 / 4.0));
    plot.line("harmonic mean, to contact", BLUE, harmonic_means(decades(-6).map(|height| 0.25 * height)));
    plot.line("GGX lobe, to the mirror", RED, decades(-3).map(|alpha| mirrors(alpha.max(1.001e-3).sqrt())).collect());
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/docs");
    let path = format!("{folder}/limits.svg");
    std::fs::create_dir_all(folder)
        .and_then(|()| std::fs::write(&path, plot.finish()))
        .unwrap_or_else(|error| panic!("{path}: {error}"));
    println!("{path}");
}
