//! Writes the light tree and the pixels of a real scene to one file, for the measurements of `lighttree`. Compares the costs
//! of shared and independent cuts with real shadow rays.
//!
//! ```sh
//! cargo run --release -p tests --example many_lights -- ../shared/scenes/conference/conference.glb 512x512 150000 out/conference.lights
//! cargo run --release -p lighttree --features serde --example measure -- out/conference.lights
//! ```
//!
//! ```text
//! length of the tree (u64)  tree (LightTree::to_bytes)  width, height (u32)
//! then for each pixel position, normal, albedo (9 × f32, zero normal for background)     all little-endian
//! ```

use glam::{Vec3, Vec3A};
use lighttree::{Lambert, Light, Lightcut, Receivers, Scratch, Stop, luminance};
use render_core::Busy;
use render2mpeg::Options;
use renderer::Preparation;
use renderer::plan::Plan;

/// Side of a block \[pixels\].
const BLOCK: usize = 8;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [scene, size, lights, out] = &arguments[..] else {
        eprintln!("usage: many_lights SCENE WxH LIGHTS OUT");
        std::process::exit(2);
    };
    let vpls = lights.parse().expect("a number of lights");
    let options = Options {
        frames: Some(1),
        size: size.parse().ok(),
        vpls: Some(vpls),
        photons: Some(2_000_000),
        ..Options::default()
    };
    let (scene, settings) = tests::load(scene.as_ref(), options);
    let plan = Plan::new(&scene, &settings.render);
    let frame = Preparation::new(&scene, &settings.render, &plan).frame(0).frame;

    // Write the tree, then position, normal and albedo of each pixel.
    let pixels = &frame.seen.pixels;
    let receiver = |x: usize, y: usize| {
        let pixel = pixels.get(x, y);
        let position = Vec3A::from(pixel.position) + Vec3A::from(pixel.geometric_normal) * frame.epsilon;
        Lambert { position: position.into(), normal: pixel.shading_normal.into(), reflectance: pixel.albedo.into() }
    };
    let tree = frame.tree.to_bytes();
    let mut bytes = (tree.len() as u64).to_le_bytes().to_vec();
    bytes.extend(tree);
    bytes.extend([pixels.width() as u32, pixels.height() as u32].map(u32::to_le_bytes).as_flattened());
    for (x, y) in (0..pixels.height()).flat_map(|y| (0..pixels.width()).map(move |x| (x, y))) {
        let Lambert { position, normal, reflectance } = receiver(x, y);
        for number in [position, normal, reflectance].map(|v| v.to_array()).as_flattened() {
            bytes.extend(number.to_le_bytes());
        }
    }
    std::fs::write(out, bytes).unwrap_or_else(|error| panic!("{out}: {error}"));

    // Every fourth block in both directions.
    let (alone, together) = (Busy::default(), Busy::default());
    let (mut scratch, mut shared) = (Scratch::default(), Vec::new());
    let [mut rays_alone, mut rays_together] = [0u64; 2];
    for (left, top) in (0..pixels.height())
        .step_by(4 * BLOCK)
        .flat_map(|y| (0..pixels.width()).step_by(4 * BLOCK).map(move |x| (x, y)))
    {
        let inside = |x: &usize, y: &usize| *x < pixels.width() && *y < pixels.height();
        let block: Vec<Lambert> = (0..BLOCK * BLOCK)
            .map(|k| (left + k % BLOCK, top + k / BLOCK))
            .filter(|(x, y)| inside(x, y))
            .map(|(x, y)| receiver(x, y))
            .filter(|r| r.normal != Vec3::ZERO)
            .collect();
        let sees = |from: Vec3, light: &Light| !frame.accelerator.occluded(from.into(), light.position.into());
        let relative = Stop::Relative { fraction: 0.02, known_luminance: 0.0 };
        let thresholds: Vec<f32> = block
            .iter()
            .map(|r| frame.tree.lightcut(r, relative, |light, _| sees(r.position, light), &mut scratch))
            .map(|cut| 0.02 * luminance(cut.radiance))
            .collect();
        // Independent cuts, then shared cuts with the same thresholds.
        let cuts: Vec<Lightcut> = alone.measure(|| {
            let each = block.iter().zip(&thresholds);
            each.map(|(r, &t)| {
                frame.tree.lightcut(r, Stop::Absolute(t), |light, _| sees(r.position, light), &mut scratch)
            })
            .collect()
        });
        together.measure(|| {
            let visible = |light: &Light, _: usize, rays: u64| {
                let seeing = |k: &usize| rays >> k & 1 == 1 && sees(block[*k].position, light);
                (0..block.len()).filter(seeing).fold(0, |bits, k| bits | 1 << k)
            };
            let receivers = Receivers { receivers: &block, thresholds: &thresholds };
            frame.tree.lightcuts(receivers, visible, &mut scratch, &mut shared);
        });
        rays_alone += cuts.iter().map(|cut| u64::from(cut.shadow_rays)).sum::<u64>();
        rays_together += shared.iter().map(|cut| u64::from(cut.shadow_rays)).sum::<u64>();
    }
    println!(
        "with shadow rays: independent {:.2} CPU s, {rays_alone} rays; shared {:.2} CPU s, {rays_together} rays",
        alone.seconds(),
        together.seconds()
    );
}
