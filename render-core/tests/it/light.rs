//! Tests that compare direct light and photons with closed forms.

use crate::common::{add, material, quad, rest, room};
use glam::{Quat, Vec3, Vec3A, vec3};
use render_core::ranks::{Alone, Ranks, ThreadRanks};
use render_core::scene::{
    Channel, Gradient, Interpolation, Material, Mesh, Node, PunctualKind, PunctualLight, Scene, Track, Transform,
};
use render_core::{
    AnchorFlux, AnchorSpread, Anchors, DirectLights, Emitters, Geometry, Photons, PosedScene, ShadingPoint, Surfaces,
    SweptVolume, Units, Zones, luminance,
};
use std::f32::consts::{FRAC_PI_2, PI};
use std::sync::Arc;

/// Returns the irradiance at `position` with normal +y. All emissive surfaces are sampled.
fn irradiance(scene: &Scene, position: Vec3) -> Vec3 {
    let pose = scene.pose(0.0);
    let surfaces = Surfaces::new(scene, &pose);
    let accelerator = Geometry::new(scene).place(&pose);
    let emitters = Emitters::new(&surfaces, &pose, &Units::of(scene));
    let all: Vec<usize> = (0..emitters.areas.len()).collect();
    let direct = DirectLights::new(&emitters, &surfaces, &Anchors::default(), &[], &all);
    let receiver = ShadingPoint { position: position.into(), normal: Vec3A::Y, geometric_normal: Vec3A::Y };
    direct.irradiance(&accelerator, &receiver).value
}

/// Returns the form factor from a point facing +y to a rectangle with sides `a`, `b` at height `h` above the point. One
/// corner of the rectangle is directly overhead (Howell's catalog, configuration B-3).
fn corner_form_factor(a: f32, b: f32, h: f32) -> f32 {
    let (x, y) = (a / h, b / h);
    let (rx, ry) = ((1.0 + x * x).sqrt(), (1.0 + y * y).sqrt());
    (x / rx * (y / rx).atan() + y / ry * (x / ry).atan()) / (2.0 * PI)
}

#[test]
fn a_rectangle_lights_as_its_form_factor_says() {
    let panel = |half: f32| quad(vec3(-half, 2.0, -half), Vec3::X * 2.0 * half, Vec3::Z * 2.0 * half);
    for half in [0.1f32, 0.5, 1.0] {
        let mut scene = Scene::default();
        add(&mut scene, rest(Vec3::ZERO), panel(half), material(Vec3::ZERO, vec3(3.0, 2.0, 1.0)));
        let expected = 4.0 * corner_form_factor(half, half, 2.0) * PI * 3.0;
        let found = irradiance(&scene, Vec3::ZERO);
        assert!((found.x / expected - 1.0).abs() < 0.005, "half side {half}: {} instead of {expected}", found.x);
        assert!((found.y / found.x - 2.0 / 3.0).abs() < 1e-5, "color is kept");
        // Behind the panel, no light arrives.
        assert_eq!(irradiance(&scene, vec3(0.0, 3.0, 0.0)), Vec3::ZERO);
    }
}

/// A fully emissive box, represented by its points, is compared with the closed form of its faces and with six lamps of
/// one face each. If the choices of face and position were correlated, points would crowd to one side of each face.
#[test]
fn a_box_lamp_lights_as_its_faces_do() {
    let half = vec3(0.3, 0.05, 0.3);
    let box_lamp = |count: usize| {
        let (mut scene, faces) = (Scene::default(), faces_of_a_box(half));
        for faces in faces.chunks(faces.len() / count) {
            let meshes = faces.iter().map(|&[corner, a, b]| quad(corner, a, b));
            let mesh = meshes.reduce(joined).expect("faces");
            add(&mut scene, rest(Vec3::ZERO), mesh, material(Vec3::ZERO, vec3(3.0, 2.0, 1.0)));
        }
        scene
    };
    let (whole, parts) = (box_lamp(1), box_lamp(6));
    for receiver in [vec3(0.0, -0.8, 0.0), vec3(0.9, -0.5, 0.2), vec3(-0.7, 0.6, 0.8), vec3(0.1, 0.2, -1.2)] {
        let normal = -receiver.normalize();
        let by_faces: f32 = faces_of_a_box(half).into_iter().map(|face| lambert(receiver, normal, face)).sum();
        let expected = 3.0 * by_faces;
        for (lamps, points) in [(&whole, 453), (&whole, 64), (&parts, 64)] {
            let found = unhidden(lamps, points, receiver, normal);
            // A few points do not represent a surface close by, regardless of their positions.
            let tolerance = if points == 64 && std::ptr::eq(lamps, &whole) { 0.04 } else { 0.01 };
            assert!(
                (found / expected - 1.0).abs() < tolerance,
                "{points} points at {receiver}: {found}, not {expected}"
            );
        }
    }
}

/// Returns six rectangles that face outward, each given by a corner and two edges.
fn faces_of_a_box(half: Vec3) -> Vec<[Vec3; 3]> {
    let mut faces = Vec::new();
    for axis in 0..3 {
        let edge = |turn: usize| Vec3::AXES[(axis + turn) % 3] * half * 2.0;
        for outward in [Vec3::AXES[axis] * half, -Vec3::AXES[axis] * half] {
            let corner = outward - (edge(1) + edge(2)) / 2.0;
            let is_upper = outward.max_element() > 0.0;
            faces.push(if is_upper { [corner, edge(1), edge(2)] } else { [corner, edge(2), edge(1)] });
        }
    }
    faces
}

/// Merges two meshes into one.
fn joined(mut a: Mesh, b: Mesh) -> Mesh {
    let first = a.positions.len() as u32;
    a.positions.extend(b.positions);
    a.triangles.extend(b.triangles.iter().map(|corners| corners.map(|corner| first + corner)));
    a
}

/// Returns the irradiance from a rectangle of radiance 1 that faces a point and is above the point's horizon, without
/// shadows (Lambert 1760). It is half a sum over the rectangle's edges: the angle that an edge spans, times the cosine
/// between the normal and the plane through the edge.
fn lambert(receiver: Vec3, normal: Vec3, [corner, a, b]: [Vec3; 3]) -> f32 {
    if a.cross(b).dot(receiver - corner) <= 0.0 {
        return 0.0;
    }
    let corners = [corner, corner + a, corner + a + b, corner + b].map(|corner| (corner - receiver).normalize());
    assert!(corners.iter().all(|corner| corner.dot(normal) > 0.0), "all of it is above the horizon");
    let edges = (0..4).map(|k| (corners[k], corners[(k + 1) % 4]));
    edges.map(|(p, q)| p.angle_between(q) * q.cross(p).normalize().dot(normal)).sum::<f32>() / 2.0
}

/// Returns the first channel of the irradiance from `points` points of each lamp.
fn unhidden(scene: &Scene, points: usize, receiver: Vec3, normal: Vec3) -> f32 {
    let pose = scene.pose(0.0);
    let surfaces = Surfaces::new(scene, &pose);
    let emitters = Emitters::new(&surfaces, &pose, &Units::of(scene));
    let samples = emitters.areas.iter().flat_map(|area| area.samples(&surfaces, points));
    let light = samples.map(|sample| {
        let way = Vec3::from(sample.position) - receiver;
        let (direction, r2) = (way.normalize(), way.length_squared());
        let cosines = direction.dot(normal).max(0.0) * (-direction).dot(sample.normal.into()).max(0.0);
        sample.intensity.x * cosines / r2
    });
    light.sum()
}

/// A half-plane is between a lamp and the floor. Each position sees a rectangle of the lamp, and the expected light is
/// the closed form for this rectangle. At both ends of the penumbra, the error stays within the light of a few of the
/// lamp's 64 points.
#[test]
fn a_penumbra_begins_where_the_lamp_comes_up() {
    let lamp = |from: f32| {
        let mut scene = Scene::default();
        let panel = quad(vec3(from, 2.0, -0.5), Vec3::X * (0.5 - from), Vec3::Z);
        add(&mut scene, rest(Vec3::ZERO), panel, material(Vec3::ZERO, Vec3::ONE));
        scene
    };
    let mut hidden = lamp(-0.5);
    let half = quad(vec3(-9.0, 1.0, -9.0), Vec3::X * 9.0, Vec3::Z * 18.0);
    add(&mut hidden, rest(Vec3::ZERO), half, material(Vec3::ONE, Vec3::ZERO));
    let mut partial = 0;
    for k in -70..70 {
        let place = vec3(k as f32 / 100.0 + 0.003, 0.0, 0.02);
        let whole = irradiance(&lamp(-0.5), place).x;
        // The edge is halfway up, so a position to the right of it sees the lamp equally far to the left.
        let seen_from = (-place.x).clamp(-0.5, 0.5);
        let expected = if seen_from < 0.5 { irradiance(&lamp(seen_from), place).x } else { 0.0 };
        let found = irradiance(&hidden, place).x;
        partial += usize::from(found > 0.0 && found < 0.99 * whole);
        assert!((found - expected).abs() < 0.025 * whole, "at {}: {found}, not {expected} of {whole}", place.x);
    }
    assert!(partial > 80, "{partial} places in the penumbra");
}

#[test]
fn punctual_lights_follow_their_laws() {
    let mut scene = Scene::default();
    add(&mut scene, rest(Vec3::ZERO), quad(vec3(9.0, -1.0, 9.0), Vec3::Z, Vec3::X), material(Vec3::ONE, Vec3::ZERO));
    let down = Quat::from_rotation_x(-FRAC_PI_2);
    let mut light = |translation, rotation, kind, color| {
        scene.nodes.push(Node { name: String::new(), parent: None, rest: Transform { rotation, ..rest(translation) } });
        scene.punctual_lights = vec![PunctualLight { node: scene.nodes.len() - 1, color, kind }];
        irradiance(&scene, Vec3::ZERO)
    };
    let near = |found: Vec3, expected: f32| {
        assert!((found.x - expected).abs() < 1e-3 * expected.max(0.01), "{found} for {expected}")
    };
    let gray = Vec3::splat;
    near(light(vec3(0.0, 2.0, 0.0), Quat::IDENTITY, PunctualKind::Point, gray(8.0)), 2.0);
    // At 45°, cos / r² = (1/√2) / 8.
    near(light(vec3(2.0, 2.0, 0.0), Quat::IDENTITY, PunctualKind::Point, gray(8.0)), 0.5f32.sqrt());
    near(light(Vec3::ZERO, down, PunctualKind::Directional, gray(5.0)), 5.0);
    near(
        light(Vec3::ZERO, Quat::from_rotation_x(-FRAC_PI_2 + 1.0), PunctualKind::Directional, gray(5.0)),
        5.0 * 1.0f32.cos(),
    );
    let cone = PunctualKind::Spot { inner: 0.2, outer: 0.4 };
    near(light(vec3(0.0, 2.0, 0.0), down, cone, gray(8.0)), 2.0);
    near(light(vec3(0.0, 2.0, 0.0), Quat::IDENTITY, cone, gray(8.0)), 0.0);
}

#[test]
fn a_half_covered_panel_gives_half_its_light() {
    let mut scene = Scene::default();
    let panel = quad(vec3(-0.5, 2.0, -0.5), Vec3::X, Vec3::Z);
    add(&mut scene, rest(Vec3::ZERO), panel, material(Vec3::ZERO, Vec3::ONE));
    let open = irradiance(&scene, Vec3::ZERO).x;
    let screen = quad(vec3(0.0, 1.0, -5.0), Vec3::X * 5.0, Vec3::Z * 10.0);
    add(&mut scene, rest(Vec3::ZERO), screen, material(Vec3::ZERO, Vec3::ZERO));
    let half = irradiance(&scene, Vec3::ZERO).x;
    assert!((half / open - 0.5).abs() < 0.02, "{half} of {open}");
}

fn photons(scene: &Scene, count: u64) -> (Anchors, AnchorFlux) {
    let pose = scene.pose(0.0);
    let surfaces = Surfaces::new(scene, &pose);
    let accelerator = Geometry::new(scene).place(&pose);
    let units = Units::of(scene);
    let emitters = Emitters::new(&surfaces, &pose, &units);
    let anchors = Anchors::spread(&surfaces, &units, 600, 0);
    let anchor_flux =
        Photons::new(count, 3).trace(PosedScene::new(&accelerator, &surfaces), &emitters, &anchors, &units).value;
    (anchors, anchor_flux)
}

#[test]
fn in_a_furnace_the_reflected_flux_is_the_geometric_series() {
    for albedo in [0.2f32, 0.5, 0.8] {
        let mut scene = Scene::default();
        add(&mut scene, rest(Vec3::ZERO), room(), material(Vec3::splat(albedo), vec3(1.0, 2.0, 0.5)));
        let (anchors, anchor_flux) = photons(&scene, 40_000);
        let area = 24.0;
        assert!(
            (anchor_flux.emitted.x / (PI * area) - 1.0).abs() < 1e-3,
            "power of the walls: {}",
            anchor_flux.emitted.x
        );
        let series = albedo / (1.0 - albedo);
        let ratio = luminance(anchor_flux.reflected) / luminance(anchor_flux.emitted);
        assert!((ratio / series - 1.0).abs() < 0.01, "albedo {albedo}: {ratio} instead of {series}");
        let held: Vec3 = anchor_flux.fixed.iter().sum();
        assert!(
            (luminance(held) / luminance(anchor_flux.reflected) - 1.0).abs() < 1e-5,
            "anchors contain the photons' energy"
        );
        // The room is closed, but a ray exactly through an edge may pass between the two triangles that share the edge.
        assert!(luminance(anchor_flux.lost) < 1e-3 * luminance(anchor_flux.emitted), "{} lost", anchor_flux.lost);
        // In uniform light, anchors have uniform energy. An anchor owns four surfels; at random positions, the spread
        // would be 1/√4.
        let mean = luminance(held) / anchors.fixed.len() as f32;
        let spread = anchor_flux.fixed.iter().map(|&e| (luminance(e) / mean - 1.0).powi(2)).sum::<f32>() / 600.0;
        assert!(spread.sqrt() < 0.4, "relative spread {}", spread.sqrt());
    }
}

#[test]
fn emitted_power_is_the_closed_form_for_every_kind_of_light() {
    let floor = || quad(vec3(-1.0, 0.0, -1.0), Vec3::Z * 2.0, Vec3::X * 2.0);
    let scene_with = |kind: Option<PunctualKind>| {
        let mut scene = Scene::default();
        add(&mut scene, rest(Vec3::ZERO), floor(), material(Vec3::splat(0.5), Vec3::ZERO));
        scene.nodes.push(Node {
            name: String::new(),
            parent: None,
            rest: Transform { rotation: Quat::from_rotation_x(-FRAC_PI_2), ..rest(Vec3::Y) },
        });
        match kind {
            Some(kind) => scene.punctual_lights.push(PunctualLight { node: 1, color: Vec3::ONE, kind }),
            None => scene.sky = render_core::Environment::gradient(Gradient::constant([1.0; 3])),
        }
        scene
    };
    let power = |kind| {
        let scene = scene_with(kind);
        (photons(&scene, 100_000).1, Units::of(&scene).radius)
    };
    let (point, _) = power(Some(PunctualKind::Point));
    assert!((point.emitted.x / (4.0 * PI) - 1.0).abs() < 1e-3);
    let (sun, radius) = power(Some(PunctualKind::Directional));
    assert!((sun.emitted.x / (PI * radius * radius) - 1.0).abs() < 1e-3);
    // The irradiance is 1 on the floor's 4 m², and half of it is reflected. No other surface is lit.
    assert!((sun.reflected.x / 2.0 - 1.0).abs() < 0.01, "{}", sun.reflected.x);
    let (sky, _) = power(None);
    // A sky of radiance 1 causes irradiance π on either side, but only the front reflects.
    assert!((sky.reflected.x / (2.0 * PI) - 1.0).abs() < 0.02, "{}", sky.reflected.x);
}

#[test]
fn threads_do_not_change_a_bit() {
    let mut scene = Scene::default();
    add(&mut scene, rest(Vec3::ZERO), room(), material(Vec3::splat(0.6), Vec3::ONE));
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| photons(&scene, 5000).1)
    };
    assert_eq!(with(1), with(3));
}

/// Builds a gray room with a lamp under its ceiling, and a panel that slides through its center for a second.
fn room_with_a_sliding_panel() -> Scene {
    let mut scene = Scene::default();
    add(&mut scene, rest(Vec3::ZERO), room(), material(Vec3::splat(0.6), Vec3::ZERO));
    let lamp = quad(vec3(-0.2, 0.95, -0.2), Vec3::X * 0.4, Vec3::Z * 0.4);
    add(&mut scene, rest(Vec3::ZERO), lamp, material(Vec3::ZERO, Vec3::splat(9.0)));
    let panel = quad(Vec3::ZERO, Vec3::X * 0.4, Vec3::Y * 0.4);
    add(
        &mut scene,
        rest(Vec3::ZERO),
        panel,
        Material { double_sided: true, ..material(vec3(0.8, 0.3, 0.1), Vec3::ZERO) },
    );
    scene.channels.push(Channel {
        node: scene.nodes.len() - 1,
        times: vec![0.0, 1.0],
        track: Track::Translation(vec![vec3(-0.9, -0.8, 0.3), vec3(0.4, -0.8, 0.3)]),
        interpolation: Interpolation::Linear,
    });
    scene
}

#[test]
fn photons_that_stay_are_kept_and_no_bit_changes() {
    let scene = room_with_a_sliding_panel();
    let units = Units::of(&scene);
    let rest = scene.pose(0.0);
    let anchors = Anchors::spread(&Surfaces::new(&scene, &rest), &units, 300, 12);
    let geometry = Geometry::new(&scene);
    let frames = || (0..5).map(|n| n as f32 / 4.0);
    let mut all = Photons::new(30_000, 7);
    let mut kept = Photons::new(30_000, 7).with_swept_volume(SweptVolume::of(&scene, &units, frames()));
    let mut anchor_flux: Vec<AnchorFlux> = Vec::new();
    for time in frames() {
        let pose = scene.pose(time);
        let surfaces = Surfaces::new(&scene, &pose);
        let accelerator = geometry.place(&pose);
        let emitters = Emitters::new(&surfaces, &pose, &units);
        let trace = |photons: &mut Photons| {
            photons.trace(PosedScene::new(&accelerator, &surfaces), &emitters, &anchors, &units).value
        };
        let (a, b) = (trace(&mut all), trace(&mut kept));
        assert_eq!(a.traced, 30_000);
        if time > 0.0 {
            assert!(b.traced > 1000 && b.traced < 24_000, "{} photons were traced again", b.traced);
        }
        assert_eq!(AnchorFlux { traced: 0, ..a.clone() }, AnchorFlux { traced: 0, ..b });
        anchor_flux.push(a);
    }
    assert!(anchor_flux.windows(2).all(|pair| pair[0].fixed != pair[1].fixed), "the panel casts a moving shadow");
    let held: Vec3 = anchor_flux[2].fixed.iter().chain(&anchor_flux[2].dynamic).sum();
    assert!((luminance(held) / luminance(anchor_flux[2].reflected) - 1.0).abs() < 1e-5);
    assert!(anchor_flux[2].dynamic.iter().any(|e| e.x > 0.0));
}

/// Photons shared among ranks produce the same result as one rank's photons in every frame. Each photon is traced by one
/// rank only.
#[test]
fn photons_of_several_ranks_are_those_of_one() {
    let scene = room_with_a_sliding_panel();
    let units = Units::of(&scene);
    let rest = scene.pose(0.0);
    let anchors = Anchors::spread(&Surfaces::new(&scene, &rest), &units, 300, 12);
    let geometry = Geometry::new(&scene);
    let frames = || (0..3).map(|n| n as f32 / 2.0);
    // Use six batches of photons, with a shorter last batch.
    let count = 90_000;
    let traced = |ranks: Arc<dyn Ranks>, keeps: bool| -> Vec<AnchorFlux> {
        let mut photons = Photons::new(count, 7).with_ranks(ranks);
        if keeps {
            photons = photons.with_swept_volume(SweptVolume::of(&scene, &units, frames()));
        }
        let flux = |time| {
            let pose = scene.pose(time);
            let surfaces = Surfaces::new(&scene, &pose);
            let emitters = Emitters::new(&surfaces, &pose, &units);
            photons.trace(PosedScene::new(&geometry.place(&pose), &surfaces), &emitters, &anchors, &units).value
        };
        frames().map(flux).collect()
    };
    for keeps in [false, true] {
        let alone = traced(Arc::new(Alone), keeps);
        for ranks in [2, 4] {
            let all: Vec<Vec<AnchorFlux>> = std::thread::scope(|scope| {
                let ranks = ThreadRanks::new(ranks).into_iter();
                let started: Vec<_> = ranks.map(|own| scope.spawn(|| traced(Arc::new(own), keeps))).collect();
                started.into_iter().map(|thread| thread.join().expect("no rank fails")).collect()
            });
            for (frame, alone) in alone.iter().enumerate() {
                for own in &all {
                    assert_eq!(
                        AnchorFlux { traced: 0, ..own[frame].clone() },
                        AnchorFlux { traced: 0, ..alone.clone() }
                    );
                    assert!(own[frame].traced < alone.traced, "not all are traced on every rank");
                }
                assert_eq!(all.iter().map(|own| own[frame].traced).sum::<u64>(), alone.traced);
            }
        }
    }
}

/// Light with at most n reflections is the sum of the first n terms of the series.
#[test]
fn paths_can_be_cut_short() {
    let mut scene = Scene::default();
    add(&mut scene, rest(Vec3::ZERO), room(), material(Vec3::splat(0.5), Vec3::ONE));
    let pose = scene.pose(0.0);
    let surfaces = Surfaces::new(&scene, &pose);
    let units = Units::of(&scene);
    let emitters = Emitters::new(&surfaces, &pose, &units);
    let anchors = Anchors::spread(&surfaces, &units, 100, 0);
    let accelerator = Geometry::new(&scene).place(&pose);
    for bounces in 0..4 {
        let mut photons = Photons::new(20_000, 1).with_bounces(bounces);
        let anchor_flux = photons.trace(PosedScene::new(&accelerator, &surfaces), &emitters, &anchors, &units).value;
        let series: f32 = (1..=bounces as i32).map(|n| 0.5f32.powi(n)).sum();
        let ratio = luminance(anchor_flux.reflected) / luminance(anchor_flux.emitted);
        assert!((ratio - series).abs() < 0.01, "{bounces} bounces: {ratio} instead of {series}");
    }
}

/// Covered surfaces have no anchors, and about the requested number of anchors remains. Moving objects cover no
/// surface, since they leave a lit floor behind.
#[test]
fn anchors_keep_out_of_covered_places() {
    let mut scene = room_with_a_block();
    let pose = scene.pose(0.0);
    let (surfaces, units) = (Surfaces::new(&scene, &pose), Units::of(&scene));
    let covered = |anchors: &Anchors| {
        let under = |p: Vec3A| p.x.abs() < 0.499 && p.z.abs() < 0.499 && p.y < -0.999;
        anchors.fixed.iter().filter(|anchor| under(anchor.position)).count()
    };
    let everywhere = Anchors::spread(&surfaces, &units, 2000, 0);
    let zones = Zones::default();
    let spread = AnchorSpread { zones: &zones, fixed: 2000, dynamic: 0, ranks: &Alone };
    assert!(covered(&everywhere) > 50, "the floor under the block is 1 of 29 m²");
    let exposed = Anchors::spread_exposed(&surfaces, &Geometry::new(&scene), &units, &spread);
    assert_eq!(covered(&exposed), 0);
    assert!(exposed.fixed.len().abs_diff(2000) < 40, "{} anchors", exposed.fixed.len());
    assert!(
        (exposed.area_share * exposed.fixed.len() as f32 / 28.0 - 1.0).abs() < 0.02,
        "they represent the exposed area"
    );

    for node in 1..scene.nodes.len() {
        scene.channels.push(Channel {
            node,
            times: vec![0.0, 1.0],
            track: Track::Translation(vec![Vec3::ZERO, Vec3::X * 0.3]),
            interpolation: Interpolation::Linear,
        });
    }
    let pose = scene.pose(0.0);
    let surfaces = Surfaces::new(&scene, &pose);
    let moving = Anchors::spread_exposed(&surfaces, &Geometry::new(&scene), &units, &spread);
    // The static surfaces have an area of 24 m².
    assert!(covered(&moving).abs_diff(2000 / 24) < 15, "{} of 83 anchors under the block", covered(&moving));
}

/// Builds a block on the floor of a room, with sides facing outward and without a bottom.
fn room_with_a_block() -> Scene {
    let mut scene = Scene::default();
    add(&mut scene, rest(Vec3::ZERO), room(), material(Vec3::splat(0.5), Vec3::ONE));
    let (low, high) = (vec3(-0.5, -1.0, -0.5), vec3(0.5, 0.0, 0.5));
    let sides = [
        (vec3(low.x, high.y, low.z), Vec3::Z, Vec3::X),
        (low, Vec3::Y, Vec3::X),
        (vec3(low.x, low.y, high.z), Vec3::X, Vec3::Y),
        (low, Vec3::Z, Vec3::Y),
        (vec3(high.x, low.y, low.z), Vec3::Y, Vec3::Z),
    ];
    for (corner, a, b) in sides {
        add(&mut scene, rest(Vec3::ZERO), quad(corner, a, b), material(Vec3::splat(0.5), Vec3::ZERO));
    }
    scene
}
