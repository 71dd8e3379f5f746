//! Pictures and videos to compare.
//!
//! The first byte selects the format.
#![no_main]

use libfuzzer_sys::fuzz_target;
use laboratory::compare::compare_paths;
use std::sync::OnceLock;

fuzz_target!(|data: &[u8]| {
    static FOLDER: OnceLock<tempfile::TempDir> = OnceLock::new();
    let folder = FOLDER.get_or_init(|| tempfile::tempdir().expect("a folder"));
    let Some((&kind, bytes)) = data.split_first() else { return };
    let ending = ["y4m", "png", "exr", "hdr"][usize::from(kind % 4)];
    let path = folder.path().join(format!("picture.{ending}"));
    std::fs::write(&path, bytes).expect("a file");
    if ending == "hdr" {
        let _ = render_core::image_file::read_radiance(&path);
    } else {
        let _ = compare_paths(&path, &path, None, |_, _| ());
    }
});
