//! Measures the CPU seconds of loading scenes, each scene three times:
//! `cargo run --release -p render2mpeg-render-core --example load_time -- FILE.glb …`.

use render_core::scene;
use rustix::time::{ClockId, clock_gettime};
use std::path::PathBuf;

/// Returns the CPU time of this process \[s\].
fn cpu() -> f64 {
    let time = clock_gettime(ClockId::ProcessCPUTime);
    time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
}

fn main() {
    for path in std::env::args().skip(1).map(PathBuf::from) {
        let mut seconds = Vec::new();
        let mut triangles = 0;
        for _ in 0..3 {
            let begin = cpu();
            let scene = scene::load(&path).unwrap_or_else(|error| panic!("{error}"));
            seconds.push(format!("{:.3}", cpu() - begin));
            triangles = scene.triangle_count();
        }
        println!("{}: {triangles} triangles, {} s", path.display(), seconds.join(" "));
    }
}
