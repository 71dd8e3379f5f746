//! Hit on a triangle, with the material sampled on demand. Textures and normals cause most of a ray's cost after
//! traversal. An absorbed photon needs neither the shading normal nor the emission at its hit.

use super::site::{Footprint, TrianglePoint};
use super::{Surface, Surfaces, normal_map};
use crate::accel::Hit;
use crate::bsdf::Bsdf;
use crate::scene::{Material, TextureSlot, mesh_interpolate as interpolate};
use glam::{Vec3, Vec3A};

/// Point where a ray hit a surface.
pub(crate) struct Interaction<'a> {
    surfaces: &'a Surfaces<'a>,
    pub(super) material: &'a Material,
    pub(super) site: TrianglePoint<'a>,
    /// Direction of the ray, a unit vector.
    direction: Vec3A,
    pub instance: u32,
    /// Position in world space \[m\].
    pub position: Vec3A,
    /// Normal of the triangle on the side of the ray's origin, a unit vector.
    pub geometric_normal: Vec3A,
    /// Whether the ray hit the front, as the file defines it.
    pub front: bool,
}

/// Distance from an edge, as a fraction of the largest coordinate, below which a point may be on either side of the
/// edge: sixteen rounding errors.
const ON_EDGE: f32 = 8.0 * f32::EPSILON;
/// Offset of points on an edge from the edge, as a fraction of the largest coordinate. It equals the offset of ray
/// origins ([`crate::Units::epsilon`]), so that rays start off both walls of a crease of at least 45°.
const OFF_EDGE: f32 = 2e-5;
/// Minimum height of a triangle over an edge that allows the offset, in units of [`OFF_EDGE`].
const LEAST_HEIGHT: f32 = 4.0;
/// Least cosine to the geometric normal of the ray that a shading normal mirrors: 0.6° above the plane.
const LEAST_COSINE: f32 = 0.01;

/// Returns the offset from a point of a triangle, with barycentric weights `u` and `v`, to a nearby point on no edge.
/// The offset is zero for nearly all points. `area_vector` is the cross product of the sides from the first corner.
///
/// At the edge between two walls, a ray that starts off one wall along its normal would start in the plane of the
/// other.
fn off_edges([u, v]: [f32; 2], corners: [Vec3A; 3], area_vector: Vec3A) -> Vec3A {
    // Test quickly for points far from all edges, with bounds on the squares of any edge and coordinate.
    let [a, b, c] = corners;
    let weights = Vec3A::new(1.0 - u - v, u, v);
    let least = weights.min_element();
    let longest = 2.0 * ((b - a).length_squared() + (c - a).length_squared());
    let farthest = 2.0 * a.length_squared() + longest;
    if least * least * area_vector.length_squared() > ON_EDGE * ON_EDGE * farthest * longest {
        return Vec3A::ZERO;
    }

    // The distance to an edge is the edge's weight times the height over the edge, area / edge.
    let largest = corners.into_iter().fold(Vec3A::ZERO, |largest, corner| largest.max(corner.abs())).max_element();
    let edges = [c - b, a - c, b - a];
    let inverse_heights = Vec3A::from_array(edges.map(Vec3A::length_squared)) / area_vector.length_squared();
    let on_edge = (weights * weights).cmplt(inverse_heights * (ON_EDGE * largest).powi(2));
    if !on_edge.any() {
        return Vec3A::ZERO;
    }

    // Offset inward along the plane if the triangle is high enough.
    let step = OFF_EDGE * largest;
    let is_high = inverse_heights.cmplt(Vec3A::splat((LEAST_HEIGHT * step).powi(-2)));
    // Use unit vectors: in the largest scenes, products of three lengths exceed the range of f32.
    let normal = area_vector.normalize_or_zero();
    let inward = |k: usize| normal.cross(edges[k].normalize_or_zero()) * step;
    (0..3).filter(|&k| on_edge.test(k) && is_high.test(k)).map(inward).sum()
}

/// Textured properties of a [`Surface`].
pub(super) struct TexturedFinish {
    pub(super) normal: Vec3A,
    albedo: Vec3,
    specular: Vec3,
    pub(super) metallic: f32,
    pub(super) roughness: f32,
}

impl<'a> Interaction<'a> {
    /// Builds the interaction. `footprint` accepts the direction of a ray and the unit normal of a surface, and returns
    /// the footprint of the ray on the surface.
    pub(super) fn new(
        surfaces: &'a Surfaces<'a>,
        hit: &Hit,
        direction: Vec3A,
        footprint: impl Fn(Vec3A, Vec3A) -> Footprint,
    ) -> Self {
        let instance = hit.instance as usize;
        // Compute the position, moved off any edge of the triangle.
        let mesh = surfaces.mesh(instance);
        let material = surfaces.material(instance);
        let world = &surfaces.world[instance];
        let corners = surfaces.corners(instance, hit.triangle as usize);
        let [a, b, c] = corners;
        let area_vector = (b - a).cross(c - a);
        let position = a + (b - a) * hit.u + (c - a) * hit.v + off_edges([hit.u, hit.v], corners, area_vector);
        // A mirroring transform reverses the corners, but not the front that the file defines.
        let mirrored = if world.matrix3.determinant() < 0.0 { -1.0 } else { 1.0 };
        let outward = (area_vector * mirrored).try_normalize().unwrap_or(-direction);
        let front = outward.dot(direction) <= 0.0;
        let geometric_normal = if front { outward } else { -outward };

        // Prepare texture samples over the footprint of the ray.
        let indices = mesh.triangles[hit.triangle as usize];
        let footprint = footprint(direction, geometric_normal);
        let site =
            TrianglePoint { scene: surfaces.scene, mesh, indices, u: hit.u, v: hit.v, corners, outward, footprint };
        Self { surfaces, material, site, direction, instance: hit.instance, position, geometric_normal, front }
    }

    /// Returns whether the hit is on the back of a single-sided surface.
    pub fn is_back(&self) -> bool {
        !self.front && !self.material.double_sided
    }

    /// Returns whether light may pass through the surface as through glass.
    pub fn transmits(&self) -> bool {
        self.material.lobes.as_ref().is_some_and(|lobes| lobes.transmission.factor > 0.0)
    }

    /// Returns the diffuse reflectance, [`Surface::albedo`].
    pub fn albedo(&self) -> Vec3 {
        let Self { material, site, .. } = self;
        if material.unlit {
            return Vec3::ZERO;
        }
        // Few materials have further lobes, which change the base.
        if material.lobes.is_some() {
            return self.surface().albedo;
        }
        // The coat's roughness does not affect the base.
        let (metallic, roughness) = site.metallic_roughness(material);
        material.split(site.base_color(material), metallic, roughness).0
    }

    /// Returns the BSDF of a surface with a coat, and the surface's shading normal, or `None` without a coat.
    pub fn coat(&self) -> Option<(Bsdf, Vec3A)> {
        if self.material.lobes.is_some() {
            let Surface { albedo, specular, roughness, shading_normal, .. } = self.surface();
            return (specular != Vec3::ZERO).then(|| (Bsdf::new(albedo, specular, roughness), shading_normal));
        }
        let TexturedFinish { normal, albedo, specular, roughness, .. } =
            self.material.may_have_coat().then(|| self.finish())?;
        (specular != Vec3::ZERO).then(|| (Bsdf::new(albedo, specular, roughness), normal))
    }

    /// Returns the fraction of the light along the ray that is reflected in all directions together.
    pub fn reflectance(&self) -> Vec3 {
        match self.coat() {
            Some((bsdf, normal)) => bsdf.directional_albedo(-self.direction.dot(normal)),
            None => self.albedo(),
        }
    }

    /// Returns whether the triangle may emit light, evenly or unevenly.
    pub fn may_glow(&self) -> bool {
        self.material.emits() && !self.material.unlit
    }

    /// Returns the emitted radiance, [`Surface::emission`].
    pub fn emission(&self) -> Vec3 {
        let Self { material, site, .. } = self;
        if material.unlit {
            site.base_color(material)
        } else if material.emits() && !self.is_back() {
            site.emission(material)
        } else {
            Vec3::ZERO
        }
    }

    /// Returns the shading normal, [`Surface::shading_normal`].
    pub fn shading_normal(&self) -> Vec3A {
        if self.material.unlit { self.geometric_normal } else { self.normal_and_unevenness().0 }
    }

    /// Evaluates all properties of the surface.
    pub fn surface(&self) -> Surface {
        let Self { material, position, geometric_normal, front, .. } = self;
        // Evaluate only the emission of unlit surfaces, because they reflect nothing.
        let dark = Surface {
            position: *position,
            geometric_normal: *geometric_normal,
            shading_normal: *geometric_normal,
            albedo: Vec3::ZERO,
            specular: Vec3::ZERO,
            roughness: 1.0,
            emission: self.emission(),
            front: *front,
            double_sided: material.double_sided,
            lobes: None,
        };
        if material.unlit {
            return dark;
        }
        let finish = self.finish();
        let lobes = self.lobes(&finish);
        let TexturedFinish { normal, albedo, specular, roughness, .. } = finish;
        let (albedo, specular) = lobes.as_ref().map_or((albedo, specular), |lobes| lobes.summary());
        Surface { shading_normal: normal, albedo, specular, roughness, lobes, ..dark }
    }

    /// Returns the base, coat and normal of a lit surface.
    fn finish(&self) -> TexturedFinish {
        let Self { material, site, .. } = self;
        let (normal, unevenness) = self.normal_and_unevenness();
        let (metallic, roughness) = site.metallic_roughness(material);
        let roughness = normal_map::roughened(roughness, unevenness);
        let (albedo, specular) = material.split(site.base_color(material), metallic, roughness);
        TexturedFinish { normal, albedo, specular, metallic, roughness }
    }

    /// Returns the shading normal, and the unevenness of the normal map within the footprint.
    fn normal_and_unevenness(&self) -> (Vec3A, f32) {
        self.mapped(self.material.normal_texture.as_ref())
    }

    /// Returns the normal of a map, or the smooth normal without a map, toward the ray's origin.
    pub(super) fn normal_of(&self, map: Option<&(TextureSlot, f32)>) -> Vec3A {
        self.mapped(map).0
    }

    /// Returns the normal of a map toward the ray's origin, and the unevenness of the map within the footprint.
    fn mapped(&self, map: Option<&(TextureSlot, f32)>) -> (Vec3A, f32) {
        let Self { site, direction, .. } = self;
        let (outward, local) = self.smooth_normal();
        // Normals belong to the front. Seen from behind, the whole frame of the normal map is reversed.
        let side = if outward.dot(self.geometric_normal) < 0.0 { -1.0 } else { 1.0 };
        let (normal, unevenness) = match map {
            None => (outward, 0.0),
            Some((slot, scale)) => site.mapped_normal(slot, *scale, outward, self.given_axes(local)),
        };
        let normal = normal * side;
        // At a silhouette, a normal may face away from the viewer, so bend it back to grazing.
        let away = normal.dot(*direction);
        let normal = if away < 0.0 { normal } else { (normal - *direction * (away + 1e-3)).normalize() };
        let may_mirror = self.material.may_have_coat();
        (if may_mirror { mirroring_outward(normal, self.geometric_normal, *direction) } else { normal }, unevenness)
    }

    /// Returns the smooth normal of the front in world space, and the interpolated normal of the mesh. Meshes without
    /// normals use the normal of the triangle.
    fn smooth_normal(&self) -> (Vec3A, Option<Vec3>) {
        let Self { surfaces, site, .. } = self;
        let instance = self.instance as usize;
        let local = interpolate(surfaces.shape(instance).normals, site.indices, site.u, site.v);
        let smooth = local.and_then(|n| (surfaces.normals[instance] * Vec3A::from(n)).try_normalize());
        (smooth.unwrap_or(site.outward), local)
    }

    /// Returns the axes of the tangent frame that the file defines, for the interpolated normal of the mesh.
    fn given_axes(&self, normal: Option<Vec3>) -> Option<(Vec3A, Vec3A)> {
        let Self { surfaces, site, .. } = self;
        let instance = self.instance as usize;
        let tangent = interpolate(surfaces.shape(instance).tangents, site.indices, site.u, site.v);
        normal.zip(tangent).and_then(|(n, t)| normal_map::given(&surfaces.world[instance], n, t))
    }

    /// Returns the axes of the tangent frame of a texture, projected onto the plane of a unit `normal`. They are zero
    /// without tangents and coordinates.
    pub(super) fn tangent_axes(&self, slot: Option<&TextureSlot>, normal: Vec3A) -> [Vec3A; 2] {
        // Without a texture, the first coordinate set defines the frame.
        let first = TextureSlot { texture: 0, uv_set: 0, transform: None };
        let (outward, local) = self.smooth_normal();
        let axes = self.given_axes(local).or_else(|| self.site.derived(slot.unwrap_or(&first), outward));
        axes.map_or([Vec3A::ZERO; 2], |(x, y)| [x, y].map(|v| v - normal * normal.dot(v)))
    }
}

/// Returns a shading normal that mirrors a ray's `direction` to the outer side of the geometric normal. Other rays would
/// end in the object, and a coat would be black there: \[Keller17\], A.3. All vectors have unit length, and the geometric
/// normal points to the origin of the ray.
fn mirroring_outward(normal: Vec3A, geometric: Vec3A, direction: Vec3A) -> Vec3A {
    let mirrored = direction - normal * (2.0 * normal.dot(direction));
    let height = mirrored.dot(geometric);
    // Lift the mirrored ray just above the surface, but not above the ray that the plane itself mirrors.
    let least = LEAST_COSINE.min(-0.9 * geometric.dot(direction));
    if height >= least {
        return normal;
    }
    let lifted = (mirrored + geometric * (least - height)).normalize_or(geometric);
    (lifted - direction).try_normalize().unwrap_or(normal)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Geometry;
    use crate::sampling::{sobol_point, uniform_sphere};
    use crate::scene::{Encoding, Instance, Mesh, Node, Scene, Texture, Transform, Wrap};
    use glam::{Quat, Vec2, vec2, vec3, vec4};

    /// Builds a texture of 8×8 texels without two equal rows or columns.
    fn texture(encoding: Encoding) -> Texture {
        let texel = |i: u8| [255 - 3 * i, 40 + 2 * i, 90 + i, 255];
        Texture::with_encoding(8, 8, (0..64).map(texel).collect(), [Wrap::Repeat; 2], encoding)
    }

    /// Returns one material of each type: matte, emissive, with all four textures, metal, double-sided, unlit.
    fn materials() -> [Material; 6] {
        let color = vec3(0.7, 0.5, 0.3);
        let plain = || Material { base_color: color, ..Material::default() };
        let slot = |texture| TextureSlot { texture, uv_set: 0, transform: None };
        let glow = vec3(3.0, 2.0, 1.0);
        let textured = Material {
            base_color_texture: Some(slot(0)),
            emission_texture: Some(slot(0)),
            metallic_roughness_texture: Some(slot(1)),
            normal_texture: Some((slot(1), 0.8)),
            emission: glow,
            metallic: 0.9,
            ..plain()
        };
        [
            plain(),
            Material { emission: glow, ..plain() },
            textured,
            Material { metallic: 1.0, roughness: 0.3, ..plain() },
            Material { double_sided: true, emission: glow, roughness: 0.5, ..plain() },
            Material { unlit: true, base_color_texture: Some(slot(0)), ..plain() },
        ]
    }

    /// Builds a square of side 2 m at z = −1 m with perturbed normals. Its front faces the origin.
    fn square(material: usize) -> Mesh {
        let uv = [Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y];
        let position = |uv: Vec2| (2.0 * uv - 1.0).extend(-1.0);
        Mesh {
            positions: uv.map(position).to_vec(),
            normals: uv.map(|uv| (0.4 * (uv - 0.5)).extend(1.0).normalize()).to_vec(),
            tangents: vec![vec4(1.0, 0.0, 0.0, 1.0); 4],
            uvs: [uv.map(|uv| 2.0 * uv + vec2(0.1, 0.3)).to_vec(), vec![], vec![], vec![]],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            material,
            ..Mesh::default()
        }
    }

    /// Builds a cube around the origin with one material per side.
    ///
    /// The two triangles of a side have opposite windings, so half of each side shows its front.
    fn cube() -> Scene {
        let mut scene = Scene {
            materials: materials().to_vec(),
            textures: vec![texture(Encoding::Srgb), texture(Encoding::Linear)],
            ..Scene::default()
        };
        let turns = [Vec3::NEG_Z, Vec3::Z, Vec3::NEG_X, Vec3::X, Vec3::NEG_Y, Vec3::Y];
        for (side, toward) in turns.into_iter().enumerate() {
            let mut mesh = square(side);
            mesh.triangles[1].swap(0, 1);
            let rotation = Quat::from_rotation_arc(Vec3::NEG_Z, toward);
            let rest = Transform { translation: Vec3::ZERO, rotation, scale: Vec3::ONE };
            scene.meshes.push(mesh);
            scene.nodes.push(Node { name: String::new(), parent: None, rest });
            scene.instances.push(Instance { node: side, mesh: side });
        }
        scene
    }

    /// Properties evaluated one by one equal the properties of the whole surface, for every type of material and on
    /// both sides.
    #[test]
    fn pieces_are_those_of_the_whole() {
        let scene = cube();
        let pose = scene.pose(0.0);
        let surfaces = Surfaces::new(&scene, &pose);
        let accelerator = Geometry::new(&scene).place(&pose);
        let mut met = [[0; 2]; 6];
        for k in 0..4000 {
            let direction = Vec3A::from(uniform_sphere(sobol_point(k)));
            let Some(hit) = accelerator.closest(Vec3A::new(0.1, 0.27, -0.1), direction) else { continue };
            let piece = surfaces.meet(&hit, direction, 0.01);
            let whole = piece.surface();
            met[hit.instance as usize][usize::from(whole.front)] += 1;
            assert_eq!(piece.albedo(), whole.albedo);
            assert_eq!(piece.emission(), whole.emission);
            assert_eq!(piece.shading_normal(), whole.shading_normal);
            assert_eq!(piece.is_back(), !(whole.front || whole.double_sided));
        }
        assert!(met.as_flattened().iter().all(|&count| count > 100), "every side of every material is met: {met:?}");
    }
}
