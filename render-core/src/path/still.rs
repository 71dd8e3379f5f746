//! A picture of a scene in one call.

use super::{PathEstimate, PathOptions, PathTracer};
use crate::scene::Scene;
use crate::{Emitters, Geometry, PosedScene, Surfaces, Units};

/// Paths through `scene` as it stands `time` seconds after the start of its animation, on `width × height` pixels.
///
/// The camera is the one that films, [`Scene::view`]. The mean of the estimate is linear RGB \[W·m⁻²·sr⁻¹\], the same for
/// any number of threads.
///
/// `progress` is called from any thread with the number of finished tiles and that of all tiles.
///
/// ```
/// use render_core::scene::{Material, Mesh, Scene};
/// use render_core::{PathOptions, glam::Vec3, path_traced};
///
/// let corners = [[-9.0, 0.0, -9.0], [0.0, 0.0, 9.0], [9.0, 0.0, -9.0]];
/// let mesh = Mesh { positions: corners.map(Vec3::from).into(), triangles: vec![[0, 1, 2]], ..Mesh::default() };
/// let lamp = Scene::of_mesh(mesh, Material { emission: Vec3::new(3.0, 2.0, 1.0), ..Material::default() });
/// let still = path_traced(&lamp, 0.0, (64, 64), &PathOptions::default(), |_, _| ()).mean;
/// assert_eq!(still.get(32, 32), [3.0, 2.0, 1.0]);
/// ```
pub fn path_traced(
    scene: &Scene,
    time: f32,
    (width, height): (usize, usize),
    options: &PathOptions,
    progress: impl Fn(usize, usize) + Sync,
) -> PathEstimate {
    // The scene at that time, and its lights.
    let pose = scene.pose(time);
    let surfaces = Surfaces::new(scene, &pose);
    let accelerator = Geometry::new(scene).place(&pose);
    let units = Units::of(scene);
    let emitters = Emitters::new(&surfaces, &pose, &units);

    // Paths from its camera.
    let tracer = PathTracer::new(PosedScene::new(&accelerator, &surfaces), &emitters, &units);
    tracer.render(&scene.view(&pose, width, height), (width, height), options, progress)
}
