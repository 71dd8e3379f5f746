//! Coincident surfaces: coplanar sheets, walls shared by two rooms, edges hit exactly by rays.
//!
//! Films and path tracing use the same rays, so neither checks the other. Both are compared with colors known by
//! construction, separate rooms, and neighboring pixels.

use super::{Room, inside, look};
use glam::{Mat4, Quat, Vec3, vec3};
use plane::Plane;
use render_core::{image_file::read_exr, luminance};
use serde_json::json;
use tests::{Glb, Quad, render, render2mpeg};

const RED: Vec3 = Vec3::X;
const GREEN: Vec3 = Vec3::Y;
const BLUE: Vec3 = Vec3::Z;
/// Side of the pictures \[pixels\].
const SIDE: usize = 64;

impl Room {
    /// Returns the linear light of a film's first frame, without antialiasing.
    fn film(&self, side: usize, more: &str) -> Plane<Vec3> {
        let arguments = format!("--size {side}x{side} --frames 1 --antialiasing off --exr linear {more}");
        render(self.folder.path(), "film", &self.scene(), &arguments);
        read_exr(&self.folder.path().join("linear/frame_00000.exr")).expect("a linear frame")
    }

    /// Returns the path-traced light through the pixel centers.
    fn paths(&self, side: usize, more: &str) -> Plane<Vec3> {
        let scene = self.scene();
        let arguments = format!("--center --size {side}x{side} --frame 0 -o paths.exr -q --overwrite {more}");
        let scene = [scene.to_str().expect("a path in UTF-8")];
        let arguments: Vec<&str> = ["reference"].into_iter().chain(scene).chain(arguments.split_whitespace()).collect();
        let finished = render2mpeg(self.folder.path(), &arguments);
        assert_eq!(finished.code, Some(0), "{}", finished.stderr);
        read_exr(&self.folder.path().join("paths.exr")).expect("a linear picture")
    }
}

/// An emissive square sheet of one color.
#[derive(Clone, Copy)]
struct Sheet {
    color: Vec3,
    /// Whether it faces up in its own space.
    up: bool,
    double_sided: bool,
    /// Whether its other diagonal splits it.
    other_diagonal: bool,
    /// Whether it slides in its plane.
    moves: bool,
    /// Whether its vertices are rotated, and its node rotates them back.
    turned_back: bool,
}

impl Sheet {
    const fn up(color: Vec3) -> Self {
        Self { color, up: true, double_sided: false, other_diagonal: false, moves: false, turned_back: false }
    }

    const fn down(color: Vec3) -> Self {
        Self { up: false, ..Self::up(color) }
    }

    /// Returns the sheet in the plane y = 0, with a side of 8 m.
    fn quad(self) -> Quad {
        let (corner, a, b) = (vec3(-4.0, 0.0, -4.0), Vec3::Z * 8.0, Vec3::X * 8.0);
        let [corner, a, b] = if self.other_diagonal { [corner + a, b, -a] } else { [corner, a, b] };
        if self.up { [corner, a, b] } else { [corner, b, a] }
    }
}

/// Placement of a scene: rotation, scale, offset.
#[derive(Clone, Copy)]
struct Placed {
    turn: Quat,
    scale: f32,
    offset: Vec3,
    /// Whether the transform is in the nodes or in the vertices.
    by_node: bool,
}

/// Builds a view of coplanar `sheets` from above (`side` 1) or from below (−1).
fn sheets(sheets: &[Sheet], placed: Placed, side: f32) -> Room {
    let Placed { turn, scale, offset, by_node } = placed;
    let world = Mat4::from_scale_rotation_translation(Vec3::splat(scale), turn, offset);
    let mut glb = Glb::default();
    for (place, sheet) in sheets.iter().enumerate() {
        let own = if sheet.turned_back { Mat4::from_rotation_y(0.7) } else { Mat4::IDENTITY };
        let (to_file, node) =
            if by_node { (own, world * own.inverse()) } else { (world * own, world * own.inverse() * world.inverse()) };
        let [corner, a, b] = sheet.quad();
        let quad = [to_file.transform_point3(corner), to_file.transform_vector3(a), to_file.transform_vector3(b)];
        let index = glb.add(&[quad], Vec3::ZERO, sheet.color);
        glb.json["materials"][place]["doubleSided"] = json!(sheet.double_sided);
        if sheet.moves {
            let along = world.transform_vector3(Vec3::X) * 0.1;
            glb.json["nodes"][index] = json!({ "mesh": glb.json["nodes"][index]["mesh"], "translation": [0, 0, 0] });
            glb.animate(index, along, -along);
        } else if by_node || sheet.turned_back {
            glb.json["nodes"][index]["matrix"] = json!(node.to_cols_array());
        }
    }
    let eye = world.transform_point3(vec3(0.3, 2.1 * side, 0.9));
    look(&mut glb, eye, world.transform_point3(vec3(-0.1, 0.0, 0.2)));
    Room::new(&glb, "")
}

const AS_IS: Placed = Placed { turn: Quat::IDENTITY, scale: 1.0, offset: Vec3::ZERO, by_node: false };

fn slanted() -> Placed {
    Placed { turn: Quat::from_euler(glam::EulerRot::XYZ, 0.5, 0.3, 0.7), ..AS_IS }
}

/// Fraction of pixels with another color than `expected`.
fn others(picture: &Plane<Vec3>, expected: Vec3) -> f32 {
    let wrong = picture.samples().iter().filter(|&&pixel| pixel != expected).count();
    wrong as f32 / picture.samples().len() as f32
}

/// Checks that every pixel shows the expected sheet from above and below, in the film and in the path-traced picture.
fn check(name: &str, list: &[Sheet], placed: Placed, expected: [Vec3; 2]) {
    for (side, expected) in [1.0, -1.0].into_iter().zip(expected) {
        let room = sheets(list, placed, side);
        let shares = [room.film(SIDE, "--vpls 50 --photons 500"), room.paths(SIDE, "--spp 1")]
            .map(|picture| others(&picture, expected));
        println!(
            "{name:40} from {side:2}: {:5.1} % of the film are wrong, {:5.1} % by paths",
            100.0 * shares[0],
            100.0 * shares[1]
        );
        assert_eq!(shares, [0.0; 2], "{name}, from {side}");
    }
}

#[test]
fn sheets_back_to_back_show_their_fronts() {
    let pair = [Sheet::down(GREEN), Sheet::up(RED)];
    let shown = [RED, GREEN];
    check("axis-parallel", &pair, AS_IS, shown);
    check("slanted", &pair, slanted(), shown);
    check("turned by a node", &pair, Placed { by_node: true, ..slanted() }, shown);
    check("far from the origin", &pair, Placed { offset: vec3(900.0, -400.0, 700.0), ..slanted() }, shown);
    check("a thousand times as large", &pair, Placed { scale: 1000.0, ..slanted() }, shown);
    check("split along other diagonals", &[pair[0], Sheet { other_diagonal: true, ..pair[1] }], slanted(), shown);
    check("one turned there and back", &[pair[0], Sheet { turned_back: true, ..pair[1] }], slanted(), shown);
    check("one that moves", &[Sheet { moves: true, ..pair[0] }, pair[1]], slanted(), shown);
    check("both move", &pair.map(|sheet| Sheet { moves: true, ..sheet }), slanted(), shown);
}

#[test]
fn of_sheets_that_face_one_way_the_first_in_the_file_is_seen() {
    let pair = [Sheet::up(RED), Sheet { other_diagonal: true, ..Sheet::up(GREEN) }];
    let shown = [RED, Vec3::ZERO];
    check("axis-parallel", &pair, AS_IS, shown);
    check("slanted", &pair, slanted(), shown);
    check("turned by a node", &pair, Placed { by_node: true, ..slanted() }, shown);
    check("far from the origin", &pair, Placed { offset: vec3(900.0, -400.0, 700.0), ..slanted() }, shown);
    check("a thousandth as large", &pair, Placed { scale: 1e-3, ..slanted() }, shown);
    check("one turned there and back", &[Sheet { turned_back: true, ..pair[0] }, pair[1]], slanted(), shown);
    check("the first moves", &[Sheet { moves: true, ..pair[0] }, pair[1]], slanted(), shown);
    check("the second moves", &[pair[0], Sheet { moves: true, ..pair[1] }], slanted(), shown);
    check("three, one back to back", &[Sheet::down(BLUE), pair[0], pair[1]], slanted(), [RED, BLUE]);
    let double_sided = Sheet { double_sided: true, ..Sheet::up(BLUE) };
    check("a double-sided one first", &[double_sided, pair[0]], slanted(), [BLUE; 2]);
    check("a double-sided one last", &[pair[0], double_sided], slanted(), [RED, BLUE]);
}

/// Builds two rooms of 2 m, each with a lamp, at a distance of `apart` meters.
fn two_rooms(apart: f32, turn: Quat) -> Room {
    let mut glb = Glb::default();
    let turned = |quads: Vec<Quad>| quads.into_iter().map(|quad| quad.map(|v| turn * v)).collect::<Vec<_>>();
    let beyond = Vec3::X * apart;
    glb.add(
        &turned(inside(vec3(0.0, 0.0, 0.0) + beyond, vec3(2.0, 2.0, 2.0) + beyond)),
        vec3(0.1, 0.2, 0.7),
        Vec3::ZERO,
    );
    glb.add(&turned(inside(vec3(-2.0, 0.0, 0.0), vec3(0.0, 2.0, 2.0))), vec3(0.7, 0.6, 0.5), Vec3::ZERO);
    for (x, radiance) in [(-1.0, 8.0), (1.0 + apart, 40.0)] {
        let quad = [vec3(x - 0.3, 1.9, 0.7), Vec3::X * 0.6, Vec3::Z * 0.6];
        glb.add(&turned(vec![quad]), Vec3::ZERO, Vec3::splat(radiance));
    }
    look(&mut glb, turn * vec3(-1.7, 1.1, 1.3), turn * vec3(0.0, 0.8, 0.9));
    Room::new(&glb, "")
}

/// A shared wall of single-sided faces separates two rooms: each is lit as with 1 cm between them.
#[test]
fn a_shared_wall_is_that_of_rooms_apart() {
    for (name, turn) in
        [("axis-parallel", Quat::IDENTITY), ("turned", Quat::from_euler(glam::EulerRot::XYZ, 0.5, 0.3, 0.7))]
    {
        let (shared, apart) = (two_rooms(0.0, turn), two_rooms(0.01, turn));
        let off = |found: &Plane<Vec3>, expected: &Plane<Vec3>, tolerance: f32| {
            let wrong = found.samples().iter().zip(expected.samples());
            let wrong = wrong.filter(|(a, b)| (luminance(**a) / luminance(**b) - 1.0).abs() > tolerance);
            wrong.count() as f32 / found.samples().len() as f32
        };
        // Path tracing differs by the rounding of the other room's position, films by the positions of lights.
        let films = off(&shared.film(SIDE, ""), &apart.film(SIDE, ""), 0.15);
        let paths = off(&shared.paths(SIDE, "--spp 16"), &apart.paths(SIDE, "--spp 16"), 1e-3);
        println!("{name}: {:.1} % of the film are off, {:.1} % by paths", 100.0 * films, 100.0 * paths);
        assert!(films < 0.02 && paths < 0.005, "{name}: {films} of the film, {paths} by paths");
    }
}

/// Builds a symmetric room, seen along its axis: creases cross pixel centers on the picture's diagonals.
fn symmetric(turn: Quat, offset: Vec3, scale: f32, by_node: bool) -> Room {
    let mut glb = Glb::default();
    // The transform is in the node or in the vertices.
    let world = Mat4::from_scale_rotation_translation(Vec3::splat(scale), turn, offset);
    let quads = inside(Vec3::splat(-1.0), Vec3::ONE);
    let quads = if by_node {
        quads
    } else {
        quads
            .into_iter()
            .map(|[c, a, b]| [world.transform_point3(c), world.transform_vector3(a), world.transform_vector3(b)])
            .collect()
    };
    let walls = glb.add(&quads, Vec3::splat(0.5), Vec3::ZERO);
    if by_node {
        glb.json["nodes"][walls]["matrix"] = json!(world.to_cols_array());
    }

    // A point light near the camera, with an intensity that matches the scale.
    let light = glb.add_camera(world.transform_point3(vec3(0.0, 0.0, 0.3)));
    let lamp = json!({ "type": "point", "intensity": scale * scale });
    glb.json["extensions"] = json!({ "KHR_lights_punctual": { "lights": [lamp] } });
    glb.json["nodes"][light]["extensions"] = json!({ "KHR_lights_punctual": { "light": 0 } });
    let camera = glb.add_camera(Vec3::ZERO);
    let stands = Mat4::from_rotation_translation(turn, offset).to_cols_array();
    glb.json["nodes"][camera] = json!({ "camera": 1, "matrix": stands });
    glb.json["cameras"][1]["perspective"]["yfov"] = json!(2.0);
    Room::new(&glb, "")
}

/// Returns the minimum ratio of a diagonal pixel to the mean of its neighbors, and the number of ratios below 0.9.
fn crease(picture: &Plane<Vec3>) -> (f32, usize) {
    let side = picture.width();
    let at = |x: usize, y: usize| luminance(picture.get(x, y));
    let (mut least, mut dark) = (f32::INFINITY, 0);
    for x in 1..side - 1 {
        for y in [x, side - 1 - x] {
            let beside = (at(x - 1, y) + at(x + 1, y) + at(x, y - 1) + at(x, y + 1)) / 4.0;
            let ratio = at(x, y) / beside;
            least = least.min(ratio);
            dark += usize::from(ratio < 0.9);
            if ratio < 0.9 {}
        }
    }
    (least, dark)
}

/// An edge between two walls is as bright as the area next to it.
#[test]
fn a_crease_is_lit_as_what_is_beside() {
    let turn = Quat::from_euler(glam::EulerRot::XYZ, 0.5, 0.3, 0.7);
    for (name, room) in [
        ("axis-parallel", symmetric(Quat::IDENTITY, Vec3::ZERO, 1.0, false)),
        ("turned", symmetric(turn, Vec3::ZERO, 1.0, false)),
        ("turned by a node", symmetric(turn, Vec3::ZERO, 1.0, true)),
        ("off the origin", symmetric(Quat::IDENTITY, vec3(7.3, -2.1, 4.7), 1.0, false)),
        ("turned, off the origin", symmetric(turn, vec3(70.3, -20.1, 40.7), 1.0, false)),
        ("a thousand times as large", symmetric(turn, Vec3::ZERO, 1000.0, true)),
    ] {
        let film = crease(&room.film(256, "--bounces 1 --camera 1"));
        let paths = crease(&room.paths(256, "--spp 4 --bounces 1 --camera 1"));
        println!("{name:30} film {film:.2?}, paths {paths:.2?}");
        // Next to a symmetric crease, light falls off by 1 % per pixel.
        assert!(film.0 > 0.95 && paths.0 > 0.95, "{name}: {film:?} in the film, {paths:?} by paths");
    }
}
