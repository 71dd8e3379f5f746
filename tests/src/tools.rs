//! Tools that a test can be left out without, unless `RENDER2MPEG_REQUIRE` names them.

/// A comma-separated list of tools that have to be there, such as `ffmpeg,mpeg2dec,avx2`.
const VARIABLE: &str = "RENDER2MPEG_REQUIRE";

/// Whether the test that calls this has to fail without `tool`.
pub fn is_required(tool: &str) -> bool {
    std::env::var(VARIABLE).is_ok_and(|list| list.split(',').any(|name| name.trim() == tool))
}

/// Returns what was `found`. Where that is nothing, prints that a check is left out.
///
/// Names in use: `ffmpeg`, `mpeg2dec`, `avx2`, `mitsuba`, `chromium`, `openjd`, `mpirun`, `shared-scenes`, and of ffmpeg's encoders `libx264`, `libsvtav1`, `libvpx-vp9`. The decoders are needed in any case.
///
/// # Panics
/// If nothing was found and `RENDER2MPEG_REQUIRE` names the tool.
pub fn need<T>(tool: &str, found: Option<T>) -> Option<T> {
    if found.is_none() {
        assert!(!is_required(tool), "{tool} is missing, and {VARIABLE} names it");
        println!("left out: {tool} is missing");
    }
    found
}
