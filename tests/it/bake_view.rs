//! Pages of baked scenes: their data, and their names.

use super::bake::{add, assert_bake_fails};
use super::bake_coats::{baked, coated_room, metal, seen_from, settings};
use base64::Engine;
use glam::{Vec3, vec3};
use lightfield::{from_shared_exponent, shared_exponent};
use render_core::scene::Gradient;
use render_core::{Environment, Surfaces};
use render2mpeg::Options;
use renderer::bake::{self, Bake, view};
use renderer::texels::BakedTexels;
use serde_json::Value;
use std::f32::consts::PI;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use tests::{Moving, checkered_room, load, render2mpeg};

/// Description and data of a page.
struct Page {
    scene: Value,
    bytes: Vec<u8>,
}

impl Page {
    /// Reads a page as its script does.
    fn read(html: &str) -> Self {
        let content = |start: &str| {
            let rest = &html[html.find(start).expect("the element exists") + start.len()..];
            &rest[..rest.find("</script>").expect("the element ends")]
        };
        let scene = serde_json::from_str(content(r#"<script type="application/json" id="scene">"#)).expect("JSON");
        let base64 = content(r#"<script type="text/plain" id="data">"#);
        let zlib = base64::engine::general_purpose::STANDARD.decode(base64).expect("base64");
        let mut bytes = Vec::new();
        flate2::read::ZlibDecoder::new(&zlib[..]).read_to_end(&mut bytes).expect("zlib");
        Self { scene, bytes }
    }

    /// Returns the bytes of a block.
    fn block(&self, name: &str) -> Vec<u8> {
        let number = |field: &str| self.scene["blocks"][name][field].as_u64().expect("a number") as usize;
        let (first, count, stride) = (number("first"), number("count"), number("stride"));
        let mut records = vec![0; count * stride];
        for column in 0..stride {
            let mut byte = 0u8;
            for record in 0..count {
                byte = byte.wrapping_add(self.bytes[first + column * count + record]);
                records[record * stride + column] = byte;
            }
        }
        records
    }

    /// Returns the words of a block.
    fn words(&self, name: &str) -> Vec<u32> {
        let bytes = self.block(name);
        bytes.chunks_exact(4).map(|bytes| u32::from_le_bytes(bytes.try_into().expect("four bytes"))).collect()
    }
}

/// Compares the picture of irradiance in a page with the baked light. Flagged texels contain only indirect light.
fn assert_same_light(page: &Page, texels: &BakedTexels, exposure: f32) {
    let (picture, visible) = (page.words("irradiance"), page.block("visible"));
    let width = texels.atlas.size().0;
    for texel in 0..texels.atlas.len() {
        let (x, y) = texels.atlas.place(texel);
        let is_live = visible.get((y * width + x) as usize).is_some_and(|code| code & 128 != 0);
        let direct = if is_live { Vec3::ZERO } else { texels.direct[texel].into() };
        let light = direct + Vec3::from(texels.indirect[texel]);
        let (found, expected) = (from_shared_exponent(picture[(y * width + x) as usize]), exposure / PI * light);
        // Shared exponents err by 1/512 of the largest channel.
        let bound = (expected.max_element() / 512.0).max(1e-6) * 1.001;
        assert!((found - expected).abs().max_element() <= bound, "texel {texel}: {found} for {expected}");
    }
}

/// A page has the same bytes for any number of threads, needs no network, and contains the baked light.
#[test]
fn a_page_contains_the_scene_and_its_light() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let path = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../scenes/cornell-box/cornell-box.glb"));
    let page_of = |extra: &str| {
        let mut arguments = vec!["bake", path.to_str().expect("a path in UTF-8"), "--view", "box.html", "--quiet"];
        arguments.extend(extra.split_whitespace());
        let finished = render2mpeg(folder, &arguments);
        assert_eq!((finished.code, finished.stderr.as_str()), (Some(0), ""), "render2mpeg {arguments:?}");
        std::fs::read_to_string(folder.join("box.html")).expect("the page exists")
    };
    let html = page_of("--texels 20000 --vpls 1000 --threads 1 -o box.slf");
    assert!(html == page_of("--baked box.slf --threads 2 --overwrite"), "the same bytes with any number of threads");
    for address in ["http://", "https://", "src=\"", "url(", "@import", "{{"] {
        assert!(!html.contains(address), "{address}");
    }
    let light = std::fs::metadata(folder.join("box.slf")).expect("the light exists").len();
    assert!(html.len() as u64 <= light * 3 / 2, "{} bytes, but the light has {light}", html.len());

    // The library makes the same page as the program.
    let (scene, settings) = load(&path, Options::default());
    let texels = bake::read(&scene, &folder.join("box.slf")).expect("the light is valid").at(0.0);
    let page = Page::read(&html);
    let same = view::view(&scene, &path, &settings.render, &texels).expect("a page");
    assert!(same.html == html);
    assert_same_light(&page, &texels, same.tone_map.exposure);

    // Each triangle is in one batch, and its corners exist.
    let (indices, vertices) = (page.words("indices"), page.block("positions").len() / 12);
    assert_eq!(indices.len(), 3 * scene.triangle_count());
    assert!(indices.iter().all(|&index| (index as usize) < vertices));
    let mut next = 0;
    for batch in page.scene["batches"].as_array().expect("a list") {
        assert_eq!(batch["first"], next);
        next += batch["count"].as_u64().expect("a number");
    }
    assert_eq!(next, indices.len() as u64);
}

/// Under a uniform sky of radiance L, a coat reflects L in all directions: each texel has one coefficient.
#[test]
fn an_evenly_lit_coat_takes_four_bytes_per_texel() {
    let mut scene = seen_from(vec3(0.0, 1.0, 3.0), 0.4);
    let floor = [vec3(-1.0, 0.0, -1.0), vec3(0.0, 0.0, 2.0), vec3(2.0, 0.0, 0.0)];
    add(&mut scene, metal(vec3(0.9, 0.6, 0.3), 0.5), &[floor]);
    scene.sky = Environment::gradient(Gradient::constant([3.0; 3]));
    let Bake { texels, .. } = baked(&scene, 200);
    let texels = Arc::new(texels);
    let page = view::view(&scene, Path::new("none.glb"), &settings(&scene, 16).render, &texels).unwrap();
    assert_eq!((page.coat_texels, page.coat_bytes_per_texel), (texels.atlas.len(), 4.0));
    assert!(page.coat_error < 0.008 && page.coarse_coats == 0, "{}", page.coat_error);

    let read = Page::read(&page.html);
    assert_same_light(&read, &texels, page.tone_map.exposure);
    let (places, width) = (read.words("places"), texels.atlas.size().0);
    let page0 = read.words("page0");
    for texel in 0..texels.atlas.len() {
        let (x, y) = texels.atlas.place(texel);
        // The kind plus 1 is in the highest four bits.
        let place = places[(y * width + x) as usize];
        assert_eq!(place >> 28, 1);
        let found = from_shared_exponent(page0[(place & 0xfff_ffff) as usize]) / page.tone_map.exposure;
        assert!((found / 3.0 - 1.0).abs().max_element() < 0.01, "{found}");
    }
    // The sky of the page is the gradient, exposed.
    let sky = read.scene["sky"]["gradient"][1][0].as_f64().expect("a number");
    assert!((sky / f64::from(3.0 * page.tone_map.exposure) - 1.0).abs() < 1e-5);
    assert_eq!(shared_exponent(Vec3::ZERO), 0, "unused texels are black");
}

/// Returns the fraction of a square lamp's irradiance at a point of the floor that passes a box, by a grid of points.
///
/// The lamp of [`coated_room`] is at a height of 1.99 m.
fn unoccluded(floor: Vec3, low: Vec3, high: Vec3) -> f64 {
    const SIDE: usize = 40;
    let (mut seen, mut all) = (0.0, 0.0);
    for k in 0..SIDE * SIDE {
        let place = |k: usize| 0.7 + 0.6 * (k as f32 + 0.5) / SIDE as f32;
        let way = vec3(place(k % SIDE), 1.99, place(k / SIDE)) - floor;
        // Intersect the segment with the box.
        let (a, b) = ((low - floor) / way, (high - floor) / way);
        let (enters, leaves) = (a.min(b).max_element().max(0.0), a.max(b).min_element().min(1.0));
        // Both cosines are the height divided by the distance.
        let weight = f64::from(way.y.powi(2) / way.length_squared().powi(2));
        all += weight;
        seen += if enters < leaves { 0.0 } else { weight };
    }
    seen / all
}

/// The lamps in coats emit the power of the scene's lamp, and their visible fraction at the floor is the geometric one.
#[test]
fn lamps_in_coats_have_the_shadows_of_the_scene() {
    let scene = coated_room();
    let texels = Arc::new(baked(&scene, 6000).texels);
    let made = view::view(&scene, Path::new("none.glb"), &settings(&scene, 16).render, &texels).unwrap();
    let page = Page::read(&made.html);

    // The intensities sum to radiance times area, and all points are on the lamp.
    let numbers: Vec<f32> = page.words("lamps").into_iter().map(f32::from_bits).collect();
    let points: Vec<&[f32]> = numbers.chunks_exact(12).collect();
    // Each of four groups represents the lamp.
    assert_eq!(page.scene["lamps"], points.len() / 4);
    let intensity: f32 = points.iter().map(|point| point[8]).sum::<f32>() / 4.0;
    assert!((intensity / (15.0 * 0.36 * made.tone_map.exposure) - 1.0).abs() < 1e-3, "{intensity}");
    let is_on_lamp = |point: &&[f32]| {
        (0.7..1.3).contains(&point[0]) && (0.7..1.3).contains(&point[2]) && (point[1] - 1.99).abs() < 1e-4
    };
    assert!(points.iter().all(is_on_lamp) && points.iter().all(|point| point[5] < -0.999));

    // Compare the floor's visible fractions with segments that pass the block.
    let pose = scene.pose(0.0);
    let (surfaces, width) = (Surfaces::new(&scene, &pose), texels.atlas.size().0);
    let visible = page.block("visible");
    let (mut error, mut count, mut shadows) = (0.0, 0, 0);
    for texel in 0..texels.atlas.len() {
        let site = texels.atlas.sites(texel, &surfaces)[0];
        let (x, y) = texels.atlas.place(texel);
        let place = Vec3::from(site.position);
        let is_under_block = place.x > 0.87 && place.x < 1.53 && place.z > 0.57 && place.z < 1.23;
        if site.instance == 1 && !is_under_block {
            let found = f64::from(visible[(y * width + x) as usize] & 127) / 127.0;
            let expected = unoccluded(place, vec3(0.9, 0.0, 0.6), vec3(1.5, 0.6, 1.2));
            error += (found - expected).abs();
            shadows += usize::from(expected < 0.5);
            count += 1;
            // Without an occluder, 16 points have the light of the lamp within 2 %.
            assert!(expected < 1.0 || found > 0.98, "{place}: {found} of an unoccluded lamp");
        }
    }
    let error = error / f64::from(count);
    println!("{count} texels, {shadows} in shadow: mean error {error:.4}");
    assert!(count > 500 && shadows > 10 && error < 0.01, "{error}");
}

#[test]
fn wrong_names_are_refused_before_the_work() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    checkered_room(Moving::Nothing).write(&folder.join("room.glb"));
    let fails = |extra: &str, words: &[&str]| assert_bake_fails(folder, extra, words);
    fails("--view room", &["room", ".html"]);
    fails("--view page.htm", &["page.htm", ".html"]);
    fails("--view none/page.html", &["none/page.html", "cannot be written", "--view"]);
    fails("--view page.html -o page.html", &["page.html", "another name"]);
    fails("--view page.html --baked room.slf", &["room.slf", "cannot be read"]);
    fails("--baked room.slf", &["--gltf", "--view"]);
    assert_eq!(tests::sorted_names(folder), ["room.glb"], "nothing is written");
    std::fs::write(folder.join("page.html"), "mine").unwrap();
    fails("--view page.html", &["page.html already exists", "--overwrite"]);
    assert_eq!(std::fs::read(folder.join("page.html")).unwrap(), b"mine");
}
