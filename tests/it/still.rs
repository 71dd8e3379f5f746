//! Single pictures, frames as pictures, and films of selected frames.

use glam::{Mat4, Vec3, vec2, vec3};
use laboratory::compare::png_file;
use plane::Plane;
use serde_json::Value;
use std::fs;
use std::path::Path;
use tests::{Ball, Finished, Glb, Moving, assert_fails, checkered_room, render, render2mpeg, sorted_names};

const SMALL: &str = "--size 48x32 --vpls 60";

fn folder_with_room(moving: Moving) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    checkered_room(moving).write(&folder.path().join("room.glb"));
    folder
}

/// Runs the command, which must succeed.
fn run(folder: &Path, words: &str) -> Finished {
    let finished = render2mpeg(folder, &words.split_whitespace().collect::<Vec<_>>());
    assert_eq!(finished.code, Some(0), "{words}: {}", finished.stderr);
    finished
}

fn png(path: &Path) -> Plane<[u8; 3]> {
    png_file::read(path).unwrap()
}

/// Mean difference of two pictures \[codes\].
fn difference(a: &Plane<[u8; 3]>, b: &Plane<[u8; 3]>) -> f64 {
    let (a, b) = (a.samples().as_flattened(), b.samples().as_flattened());
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(&a, &b)| f64::from(a.abs_diff(b))).sum::<f64>() / a.len() as f64
}

#[test]
fn a_still_is_the_frame_of_a_film() {
    let folder = folder_with_room(Moving::Camera);
    let folder = folder.path();
    run(folder, &format!("still room.glb {SMALL} --samples 1"));
    run(folder, &format!("still room.glb {SMALL} --samples 1 --frame 20 -o late.png"));
    render(
        folder,
        "film",
        &folder.join("room.glb"),
        &format!("{SMALL} --samples 1 --qscale 1 --frames 21 --png frames"),
    );
    let (first, late) = (png(&folder.join("frames/frame_00000.png")), png(&folder.join("frames/frame_00020.png")));
    assert!(difference(&png(&folder.join("room.png")), &first) < 0.01, "the first frame is lit alike");
    // A film's later frames reuse light of previous frames, and the exposure comes from a smaller picture.
    let apart = difference(&png(&folder.join("late.png")), &late);
    assert!(apart < 4.0 && difference(&first, &late) > 2.0 * apart, "{apart} of {}", difference(&first, &late));

    // Several frames have separate files.
    run(folder, &format!("still room.glb {SMALL} --samples 1 --frame 20,0 -o list.png"));
    for (one, of_list) in [("room.png", "list_00.png"), ("late.png", "list_20.png")] {
        assert!(fs::read(folder.join(one)).unwrap() == fs::read(folder.join(of_list)).unwrap(), "{of_list}");
    }

    // A reference picture agrees within its noise.
    run(folder, "reference room.glb --size 48x32 --spp 64 -o truth.png --quiet");
    let apart = difference(&png(&folder.join("truth.png")), &first);
    assert!(apart < 12.0, "{apart}");
}

#[test]
fn the_ending_of_a_picture_says_what_it_is() {
    let folder = folder_with_room(Moving::Nothing);
    let folder = folder.path();
    for (name, magic) in
        [("a.png", &b"\x89PNG"[..]), ("a.webp", b"RIFF"), ("a.jpg", b"\xff\xd8\xff"), ("a.exr", b"\x76\x2f\x31\x01")]
    {
        for command in ["still", "reference --spp 1"] {
            let words = format!("{command} room.glb --size 16x16 --vpls 20 -o {name} --overwrite");
            let told = run(folder, &words).stderr;
            assert!(told.contains(&format!("{name}: 16x16 pixels in ")), "{words}: {told}");
            assert_eq!(run(folder, &format!("{words} --quiet")).stderr, "");
            assert!(fs::read(folder.join(name)).unwrap().starts_with(magic), "{words}");
        }
    }
    assert!(image::open(folder.join("a.webp")).unwrap() == image::open(folder.join("a.png")).unwrap());
    for name in ["a.bmp", "a", "a.m2v"] {
        for command in ["still", "reference"] {
            assert_fails(folder, &[command, "room.glb", "-o", name], &[name, ".png", ".exr"]);
            assert!(!folder.join(name).exists());
        }
    }
    assert_fails(folder, &["still", "room.glb", "-o", "a.png"], &["a.png", "--overwrite"]);
}

#[test]
fn films_show_the_frames_that_are_wanted() {
    let folder = folder_with_room(Moving::Camera);
    let folder = folder.path();
    let film = |name: &str, words: &str| {
        let report =
            render(folder, name, &folder.join("room.glb"), &format!("{SMALL} --photons 3000 --exr {name} {words}"))
                .report;
        (report["summary"]["frames"].as_u64().unwrap(), sorted_names(&folder.join(name)).len())
    };
    // Frames 6, 8 and 10 of the scene equal the same frames of the whole film.
    assert_eq!(film("whole", "--frames 12"), (12, 12));
    assert_eq!(film("some", "--from 6 --to 11 --every 2"), (3, 3));
    let linear = |name: &str, frame: u32| {
        let picture =
            render_core::image_file::read_radiance(&folder.join(format!("{name}/frame_{frame:05}.exr"))).unwrap();
        let sum: f32 = picture.samples().iter().map(|rgb| rgb.element_sum()).sum();
        (picture, sum)
    };
    for (frame, of_whole) in [(0, 6), (1, 8), (2, 10)] {
        let ((a, sum), (b, _), (elsewhere, _)) =
            (linear("some", frame), linear("whole", of_whole), linear("whole", of_whole + 1));
        let apart = |a: &Plane<Vec3>, b: &Plane<Vec3>| -> f32 {
            a.samples().iter().zip(b.samples()).map(|(a, b)| (*a - *b).abs().element_sum()).sum()
        };
        assert!(apart(&a, &b) < 0.5 * apart(&a, &elsewhere) && apart(&a, &b) < 0.1 * sum, "{frame}");
    }
    assert_eq!(film("tail", "--from 90 --frames 2").0, 2);

    // Invalid ranges.
    for (words, word) in [
        ("--from 5 --to 3", "--from"),
        ("--from 100000", "--from"),
        ("--every 0", "--every"),
        ("--to 3 --frames 4", "--frames"),
    ] {
        let words = format!("render room.glb {words}");
        let refused = render2mpeg(folder, &words.split_whitespace().collect::<Vec<_>>());
        assert_eq!(refused.code, Some(2), "{words}: {}", refused.stderr);
        assert!(refused.stderr.contains(word), "{}", refused.stderr);
    }
}

#[test]
fn presets_fill_in_what_is_left_open() {
    let folder = folder_with_room(Moving::Nothing);
    let folder = folder.path();
    let printed = |words: &str| run(folder, &format!("render room.glb --print-config {words}")).stdout;
    for (words, lines) in [
        ("--preset draft", &["size = \"256x256\"", "qscale = 16", "samples = 1", "effort = \"fast\""][..]),
        ("--preset good", &["size = \"512x512\"", "qscale = 8", "samples = \"auto\""]),
        ("--preset final", &["size = \"1024x1024\"", "qscale = 4", "samples = 4", "effort = \"best\""]),
        ("--preset final --samples 2", &["samples = 2", "qscale = 4"]),
    ] {
        let text = printed(words);
        assert!(lines.iter().all(|line| text.contains(line)), "{words}: {text}");
    }
}

/// A transparent picture over the background of the opaque picture looks like the opaque picture.
#[test]
fn transparent_pictures_have_no_fringe() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let mut glb = Glb::default();
    glb.add_ball(
        Ball { center: vec3(0.0, 1.0, 0.0), radius: 1.0, columns: 24, rows: 12, half: false, inward: false },
        Vec3::new(0.8, 0.2, 0.1),
        Vec3::ZERO,
    );
    glb.write(&folder.join("ball.glb"));
    let size = "--size 64x64 -q";
    run(folder, &format!("still ball.glb {size} -o opaque.png"));
    run(folder, &format!("still ball.glb {size} -o clear.png --background transparent"));
    let opaque = png(&folder.join("opaque.png"));
    let clear = image::open(folder.join("clear.png")).unwrap().into_rgba8();
    let background = opaque.get(0, 0);
    let (mut solid, mut border, mut shadow) = (0, 0, 0);
    for y in 0..64 {
        for x in 0..64 {
            let [r, g, b, a] = clear.get_pixel(x, y).0;
            let opacity = f32::from(a) / 255.0;
            for ((color, back), shown) in [r, g, b].into_iter().zip(background).zip(opaque.get(x as usize, y as usize))
            {
                let over = opacity * f32::from(color) + (1.0 - opacity) * f32::from(back);
                assert!((over - f32::from(shown)).abs() <= 4.0, "({x}, {y}): {over} for {shown}");
            }
            // Partly transparent pixels next to the ball are borders; all others are shadow.
            let is_solid = |x: u32, y: u32| clear.get_pixel(x.min(63), y.min(63)).0[3] == 255;
            let is_border = is_solid(x + 1, y) || is_solid(x.saturating_sub(1), y) || is_solid(x, y + 1);
            solid += u32::from(a == 255);
            border += u32::from(is_border && a < 255);
            shadow += u32::from(!is_border && a > 8 && a < 255);
            assert!(a < 255 || r > g.saturating_add(20) || g < 40, "({x}, {y}): {r} {g} {b} is opaque");
        }
    }
    assert!(solid > 800 && border > 40 && shadow > 100, "{solid} solid, {border} at borders, {shadow} in shadow");
    assert_fails(folder, &["still", "ball.glb", "-o", "a.jpg", "--background", "transparent"], &["a.jpg", ".png"]);

    // WebP has the same pixels. Linear light with associated opacity, over its background, is the opaque light.
    run(folder, &format!("still ball.glb {size} -o clear.webp --background transparent"));
    assert!(image::open(folder.join("clear.webp")).unwrap().into_rgba8() == clear);
    run(folder, &format!("still ball.glb {size} -o opaque.exr"));
    run(folder, &format!("still ball.glb {size} -o clear.exr --background transparent"));
    let [opaque, clear] = ["opaque.exr", "clear.exr"].map(|name| {
        let layers = render_core::image_file::read_layers(&folder.join(name)).unwrap();
        ["R", "G", "B", "A"].map(|channel| layers.channel(channel).map(<[f32]>::to_vec))
    });
    assert_eq!(opaque[3], None);
    let opacity = clear[3].as_ref().unwrap();
    let covered = opacity.iter().filter(|&&opacity| opacity == 1.0).count();
    assert!(covered.abs_diff(solid as usize) < 40, "{covered} of {solid} pixels");
    assert_eq!(opacity[0], 0.0);
    for channel in 0..3 {
        let (opaque, clear) = (opaque[channel].as_ref().unwrap(), clear[channel].as_ref().unwrap());
        let background = opaque[0];
        for ((opaque, clear), opacity) in opaque.iter().zip(clear).zip(opacity) {
            let over = clear + (1.0 - opacity) * background;
            assert!((over - opaque).abs() < 0.03 * opaque.max(background), "{over} for {opaque}");
        }
    }
}

/// Points of one view, placed in the world by its depth and camera, are at the same depth in the other views that see
/// them.
#[test]
fn views_agree_with_their_cameras() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let mut glb = Glb::default();
    glb.add(
        &[[Vec3::ZERO, Vec3::Z, Vec3::X], [Vec3::ZERO, Vec3::Y, Vec3::Z], [Vec3::ZERO, Vec3::X, Vec3::Y]],
        Vec3::ONE,
        Vec3::ZERO,
    );
    glb.write(&folder.join("corner.glb"));
    run(folder, "views corner.glb --output views --count 8 --size 64x48 --aov depth,normal -q");
    let table: Value = serde_json::from_slice(&fs::read(folder.join("views/transforms.json")).unwrap()).unwrap();
    let number = |name: &str| table[name].as_f64().unwrap() as f32;
    let (focal, center) = (number("fl_x"), vec2(number("cx"), number("cy")));
    assert!((2.0 * (32.0 / focal).atan() - number("camera_angle_x")).abs() < 1e-5);
    let frames = table["frames"].as_array().unwrap();
    assert_eq!(frames.len(), 8);
    // Read the cameras and channels with other code than the program's.
    let mut views = Vec::new();
    for frame in frames {
        let rows: Vec<Vec<f32>> = serde_json::from_value(frame["transform_matrix"].clone()).unwrap();
        let world = Mat4::from_cols_array_2d(&std::array::from_fn(|c| std::array::from_fn(|r| rows[r][c])));
        let path = folder.join("views").join(frame["channels_path"].as_str().unwrap());
        let layers = render_core::image_file::read_layers(&path).unwrap();
        assert!(folder.join("views").join(frame["file_path"].as_str().unwrap()).exists());
        views.push((world, layers));
    }
    let channel = |k: usize, name: &str| -> Vec<f32> { views[k].1.channel(name).unwrap().to_vec() };
    let (mut close, mut normals) = (0, 0);
    for (k, (world, _)) in views.iter().enumerate() {
        let depth = channel(k, "depth.Z");
        let axes = ["normal.X", "normal.Y", "normal.Z"].map(|name| channel(k, name));
        for (index, &z) in depth.iter().enumerate().filter(|(_, z)| z.is_finite()) {
            let at = vec2((index % 64) as f32 + 0.5, (index / 64) as f32 + 0.5) - center;
            let point = world.transform_point3(vec3(at.x / focal * z, -at.y / focal * z, -z));
            // The three squares are in the planes of the axes, with an axis as normal.
            let normal = Vec3::from_array(std::array::from_fn(|c| axes[c][index]));
            let inside = point.max_element() < 1.001 && point.min_element() > -1e-3;
            if !inside {
                continue;
            }
            close += 1;
            let off = point.abs().min_element() * focal / z;
            assert!(off < 0.5, "view {k}: {point} is {off} pixels off its plane");
            normals += u32::from((normal.abs().max_element() - 1.0).abs() < 1e-3 && point.dot(normal).abs() < 1e-3);
        }
    }
    assert!(close > 2000 && normals > close * 95 / 100, "{normals} normals of {close} points");
}

/// Options for background and camera that cannot have their effect are refused, with a remedy.
#[test]
fn contradicting_views_are_refused() {
    let folder = folder_with_room(Moving::Camera);
    let folder = folder.path();
    for (words, remedy) in [
        ("render room.glb --background transparent", "only still and views"),
        ("still room.glb --background white", "--set exposure=1"),
        ("still room.glb --camera 0 --orbit 30,70", "drop one"),
        ("turntable room.glb --camera 0", "drop one"),
    ] {
        assert_fails(folder, &words.split(' ').collect::<Vec<_>>(), &[remedy]);
    }
    // A fixed exposure makes the color exact, for any tone curve.
    for curve in ["srgb", "filmic"] {
        let words = "still room.glb --background #204060 --set exposure=2 --orbit 0,90,100 --overwrite -o a.png";
        run(folder, &format!("{words} {SMALL} --set operator={curve}"));
        let shown = png(&folder.join("a.png")).get(0, 0);
        assert!(
            shown.iter().zip([0x20, 0x40, 0x60]).all(|(&a, b): (&u8, u8)| a.abs_diff(b) <= 1),
            "{curve}: {shown:?}"
        );
    }
}

/// The exposure of a transparent picture follows from its surfaces, not from the removed background.
#[test]
fn removed_backgrounds_do_not_set_the_exposure() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let mean = |emission: f32| {
        let mut glb = Glb::default();
        let ball = Ball { center: Vec3::ZERO, radius: 1.0, columns: 24, rows: 12, half: false, inward: false };
        glb.add_ball(ball, Vec3::splat(0.5), Vec3::ZERO);
        glb.add(&[[vec3(-3.0, 4.0, -3.0), Vec3::X * 6.0, Vec3::Z * 6.0]], Vec3::ZERO, Vec3::splat(emission));
        glb.write(&folder.join("ball.glb"));
        run(folder, "still ball.glb --size 96x64 -o a.png --overwrite --background transparent");
        let picture = image::open(folder.join("a.png")).unwrap().into_rgba8();
        let solid: Vec<f64> = picture.pixels().filter(|p| p.0[3] == 255).map(|p| f64::from(p.0[1])).collect();
        assert!(solid.len() > 20, "{} pixels", solid.len());
        solid.iter().sum::<f64>() / solid.len() as f64
    };
    let (bright, dim) = (mean(20_000.0), mean(20.0));
    assert!((bright - dim).abs() < 4.0, "{bright} and {dim} codes");
}
