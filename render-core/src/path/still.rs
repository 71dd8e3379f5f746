//! Rendering of a picture of a scene in one call.

use super::{PathEstimate, PathOptions, PathTracer};
use crate::scene::Scene;
use crate::{Emitters, Geometry, PosedScene, Surfaces, Units};

/// Time and size of a picture of a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Still {
    /// Time since the start of the animation \[s\].
    pub time: f32,
    /// Width of the picture \[pixels\].
    pub width: usize,
    /// Height of the picture \[pixels\].
    pub height: usize,
}

/// Renders `scene` with path tracing at the time of `still`.
///
/// Uses the filming camera, [`Scene::view`]. The mean of the estimate is linear RGB \[W·m⁻²·sr⁻¹\]. The result is
/// independent of the number of threads.
///
/// `progress` is called from any thread with the number of finished tiles and the total number of tiles.
///
/// ```
/// use render_core::scene::{Material, Mesh, Scene};
/// use render_core::{PathOptions, Still, glam::Vec3, path_traced};
///
/// let corners = [[-9.0, 0.0, -9.0], [0.0, 0.0, 9.0], [9.0, 0.0, -9.0]];
/// let mesh = Mesh { positions: corners.map(Vec3::from).into(), triangles: vec![[0, 1, 2]], ..Mesh::default() };
/// let lamp = Scene::of_mesh(mesh, Material { emission: Vec3::new(3.0, 2.0, 1.0), ..Material::default() });
/// let still = Still { time: 0.0, width: 64, height: 64 };
/// let picture = path_traced(&lamp, still, &PathOptions::default(), |_, _| ()).mean;
/// assert_eq!(picture.get(32, 32), [3.0, 2.0, 1.0]);
/// ```
pub fn path_traced(
    scene: &Scene,
    still: Still,
    options: &PathOptions,
    progress: impl Fn(usize, usize) + Sync,
) -> PathEstimate {
    // Pose the scene at the time of the still, and collect its lights.
    let pose = scene.pose(still.time);
    let surfaces = Surfaces::new(scene, &pose);
    let accelerator = Geometry::new(scene).place(&pose);
    let units = Units::of(scene);
    let emitters = Emitters::new(&surfaces, &pose, &units);

    // Trace paths from the filming camera.
    let tracer = PathTracer::new(PosedScene::new(&accelerator, &surfaces), &emitters, &units);
    tracer.render(&scene.view(&pose, still.width, still.height), options, progress)
}
