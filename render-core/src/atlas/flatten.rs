//! Unwrapping of surfaces into flat charts by `uvunwrap`. Each instance is unwrapped separately, in world space.

use super::planes::{Laid, merged};
use super::weld::WeldedMesh;
use crate::Surfaces;
use glam::{DVec2, Vec2, Vec3, dvec2};
use rayon::prelude::*;

/// Width of the atlas that `uvunwrap` packs for one instance \[texels\]. The packing is not used, and a small atlas is
/// fast.
const SIDE: f32 = 256.0;

/// Reasons why an atlas cannot be made.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum AtlasError {
    /// No instance is static and lit.
    #[error("this scene has no static geometry, so no light can be baked; bake a scene with lit static surfaces")]
    NothingStatic,
    /// Fewer texels than charts; each chart needs at least one.
    #[error("{texels} texels are too few for {charts} charts of surfaces; ask for {charts} or more")]
    TooFewTexels {
        /// Requested number of texels.
        texels: usize,
        /// Number of charts, which is the minimum number of texels that can be requested.
        charts: usize,
    },
    /// More texels than an atlas can have.
    #[error("{texels} texels are more than an atlas takes; ask for {most} or less")]
    TooManyTexels {
        /// Requested number of texels.
        texels: usize,
        /// Maximum number of texels that can be requested.
        most: usize,
    },
    /// Surfaces that cannot be flattened.
    #[error("surfaces of instance {instance} cannot be laid out flat ({reason}); export the scene without it")]
    Unwrap {
        /// Index of the instance in the scene.
        instance: usize,
        /// Reason reported by `uvunwrap`.
        reason: String,
    },
}

/// Triangle in its chart.
pub(super) struct FlatTriangle {
    /// Index into the mesh's triangles.
    pub index: u32,
    /// Positions of the corners relative to the chart's corner \[m\].
    pub corners: [Vec2; 3],
    /// Whether the triangle has an area in the chart. `uvunwrap` maps triangles thinner than a millionth of their
    /// instance to a point.
    pub has_area: bool,
}

/// Flattened piece of surface with a height of at most its width.
pub(super) struct FlatChart {
    /// Width and height \[m\].
    pub size: Vec2,
    pub triangles: Vec<FlatTriangle>,
}

impl FlatChart {
    /// Returns the area of the triangles \[m²\].
    pub fn area(&self) -> f64 {
        let mut double = 0.0;
        for [a, b, c] in self.triangles.iter().map(|triangle| triangle.corners) {
            double += f64::from((b - a).perp_dot(c - a).abs());
        }
        double / 2.0
    }
}

/// Flattened surfaces of an instance.
pub(super) struct FlatMesh {
    pub instance: u32,
    /// Number of sides that need texels: 2 for double-sided materials, otherwise 1.
    pub sides: usize,
    /// Number of triangles of the mesh, including triangles without a chart.
    pub count: u32,
    /// Opposite corners of the bounding box in world space \[m\].
    pub bounds: [Vec3; 2],
    pub charts: Vec<FlatChart>,
}

/// Flattens all static lit surfaces, by instance.
pub(super) fn standing(surfaces: &Surfaces) -> Result<Vec<FlatMesh>, AtlasError> {
    let instances = standing_instances(surfaces);
    let meshes: Vec<_> = instances.into_par_iter().map(|instance| flattened(surfaces, instance)).collect();

    // Drop instances without charts. Return the first error in the order of instances.
    let mut standing = Vec::new();
    for mesh in meshes {
        let mesh = mesh?;
        if !mesh.charts.is_empty() {
            standing.push(mesh);
        }
    }
    if standing.is_empty() { Err(AtlasError::NothingStatic) } else { Ok(standing) }
}

/// Returns the static instances that reflect light.
pub(super) fn standing_instances(surfaces: &Surfaces) -> Vec<usize> {
    let (scene, moving) = (surfaces.scene(), surfaces.moving());
    let is_baked = |instance: &usize| {
        let mesh = &scene.meshes[scene.instances[*instance].mesh];
        !moving[*instance] && !scene.materials[mesh.material].unlit
    };
    (0..scene.instances.len()).filter(is_baked).collect()
}

/// Flattens the surfaces of an instance.
fn flattened(surfaces: &Surfaces, instance: usize) -> Result<FlatMesh, AtlasError> {
    // Work in world space, so that all instances have the same density.
    let scene = surfaces.scene();
    let mesh = &scene.meshes[scene.instances[instance].mesh];
    let (rest, normals) = match surfaces.deformed(instance) {
        Some(bent) => (&bent.positions, &bent.normals),
        None => (&mesh.positions, &mesh.normals),
    };
    let world = surfaces.world(instance);
    let positions: Vec<Vec3> = rest.iter().map(|&place| world.transform_point3(place)).collect();
    let welded = WeldedMesh::new(&positions, normals, &mesh.triangles);
    let charts = unwrapped(&welded).map_err(|reason| AtlasError::Unwrap { instance, reason })?;

    // Both sides of a double-sided surface use the same charts, with separate texels.
    let sides = if scene.materials[mesh.material].double_sided { 2 } else { 1 };
    let (instance, count) = (instance as u32, mesh.triangles.len() as u32);
    let charts = merged(&welded, charts).into_iter().filter_map(chart).collect();
    Ok(FlatMesh { instance, sides, count, bounds: welded.bounds, charts })
}

/// Returns the charts of a mesh made by `uvunwrap`, or the reason why there are none.
fn unwrapped(mesh: &WeldedMesh) -> Result<Vec<Vec<Laid>>, String> {
    // Unwrap without padding: charts are packed again at their final density.
    let positions: Vec<[f32; 3]> = mesh.positions.iter().map(Vec3::to_array).collect();
    let input = uvunwrap::MeshInput::new(&positions, mesh.triangles.as_flattened());
    let options = uvunwrap::Options {
        density: uvunwrap::Density::Fixed { texels_per_unit: SIDE / mesh.length as f32, page_size: None },
        padding: 0,
        packing: uvunwrap::Packing::Fast,
        ..uvunwrap::Options::default()
    };
    let unwrapped = uvunwrap::generate(&[input], &options).map_err(|error| error.to_string())?;

    // Convert texture coordinates in 0…1 to meters, by chart. Isolated triangles without area have no chart.
    let density = f64::from(unwrapped.texels_per_unit);
    let meters = dvec2(f64::from(unwrapped.width), f64::from(unwrapped.height)) / density;
    let found = &unwrapped.meshes[0];
    let mut charts: Vec<Vec<Laid>> = vec![Vec::new(); unwrapped.chart_count as usize];
    for (index, vertices) in found.indices.chunks_exact(3).enumerate() {
        let vertices = [0, 1, 2].map(|corner| &found.vertices[vertices[corner] as usize]);
        if let Some(chart) = vertices[0].chart {
            let corners = vertices.map(|vertex| Vec2::from(vertex.uv).as_dvec2() * meters);
            charts[chart as usize].push(Laid { index: index as u32, corners });
        }
    }
    Ok(charts)
}

/// Returns the chart of the triangles, rotated so that its height is at most its width. Returns `None` for an
/// empty chart.
fn chart(mut triangles: Vec<Laid>) -> Option<FlatChart> {
    // Move the chart to the origin, and rotate high charts by 90°.
    let (mut least, mut most) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
    for corner in triangles.iter().flat_map(|triangle| &triangle.corners) {
        (least, most) = (least.min(*corner), most.max(*corner));
    }
    let mut size = most - least;
    let is_high = size.y > size.x;
    for Laid { corners, .. } in &mut triangles {
        let moved = corners.map(|corner| corner - least);
        *corners = if is_high { moved.map(|corner| dvec2(corner.y, size.x - corner.x)) } else { moved };
    }
    if is_high {
        size = dvec2(size.y, size.x);
    }

    // Round to f32 after the translation, to keep precision. Drop charts without any area.
    let single = |triangle: Laid| {
        let has_area = triangle.has_area();
        FlatTriangle { index: triangle.index, corners: triangle.corners.map(|corner| corner.as_vec2()), has_area }
    };
    let triangles: Vec<FlatTriangle> = triangles.into_iter().map(single).collect();
    triangles.iter().any(|triangle| triangle.has_area).then(|| FlatChart { size: size.as_vec2(), triangles })
}
