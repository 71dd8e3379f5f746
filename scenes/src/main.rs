//! Writes the shipped scenes: `make-scenes [OUTPUT_DIR]`.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

fn write(folder: &Path) -> std::io::Result<()> {
    for shipped in scenes::SCENES {
        let scene = (shipped.build)();
        let glb = scene.to_glb();
        let folder = folder.join(shipped.name);
        std::fs::create_dir_all(&folder)?;
        std::fs::write(folder.join(format!("{}.glb", shipped.name)), &glb)?;
        let settings = shipped.settings.to_toml();
        std::fs::write(folder.join(format!("{}.toml", shipped.name)), settings)?;
        println!("{:12} {:7} triangles {:8} bytes", shipped.name, scene.triangles(), glb.len());
    }
    Ok(())
}

fn main() -> ExitCode {
    let mut arguments = std::env::args_os().skip(1);
    let folder = arguments.next().map_or_else(|| env!("CARGO_MANIFEST_DIR").into(), PathBuf::from);
    if arguments.next().is_some() {
        eprintln!("usage: make-scenes [OUTPUT_DIR]");
        return ExitCode::FAILURE;
    }
    match write(&folder) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{}: {error}", folder.display());
            ExitCode::FAILURE
        }
    }
}
