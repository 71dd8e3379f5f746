//! Rays a second: `cargo bench -p render-core`.

use divan::counter::ItemsCount;
use glam::Vec3A;
use render_core::scene::load;
use render_core::{Busy, GBuffer, Geometry, Surfaces};
use std::path::Path;

fn main() {
    divan::main();
}

const SCENES: [&str; 2] = ["cornell", "atrium"];

fn scene(name: &str) -> render_core::scene::Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../scenes/{name}/{name}.glb"));
    load(&path).expect("the shipped scenes load")
}

#[divan::bench(args = SCENES, sample_count = 10)]
fn primary_rays_128x128(bencher: divan::Bencher, name: &str) {
    let scene = scene(name);
    let pose = scene.pose(0.0);
    let accelerator = Geometry::new(&scene).place(&pose);
    let surfaces = Surfaces::new(&scene, &pose);
    let view = scene.view(&pose, 128, 128);
    bencher
        .counter(ItemsCount::new(128usize * 128))
        .bench(|| GBuffer::trace(&accelerator, &surfaces, &view, (128, 128), &Busy::default()));
}

#[divan::bench(args = SCENES, sample_count = 10)]
fn shadow_rays_between_pixels(bencher: divan::Bencher, name: &str) {
    let scene = scene(name);
    let pose = scene.pose(0.0);
    let accelerator = Geometry::new(&scene).place(&pose);
    let view = scene.view(&pose, 128, 128);
    let seen = GBuffer::trace(&accelerator, &Surfaces::new(&scene, &pose), &view, (128, 128), &Busy::default());
    let points: Vec<Vec3A> = seen
        .pixels
        .samples()
        .iter()
        .filter(|pixel| pixel.depth.is_finite())
        .map(|pixel| Vec3A::from(pixel.position) + Vec3A::from(pixel.geometric_normal) * 1e-3)
        .collect();
    bencher.counter(ItemsCount::new(points.len())).bench(|| {
        // A stride that is no divisor of the count pairs every point with one far away.
        points
            .iter()
            .enumerate()
            .filter(|&(i, &a)| accelerator.occluded(a, points[(i * 7919 + 4001) % points.len()]))
            .count()
    });
}
