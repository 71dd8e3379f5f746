//! Tests of atlases: each surface point has texels, and these represent nearby points.

use crate::common::{add, material, quad, rest};
use glam::{Quat, Vec3, Vec3A, vec3};
use render_core::sampling::{Distribution, hash_unit};
use render_core::scene::{Channel, Instance, Interpolation, Material, Mesh, Node, Scene, Track, Transform, load};
use render_core::{Atlas, AtlasError, AtlasPoint, Surfaces, TexelBlend};
use std::collections::BTreeSet;
use std::path::Path;

/// Maximum distance between a point and the blend of its texels' positions \[texels\].
const FARTHEST: f32 = 1.5;

/// Builds a sphere with `n` rings of 2n quads. Each quad at the poles has a triangle of almost no area.
fn ball(n: u32) -> Mesh {
    let mut mesh = Mesh::default();
    for ring in 0..=n {
        for k in 0..2 * n {
            let (theta, phi) = (ring as f32 / n as f32, k as f32 / n as f32);
            let ((sin, cos), (y, x)) =
                ((theta * std::f32::consts::PI).sin_cos(), (phi * std::f32::consts::PI).sin_cos());
            mesh.positions.push(vec3(sin * x, cos, sin * y));
        }
    }
    mesh.normals.clone_from(&mesh.positions);
    for ring in 0..n {
        for k in 0..2 * n {
            let [a, b] = [k, (k + 1) % (2 * n)].map(|column| ring * 2 * n + column);
            mesh.triangles.extend([[a, b, a + 2 * n], [b, b + 2 * n, a + 2 * n]]);
        }
    }
    mesh
}

/// Builds a box with sides of 1 m, facing outward.
fn cube() -> Mesh {
    let mut mesh = Mesh::default();
    for axis in 0..3 {
        for sign in [-0.5f32, 0.5] {
            let mut n = Vec3::ZERO;
            n[axis] = sign;
            let (a, b) = (vec3(n.z, n.x, n.y).abs(), vec3(n.y, n.z, n.x).abs());
            let (a, b) = if a.cross(b).dot(n) > 0.0 { (a, b) } else { (b, a) };
            let base = mesh.positions.len() as u32;
            let wall = quad(n - a - b, 2.0 * a, 2.0 * b);
            mesh.positions.extend(wall.positions);
            mesh.triangles.extend(wall.triangles.iter().map(|triangle| triangle.map(|vertex| vertex + base)));
        }
    }
    mesh
}

/// Builds a strip of 2 m: a fan of slivers around one of its corners, and a row of steps a millimeter high.
fn slivers() -> Mesh {
    let mut mesh = Mesh { positions: vec![Vec3::ZERO], ..Mesh::default() };
    for k in 0..=200u32 {
        mesh.positions.push(vec3(2.0, 0.01 * k as f32, 0.0));
    }
    mesh.triangles.extend((1..=200).map(|k| [0, k, k + 1]));
    for k in 0..40u32 {
        let base = mesh.positions.len() as u32;
        let step = quad(vec3(0.0, 0.0, -0.001 * k as f32), Vec3::X * 2.0, Vec3::Z * -0.001);
        mesh.positions.extend(step.positions);
        mesh.triangles.extend(step.triangles.iter().map(|triangle| triangle.map(|vertex| vertex + base)));
    }
    mesh
}

/// Index of a moving box, the first instance without texels.
const MOVING: u32 = 6;
/// Index of an unlit square, the second instance without texels.
const UNLIT: u32 = 7;
/// Index of a double-sided square in the instances.
const SHEET: u32 = 5;

/// Builds a floor, a sphere, slivers, a double-sided square, and two touching boxes, one of them mirrored and
/// flattened.
fn room() -> Scene {
    let mut scene = Scene::default();
    let gray = || material(Vec3::splat(0.5), Vec3::ZERO);
    add(&mut scene, rest(Vec3::ZERO), quad(vec3(-3.0, 0.0, 3.0), Vec3::X * 6.0, Vec3::Z * -6.0), gray());
    add(&mut scene, rest(vec3(1.0, 1.0, 1.0)), ball(12), gray());
    add(&mut scene, rest(vec3(-2.0, 0.3, -1.0)), slivers(), gray());
    add(&mut scene, rest(vec3(-1.5, 0.5, 1.0)), cube(), gray());
    let mirrored = Transform { scale: vec3(-1.0, 1.0, 0.25), ..rest(vec3(-0.5, 0.5, 1.0)) };
    scene.nodes.push(Node { name: String::new(), parent: None, rest: mirrored });
    scene.instances.push(Instance { node: scene.nodes.len() - 1, mesh: 3 });
    let sheet = Material { double_sided: true, ..gray() };
    let turned = Transform { rotation: Quat::from_rotation_y(0.4), ..rest(vec3(0.0, 1.0, -1.5)) };
    add(&mut scene, turned, quad(vec3(0.0, 0.0, 0.0), Vec3::X, Vec3::Y), sheet);

    let node = add(&mut scene, rest(vec3(0.0, 2.0, 0.0)), cube(), gray());
    let track = Track::Translation(vec![Vec3::ZERO, Vec3::X]);
    scene.channels.push(Channel { node, times: vec![0.0, 1.0], track, interpolation: Interpolation::Linear });
    let sky = Material { unlit: true, ..gray() };
    add(&mut scene, rest(vec3(0.0, 9.0, 0.0)), quad(Vec3::ZERO, Vec3::X * 100.0, Vec3::Z * 100.0), sky);
    scene
}

/// Runs `test` with a scene in its rest pose and the scene's atlas.
fn with_atlas(scene: &Scene, texels: usize, test: impl Fn(&Surfaces, &Atlas)) {
    let surfaces = Surfaces::new(scene, &scene.pose(0.0));
    test(&surfaces, &Atlas::new(&surfaces, texels).expect("static surfaces"));
}

/// Returns the triangles of static, lit instances, with the sign of each side that has texels.
fn sides(surfaces: &Surfaces) -> Vec<(u32, u32, f32)> {
    let (scene, mut sides) = (surfaces.scene(), Vec::new());
    for (k, instance) in scene.instances.iter().enumerate().filter(|&(k, _)| !surfaces.moving()[k]) {
        let mesh = &scene.meshes[instance.mesh];
        let material = &scene.materials[mesh.material];
        for triangle in (0..mesh.triangles.len() as u32).filter(|_| !material.unlit) {
            sides.push((k as u32, triangle, 1.0));
            sides.extend(material.double_sided.then_some((k as u32, triangle, -1.0)));
        }
    }
    sides
}

/// Returns points on static, lit surfaces. Half of the points are distributed by area, the others by triangle.
fn points(surfaces: &Surfaces, count: u64) -> Vec<AtlasPoint> {
    let sides = sides(surfaces);
    let normal = |&(instance, triangle, sign): &(u32, u32, f32)| {
        let [a, b, c] = surfaces.corners(instance as usize, triangle as usize);
        let mirrored = surfaces.world(instance as usize).matrix3.determinant().signum();
        (b - a).cross(c - a) * mirrored * sign
    };
    let areas = Distribution::new(sides.iter().map(|side| f64::from(normal(side).length()))).expect("areas");
    let mut points = Vec::new();
    for k in 0..count {
        let random = |dimension| hash_unit(1, k, dimension);
        let index =
            if k % 2 == 0 { areas.pick(f64::from(random(0))).index } else { (random(0) * sides.len() as f32) as usize };
        let side = sides[index.min(sides.len() - 1)];
        let geometric_normal = normal(&side);
        if geometric_normal.length() < 1e-6 {
            continue;
        }
        let [a, b, c] = surfaces.corners(side.0 as usize, side.1 as usize);
        let (u, v) = render_core::sampling::triangle(glam::Vec2::new(random(1), random(2)));
        let position = a + (b - a) * u + (c - a) * v;
        points.push(AtlasPoint { instance: side.0, triangle: side.1, position, geometric_normal });
    }
    points
}

/// Returns the largest distance between points and the blended positions of their texels \[texels\].
fn worst_position(surfaces: &Surfaces, atlas: &Atlas, count: u64) -> f32 {
    let baked: Vec<Vec3A> = (0..atlas.len()).map(|texel| atlas.sites(texel, surfaces)[0].position).collect();
    let mut worst = 0.0f32;
    for point in points(surfaces, count) {
        let TexelBlend { texels, weights } = atlas.bilinear(surfaces, &point).expect("it stands still");
        let blend: Vec3A = texels.iter().zip(weights).map(|(&texel, weight)| baked[texel as usize] * weight).sum();
        worst = worst.max(blend.distance(point.position) * atlas.texels_per_meter());
    }
    worst
}

#[test]
fn baked_positions_are_close() {
    let scene = room();
    for texels in [3_000, 30_000] {
        with_atlas(&scene, texels, |surfaces, atlas| {
            let worst = worst_position(surfaces, atlas, 100_000);
            assert!(worst < FARTHEST, "{worst} texels off with {texels} texels");
        });
    }
}

#[test]
fn baked_positions_of_a_church_are_close() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes/nave/nave.glb");
    let scene = load(&path).expect("a scene that ships");
    with_atlas(&scene, 200_000, |surfaces, atlas| {
        let worst = worst_position(surfaces, atlas, 100_000);
        assert!(worst < FARTHEST, "{worst} texels off");
        assert!((atlas.len() as f64 / 200_000.0 - 1.0).abs() < 0.05, "{} texels", atlas.len());
        assert!(atlas.validate(&scene));
    });
}

#[test]
fn a_blend_has_four_texels_of_one_chart() {
    let scene = room();
    with_atlas(&scene, 10_000, |surfaces, atlas| {
        let mut charts = BTreeSet::new();
        let mut check = |point: &AtlasPoint| {
            let TexelBlend { texels, weights } = atlas.bilinear(surfaces, point).expect("it stands still");
            let sum: f32 = weights.iter().sum();
            assert!(
                (sum - 1.0).abs() < 1e-5 && weights.iter().all(|weight| (0.0..=1.0).contains(weight)),
                "{weights:?}"
            );
            let [(x, y), right, below, last] = texels.map(|texel| atlas.place(texel as usize));
            // Use the next column and row. At the center of a texel, they may be the same, because the others have no weight.
            let (next_x, next_y) = (right.0, below.1);
            assert!((x..=x + 1).contains(&next_x) && (y..=y + 1).contains(&next_y));
            assert_eq!([right, below, last], [(next_x, y), (x, next_y), (next_x, next_y)]);
            assert!(next_x > x || weights[1] + weights[3] == 0.0, "{weights:?}");
            assert!(next_y > y || weights[2] + weights[3] == 0.0, "{weights:?}");
            let chart = atlas.chart(texels[0] as usize);
            assert!(texels.iter().all(|&texel| atlas.chart(texel as usize) == chart));
            charts.insert(chart);
        };
        points(surfaces, 100_000).iter().for_each(&mut check);
        // Include corners, and points beyond the corners.
        for mut point in points(surfaces, 2000) {
            for corner in surfaces.corners(point.instance as usize, point.triangle as usize) {
                point.position = corner;
                check(&point);
                point.position += Vec3A::splat(0.3);
                check(&point);
            }
        }
        assert_eq!(charts.len(), atlas.charts(), "every chart is found");
    });
}

#[test]
fn what_has_no_texels_is_not_found() {
    let scene = room();
    with_atlas(&scene, 5000, |surfaces, atlas| {
        let found = |instance, triangle, geometric_normal| {
            atlas.bilinear(surfaces, &AtlasPoint { instance, triangle, position: Vec3A::ZERO, geometric_normal })
        };
        for normal in [Vec3A::Y, Vec3A::NEG_Y] {
            assert_eq!([MOVING, UNLIT, 8, u32::MAX].map(|instance| found(instance, 0, normal)), [None; 4]);
            assert_eq!(found(0, 2, normal), None, "the floor has two triangles");
        }
        assert_eq!(found(0, 0, Vec3A::NEG_Y), None, "the back of a floor");
        // Triangles at the poles of the sphere have almost no area.
        assert!([0, 12 * 24 * 2 - 1].into_iter().all(|triangle| found(1, triangle, Vec3A::Y).is_some()));

        // The other side of a sheet has separate texels that face in its own direction.
        let [front, back] = [Vec3A::Z, Vec3A::NEG_Z].map(|normal| found(SHEET, 0, normal).expect("both sides"));
        assert!(front.texels.iter().all(|texel| !back.texels.contains(texel)));
        for (blend, way) in [(front, Vec3A::Z), (back, Vec3A::NEG_Z)] {
            for site in atlas.sites(blend.texels[0] as usize, surfaces) {
                assert!(site.geometric_normal.dot(way) > 0.9 && site.shading_normal.dot(way) > 0.9);
            }
        }
    });
}

#[test]
fn sites_are_points_of_their_surface() {
    let scene = room();
    with_atlas(&scene, 10_000, |surfaces, atlas| {
        let mut counts = [0; 11];
        for texel in 0..atlas.len() {
            let sites = atlas.sites(texel, surfaces);
            counts[sites.len()] += 1;
            for site in &sites {
                // The texel is one of the texels sampled at the site, or adjacent to one of them.
                let blend = atlas.bilinear(surfaces, &site.point()).expect("it has texels");
                let (x, y) = atlas.place(texel);
                let near = |&other: &u32| {
                    let (ox, oy) = atlas.place(other as usize);
                    x.abs_diff(ox) <= 1 && y.abs_diff(oy) <= 1
                };
                assert!(blend.texels.iter().any(near));
                assert_eq!(atlas.chart(blend.texels[0] as usize), atlas.chart(texel));
                assert!(site.shading_normal.dot(site.geometric_normal) > 0.5);
            }
        }
        assert_eq!(counts[0], 0);
        assert!(counts[9] + counts[10] > 5000, "{counts:?}");
    });
}

/// A strip of a fifth of a texel has sites in its middle and at an edge. Its two triangles meet along a diagonal.
#[test]
fn sites_reach_the_edges_of_narrow_strips() {
    let mut scene = Scene::default();
    let gray = || material(Vec3::splat(0.5), Vec3::ZERO);
    add(&mut scene, rest(Vec3::ZERO), quad(Vec3::ZERO, Vec3::Z * 4.0, Vec3::X * 4.0), gray());
    add(&mut scene, rest(vec3(0.0, 1.0, 0.0)), quad(Vec3::ZERO, Vec3::Z * 4.0, Vec3::X * 0.02), gray());
    with_atlas(&scene, 1800, |surfaces, atlas| {
        assert!((atlas.texels_per_meter() - 10.0).abs() < 1.0 && atlas.narrow_charts() == 1);
        let mut count = 0;
        for texel in 0..atlas.len() {
            let sites = atlas.sites(texel, surfaces);
            if sites[0].instance == 1 {
                count += 1;
                let across: Vec<f32> = sites.iter().map(|site| site.position.x / 0.02).collect();
                assert!((across[0] - 0.5).abs() < 0.01, "{across:?}");
                assert!(across.iter().any(|&x| !(0.01..0.99).contains(&x)), "{across:?}");
            }
        }
        assert!(count > 35, "{count} texels");
    });
}

#[test]
fn boxes_face_outward() {
    let scene = room();
    with_atlas(&scene, 10_000, |surfaces, atlas| {
        for site in (0..atlas.len()).flat_map(|texel| atlas.sites(texel, surfaces)) {
            if [3, 4].contains(&site.instance) {
                let middle = surfaces.world(site.instance as usize).translation;
                assert!(site.geometric_normal.dot(site.position - middle) > 0.1);
            }
        }
    });
}

#[test]
fn charts_are_apart() {
    let scene = room();
    with_atlas(&scene, 10_000, |_, atlas| {
        let mut covers = BTreeSet::new();
        for texel in 0..atlas.len() {
            let (x, y) = atlas.place(texel);
            assert_eq!(atlas.texel(x, y), Some(texel as u32));
            assert!(covers.insert((x, y)), "each has a place of its own");
            for (ox, oy) in (0..25).map(|k| (x + k % 5, y + k / 5)).filter(|&(ox, oy)| ox > 1 && oy > 1) {
                if let Some(other) = atlas.texel(ox - 2, oy - 2) {
                    assert_eq!(atlas.chart(other as usize), atlas.chart(texel));
                }
            }
            let neighbors = atlas.neighbors(texel);
            let left = neighbors[3].map(|neighbor| atlas.place(neighbor as usize));
            assert!(left.is_none_or(|left| left == (x - 1, y)));
        }
        assert!(atlas.covered() < atlas.len() && atlas.tiles() * 256 >= atlas.len());
    });
}

#[test]
fn the_wished_number_is_met() {
    let scene = room();
    for wish in [2_000, 20_000, 100_000] {
        with_atlas(&scene, wish, |_, atlas| {
            assert!((atlas.len() as f64 / wish as f64 - 1.0).abs() < 0.05, "{} for {wish}", atlas.len());
        });
    }
}

/// A texel of the automatic density is 1/120 of the diagonal, for a floor whose texels are then above the minimum.
#[test]
fn the_automatic_number_follows_from_the_size() {
    for size in [0.01, 1.0, 300.0] {
        let mut scene = Scene::default();
        let gray = || material(Vec3::splat(0.5), Vec3::ZERO);
        for height in 0..5 {
            let corner = vec3(0.0, 0.1 * size * height as f32, 0.0);
            add(&mut scene, rest(corner), quad(Vec3::ZERO, Vec3::Z * size, Vec3::X * size), gray());
        }
        let surfaces = Surfaces::new(&scene, &scene.pose(0.0));
        let atlas = Atlas::automatic(&surfaces).expect("surfaces");
        let diagonal = vec3(size, 0.4 * size, size).length();
        let wanted = 120.0 / diagonal;
        assert!((atlas.texels_per_meter() / wanted - 1.0).abs() < 0.02, "{} for {wanted}", atlas.texels_per_meter());
        assert_eq!(atlas.narrow_charts(), 0);
        assert_eq!(atlas.texels_for_half_as_narrow(&surfaces), Ok(None));
    }
    // One square has fewer texels at this density than the minimum.
    let mut scene = Scene::default();
    add(&mut scene, rest(Vec3::ZERO), quad(Vec3::ZERO, Vec3::Z, Vec3::X), material(Vec3::ONE, Vec3::ZERO));
    let atlas = Atlas::automatic(&Surfaces::new(&scene, &scene.pose(0.0))).expect("a square");
    assert!((19_000..21_000).contains(&atlas.len()), "{} texels", atlas.len());
}

/// The suggested number of texels has at most half as many narrow charts. The charts are counted by their sizes.
#[test]
fn narrow_charts_are_counted_and_halved() {
    let mut scene = Scene::default();
    let gray = || material(Vec3::splat(0.5), Vec3::ZERO);
    for k in 0..20 {
        let width = 0.004 * (k + 1) as f32;
        add(&mut scene, rest(vec3(0.0, k as f32, 0.0)), quad(Vec3::ZERO, Vec3::Z, Vec3::X * width), gray());
    }
    let surfaces = Surfaces::new(&scene, &scene.pose(0.0));
    let narrow = |texels| {
        let atlas = Atlas::new(&surfaces, texels).expect("surfaces");
        let widths = (0..20).map(|k| 0.004 * (k + 1) as f32 * atlas.texels_per_meter());
        assert_eq!(atlas.narrow_charts(), widths.filter(|&width| width < 1.5).count(), "{texels} texels");
        (atlas.narrow_charts(), atlas.texels_for_half_as_narrow(&surfaces).expect("surfaces"))
    };
    let (count, texels) = narrow(2000);
    let (fewer, _) = narrow(texels.expect("possible") * 102 / 100);
    assert!(count > 5 && fewer <= count / 2, "{count} and {fewer}");
}

#[test]
fn wishes_that_cannot_be_met_are_refused() {
    let scene = room();
    let surfaces = Surfaces::new(&scene, &scene.pose(0.0));
    let Err(AtlasError::TooFewTexels { charts, .. }) = Atlas::new(&surfaces, 3) else { panic!("refused") };
    let smallest = Atlas::new(&surfaces, charts).expect("a texel for each chart");
    assert_eq!((smallest.charts(), smallest.len()), (charts, charts));
    assert!(matches!(Atlas::new(&surfaces, usize::MAX), Err(AtlasError::TooManyTexels { .. })));

    let nothing = Scene::default();
    let surfaces = Surfaces::new(&nothing, &nothing.pose(0.0));
    assert_eq!(Atlas::new(&surfaces, 1000), Err(AtlasError::NothingStatic));
}

#[test]
fn the_same_scene_has_the_same_atlas() {
    let scene = room();
    let surfaces = Surfaces::new(&scene, &scene.pose(0.0));
    let on_threads = |count| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(count).build().expect("threads");
        let atlas = pool.install(|| Atlas::new(&surfaces, 20_000).expect("surfaces"));
        serde_json::to_string(&atlas).expect("numbers")
    };
    assert_eq!(on_threads(1), on_threads(3));
}

#[test]
fn forged_atlases_are_refused() {
    let scene = room();
    let surfaces = Surfaces::new(&scene, &scene.pose(0.0));
    let atlas = Atlas::new(&surfaces, 2000).expect("surfaces");
    let honest = serde_json::to_value(&atlas).expect("numbers");
    let read = |value| serde_json::from_value::<Atlas>(value).expect("the same fields");
    assert!(read(honest.clone()) == atlas && atlas.validate(&scene));

    // Set each number in the file to a value out of range.
    for name in ["texels_per_meter", "covered"] {
        let mut forged = honest.clone();
        forged[name] = 1e9.into();
        if name == "covered" {
            forged[name] = u32::MAX.into();
        } else {
            forged[name] = (-1.0).into();
        }
        assert!(!read(forged).validate(&scene), "{name}");
    }
    let lists = ["sheets", "charts", "triangles", "owners", "tiles/grid", "tiles/tiles"];
    for list in lists.map(|list| format!("/{list}")) {
        let mut short = honest.clone();
        short.pointer_mut(&list).and_then(|list| list.as_array_mut()).expect("a list").pop();
        assert!(!read(short).validate(&scene), "a shorter {list}");
    }
    for number in ["owners/7", "charts/1/0", "triangles/3/chart", "sheets/0/first", "sheets/1/count", "tiles/grid/0"] {
        let mut forged = honest.clone();
        *forged.pointer_mut(&format!("/{number}")).expect("a number") = 123_456.into();
        assert!(!read(forged).validate(&scene), "{number}");
    }

    // An atlas of one scene does not fit another.
    let mut other = room();
    other.meshes[0].triangles.pop();
    assert!(!atlas.validate(&other));
    assert!(!atlas.validate(&Scene::default()));
}
