//! Measures rays per second on one thread, for each type of query:
//! `cargo bench -p render2mpeg-render-core --bench rays`.
//!
//! The scene is Sponza if `shared/scenes` is next to the checkout, otherwise the shipped scene `nave`. Finally, Embree
//! traces the same rays if a C++ compiler and Embree's headers are installed.

use divan::counter::ItemsCount;
use glam::{Vec2, Vec3, Vec3A};
use obvhs::{BvhBuildParams, cwbvh::CwBvh, cwbvh::builder::build_cwbvh_from_tris, ray::RayHit};
use obvhs::{rt_triangle::RtTriangle, triangle::Triangle};
use render_core::sampling::{cosine_hemisphere, hash_unit};
use render_core::scene::load;
use render_core::{Accelerator, Geometry, Hit, PACKET, Surfaces};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::LazyLock;
use std::time::Duration;

fn main() {
    divan::main();
    if let Err(reason) = embree() {
        println!("embree: skipped, {reason}");
    }
}

/// Side of the traced picture \[pixels\].
const SIDE: usize = 512;

#[derive(Clone, Copy)]
struct Segment {
    origin: Vec3A,
    direction: Vec3A,
    length: f32,
}

struct Setting {
    accelerator: Accelerator,
    scalar: Accelerator,
    obvhs: (CwBvh, Vec<RtTriangle>),
    corners: Vec<[Vec3A; 3]>,
    primary: Vec<Segment>,
    /// Shadow segments from one light to the surfaces that the camera sees.
    shadow: Vec<Segment>,
    /// Cosine-distributed rays from the surfaces that the camera sees.
    diffuse: Vec<Segment>,
}

fn scene_file() -> PathBuf {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let real = root.join("../shared/scenes/sponza-dabrovic/sponza.glb");
    let real = if real.exists() { real } else { root.join("../../shared/scenes/sponza-dabrovic/sponza.glb") };
    if real.exists() { real } else { root.join("scenes/nave/nave.glb") }
}

static SETTING: LazyLock<Setting> = LazyLock::new(|| {
    let file = scene_file();
    println!("scene: {}", file.display());
    let scene = load(&file).expect("the scene loads");
    let pose = scene.pose(0.0);
    let surfaces = Surfaces::new(&scene, &pose);
    let accelerator = Geometry::new(&scene).place(&pose);
    let corners: Vec<[Vec3A; 3]> = (0..scene.instances.len())
        .flat_map(|i| (0..scene.meshes[scene.instances[i].mesh].triangles.len()).map(move |t| (i, t)))
        .map(|(i, t)| surfaces.corners(i, t))
        .collect();
    let (min, max) = scene.bounds(&pose).expect("the scene has triangles");
    let center = (min + max) / 2.0;
    // View the nave along its length from one end, slightly above the floor.
    let eye = center + (max - min) * Vec3A::new(-0.35, -0.3, 0.0);
    let primary: Vec<Segment> = (0..SIDE * SIDE)
        .map(|i| {
            // Order the pixels in squares of 8 × 8, each in blocks of 4 × 2.
            let (square, inside) = (i / 64, i % 64);
            let x = square % (SIDE / 8) * 8 + inside / 8 % 2 * 4 + inside % 4;
            let y = square / (SIDE / 8) * 8 + inside / 16 * 2 + inside / 4 % 2;
            let p = (Vec2::new(x as f32, y as f32) + 0.5) / SIDE as f32 * 2.0 - 1.0;
            Segment { origin: eye, direction: Vec3A::new(1.0, -p.y + 0.2, p.x).normalize(), length: f32::INFINITY }
        })
        .collect();
    let lamp = center + (max - min) * Vec3A::new(0.05, 0.2, 0.02);
    // A pixel without a surface repeats the previous one, which keeps the squares complete.
    let mut last = None;
    let seen: Vec<(usize, Hit)> = primary
        .iter()
        .enumerate()
        .filter_map(|(i, ray)| {
            last = accelerator.closest(ray.origin, ray.direction).map(|hit| (i, hit)).or(last);
            last
        })
        .collect();
    let surface = |&(i, hit): &(usize, Hit)| {
        let surface = surfaces.at(&hit, primary[i].direction, 0.0);
        (surface.position + surface.geometric_normal * 1e-3, surface.geometric_normal)
    };
    let shadow = seen
        .iter()
        .map(surface)
        .map(|(position, _)| Segment { origin: lamp, direction: position - lamp, length: 1.0 })
        .collect();
    let diffuse = seen
        .iter()
        .map(|at| (at.0 as u64, surface(at)))
        .map(|(i, (origin, normal))| {
            let u = Vec2::new(hash_unit(1, i, 0), hash_unit(1, i, 1));
            let direction = cosine_hemisphere(Vec3::from(normal), u).into();
            Segment { origin, direction, length: f32::INFINITY }
        })
        .collect();
    let triangles: Vec<Triangle> = corners.iter().map(|&[v0, v1, v2]| Triangle { v0, v1, v2 }).collect();
    let bvh = build_cwbvh_from_tris(&triangles, BvhBuildParams::medium_build(), &mut Duration::default());
    let triangles = bvh.primitive_indices.iter().map(|&i| RtTriangle::from(&triangles[i as usize])).collect();
    let scalar = Geometry::new(&scene).place(&pose).without_vector_instructions();
    Setting { accelerator, scalar, obvhs: (bvh, triangles), corners, primary, shadow, diffuse }
});

fn closest_alone(bencher: divan::Bencher, accelerator: &Accelerator, rays: &[Segment]) {
    bencher
        .counter(ItemsCount::new(rays.len()))
        .bench(|| rays.iter().filter(|ray| accelerator.closest(ray.origin, ray.direction).is_some()).count());
}

fn closest_together(bencher: divan::Bencher, accelerator: &Accelerator, rays: &[Segment]) {
    let origin = rays[0].origin;
    let directions: Vec<Vec3A> = rays.iter().map(|ray| ray.direction).collect();
    let mut hits = vec![None; rays.len()];
    bencher
        .counter(ItemsCount::new(rays.len()))
        .bench_local(|| accelerator.closest_packet(origin, &directions, &mut hits));
}

fn occluded_alone(bencher: divan::Bencher, accelerator: &Accelerator, rays: &[Segment]) {
    bencher
        .counter(ItemsCount::new(rays.len()))
        .bench(|| rays.iter().filter(|ray| accelerator.occluded(ray.origin, ray.origin + ray.direction)).count());
}

fn occluded_together(bencher: divan::Bencher, accelerator: &Accelerator, rays: &[Segment]) {
    let ends: Vec<Vec3A> = rays.iter().map(|ray| ray.origin + ray.direction).collect();
    bencher.counter(ItemsCount::new(rays.len())).bench(|| {
        ends.chunks(PACKET)
            .map(|ends| accelerator.occluded_packet(rays[0].origin, ends, u64::MAX).count_ones())
            .sum::<u32>()
    });
}

fn by_obvhs(bencher: divan::Bencher, rays: &[Segment], any: bool) {
    let (bvh, triangles) = &SETTING.obvhs;
    bencher.counter(ItemsCount::new(rays.len())).bench(|| {
        rays.iter()
            .filter(|ray| {
                let ray = obvhs::ray::Ray::new(ray.origin, ray.direction, 0.0, ray.length);
                let meet = |ray: &obvhs::ray::Ray, i: usize| triangles[i].intersect(ray);
                if any { !bvh.ray_traverse_miss(ray, meet) } else { bvh.ray_traverse(ray, &mut RayHit::none(), meet) }
            })
            .count()
    });
}

#[divan::bench_group(sample_count = 7)]
mod primary {
    use super::*;

    #[divan::bench]
    fn packets(bencher: divan::Bencher) {
        closest_together(bencher, &SETTING.accelerator, &SETTING.primary);
    }

    #[divan::bench]
    fn packets_scalar(bencher: divan::Bencher) {
        closest_together(bencher, &SETTING.scalar, &SETTING.primary);
    }

    #[divan::bench]
    fn alone(bencher: divan::Bencher) {
        closest_alone(bencher, &SETTING.accelerator, &SETTING.primary);
    }

    #[divan::bench]
    fn alone_scalar(bencher: divan::Bencher) {
        closest_alone(bencher, &SETTING.scalar, &SETTING.primary);
    }

    #[divan::bench]
    fn obvhs(bencher: divan::Bencher) {
        by_obvhs(bencher, &SETTING.primary, false);
    }
}

#[divan::bench_group(sample_count = 7)]
mod shadow_of_one_light {
    use super::*;

    #[divan::bench]
    fn packets(bencher: divan::Bencher) {
        occluded_together(bencher, &SETTING.accelerator, &SETTING.shadow);
    }

    #[divan::bench]
    fn packets_scalar(bencher: divan::Bencher) {
        occluded_together(bencher, &SETTING.scalar, &SETTING.shadow);
    }

    #[divan::bench]
    fn alone(bencher: divan::Bencher) {
        occluded_alone(bencher, &SETTING.accelerator, &SETTING.shadow);
    }

    #[divan::bench]
    fn alone_scalar(bencher: divan::Bencher) {
        occluded_alone(bencher, &SETTING.scalar, &SETTING.shadow);
    }

    #[divan::bench]
    fn obvhs(bencher: divan::Bencher) {
        by_obvhs(bencher, &SETTING.shadow, true);
    }
}

#[divan::bench_group(sample_count = 7)]
mod diffuse {
    use super::*;

    #[divan::bench]
    fn alone(bencher: divan::Bencher) {
        closest_alone(bencher, &SETTING.accelerator, &SETTING.diffuse);
    }

    #[divan::bench]
    fn alone_scalar(bencher: divan::Bencher) {
        closest_alone(bencher, &SETTING.scalar, &SETTING.diffuse);
    }

    #[divan::bench]
    fn obvhs(bencher: divan::Bencher) {
        by_obvhs(bencher, &SETTING.diffuse, false);
    }
}

/// Compiles `embree.cpp` and traces the same rays with Embree.
fn embree() -> Result<(), String> {
    let folder = tempfile::tempdir().map_err(|error| error.to_string())?;
    let (program, data) = (folder.path().join("embree"), folder.path().join("rays"));
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/embree.cpp");
    let mut compiler = Command::new("g++");
    compiler.args(["-O3", "-march=native", "-std=c++17", "-o"]).arg(&program).arg(&source).arg("-lembree3");
    if !compiler.output().is_ok_and(|output| output.status.success()) {
        return Err("g++ and Embree 3 with its headers are needed (Debian: g++, libembree-dev)".into());
    }
    let setting = &*SETTING;
    let mut bytes = Vec::new();
    let kinds = [&setting.primary, &setting.shadow, &setting.diffuse];
    bytes.extend((setting.corners.len() as u32).to_le_bytes());
    bytes.extend((kinds.len() as u32).to_le_bytes());
    bytes.extend(setting.corners.iter().flatten().flat_map(|corner| corner.to_array()).flat_map(f32::to_le_bytes));
    for rays in kinds {
        bytes.extend((rays.len() as u32).to_le_bytes());
        for ray in rays {
            let numbers = ray.origin.to_array().into_iter().chain(ray.direction.to_array()).chain([ray.length]);
            bytes.extend(numbers.flat_map(f32::to_le_bytes));
        }
    }
    let mut file = std::fs::File::create(&data).map_err(|error| error.to_string())?;
    file.write_all(&bytes).map_err(|error| error.to_string())?;
    let status = Command::new(&program).arg(&data).status().map_err(|error| error.to_string())?;
    if status.success() { Ok(()) } else { Err(format!("its program ended with {status}")) }
}
