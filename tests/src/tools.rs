//! Optional tools: a test without its tool is skipped, unless `RENDER2MPEG_REQUIRE` lists the tool.

/// Variable with a comma-separated list of required tools, such as `ffmpeg,mpeg2dec,avx2`.
const VARIABLE: &str = "RENDER2MPEG_REQUIRE";

/// Returns whether the calling test must fail without `tool`.
pub fn is_required(tool: &str) -> bool {
    std::env::var(VARIABLE).is_ok_and(|list| list.split(',').any(|name| name.trim() == tool))
}

/// Returns `found`. If it is `None`, prints that a check is skipped.
///
/// Names in use: `ffmpeg`, `mpeg2dec`, `avx2`, `mitsuba`, `chromium`, `openjd`, `mpirun`, `shared-scenes`, and ffmpeg's
/// encoders `libx264`, `libsvtav1`, `libvpx-vp9`. The decoders are always required.
///
/// # Panics
/// If the tool is missing and `RENDER2MPEG_REQUIRE` lists it.
pub fn need<T>(tool: &str, found: Option<T>) -> Option<T> {
    if found.is_none() {
        assert!(!is_required(tool), "{tool} is missing, and {VARIABLE} names it");
        println!("left out: {tool} is missing");
    }
    found
}
