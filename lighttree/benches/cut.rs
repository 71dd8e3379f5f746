//! Benchmarks of tree builds, updates, lightcuts and the exhaustive sum, for trees of several sizes. The lights are on
//! the walls of a box, the receivers on its floor. Run with `cargo bench -p lighttree`.

#[path = "../examples/walls/mod.rs"]
mod walls;

use divan::{Bencher, black_box};
use glam::Vec3;
use lighttree::{BuildParams, Builder, Lambert, LightTree, Receivers, Scratch, Stop};
use walls::{spread, walls};

const SIZES: [usize; 3] = [2_000, 10_000, 100_000];

fn main() {
    divan::main();
}

fn params(count: usize) -> BuildParams {
    BuildParams::bounded_by(12.0 / (std::f32::consts::PI * count as f32)).with_seed(1)
}

fn floor() -> Vec<Lambert> {
    (0..256)
        .map(|k| Lambert {
            position: (spread(k) * 2.0 - 1.0).with_z(-1.0),
            normal: Vec3::Z,
            reflectance: Vec3::new(0.7, 0.5, 0.3),
        })
        .collect()
}

#[divan::bench(args = SIZES, sample_count = 5)]
fn build(bencher: Bencher, count: usize) {
    let lights = walls(count);
    bencher.bench(|| LightTree::build(black_box(&lights), params(count)));
}

#[divan::bench(args = SIZES, sample_count = 20)]
fn build_top_down(bencher: Bencher, count: usize) {
    let lights = walls(count);
    bencher.bench(|| LightTree::build_by(Builder::TopDown, black_box(&lights), params(count)));
}

#[divan::bench(args = SIZES)]
fn update(bencher: Bencher, count: usize) {
    let lights = walls(count);
    let mut tree = LightTree::build(&lights, params(count));
    let intensities: Vec<Vec3> = lights.iter().map(|light| light.intensity * 1.5).collect();
    bencher.bench_local(|| tree.update(black_box(&intensities)));
}

/// Times 256 lightcuts with all lights visible. The counter is the number of node visits.
fn cuts(bencher: Bencher, count: usize, stop: Stop) {
    let tree = LightTree::build(&walls(count), params(count));
    let receivers = floor();
    let mut scratch = Scratch::default();
    let mut visit = || {
        let cuts = receivers.iter().map(|receiver| tree.lightcut(receiver, stop, |_, _| true, &mut scratch));
        cuts.map(|cut| u64::from(cut.nodes_visited)).sum::<u64>()
    };
    let visited = visit();
    bencher.counter(divan::counter::ItemsCount::new(visited)).bench_local(visit);
}

#[divan::bench(args = SIZES)]
fn cut_absolute(bencher: Bencher, count: usize) {
    cuts(bencher, count, Stop::Absolute(2e-4));
}

#[divan::bench(args = SIZES)]
fn cut_relative(bencher: Bencher, count: usize) {
    cuts(bencher, count, Stop::Relative { fraction: 0.02, known_luminance: 0.0 });
}

/// Times shared lightcuts of the 256 receivers in four bundles of 8×8 neighbors. The counter is the number of node
/// visits of independent lightcuts.
#[divan::bench(args = SIZES)]
fn cut_shared(bencher: Bencher, count: usize) {
    let tree = LightTree::build(&walls(count), params(count));
    let bundles = [0, 1, 2, 3].map(|bundle| {
        let corner = floor()[bundle].position * 0.9;
        let step = |k: usize| Vec3::new((k % 8) as f32, (k / 8) as f32, 0.0) * 0.004;
        let receiver = |k| Lambert { position: corner.with_z(-1.0) + step(k), ..floor()[bundle] };
        (0..64).map(receiver).collect::<Vec<_>>()
    });
    let (mut scratch, mut found) = (Scratch::default(), Vec::new());
    let mut visit = || {
        let mut visited = 0;
        for bundle in &bundles {
            let together = Receivers { receivers: bundle, thresholds: &[2e-4; 64] };
            tree.lightcuts(together, |_, _, rays| rays, &mut scratch, &mut found);
            visited += found.iter().map(|cut| u64::from(cut.nodes_visited)).sum::<u64>();
        }
        visited
    };
    let visited = visit();
    bencher.counter(divan::counter::ItemsCount::new(visited)).bench_local(visit);
}

#[divan::bench(args = SIZES)]
fn exhaustive(bencher: Bencher, count: usize) {
    let tree = LightTree::build(&walls(count), params(count));
    let receiver = floor()[0];
    bencher
        .counter(divan::counter::ItemsCount::new(count))
        .bench(|| tree.exhaustive(black_box(&receiver), |_, _| true));
}
