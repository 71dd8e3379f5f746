//! `render2mpeg compare` reads MPEG-1 and MPEG-2 videos without ffmpeg, with the figures of ffmpeg's pictures.

use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::Command;
use tests::{assert_fails, program};

/// Runs ffmpeg in a folder.
fn ffmpeg(folder: &Path, arguments: &str) {
    let words = arguments.split_whitespace();
    let output = Command::new("ffmpeg").args(["-nostdin", "-v", "error"]).args(words).current_dir(folder).output();
    let output = output.expect("ffmpeg starts");
    assert!(output.status.success(), "{arguments}: {}", String::from_utf8_lossy(&output.stderr));
}

/// Source of all videos: a moving pattern of six pictures.
fn source(size: &str) -> String {
    format!("-f lavfi -i testsrc2=s={size}:r=25:d=0.24")
}

/// Compares a video with `reference.y4m`, in an environment without other programs if `is_alone`.
fn compare(folder: &Path, video: &str, is_alone: bool) -> Value {
    let mut command = Command::new(program());
    command.args(["compare", video, "reference.y4m", "--json"]).current_dir(folder);
    if is_alone {
        command.env("PATH", "");
    }
    let output = command.output().expect("render2mpeg starts");
    let messages = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && messages.is_empty(), "{video}: {messages}");
    serde_json::from_slice(&output.stdout).expect("JSON")
}

/// Checks that the figures of two comparisons agree, for six pictures.
fn assert_agree(found: &Value, expected: &Value, name: &str) {
    let frames = [found, expected].map(|value| value["frames"].as_array().expect("frames").clone());
    assert_eq!((frames[0].len(), frames[1].len()), (6, 6), "{name}");
    for (a, b) in frames[0].iter().zip(&frames[1]) {
        let number = |value: &Value, figure: &str| value[figure].as_f64().expect("a number");
        // A difference of 1 in 2 % of the samples, and other rounding of colors.
        assert!((number(a, "psnr_y") - number(b, "psnr_y")).abs() < 0.1, "{name}: {a} {b}");
        assert!((number(a, "ssim") - number(b, "ssim")).abs() < 0.002, "{name}: {a} {b}");
        assert!((number(a, "rmse") / number(b, "rmse") - 1.0).abs() < 0.02, "{name}: {a} {b}");
        assert!((number(a, "mean_ratio") - number(b, "mean_ratio")).abs() < 0.005, "{name}: {a} {b}");
    }
}

#[test]
fn figures_equal_those_of_pictures_by_ffmpeg() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let mpeg2 = "-c:v mpeg2video -bf 2 -g 4 -q:v 6";
    let rec709 = "-colorspace bt709 -color_primaries bt709 -color_trc bt709";
    for (name, size, options) in [
        ("film.m2v", "64x48", format!("{mpeg2} -pix_fmt yuv420p")),
        ("old.m1v", "64x48", "-c:v mpeg1video -bf 2 -g 4 -q:v 6 -pix_fmt yuv420p".into()),
        ("odd.mpg", "61x43", format!("{mpeg2} -pix_fmt yuv420p {rec709}")),
        ("fields.vob", "64x64", format!("{mpeg2} -pix_fmt yuv420p -flags +ildct+ilme {rec709}")),
        ("wide.mpeg", "64x48", format!("{mpeg2} -pix_fmt yuv420p -aspect 16:9 {rec709}")),
        ("studio.ts", "64x48", format!("{mpeg2} -pix_fmt yuv422p {rec709}")),
    ] {
        // ffmpeg decodes the same pictures from Matroska.
        ffmpeg(folder, &format!("-y {} {options} film.mkv", source(size)));
        ffmpeg(folder, &format!("-y {} -pix_fmt yuv420p reference.y4m", source(size)));
        let ending = name.split_once('.').unwrap().1;
        let format = match ending {
            "m2v" => "-f mpeg2video",
            "m1v" => "-f mpeg1video",
            "vob" => "-f vob",
            _ => "",
        };
        ffmpeg(folder, &format!("-i film.mkv -c copy {format} {name}"));
        let found = compare(folder, name, true);
        // Without a stated matrix, both routes use BT.601, which .y4m files keep. ffmpeg converts chroma of Matroska files.
        let is_stated = options.contains("bt709");
        if !is_stated {
            ffmpeg(folder, "-y -i film.mkv -fps_mode passthrough -pix_fmt yuv420p film.y4m");
        }
        let expected = compare(folder, if is_stated { "film.mkv" } else { "film.y4m" }, false);
        assert_agree(&found, &expected, name);
        // The contents of a file determine its format, and sequence_end_code may be missing.
        if name == "studio.ts" {
            fs::copy(folder.join(name), folder.join("renamed.mpg")).unwrap();
            assert_eq!(compare(folder, "renamed.mpg", true), found);
        }
        if name == "film.m2v" {
            let mut stream = fs::read(folder.join(name)).unwrap();
            assert!(!stream.ends_with(&[0, 0, 1, 0xb7]), "Matroska omits sequence_end_code");
            stream.extend([0, 0, 1, 0xb7]);
            fs::write(folder.join("ended.m2v"), stream).unwrap();
            assert_eq!(compare(folder, "ended.m2v", true), found);
        }
    }
    // ffmpeg decodes other codecs in the same containers.
    ffmpeg(folder, &format!("-y {} -c:v mpeg4 -q:v 6 other.ts", source("64x48")));
    assert_eq!(compare(folder, "other.ts", false)["frames"].as_array().unwrap().len(), 6);
}

/// Returns the offsets of a start code.
fn offsets(stream: &[u8], code: u8) -> Vec<usize> {
    (0..stream.len() - 3).filter(|&i| stream[i..i + 4] == [0, 0, 1, code]).collect()
}

#[test]
fn incomplete_videos_have_no_figures() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let options = "-c:v mpeg2video -bf 2 -g 3 -q:v 6 -pix_fmt yuv420p";
    ffmpeg(folder, &format!("{} -pix_fmt yuv420p reference.y4m", source("64x48")));
    ffmpeg(folder, &format!("{} {options} film.m2v", source("64x48")));
    ffmpeg(folder, &format!("{} {options} film.ts", source("64x48")));
    ffmpeg(folder, &format!("{} {options} small.m2v", source("48x48")));
    ffmpeg(folder, "-f lavfi -i sine=d=0.2 -c:a mp2 -f mpeg sound.mpg");
    let [film, small, packets] = ["film.m2v", "small.m2v", "film.ts"].map(|name| fs::read(folder.join(name)).unwrap());
    let pictures = offsets(&film, 0);
    let (group, last) = (offsets(&film, 0xb8)[0], pictures[5]);

    // The second slice of the third coded picture, which is frame 1, without its data.
    let slice = pictures[2] + offsets(&film[pictures[2]..], 2)[0];
    let end = slice + offsets(&film[slice..], 3)[0];
    // Every transport packet whose PID is 256, ffmpeg's first one, has video.
    let video: Vec<usize> = (0..packets.len() / 188).filter(|n| packets[188 * n + 1] & 31 == 1).collect();
    let lost = 188 * video[video.len() / 2];
    for (name, bytes, words) in [
        ("empty.m2v", Vec::new(), &["the file is empty", "render the film again"][..]),
        (
            "no_i.m2v",
            [&film[..group], &film[pictures[1]..]].concat(),
            &["before byte", "not in the file", "closed group"],
        ),
        ("headless.m2v", film[pictures[1]..].to_vec(), &["before byte", "not in the file"]),
        ("damaged.m2v", [&film[..slice + 4], &film[end..]].concat(), &["frame 1 is damaged, before byte"]),
        (
            "cut.m2v",
            film[..(last + film.len()) / 2].to_vec(),
            &["is damaged or truncated at the end of the file", "copy or render"],
        ),
        ("header.m2v", film[..last + 12].to_vec(), &["the last picture has no data", "truncated"]),
        ("lost.ts", [&packets[..lost], &packets[lost + 188..]].concat(), &["a packet is missing before byte"]),
        ("sizes.m2v", [&film[..], &small].concat(), &["frame 6 has 48x48 pixels, but frame 0 has 64x48"]),
        ("noise.mpg", vec![0x55; 5000], &["no video in this file", "name a film"]),
        ("sound.mpg", fs::read(folder.join("sound.mpg")).unwrap(), &["no video in this file", "name a film"]),
    ] {
        fs::write(folder.join(name), bytes).unwrap();
        assert_fails(folder, &["compare", name, "reference.y4m", "--json"], &[&[name], words].concat());
    }

    // Without ffmpeg, other codecs cannot be decoded.
    let mut alone = Command::new(program());
    alone.args(["compare", "sound.mpg", "reference.y4m"]).current_dir(folder).env("PATH", "");
    let messages = String::from_utf8(alone.output().expect("render2mpeg starts").stderr).unwrap();
    assert!(messages.lines().count() == 1 && messages.contains("install ffmpeg for other codecs"), "{messages}");
}
