//! Importance maps of edges, costs and files.

use super::importance::{WATCHED, film, room};
use png::ColorType;
use render_core::image_file::{read_layers, write_layers};
use std::fs;
use std::path::Path;
use tests::{assert_fails, render2mpeg};

/// Returns a channel of frame `index` of the film whose frames are in `frames`.
fn channel(folder: &Path, frames: &str, index: u32, name: &str) -> Vec<f32> {
    let layers = read_layers(&folder.join(format!("{frames}/frame_{index:05}.exr"))).unwrap();
    layers.channel(name).unwrap_or_else(|| panic!("{name} is missing")).to_vec()
}

/// Writes an 8-bit picture of `size` = (width, height).
fn write_png(path: &Path, size: (u32, u32), color: ColorType, codes: &[u8]) {
    fs::create_dir_all(path.parent().expect("a folder")).unwrap();
    let mut encoder = png::Encoder::new(fs::File::create(path).unwrap(), size.0, size.1);
    encoder.set_color(color);
    encoder.write_header().unwrap().write_image_data(codes).unwrap();
}

const WITH_MAP: &str = "--exr-depth float --aov importance";

/// A film with the maps of another film has the same pictures from the frame on where both maps exist before the light.
#[test]
fn maps_of_a_film_are_read_again() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    room(folder, WATCHED);
    let task = film(folder, "task", &format!("--importance task:1 --exr maps {WITH_MAP}"));
    let again = film(folder, "again", "--importance map:maps");
    assert!(task.stream == again.stream, "the maps differ");
    let half = film(folder, "half", "--importance map:0.5:maps --exr half --aov importance");
    assert!(half.stream != again.stream && half.figures(&["importance_mean"])[3] > 0.0);
    for (half, whole) in
        channel(folder, "half", 4, "importance.V").iter().zip(channel(folder, "maps", 4, "importance.V"))
    {
        assert!((half - 0.5 * whole).abs() < 1e-3);
    }
}

/// One gray picture of another size holds for all frames.
#[test]
fn one_picture_suffices() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    room(folder, WATCHED);
    let left: Vec<u8> = (0..300 * 200).map(|at| if at % 300 < 150 { 255 } else { 0 }).collect();
    write_png(&folder.join("gaze/heat.png"), (300, 200), ColorType::Grayscale, &left);
    film(folder, "film", "--importance map:gaze --exr frames --aov importance");
    for (index, count) in channel(folder, "frames", 2, "importance.N").iter().enumerate() {
        assert_eq!(*count, if index % 96 < 48 { 5.0 } else { 1.0 }, "pixel {index}");
    }
    // Ranges of the film, joined, are the same film.
    let whole = film(folder, "whole", "--importance map:gaze --chunk 3");
    film(folder, "first", "--importance map:gaze --range 0-2");
    film(folder, "second", "--importance map:gaze --range 3-4");
    let joined = render2mpeg(folder, &["join", "--quiet", "-o", "joined.m2v", "first.m2v", "second.m2v"]);
    assert_eq!((joined.code, joined.stderr.as_str()), (Some(0), ""));
    assert!(whole.stream == fs::read(folder.join("joined.m2v")).unwrap(), "ranges differ");
}

/// Edges have more samples than faces; costs sum up the lightcuts of the previous frame.
#[test]
fn edges_and_costs_are_maps() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    room(folder, WATCHED);
    for maps in ["edges:1", "cost:1"] {
        let made = film(folder, "film", &format!("--importance {maps} --exr frames --aov importance,cut-size,normal"));
        let mean = made.figures(&["importance_mean"]);
        assert!(mean.iter().all(|mean| (0.01..0.9).contains(mean)), "{maps}: {mean:?}");
        let two = film(folder, "two", &format!("--importance {maps} --threads 2"));
        assert!(made.stream == two.stream, "{maps}: two threads make another film");
    }
    // Compare the costs with the sizes of lightcuts in the previous frame, summed by macroblock.
    let sums = |index| {
        let sizes = channel(folder, "frames", index, "cut.size");
        let mut sums = [0.0f32; 6 * 4];
        sizes.iter().enumerate().for_each(|(at, size)| sums[at / 96 / 16 * 6 + at % 96 / 16] += size);
        sums
    };
    let (before, costs) = (sums(2), channel(folder, "frames", 3, "importance.V"));
    let most = before.iter().copied().fold(0.0, f32::max);
    for (at, cost) in costs.iter().enumerate() {
        let expected = before[at / 96 / 16 * 6 + at % 96 / 16] / most;
        assert!((cost - expected).abs() < 1e-3, "pixel {at}: {cost} for {expected}");
    }
}

#[test]
fn unusable_maps_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    room(folder, WATCHED);
    let gray = |name: &str, width: u32, height: u32| {
        let codes = vec![0; (width * height) as usize];
        write_png(&folder.join(name), (width, height), ColorType::Grayscale, &codes);
    };
    fs::create_dir(folder.join("empty")).unwrap();
    for frame in [0, 1, 3, 4] {
        gray(&format!("gap/map_{frame}.png"), 96, 64);
    }
    gray("square/a.png", 64, 64);
    gray("named/left.png", 96, 64);
    gray("named/right.png", 96, 64);
    write_png(&folder.join("colors/heat.png"), (96, 64), ColorType::Rgb, &[255, 0, 40].repeat(96 * 64));
    fs::create_dir(folder.join("counts")).unwrap();
    write_layers(&folder.join("counts/a.exr"), 96, 64, vec![("Y".into(), vec![3.0; 96 * 64])]).unwrap();
    fs::create_dir(folder.join("broken")).unwrap();
    fs::write(folder.join("broken/a.png"), b"no picture").unwrap();

    let words: [(&str, &[&str]); 9] = [
        ("map:nowhere", &["nowhere", "folder of importance maps"]),
        ("map:empty", &["empty", "no .png or .exr"]),
        ("map:gap", &["gap", "frame 2", "counted from 0"]),
        ("map:square", &["a.png", "64x64", "96x64"]),
        ("map:named", &["left.png", "end in the frame number"]),
        ("map:colors", &["heat.png", "colors", "gray"]),
        ("map:counts", &["a.exr", "3", "maximum"]),
        ("map:broken", &["a.png"]),
        ("cost:1", &["--importance cost", "--lighting"]),
    ];
    for (maps, words) in words {
        let option = format!("--importance={maps}");
        let mut arguments = vec!["render", "room.glb", &option, "--size=96x64", "--frames=5"];
        if maps == "cost:1" {
            arguments.push("--lighting=all-lights");
        }
        assert_fails(folder, &arguments, words);
    }
}
