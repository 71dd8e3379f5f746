//! Draws the figures of `docs/`. They are bit-identical in every run. Then writes `docs/figures.md`, which embeds all
//! figures of the README in the documentation page.
//!
//! `cargo run --release -p lighttree --example figures`

mod rivals;
mod room;

use glam::Vec3;
use lighttree::{BuildParams, Cluster, Emission, KeptCluster, Lambert, Light, LightTree, Scratch, Stop, luminance};
use plot::{BLUE, GRAY, GREEN, Plot, RED, Svg, data_uri};
use rivals::{Method, illuminate};
use room::{floor, params, room, unblocked};

const LIGHTS: usize = 20_000;
/// Allowed error of a cluster as a fraction of the pixel's luminance, as in figure 6b of \[Herzog08\].
const THRESHOLD: f32 = 0.03;

fn main() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/docs");
    let lights = room(LIGHTS);
    let tree = LightTree::build(&lights, params(LIGHTS));
    let [histogram, thresholds] = errors(&tree);
    for (name, figure) in [
        ("cut.svg", explain()),
        ("bounds.svg", bounds(&tree)),
        ("errors.svg", histogram),
        ("thresholds.svg", thresholds),
        ("methods.svg", methods(&tree)),
    ] {
        let path = format!("{folder}/{name}");
        std::fs::write(&path, figure).unwrap_or_else(|error| panic!("{path}: {error}"));
        println!("{path}");
    }
    let path = format!("{folder}/figures.md");
    std::fs::write(&path, embedded(folder)).unwrap_or_else(|error| panic!("{path}: {error}"));
    println!("{path}");
}

/// Returns a Markdown link definition for each figure of the README, with the file as a data URI.
fn embedded(folder: &str) -> String {
    let mut definitions = String::new();
    for line in include_str!("../README.md").lines() {
        let Some((label, path)) = line.strip_prefix("[figure-").and_then(|rest| rest.split_once("]: docs/")) else {
            continue;
        };
        let svg = std::fs::read_to_string(format!("{folder}/{path}")).unwrap_or_else(|error| panic!("{path}: {error}"));
        definitions += &format!("[figure-{label}]: {}\n", data_uri(&svg));
    }
    definitions
}

/// Returns the clusters of the lightcut at a receiver.
fn cut(tree: &LightTree, receiver: &Lambert, threshold: f32) -> Vec<KeptCluster> {
    let mut scratch = Scratch::default();
    let visible = |light: &Light, _| unblocked(receiver.position, light.position);
    let stop = Stop::Absolute(threshold);
    tree.lightcut_kept(receiver, stop, visible, &mut scratch);
    scratch.kept().to_vec()
}

fn truth(tree: &LightTree, receiver: &Lambert) -> f32 {
    luminance(tree.exhaustive(receiver, |light, _| unblocked(receiver.position, light.position)))
}

/// Draws twelve lamps above a floor and the clusters of a lightcut. Clusters are smaller near the receiver.
fn explain() -> String {
    let lamp = |k: usize| Light {
        position: Vec3::new([0.3, 0.8, 1.4, 1.9, 3.0, 3.4, 4.2, 5.0, 6.3, 6.8, 7.9, 8.4][k], 0.0, 2.6),
        emission: Emission::Cosine(Vec3::NEG_Z),
        intensity: Vec3::splat([1.0, 2.0, 1.5, 1.0, 0.5, 1.0, 2.0, 1.0, 3.0, 1.0, 1.0, 2.0][k]),
    };
    let lamps: Vec<Light> = (0..12).map(lamp).collect();
    let tree = LightTree::build(&lamps, BuildParams::bounded_by(0.05).with_seed(3));
    let receiver = Lambert { position: Vec3::new(1.2, 0.0, 0.2), normal: Vec3::Z, reflectance: Vec3::ONE };
    let all = luminance(tree.exhaustive(&receiver, |_, _| true));
    let stop = Stop::Absolute(0.14 * all);
    let mut scratch = Scratch::default();
    tree.lightcut_kept(&receiver, stop, |_, _| true, &mut scratch);
    let clusters: Vec<Cluster> = scratch.kept().iter().map(|kept| kept.cluster).collect();

    // Draw the floor, then a box, a shadow ray and a bound for each cluster.
    let mut svg = Svg::new(720.0, 330.0);
    let place = |p: Vec3| (40.0 + p.x * 73.0, 280.0 - p.z * 80.0);
    let (x, y) = place(receiver.position);
    svg.line((20.0, y + 8.0), (700.0, y + 8.0), GRAY, 3.0);
    for &cluster in &clusters {
        let below: Vec<&Light> = tree.cluster_lights(cluster).iter().map(|&k| &lamps[k as usize]).collect();
        let (left, top) = place(below.iter().map(|l| l.position).reduce(Vec3::min).expect("a light"));
        let (right, _) = place(below.iter().map(|l| l.position).reduce(Vec3::max).expect("a light"));
        svg.rectangle((left - 14.0, top - 22.0), (right - left + 28.0, 44.0), BLUE);
        let to = place(lamps[cluster.light as usize].position);
        svg.line((x, y), to, RED, 1.2);
        let bound = tree.cluster_bound(&receiver, cluster);
        let text = if bound > 0.0 { format!("≤ {:.0} %", 100.0 * bound / all) } else { "exact".into() };
        svg.text(((left + right) / 2.0, top - 30.0), 12.0, "middle", &text);
    }
    // Draw brighter lamps larger, and representatives in red.
    for (k, lamp) in lamps.iter().enumerate() {
        let represents = clusters.iter().any(|cluster| cluster.light as usize == k);
        let radius = 3.0 + 3.0 * luminance(lamp.intensity).sqrt();
        svg.circle(place(lamp.position), radius, if represents { RED } else { GRAY });
    }
    svg.circle((x, y), 5.0, "black");
    svg.text((x + 12.0, y + 1.0), 13.0, "start", "receiver");
    let caption =
        "Twelve lights in a cut of clusters (boxes). Red: the light that represents each, and its shadow ray.";
    svg.text((20.0, 306.0), 13.0, "start", caption);
    let caption = "Above: how wrong each can be at most, as a share of all light; the threshold is 14 %.";
    svg.text((20.0, 323.0), 13.0, "start", caption);
    svg.finish()
}

/// Plots one pixel's lightcut, largest bounds first: bounds, true errors, and the running sum of the true errors
/// (figure 6b of \[Herzog08\]).
fn bounds(tree: &LightTree) -> String {
    let receiver = floor(64)[64 * 20 + 44];
    let all = truth(tree, &receiver);
    let mut clusters: Vec<(f32, f32)> = cut(tree, &receiver, THRESHOLD * all)
        .into_iter()
        .map(|KeptCluster { cluster, transport, .. }| {
            let estimate = luminance(transport * tree.cluster_intensity(cluster));
            let below: Vec<Light> = tree.cluster_lights(cluster).iter().map(|&k| tree.lights()[k as usize]).collect();
            let sees = |light: &Light, _| unblocked(receiver.position, light.position);
            let true_value = luminance(lighttree::exhaustive(&below, tree.geometry_term_bound(), &receiver, sees));
            (tree.cluster_bound(&receiver, cluster) / all, (estimate - true_value) / all)
        })
        .collect();
    // Positive and negative errors cancel in the running sum.
    clusters.sort_by(|a, b| b.0.total_cmp(&a.0));
    let points = |f: &mut dyn FnMut(&(f32, f32)) -> f32| -> Vec<(f32, f32)> {
        clusters.iter().enumerate().map(|(k, cluster)| (k as f32 + 1.0, 100.0 * f(cluster))).collect()
    };
    let mut sum = 0.0;
    let running = points(&mut |c| {
        sum += c.1;
        sum
    });
    let title = format!("A cut of {} clusters, threshold {:.0} %", clusters.len(), 100.0 * THRESHOLD);
    let mut plot = Plot::new(&title, "cluster, largest bound first", "share of the pixel's luminance [%]");
    plot.line("error bound", BLUE, points(&mut |c| c.0));
    plot.line("true error", RED, points(&mut |c| c.1));
    plot.line("true errors, summed up to here", GREEN, running);
    plot.finish()
}

/// Plots the histogram of pixel errors in thresholds, and the mean threshold at each error (figure 7 of
/// \[Herzog08\]).
///
/// Thresholds are between 1 and 40 % of a pixel's luminance, like thresholds from visual masking.
fn errors(tree: &LightTree) -> [String; 2] {
    const WIDTH: f32 = 0.1;
    let receivers = floor(48);
    // Count the pixels and sum their thresholds in each error bin.
    let mut found = vec![(0u32, 0.0f32); 60];
    let mut outside = 0;
    let mut scratch = Scratch::default();
    for (k, receiver) in receivers.iter().enumerate() {
        // Use multiples of the golden ratio to spread all thresholds over the floor.
        let threshold = 0.01 * 40f32.powf((k as f32 * 0.618_034).fract());
        let all = truth(tree, receiver);
        let visible = |light: &Light, _| unblocked(receiver.position, light.position);
        let cut = tree.lightcut(receiver, Stop::Absolute(threshold * all), visible, &mut scratch);
        let ratio = (luminance(cut.radiance) - all) / (threshold * all);
        outside += u32::from(ratio.abs() > 1.0);
        let (count, sum) = &mut found[((ratio / WIDTH + 30.0) as usize).min(59)];
        (*count, *sum) = (*count + 1, *sum + threshold);
    }
    // Give different colors to bars within the threshold and beyond it.
    let center = |k: usize| (k as f32 - 29.5) * WIDTH;
    let bars = |value: &dyn Fn(u32, f32) -> f32| {
        [true, false].map(|inside| -> Vec<(f32, f32)> {
            let of_kind = |k: &usize| (center(*k).abs() < 1.0) == inside && found[*k].0 > 0;
            (0..60).filter(of_kind).map(|k| (center(k), value(found[k].0, found[k].1))).collect()
        })
    };
    let share = |count: u32| 100.0 * count as f32 / receivers.len() as f32;
    let histogram = format!("{} pixels: {:.1} % are wrong by more than the threshold", receivers.len(), share(outside));
    [
        (histogram.as_str(), "pixels [%]", bars(&|count, _| share(count))),
        ("Mean threshold of the same pixels", "threshold [%]", bars(&|count, sum| 100.0 * sum / count as f32)),
    ]
    .map(|(title, axis, [within, beyond])| {
        let mut plot = Plot::new(title, "error of the pixel / threshold of its clusters", axis);
        plot.bars("within the threshold", GREEN, WIDTH, within);
        plot.bars("outside", RED, WIDTH, beyond);
        plot.finish()
    })
}

/// Plots error against the number of shadow rays for each method.
fn methods(tree: &LightTree) -> String {
    let receivers = floor(16);
    let all: Vec<f32> = receivers.iter().map(|receiver| truth(tree, receiver)).collect();
    let mean = all.iter().sum::<f32>() / all.len() as f32;
    let mut scratch = Scratch::default();
    // Plot the logarithms of the mean number of rays and of the relative error in percent.
    let mut measure = |method: &dyn Fn(u64) -> Method| {
        let (mut squares, mut rays) = (0.0, 0);
        for ((stream, receiver), all) in (0..).zip(&receivers).zip(&all) {
            let visible = |light: &Light, _| unblocked(receiver.position, light.position);
            let cut = illuminate(tree, receiver, method(stream), visible, &mut scratch);
            squares += ((luminance(cut.radiance) - all) / all).powi(2);
            rays += cut.shadow_rays;
        }
        let count = receivers.len() as f32;
        ((rays as f32 / count).log10(), (100.0 * (squares / count).sqrt()).log10())
    };
    let shares = [0.5, 0.2, 0.1, 0.05, 0.02, 0.01, 0.005];
    let stop = |share: f32| Stop::Absolute(share * mean);
    let mut plot = Plot::new("Every light would be 20 000 rays", "shadow rays a pixel", "relative error, rms [%]");
    plot.logarithmic();
    let cuts = shares.map(|share| measure(&|_| Method::Lightcut(stop(share))));
    plot.line("lightcut", BLUE, cuts.to_vec());
    let drawn = shares.map(|share| measure(&|stream| Method::Stochastic { stop: stop(share), stream }));
    plot.line("cut, lights drawn for each pixel", GREEN, drawn.to_vec());
    let sampled = [4, 16, 64, 256, 1024].map(|samples| measure(&|stream| Method::Sampled { samples, stream }));
    plot.line("tree sampled from the root", RED, sampled.to_vec());
    plot.finish()
}
