//! The WebAssembly module of the npm folder: its size, its pictures, and its build.

use crate::{
    common::{decoded, encoded, raw, temporary},
    random,
};
use std::{fs, path::Path, process::Command};

/// Compiler that built the committed module.
const RUSTC: &str = "rustc 1.95.0";
/// Maximum size of the module in bytes.
const SIZE_MAX: u64 = 80_000;

fn folder() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

#[test]
fn the_module_is_small() {
    let size = fs::metadata(folder().join("npm/mpeg2dec.wasm")).expect("a module").len();
    assert!(size <= SIZE_MAX, "{size} bytes");
    let script = fs::read_to_string(folder().join("npm/mpeg2dec.js")).expect("a script");
    assert!(script.lines().count() <= 200);
}

/// FNV-1a checksum.
fn checksum(bytes: &[u8]) -> u32 {
    bytes.iter().fold(0x811c_9dc5, |sum, &byte| (sum ^ u32::from(byte)).wrapping_mul(0x0100_0193))
}

#[test]
fn the_module_decodes_the_same_pictures() {
    let video = "-pix_fmt yuv420p -c:v mpeg2video -bf 2 -q:v 4 -flags +ildct+ilme -c:a mp2";
    let mut streams = vec![encoded("174x98", "ts", video), encoded("96x64", "mpg", &format!("{video} -f mpeg"))];
    streams.extend(random::streams(2));
    for stream in streams {
        let path = temporary("stream");
        fs::write(&path, &stream).expect("a file");
        let output = match Command::new("node").arg(folder().join("npm/checksums.mjs")).arg(&path).output() {
            Ok(output) => output,
            Err(error) => return eprintln!("NOT TESTED: node cannot be run ({error}): apt-get install nodejs"),
        };
        fs::remove_file(path).expect("a temporary file");
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let text = String::from_utf8(output.stdout).expect("text");
        let found: Vec<&str> = text.lines().map(|line| &line[..8]).collect();
        let pictures = decoded(&stream, 1000).pictures;
        let expected: Vec<String> = pictures.iter().map(|picture| format!("{:08x}", checksum(&raw(picture)))).collect();
        assert_eq!(found, expected);
    }
}

#[test]
fn the_module_is_up_to_date() {
    let version = Command::new("rustc").arg("--version").output().expect("a compiler");
    let version = String::from_utf8_lossy(&version.stdout).into_owned();
    let sysroot = Command::new("rustc").args(["--print", "sysroot"]).output().expect("a compiler");
    let sysroot = String::from_utf8_lossy(&sysroot.stdout).into_owned();
    let target = Path::new(sysroot.trim()).join("lib/rustlib/wasm32-unknown-unknown");
    if !version.starts_with(RUSTC) || !target.exists() {
        return eprintln!("NOT TESTED: the module was built with {RUSTC} and its wasm32-unknown-unknown target");
    }
    let path = temporary("wasm");
    let target = Path::new(env!("CARGO_TARGET_TMPDIR")).join("wasm");
    let build = Command::new("sh").arg(folder().join("wasm/build")).arg(&path).env("CARGO_TARGET_DIR", target).output();
    let build = build.expect("a shell");
    assert!(build.status.success(), "{}", String::from_utf8_lossy(&build.stderr));
    let (built, committed) = (fs::read(&path), fs::read(folder().join("npm/mpeg2dec.wasm")));
    fs::remove_file(path).expect("a temporary file");
    assert!(built.expect("a module") == committed.expect("a module"), "run mpeg2dec/wasm/build");
}
