//! Tools required by `RENDER2MPEG_REQUIRE` are installed.

use std::process::Command;
use tests::need;

/// Crates compare AVX2 kernels with scalar code. A machine without AVX2 would compare scalar code with itself.
#[test]
fn the_processor_has_what_vector_code_is_tested_with() {
    #[cfg(target_arch = "x86_64")]
    let found = [
        is_x86_feature_detected!("avx2"),
        is_x86_feature_detected!("bmi1"),
        is_x86_feature_detected!("lzcnt"),
        is_x86_feature_detected!("popcnt"),
    ]
    .iter()
    .all(|&found| found);
    #[cfg(not(target_arch = "x86_64"))]
    let found = false;
    need("avx2", found.then_some(()));
}

#[test]
fn decoders_are_there() {
    for (decoder, question) in [("ffmpeg", "-version"), ("mpeg2dec", "--help")] {
        need(decoder, Command::new(decoder).arg(question).output().ok());
    }
}

/// A missing tool is a failure only if it is required.
#[test]
fn only_what_is_required_must_be_there() {
    assert_eq!(need("no-such-tool", Some(3)), Some(3));
    assert_eq!(need::<()>("no-such-tool", None), None);
    let child = Command::new(std::env::current_exe().unwrap())
        .args(["--exact", "tools::only_what_is_required_must_be_there", "--nocapture"])
        .env("RENDER2MPEG_REQUIRE", "ffmpeg, no-such-tool")
        .output()
        .unwrap();
    // The child must fail at the line above; without the variable, this test would start itself forever.
    let said = String::from_utf8_lossy(&child.stderr);
    assert!(!child.status.success() && said.contains("no-such-tool is missing"), "{said}");
}
