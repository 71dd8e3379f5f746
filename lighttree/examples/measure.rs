//! Measures builds, lightcuts and shared lightcuts on the lights and pixels of a real scene. Times are CPU times of
//! this thread \[s\].
//!
//! ```sh
//! cargo run --release -p tests --example many_lights -- SCENE 512x512 150000 out/conference.lights
//! cargo run --release -p lighttree --features serde --example measure -- out/conference.lights
//! ```
//!
//! No light is occluded, so that only the tree is measured. Thresholds are 2 % of each pixel's luminance. Without a
//! file, `measure` uses lights in a room and a picture of its floor; `measure COUNT` sets the number of lights. The
//! plain loop for comparison evaluates one light per visited node.

mod walls;

use glam::Vec3;
use lighttree::{
    BuildParams, Builder, Emission, Lambert, Light, LightTree, Lightcut, Receivers, Scratch, Stop, luminance,
};
use walls::walls;

/// Returns the CPU time of this thread \[s\].
fn now() -> f64 {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
}

fn seconds<T>(work: impl FnOnce() -> T) -> (T, f64) {
    let start = now();
    let result = work();
    (result, now() - start)
}

fn room(count: usize) -> (LightTree, Vec<Lambert>, usize) {
    let lights = walls(count);
    let geometry_term_bound = 12.0 / (std::f32::consts::PI * count as f32);
    let side = 128;
    let floor = (0..side * side).map(|k| Lambert {
        position: Vec3::new((k % side) as f32 / 64.0 - 0.99, (k / side) as f32 / 64.0 - 0.99, -1.0),
        normal: Vec3::Z,
        reflectance: Vec3::new(0.7, 0.5, 0.3),
    });
    (
        LightTree::build_by(Builder::TopDown, &lights, BuildParams::bounded_by(geometry_term_bound).with_seed(1)),
        floor.collect(),
        side,
    )
}

fn read(path: &str) -> (LightTree, Vec<Lambert>, usize) {
    let bytes = std::fs::read(path).unwrap_or_else(|error| panic!("{path}: {error}"));
    let length = u64::from_le_bytes(bytes[..8].try_into().expect("eight bytes")) as usize;
    let tree = LightTree::from_bytes(&bytes[8..8 + length]).unwrap_or_else(|error| panic!("{path}: {error}"));
    let rest = &bytes[8 + length..];
    let width = u32::from_le_bytes(rest[..4].try_into().expect("four bytes")) as usize;
    let vector = |bytes: &[u8]| {
        let number = |k: usize| f32::from_le_bytes(bytes[4 * k..4 * k + 4].try_into().expect("four bytes"));
        Vec3::new(number(0), number(1), number(2))
    };
    let pixel = |b: &[u8]| Lambert { position: vector(b), normal: vector(&b[12..]), reflectance: vector(&b[24..]) };
    (tree, rest[8..].chunks(36).map(pixel).collect(), width)
}

fn main() {
    let (given, pixels, width) = match std::env::args().nth(1) {
        Some(argument) => argument.parse().map_or_else(|_| read(&argument), room),
        None => room(150_000),
    };
    let (lights, params) = (given.lights().to_vec(), BuildParams::bounded_by(given.geometry_term_bound()).with_seed(1));
    drop(given);
    println!("{} lights, {} pixels", lights.len(), pixels.len());

    let mut trees = Vec::new();
    // With one thread, the time of the thread is the total time.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a pool of one thread");
    for builder in [Builder::TopDown, Builder::BottomUp] {
        let (tree, time) = pool.install(|| seconds(|| LightTree::build_by(builder, &lights, params)));
        println!("{builder:?}: built in {time:.3} s, depth {}, memory so far {} MiB", tree.depth(), peak_memory());
        trees.push(tree);
    }
    let intensities: Vec<Vec3> = lights.iter().map(|light| light.intensity).collect();
    let mut update = || seconds(|| trees[0].update_drawn(&intensities)).1;
    let time = (0..9).map(|_| update()).fold(f64::INFINITY, f64::min);
    println!("update: {:.2} ms", 1e3 * time);
    let tree = trees.pop().expect("bottom-up");
    // 20 000 is an upper limit of the lightcut size in these scenes.
    let mut scratch = Scratch::with_max_size(20_000);

    // Divide the picture into blocks of 8×8 pixels with thresholds of 2 %.
    let height = pixels.len() / width;
    let mut blocks = Vec::new();
    for (left, top) in (0..height).step_by(8).flat_map(|y| (0..width).step_by(8).map(move |x| (x, y))) {
        let within = (0..64).map(|k| (left + k % 8, top + k / 8)).filter(|&(x, y)| x < width && y < height);
        let block: Vec<Lambert> =
            within.map(|(x, y)| pixels[y * width + x]).filter(|r| r.normal != Vec3::ZERO).collect();
        let relative = Stop::Relative { fraction: 0.02, known_luminance: 0.0 };
        let thresholds: Vec<f32> = block
            .iter()
            .map(|r| 0.02 * luminance(tree.lightcut(r, relative, |_, _| true, &mut scratch).radiance))
            .collect();
        blocks.push((block, thresholds));
    }

    // Interleave the methods, so that other load on the machine affects them equally.
    let (mut alone, mut together, mut top_down, mut plain) = (Sum::default(), Sum::default(), Sum::default(), 0.0);
    let mut evaluated = 0;
    let rounds = 100_000usize.div_ceil(blocks.iter().map(|(block, _)| block.len()).sum::<usize>().max(1));
    let mut shared = Vec::new();
    for (block, thresholds) in std::iter::repeat_n(&blocks, rounds).flatten() {
        let cut = |tree: &LightTree, scratch: &mut Scratch| -> Vec<Lightcut> {
            let each = block.iter().zip(thresholds);
            each.map(|(r, &t)| tree.lightcut(r, Stop::Absolute(t), |_, _| true, scratch)).collect()
        };
        let (cuts, time) = seconds(|| cut(&tree, &mut scratch));
        alone.add(&cuts, time);
        let all_visible = |_: &Light, _: usize, rays: u64| rays;
        let receivers = Receivers { receivers: block, thresholds };
        let ((), time) = seconds(|| tree.lightcuts(receivers, all_visible, &mut scratch, &mut shared));
        together.add(&shared, time);
        let (cuts, time) = seconds(|| cut(&trees[0], &mut scratch));
        top_down.add(&cuts, time);
        // Evaluate one light per visited node in a plain loop.
        if let Some(receiver) = block.first() {
            let count = cuts.iter().map(|cut| cut.nodes_visited as usize).sum::<usize>().min(lights.len());
            let (sum, time) = seconds(|| plain_loop(&lights[..count], params.geometry_term_bound, receiver));
            assert!(sum.is_finite());
            plain += time;
            evaluated += count;
        }
    }
    alone.print("independent");
    together.print("shared");
    top_down.print("top-down");
    let (node, light) = (alone.time / alone.visited, plain / evaluated as f64);
    println!("plain loop: {:.2} ns per light; lights in the time of a node visit: {:.2}", light * 1e9, node / light);
    println!("node visits per second against the plain loop: {:.2}", light / node);
    println!(
        "shared against independent: time {:.2}, visits {:.2}, size {:.3}",
        together.time / alone.time,
        together.visited / alone.visited,
        together.size / alone.size
    );
    println!("top-down cuts against bottom-up: {:.3}", top_down.size / alone.size);
}

/// Returns the peak memory of this process \[MiB\], or 0 if the system does not report it.
fn peak_memory() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).unwrap_or_default();
    line.split_whitespace().next().and_then(|number| number.parse::<u64>().ok()).unwrap_or(0) / 1024
}

/// Returns the sum over all lights, computed without a tree.
fn plain_loop(lights: &[Light], geometry_term_bound: f32, receiver: &Lambert) -> Vec3 {
    let mut radiance = Vec3::ZERO;
    for light in lights {
        let way = light.position - receiver.position;
        let r2 = way.length_squared();
        let direction = way / r2.sqrt();
        let emitted = match light.emission {
            Emission::Omni => 1.0,
            Emission::Cosine(axis) => -axis.dot(direction),
            _ => continue,
        };
        let received = receiver.normal.dot(direction);
        if emitted > 0.0 && received > 0.0 {
            radiance += light.intensity * (emitted * received / (r2 + geometry_term_bound));
        }
    }
    radiance * receiver.reflectance / std::f32::consts::PI
}

/// Sums over many lightcuts.
#[derive(Default)]
struct Sum {
    cuts: usize,
    time: f64,
    visited: f64,
    size: f64,
}

impl Sum {
    fn add(&mut self, cuts: &[Lightcut], time: f64) {
        self.cuts += cuts.len();
        self.time += time;
        self.visited += cuts.iter().map(|cut| f64::from(cut.nodes_visited)).sum::<f64>();
        self.size += cuts.iter().map(|cut| f64::from(cut.size)).sum::<f64>();
    }

    fn print(&self, name: &str) {
        let cuts = self.cuts as f64;
        println!(
            "{name:12} {:8.2} µs a cut, {:6.1} clusters, {:6.1} nodes visited, {:.2} ns a visit",
            self.time / cuts * 1e6,
            self.size / cuts,
            self.visited / cuts,
            self.time / self.visited * 1e9,
        );
    }
}
