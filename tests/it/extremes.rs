//! Scenes at the limits of number ranges: light, lengths, shapes, albedo, counts. Every frame is finite. Sums of light match
//! a closed form or the same scene at a common scale, and omitted objects are counted.

use glam::{Vec3, vec3};
use pipeline::Run;
use plane::Plane;
use render_core::image_file::{read_exr, write_exr};
use render_core::{luminance, scene};
use render2mpeg::settings::ExrDepth;
use render2mpeg::{Options, Report, Settings};
use renderer::plan::Plan;
use renderer::settings::Lighting;
use serde_json::{Value, json};
use std::path::Path;
use tests::{Glb, Moving, checkered_room, furnace};

const SIDE: usize = 32;

/// Options of a small, fast film.
fn small() -> Options {
    let size = format!("{SIDE}x{SIDE}").parse().ok();
    Options { frames: Some(2), size, vpls: Some(200), photons: Some(10_000), ..Options::default() }
}

/// Returns the last frame of a film of `glb` in linear light, and the report.
fn film_in(folder: &Path, glb: &Glb, settings: &str, options: Options) -> Result<(Plane<Vec3>, Report), String> {
    let path = folder.join("scene.glb");
    glb.write(&path);
    std::fs::write(path.with_extension("toml"), settings).unwrap();
    let scene = scene::load(&path).map_err(|error| error.to_string())?;
    let exr = folder.join("linear");
    std::fs::create_dir_all(&exr).unwrap();
    let options = Options {
        output: Some(folder.join("film.m2v")),
        exr: Some(exr.clone()),
        exr_depth: Some(ExrDepth::Float),
        ..options
    };
    let settings = Settings::new(path, &scene, &options).map_err(|error| error.to_string())?;
    let plan = Plan::new(&scene, &settings.render);
    let report = render2mpeg::render(&scene, &settings, &plan, Run::default());
    let report = report.map_err(|error| error.chain())?;
    let last = exr.join(format!("frame_{:05}.exr", settings.render.frames - 1));
    Ok((read_exr(&last).unwrap(), report))
}

fn film(glb: &Glb, settings: &str) -> (Plane<Vec3>, Report) {
    film_in(tempfile::tempdir().unwrap().path(), glb, settings, small()).unwrap()
}

/// Checks that every pixel is finite and not negative, and that the report agrees.
fn assert_sound((picture, report): &(Plane<Vec3>, Report), what: &str) {
    let bad = picture.samples().iter().filter(|c| !c.is_finite() || c.min_element() < 0.0).count();
    assert_eq!(bad, 0, "{what}: {bad} pixels that are negative, NaN or infinite");
    assert!(report.frames.iter().all(|frame| frame.figures.non_finite == 0), "{what}: pixels counted as non-finite");
}

fn mean(picture: &Plane<Vec3>) -> f64 {
    picture.samples().iter().map(|&c| f64::from(luminance(c))).sum::<f64>() / picture.samples().len() as f64
}

/// Returns the room with its lamp `strength` times as bright.
fn room_lit(strength: f64) -> Glb {
    let mut room = checkered_room(Moving::Box);
    for material in room.json["materials"].as_array_mut().unwrap() {
        let emission = &mut material["extensions"]["KHR_materials_emissive_strength"]["emissiveStrength"];
        // Dark materials have strength 1 and an emissive factor of 0.
        *emission = json!(emission.as_f64().unwrap() * strength);
    }
    room
}

/// Light scaled from 10⁻¹² to 10¹² scales the picture, bit-exactly for powers of two.
#[test]
fn pictures_are_linear_in_light_over_twenty_four_decades() {
    let reference = film(&room_lit(1.0), "");
    assert_sound(&reference, "strength 1");
    assert!(mean(&reference.0) > 0.05, "the room is lit");
    for exponent in [-40, -30, -10, 10, 30, 40] {
        let factor = 2f32.powi(exponent);
        let found = film(&room_lit(f64::from(factor)), "");
        assert_sound(&found, &format!("strength 2^{exponent}"));
        let same = found.0.samples().iter().zip(reference.0.samples()).filter(|(a, b)| **a == **b * factor).count();
        assert_eq!(same, SIDE * SIDE, "2^{exponent}: {} pixels differ", SIDE * SIDE - same);
        // The exposure cancels the factor, so the film is the same too.
        let bits = |report: &Report| report.frames.iter().map(|frame| frame.bits).collect::<Vec<_>>();
        assert_eq!(bits(&found.1), bits(&reference.1), "2^{exponent}");
    }
}

/// Moves all root nodes below a node that scales them.
fn scaled(mut glb: Glb, factor: f32) -> Glb {
    let top = glb.json["scenes"][0]["nodes"].take();
    let nodes = glb.json["nodes"].as_array_mut().unwrap();
    nodes.push(json!({ "scale": [factor, factor, factor], "children": top }));
    glb.json["scenes"][0]["nodes"] = json!([nodes.len() - 1]);
    glb
}

/// Rooms of one millimeter and of a thousand kilometers give the same bits as one of four meters.
#[test]
fn a_millimeter_and_a_thousand_kilometers_look_the_same() {
    let reference = film(&checkered_room(Moving::Box), "");
    for exponent in [-12, 18] {
        let found = film(&scaled(checkered_room(Moving::Box), 2f32.powi(exponent)), "");
        assert_sound(&found, &format!("lengths 2^{exponent}"));
        let same = found.0.samples().iter().zip(reference.0.samples()).filter(|(a, b)| a == b).count();
        assert_eq!(same, SIDE * SIDE, "2^{exponent}: {} pixels differ", SIDE * SIDE - same);
    }
}

/// A scene is refused if the square of an area exceeds `f32`, as its lamps would be NaN. Smaller lengths leave the film unchanged.
#[test]
fn lengths_beyond_range_are_refused() {
    let room = |exponent| scaled(checkered_room(Moving::Box), 2f32.powi(exponent));
    let (reference, largest) = (film(&room(0), ""), film(&room(27), ""));
    assert_sound(&largest, "lengths 2^27");
    assert!(largest.0.samples() == reference.0.samples(), "a pixel is off");
    for exponent in [32, 60, 100] {
        let found = film_in(tempfile::tempdir().unwrap().path(), &room(exponent), "", small());
        let message = found.expect_err("an error");
        assert!(message.contains("scene.glb") && message.contains("scale the scene"), "{message}");
        assert_eq!(message.lines().count(), 1, "{message}");
    }
}

/// Albedo 0 shows exactly the walls' emission. Albedo 1 has no limit: paths end after 1024 reflections, so light is at most
/// 1025 times the emission.
#[test]
fn albedo_zero_and_one() {
    let black = film(&furnace(Vec3::ZERO, Vec3::ONE), "");
    assert_sound(&black, "albedo 0");
    assert!(black.0.samples().iter().all(|&c| c == Vec3::ONE), "{:?}", black.0.get(3, 3));
    let white = film(&furnace(Vec3::ONE, Vec3::ONE), "");
    assert_sound(&white, "albedo 1");
    let mean = mean(&white.0);
    println!("the closed white room: {mean:.2} times the emission");
    assert!((0.97 * 1025.0..1.03 * 1025.0).contains(&mean), "{mean} times the emission");
}

/// At albedo 0.99 the closed form is 100. Earlier versions gave 92.4 (photons ended after 256 reflections) and 144 (photon
/// energy grew with age).
#[test]
fn a_nearly_white_room_gains_nothing() {
    let found = film(&furnace(Vec3::splat(0.99), Vec3::ONE), "");
    assert_sound(&found, "albedo 0.99");
    let mean = mean(&found.0);
    println!("albedo 0.99: {mean:.2} times the emission");
    assert!((97.0..103.0).contains(&mean), "{mean} times the emission");
}

/// No surface reflects more than it receives: an albedo above 1 in a file counts as 1.
#[test]
fn no_surface_gains_energy() {
    // Few reflections, as photons in lossless walls take all that are allowed.
    let film =
        |glb: &Glb| film_in(tempfile::tempdir().unwrap().path(), glb, "", Options { bounces: Some(16), ..small() });
    let mut glb = furnace(Vec3::ONE, Vec3::ONE);
    let one = film(&glb).unwrap();
    for material in glb.json["materials"].as_array_mut().unwrap() {
        material["pbrMetallicRoughness"]["baseColorFactor"] = json!([8.0, 8.0, 8.0, 1.0]);
    }
    if let Ok(eight) = film(&glb) {
        assert_sound(&eight, "albedo 8");
        assert!(eight.0 == one.0, "{} and {}", mean(&eight.0), mean(&one.0));
    }
}

/// Zero, one or two photons give finite light.
#[test]
fn a_single_photon() {
    for photons in [0, 1, 2] {
        let options = Options { photons: Some(photons), ..small() };
        let found = film_in(tempfile::tempdir().unwrap().path(), &room_lit(1.0), "", options).unwrap();
        assert_sound(&found, &format!("{photons} photons"));
    }
}

#[test]
fn all_black_and_all_white() {
    // A room without emission; the black sky prevents the default one.
    let black = film(&room_lit(0.0), "[sky]\nzenith = [0, 0, 0]\nhorizon = [0, 0, 0]\n");
    assert_sound(&black, "black");
    // Emission that saturates every pixel.
    let white = film(&furnace(Vec3::ZERO, Vec3::splat(1e6)), "[tone_mapping]\noperator = \"srgb\"\nexposure = 1.0\n");
    assert_sound(&white, "white");
    assert!(white.0.samples().iter().all(|&c| c == Vec3::splat(1e6)));
    for (name, (_, report)) in [("black", black), ("white", white)] {
        // Uniform pictures have hardly any bits beyond headers and end codes.
        assert!(report.frames[1].bits < 4000, "{name}: {} bits", report.frames[1].bits);
    }
}

/// Subnormal numbers as lengths, colors and light.
#[test]
fn denormals_are_as_good_as_nothing() {
    let mut glb = room_lit(1e-38);
    glb.add(&[[Vec3::splat(0.5), Vec3::X * 1e-40, Vec3::Y * 1e-40]], Vec3::splat(1e-40), Vec3::splat(1e-41));
    assert_sound(&film(&glb, ""), "denormals");
}

/// Returns the room with `quads` of one emission.
fn room_with(quads: &[[Vec3; 3]], emission: Vec3) -> Glb {
    let mut glb = room_lit(1.0);
    glb.add(quads, Vec3::splat(0.5), emission);
    glb
}

/// Triangles without area, needles of aspect ratio 10⁸, coplanar walls, thousands of coincident quads.
#[test]
fn broken_shapes_do_no_harm() {
    let plain = film(&room_lit(1.0), "");
    let corner = vec3(-1.0, 1.0, -1.0);
    let (x, y) = (Vec3::X, Vec3::Y);
    let same_place: Vec<[Vec3; 3]> = vec![[corner, 0.5 * x, 0.5 * y]; 2000];
    let coplanar = [[vec3(-2.0, 0.0, -2.0), 4.0 * Vec3::Z, 4.0 * x], [vec3(-1.0, 0.0, -1.0), 2.0 * Vec3::Z, 2.0 * x]];
    for (name, quads) in [
        ("points", vec![[corner, Vec3::ZERO, Vec3::ZERO]; 10]),
        ("lines", vec![[corner, x, x], [corner, x, Vec3::ZERO], [corner, Vec3::ZERO, y]]),
        ("needles", vec![[corner, x, 1e-8 * y], [corner, 1e-8 * x, y], [corner, x + 1e-8 * y, x]]),
        ("two thousand in one place", same_place),
        ("coplanar with the floor", coplanar.to_vec()),
    ] {
        for emission in [Vec3::ZERO, Vec3::splat(3.0)] {
            let found = film(&room_with(&quads, emission), "");
            assert_sound(&found, name);
            // Shapes without area neither occlude nor emit; the others are a small square.
            if quads[0][1].cross(quads[0][2]).length() < 1e-6 {
                let ratio = mean(&found.0) / mean(&plain.0);
                assert!((0.97..1.03).contains(&ratio), "{name}, emission {emission}: {ratio} of the light");
            }
        }
    }
}

/// Adds lights of the extension, of one kind and intensity, on nodes at `places`.
fn with_lights(mut glb: Glb, kind: &str, intensity: f64, places: &[Vec3]) -> Glb {
    let mut light = json!({ "type": kind, "intensity": intensity });
    if kind == "spot" {
        light["spot"] = json!({ "innerConeAngle": 0.0, "outerConeAngle": 0.5 });
    }
    glb.json["extensions"] = json!({ "KHR_lights_punctual": { "lights": [light] } });
    glb.json["extensionsUsed"] = json!(["KHR_materials_emissive_strength", "KHR_lights_punctual"]);
    for place in places {
        let nodes = glb.json["nodes"].as_array_mut().unwrap();
        nodes.push(json!({ "translation": place.to_array(), "extensions": { "KHR_lights_punctual": { "light": 0 } } }));
        let node = nodes.len() - 1;
        glb.json["scenes"][0]["nodes"].as_array_mut().unwrap().push(json!(node));
    }
    glb
}

/// Lights in a wall, in a corner and at the camera; the camera in a wall.
#[test]
fn lights_and_cameras_on_surfaces() {
    let camera = vec3(0.0, 1.5, 4.5);
    for kind in ["point", "spot"] {
        for place in [vec3(0.0, 0.0, 0.0), vec3(-2.0, 0.0, -2.0), vec3(0.0, 1.5, -2.0), camera] {
            let found = film(&with_lights(room_lit(1.0), kind, 5.0, &[place]), "");
            assert_sound(&found, &format!("a {kind} light at {place}"));
        }
    }
    for place in [vec3(0.0, 0.0, 0.0), vec3(0.0, 1.5, -2.0), vec3(-2.0, 0.0, -2.0)] {
        let mut glb = room_lit(1.0);
        let node = glb.json["nodes"].as_array().unwrap().iter().position(|node| !node["camera"].is_null()).unwrap();
        glb.json["nodes"][node]["translation"] = json!(place.to_array());
        assert_sound(&film(&glb, ""), &format!("the camera at {place}"));
    }
}

/// Two thousand coincident lights equal one of two thousand times the intensity.
#[test]
fn coincident_lights_add_up() {
    let place = vec3(0.3, 1.7, 0.4);
    let many = film(&with_lights(room_lit(0.0), "point", 0.01, &[place; 2000]), "");
    let one = film(&with_lights(room_lit(0.0), "point", 20.0, &[place]), "");
    assert_sound(&many, "two thousand lights");
    let ratio = mean(&many.0) / mean(&one.0);
    println!("two thousand lights: {ratio} times the one");
    assert!((ratio - 1.0).abs() < 0.02, "{ratio}");
}

/// Skies with radiances beyond the summable range, or NaN.
#[test]
fn skies_beyond_range() {
    let folder = tempfile::tempdir().unwrap();
    // Texels that are NaN, infinite or negative.
    let broken = Plane::from_fn(16, 8, |x, y| match (x * 3 + y) % 5 {
        0 => Vec3::splat(f32::NAN),
        1 => Vec3::splat(f32::INFINITY),
        2 => Vec3::splat(-1.0),
        _ => Vec3::splat(0.5),
    });
    write_exr(&folder.path().join("sky.exr"), &broken).unwrap();
    let glb = room_lit(1.0);
    let found = film_in(folder.path(), &glb, "[sky]\nimage = \"sky.exr\"\n", small()).unwrap();
    assert_sound(&found, "a sky with NaN texels");
    for sky in [
        "[sky]\nimage = \"../sky.exr\"\n",
        "[sky]\nimage = \"/etc/hostname\"\n",
        "[sky]\nzenith = [1e30, 1, 1]\nhorizon = [1, 1, 1]\nintensity = 1e30\n",
        "[sky]\nzenith = [3e38, 1, 1]\nhorizon = [1, 1, 1]\n",
        "[sky]\nimage = \"sky.exr\"\nintensity = 3e38\n",
        "[sky]\nimage = \"sky.exr\"\nrotation = 1e38\n",
    ] {
        // Only the rotation accepts any value.
        match film_in(folder.path(), &glb, sky, small()) {
            Ok(found) if sky.contains("rotation") => assert_sound(&found, sky),
            Ok(_) => panic!("{sky} is taken"),
            Err(message) => assert!(message.contains("[sky]") && message.lines().count() == 1, "{sky}: {message}"),
        }
    }
}

/// Light too bright for sums in `f32` is refused; smaller values add up correctly.
#[test]
fn lamps_beyond_range_are_refused() {
    let reference = film(&room_lit(1.0), "");
    let strong = film(&room_lit(5e16), "");
    assert_sound(&strong, "strength 5·10¹⁶");
    let ratio = mean(&strong.0) / mean(&reference.0) / 5e16;
    assert!((ratio - 1.0).abs() < 1e-4, "{ratio}");
    for strength in [1e20, 1e30, 3e37] {
        let message = |glb: &Glb| film_in(tempfile::tempdir().unwrap().path(), glb, "", small()).expect_err("an error");
        let lit = with_lights(room_lit(1.0), "point", strength, &[Vec3::Y]);
        for (glb, word) in [(room_lit(strength), "material"), (lit, "light 0")] {
            let message = message(&glb);
            assert!(message.contains(word) && message.contains("1e18"), "{message}");
            assert_eq!(message.lines().count(), 1, "{message}");
        }
    }
}

/// NaN in vertices, animations and cameras is refused with its position; harmless NaN is ignored.
#[test]
fn what_is_no_number_is_refused_or_left_out() {
    let room = || checkered_room(Moving::Camera);
    let accessor_bytes = |glb: &Glb, accessor: usize| {
        let view = glb.json["accessors"][accessor]["bufferView"].as_u64().unwrap() as usize;
        glb.json["bufferViews"][view]["byteOffset"].as_u64().unwrap() as usize
    };
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX] {
        let broken = |accessor: usize| {
            let mut glb = room();
            let place = accessor_bytes(&glb, accessor);
            glb.bin[place..place + 4].copy_from_slice(&bad.to_le_bytes());
            glb
        };
        let load = |glb: &Glb| film_in(tempfile::tempdir().unwrap().path(), glb, "", small());
        // Positions and animations with the bad value are refused.
        let animation = room();
        let sampler = &animation.json["animations"][0]["samplers"][0];
        let [times, keys] = ["input", "output"].map(|name| sampler[name].as_u64().unwrap() as usize);
        for (what, accessor) in [("positions", 0), ("times", times), ("keys", keys)] {
            let message = load(&broken(accessor)).err().unwrap_or_else(|| panic!("{what} of {bad} load"));
            assert_eq!(message.lines().count(), 1, "{what} of {bad}: {message}");
        }
        // Normals, tangents, texture coordinates and colors of the first mesh.
        let mut glb = room();
        let count = glb.json["accessors"][0]["count"].as_u64().unwrap() as usize;
        for (name, kind, width) in
            [("NORMAL", "VEC3", 3), ("TANGENT", "VEC4", 4), ("TEXCOORD_0", "VEC2", 2), ("COLOR_0", "VEC3", 3)]
        {
            let start = glb.bin.len();
            glb.bin.extend(bad.to_le_bytes().repeat(count * width));
            let view = json!({ "buffer": 0, "byteOffset": start, "byteLength": 4 * count * width });
            let place = push(&mut glb.json["bufferViews"], view);
            let accessor = json!({ "bufferView": place, "componentType": 5126, "count": count, "type": kind });
            let place = push(&mut glb.json["accessors"], accessor);
            glb.json["meshes"][0]["primitives"][0]["attributes"][name] = json!(place);
        }
        let png = "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNk+M9QDwADhgGAWjR9awAAAABJRU5ErkJggg==";
        glb.json["images"] = json!([{ "uri": format!("data:image/png;base64,{png}") }]);
        glb.json["textures"] = json!([{ "source": 0 }]);
        glb.json["materials"][0]["normalTexture"] = json!({ "index": 0 });
        glb.json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = json!({ "index": 0 });
        match load(&glb) {
            Ok(found) => assert_sound(&found, &format!("attributes of {bad}")),
            Err(message) => assert_eq!(message.lines().count(), 1, "attributes of {bad}: {message}"),
        }
    }
}

fn push(list: &mut Value, value: Value) -> usize {
    let list = list.as_array_mut().unwrap();
    list.push(value);
    list.len() - 1
}

/// All lights at every pixel, as a reference without cuts: the same scenes give finite frames.
#[test]
fn the_reference_is_sound_at_the_ends_of_the_range() {
    let options = || Options { lighting: Some(Lighting::AllLights), frames: Some(1), ..small() };
    for (name, glb) in [
        ("strong", room_lit(1e12)),
        ("weak", room_lit(1e-12)),
        ("small", scaled(room_lit(1.0), 2f32.powi(-12))),
        ("white", furnace(Vec3::ONE, Vec3::ONE)),
    ] {
        let found = film_in(tempfile::tempdir().unwrap().path(), &glb, "", options()).unwrap();
        assert_sound(&found, name);
    }
}
