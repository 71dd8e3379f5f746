//! Estimate of a film's memory, made before memory is allocated.

use crate::error::{Error, Result};
use crate::settings::MemorySize;
use render_core::Geometry;
use render_core::scene::{Instance, Node, Scene};
use renderer::settings::Size;
use std::path::Path;

/// Memory of program, threads, lights and light tree \[bytes\]: measured as 60 MB (cornell) to 150 MB (atrium) at
/// 128x128.
const PROGRAM: u64 = 100_000_000;
/// Memory of pictures and caches per pixel, over all frames in progress \[bytes\]: measured as 250 (nave) to 720
/// (atrium) between 512x512 and 1024x1024.
const PIXEL: u64 = 500;
/// Peak memory per triangle while the BVH is built \[bytes\]: measured as 367 with a million triangles.
const TRIANGLE: u64 = 370;
/// Memory per instance: transforms of instance and node at several times, and boxes of the BVH \[bytes\].
const INSTANCE: u64 = 600;

/// Estimates the maximum memory of a film of `scene` \[bytes\]. In the scenes tested, the error is below a factor of
/// two.
#[must_use]
pub fn estimate(scene: &Scene, size: Size) -> u64 {
    // Add the data of the scene, which is already loaded, to the memory that rendering will allocate.
    let meshes: usize = scene.meshes.iter().map(render_core::scene::Mesh::byte_count).sum();
    let textures: usize = scene.textures.iter().map(render_core::scene::Texture::byte_count).sum();
    let places = size_of_val::<[Node]>(&scene.nodes) + size_of_val::<[Instance]>(&scene.instances);
    let held = (meshes + textures + places) as u64;
    let pixels = (size.width * size.height) as u64;
    let instances = scene.instances.len() as u64;
    PROGRAM + held + pixels * PIXEL + instances * INSTANCE + Geometry::triangles_to_hold(scene) as u64 * TRIANGLE
}

/// Refuses a film if its estimated memory exceeds `limit`; without a limit, if it exceeds the machine's memory.
///
/// # Errors
/// Returns [`Error::Memory`] with the scene's `path`, the estimate and the limit.
pub fn check(path: &Path, scene: &Scene, size: Size, limit: Option<MemorySize>) -> Result<()> {
    let needed = estimate(scene, size);
    // Prefer the user's limit; without any known limit, accept every film.
    let (allowed, whose) = match (limit, of_machine()) {
        (Some(MemorySize(bytes)), _) => (bytes, "--max-memory allows"),
        (None, Some(bytes)) => (bytes, "this machine has"),
        (None, None) => return Ok(()),
    };
    if needed <= allowed {
        return Ok(());
    }
    Err(Error::Memory {
        path: path.into(),
        needed: MemorySize(needed).to_string(),
        allowed: format!("{whose} {}", MemorySize(allowed)),
    })
}

/// Returns the memory of this machine, or of the program's control group \[bytes\]; Linux only.
#[must_use]
pub fn of_machine() -> Option<u64> {
    let information = std::fs::read_to_string("/proc/meminfo").ok()?;
    let line = information.lines().find_map(|line| line.strip_prefix("MemTotal:"))?;
    let total = line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()? * 1024;

    // If the group has no limit, the file contains "max", which is not a number.
    let group = std::fs::read_to_string("/sys/fs/cgroup/memory.max").ok();
    let group = group.and_then(|text| text.trim().parse::<u64>().ok());
    Some(group.map_or(total, |group| group.min(total)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use render_core::scene::{Material, Mesh};

    /// Returns a scene of `instances` instances of a flat mesh with `triangles` triangles.
    fn scene(triangles: u32, instances: usize) -> Scene {
        let mesh = Mesh {
            positions: vec![render_core::glam::Vec3::ZERO, render_core::glam::Vec3::X, render_core::glam::Vec3::Y],
            triangles: vec![[0, 1, 2]; triangles as usize],
            ..Mesh::default()
        };
        let mut scene = Scene::of_mesh(mesh, Material::default());
        scene.instances = vec![scene.instances[0]; instances];
        scene
    }

    #[test]
    fn instances_cost_little_and_pixels_and_triangles_what_they_take() {
        let size = |width, height| Size { width, height };
        let small = estimate(&scene(1, 1), size(64, 64));
        // Check that a thousand instances of ten thousand triangles need no more than one mesh and a thousand
        // transforms.
        let shared = estimate(&scene(10_000, 1000), size(64, 64)) - small;
        assert!(shared < 10_000 * (TRIANGLE + 12) + 1000 * (INSTANCE + 32), "{shared}");
        let pixels = estimate(&scene(1, 1), size(1064, 64)) - small;
        assert_eq!(pixels, 64_000 * PIXEL);
        let triangles = estimate(&scene(1_000_001, 1), size(64, 64)) - small;
        assert_eq!(triangles, 1_000_000 * (TRIANGLE + 12));
    }

    #[test]
    fn what_is_too_large_is_refused_with_both_numbers() {
        let (path, size) = (Path::new("big.glb"), Size { width: 64, height: 64 });
        let scene = scene(1_000_000, 1);
        assert!(check(path, &scene, size, Some("600M".parse().unwrap())).is_ok());
        let error = check(path, &scene, size, Some("400M".parse().unwrap())).unwrap_err().to_string();
        assert!(error.starts_with("big.glb: ") && error.contains("484 MB") && error.contains("400 MB"), "{error}");
    }
}
