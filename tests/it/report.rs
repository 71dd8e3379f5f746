//! Figures of the report that a test can verify.

use boon::{Compiler, Schemas};
use serde_json::Value;
use std::fs;
use std::path::Path;
use tests::{cornell, render, render2mpeg};

#[test]
fn figures_are_those_of_the_stream_and_the_process() {
    let folder = tempfile::tempdir().unwrap();
    let film = render(folder.path(), "film", &cornell(), "--size 64x48 --frames 8 --gop 4 --qscale 10 --threads 2");
    let (report, summary) = (&film.report, &film.report["summary"]);
    assert_eq!(report["schema"], 1);
    assert_eq!((&summary["frames"], &summary["interrupted"]), (&8.into(), &false.into()));

    // The stream contains all reported bits; only sequence_end_code follows the last picture.
    let bits: f64 = film.figures(&["bits"]).iter().sum();
    assert_eq!(bits, 8.0 * (film.stream.len() as f64 - 4.0));
    assert_eq!(summary["bits_total"].as_f64(), Some(bits));
    let types: Vec<&str> =
        report["frames"].as_array().unwrap().iter().map(|frame| frame["picture_type"].as_str().unwrap()).collect();
    assert_eq!(types.concat(), "IPPPIPPP");
    assert_eq!(film.figures(&["index"]), [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]);
    assert!(film.figures(&["qscale"]).iter().all(|&scale| scale == 10.0));
    assert!(film.figures(&["non_finite_pixels"]).iter().all(|&count| count == 0.0));

    // Every stage that runs takes time; the sum is the total.
    let names = ["update", "photons", "tree", "visibility", "direct", "indirect", "tone_map", "encode", "thresholds"];
    let frames = report["frames"].as_array().unwrap();
    let anchors: Vec<f64> = frames.iter().map(|frame| frame["seconds"]["anchors"].as_f64().unwrap()).collect();
    assert!(anchors[0] > 0.0 && anchors[1..].iter().all(|&seconds| seconds == 0.0), "{anchors:?}");
    for (index, frame) in report["frames"].as_array().unwrap().iter().enumerate() {
        let seconds = |name: &str| frame["seconds"][name].as_f64().unwrap_or_else(|| panic!("no seconds of {name}"));
        let sum = anchors[index] + names.iter().map(|name| seconds(name)).sum::<f64>();
        assert!((sum - seconds("total")).abs() < 1e-9 && sum > 0.0, "frame {index}");
        assert!(names.iter().all(|name| seconds(name) > 0.0), "frame {index}: {}", frame["seconds"]);
    }
    let [wall, cpu] = ["wall_seconds", "cpu_seconds"].map(|name| summary[name].as_f64().unwrap());
    assert!(wall > 0.0 && cpu > 0.0 && cpu < 4.0 * wall, "{cpu} s of CPU in {wall} s by the clock, on two threads");
}

#[test]
#[cfg(target_os = "linux")]
fn peak_memory_is_plausible() {
    let folder = tempfile::tempdir().unwrap();
    let peak = |size: &str| {
        let film =
            render(folder.path(), size, &cornell(), &format!("--size {size} --frames 2 --vpls 50 --photons 1000"));
        film.report["summary"]["peak_memory_bytes"].as_f64().expect("Linux tells")
    };
    let (small, large) = (peak("32x32"), peak("512x512"));
    println!("peak memory: {small:.3e} bytes for 32x32, {large:.3e} for 512x512");
    // The program itself takes a few megabytes, and each of several linear frames of 512×512 takes three.
    assert!(small > 3e6 && small < 500e6, "{small}");
    assert!(large > small + 3e6 && large < 2e9, "{large} after {small}");
}

/// The schema in this file of docs/reference, as a check of values: none if the value fits, else the faults.
fn schema(name: &str) -> impl Fn(&Value) -> Option<String> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/reference").join(name);
    let text = fs::read(path).expect("a schema");
    let (mut schemas, mut compiler) = (Schemas::new(), Compiler::new());
    compiler.add_resource(name, serde_json::from_slice(&text).unwrap()).unwrap();
    let index = compiler.compile(name, &mut schemas).unwrap();
    move |value| schemas.validate(value, index).err().map(|error| error.to_string())
}

#[test]
fn schemas_are_those_of_the_program() {
    for (name, schema) in
        [("report.schema.json", program::report_schema()), ("progress.schema.json", program::progress_schema())]
    {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/reference").join(name);
        let stored: Value = serde_json::from_slice(&fs::read(path).unwrap()).unwrap();
        assert!(
            stored == *schema.as_value(),
            "write docs/reference again: cargo run -p render2mpeg-cli --example reference"
        );
    }
}

#[test]
fn reports_and_progress_fit_their_schemas() {
    let folder = tempfile::tempdir().unwrap();
    let scene = cornell();
    let mut arguments = vec!["render", scene.to_str().unwrap(), "-o", "film.m2v", "--progress", "json"];
    arguments.extend("--size 64x48 --frames 3 --vpls 60 --importance saliency:1 --stopping calibrated".split(' '));
    let film = render2mpeg(folder.path(), &arguments);
    assert_eq!(film.code, Some(0), "{}", film.stderr);

    // A report that lacks a key, or has one of another type, does not fit.
    let fits = schema("report.schema.json");
    let report: Value = serde_json::from_slice(&fs::read(folder.path().join("film.report.json")).unwrap()).unwrap();
    assert_eq!(fits(&report), None);
    let mut broken = report.clone();
    broken["frames"][1].as_object_mut().unwrap().remove("shadow_rays");
    assert!(fits(&broken).is_some_and(|fault| fault.contains("shadow_rays")));
    let mut broken = report;
    broken["summary"]["bits_total"] = "many".into();
    assert!(fits(&broken).is_some_and(|fault| fault.contains("bits_total")));

    let fits = schema("progress.schema.json");
    let lines: Vec<Value> = film.stdout.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(lines.len(), 5, "begin, three frames, end");
    assert_eq!(lines.iter().find_map(&fits), None);
    assert!(fits(&serde_json::json!({ "event": "pause" })).is_some());
}
