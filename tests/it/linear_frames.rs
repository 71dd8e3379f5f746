//! Linear frames for other programs: header, bits, vectors and mattes, each compared with a closed form.

use exr::meta::MetaData;
use exr::meta::attribute::{AttributeValue, SampleType, Text};
use exr::meta::header::Header;
use glam::{Mat4, Vec3, vec3};
use render_core::image_file::{Layers, cryptomatte_id, read_layers};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use tests::{Glb, render};

/// Width and height \[pixels\].
const SIZE: (usize, usize) = (32, 24);
/// Camera motion per frame, a 25th of a second \[m\].
const STEP: (f32, f32) = (0.08, 0.04);
/// Distances from the camera of the card and of the wall \[m\].
const DISTANCES: [f32; 2] = [4.0, 6.0];
/// Size of the card \[m\].
const CARD: (f32, f32) = (1.1, 0.9);

/// Builds a named emissive wall, a card without a name in front of it, and a camera that moves right and up.
fn scene() -> Glb {
    let mut glb = Glb::default();
    let wall = glb.add(&[[vec3(-9.0, -9.0, -2.0), 18.0 * Vec3::X, 18.0 * Vec3::Y]], Vec3::splat(0.5), Vec3::splat(2.0));
    glb.add(&[[vec3(-0.53, -0.41, 0.0), CARD.0 * Vec3::X, CARD.1 * Vec3::Y]], vec3(0.8, 0.4, 0.1), Vec3::ZERO);
    glb.json["nodes"][wall]["name"] = "wall \"süd\"".into();
    glb.json["materials"][1]["name"] = "paper".into();
    let camera = glb.add_camera(Vec3::ZERO);
    let way = 12.5 * vec3(STEP.0, STEP.1, 0.0);
    glb.animate(camera, vec3(0.0, 0.0, 4.0) - way, vec3(0.0, 0.0, 4.0) + way);
    glb
}

/// Renders two frames from the middle of the camera's path, and returns the path of the second file.
fn second_frame(folder: &Path, name: &str, more: &str) -> PathBuf {
    let path = folder.join("scene.glb");
    scene().write(&path);
    let size = format!("{}x{}", SIZE.0, SIZE.1);
    let layers = "albedo,depth,position,motion,vector,crypto-object,crypto-material";
    let film = format!("--size {size} --from 9 --frames 2 --vpls 50 --photons 1000 --exr {name} --aov {layers} {more}");
    render(folder, name, &path, &film);
    folder.join(name).join("frame_00001.exr")
}

fn header(path: &Path) -> Header {
    MetaData::read_from_file(path, true).expect("a header").headers.remove(0)
}

/// Returns three channels of a layer as vectors.
fn vectors(layers: &Layers, names: [&str; 3]) -> Vec<Vec3> {
    let [x, y, z] = names.map(|name| layers.channel(name).expect("the channel"));
    (0..x.len()).map(|index| vec3(x[index], y[index], z[index])).collect()
}

#[test]
fn headers_lead_from_the_world_to_the_pixels_that_show_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = second_frame(folder.path(), "film", "");
    let Header { own_attributes: own, shared_attributes: shared, .. } = header(&path);
    assert_eq!(own.frames_per_second, Some((25, 1)));
    assert_eq!(shared.time_code.map(|code| (code.seconds, code.frame)), Some((0, 1)));
    assert_eq!(own.other.get(&Text::new_or_panic("imageCounter")), Some(&AttributeValue::I32(1)));
    assert_eq!(shared.chromaticities.map(|known| known.green.0), Some(0.30));
    assert!(own.software_name.is_some_and(|name| name.to_string().starts_with("render2mpeg ")));

    // The file's matrices apply to row vectors: their rows, in order, are glam's columns.
    let [camera, device] = [own.world_to_camera, own.world_to_normalized_device].map(|known| known.expect("a matrix"));
    let [camera, device] = [camera, device].map(|rows| Mat4::from_cols_array(&rows));
    let layers = read_layers(&path).unwrap();
    let positions = vectors(&layers, ["position.X", "position.Y", "position.Z"]);
    let depths = layers.channel("depth.Z").unwrap();
    for (index, (&position, &depth)) in positions.iter().zip(depths).enumerate() {
        let seen = device.project_point3(position);
        let pixel = (seen.x * SIZE.0 as f32, seen.y * SIZE.1 as f32);
        let center = ((index % SIZE.0) as f32 + 0.5, (index / SIZE.0) as f32 + 0.5);
        let off = (pixel.0 - center.0).abs().max((pixel.1 - center.1).abs());
        assert!(off < 1e-3, "{position} at {center:?} is seen at {pixel:?}");
        let before = camera.transform_point3(position);
        assert!((before.z - depth).abs() < 1e-4 && (before.x > 0.0) == (center.0 > 16.0), "{before}, {depth} m away");
    }
}

#[test]
fn vectors_are_those_of_the_cameras_way() {
    let folder = tempfile::tempdir().unwrap();
    let layers = read_layers(&second_frame(folder.path(), "film", "")).unwrap();
    let known = ["Vector.X", "Vector.Y", "Vector.Z", "Vector.W"].map(|name| layers.channel(name).unwrap());
    let [back, down] = ["motion.X", "motion.Y"].map(|name| layers.channel(name).unwrap());
    let mut seen = [0; 2];
    for (index, &depth) in layers.channel("depth.Z").unwrap().iter().enumerate() {
        let thing = usize::from(depth > 5.0);
        assert!((depth - DISTANCES[thing]).abs() < 1e-4, "{depth}");
        // Pixels per meter. A point that the camera passes was farther right and farther up in the previous frame.
        let scale = SIZE.1 as f32 / (2.0 * 0.45f32.tan() * depth);
        let vector = (STEP.0 * scale, STEP.1 * scale);
        let expected = [vector.0, vector.1, vector.0, vector.1];
        for (channel, expected) in known.iter().zip(expected) {
            assert!((channel[index] - expected).abs() < 1e-3, "{} instead of {expected}", channel[index]);
        }
        if layers.channel("motion.A").unwrap()[index] > 0.0 {
            assert!((back[index] - vector.0).abs() < 1e-3 && (down[index] + vector.1).abs() < 1e-3, "y is down there");
        }
        seen[thing] += 1;
    }
    assert!(seen[0] > 10 && seen[1] > 100, "{seen:?}");
}

#[test]
fn mattes_cover_each_pixel_and_the_manifest_names_them() {
    let folder = tempfile::tempdir().unwrap();
    let path = second_frame(folder.path(), "film", "");
    let (layers, texts) = (read_layers(&path).unwrap(), header(&path).own_attributes.other);
    // Reads the names and ids from the header.
    let manifest = |kind: &str| -> BTreeMap<String, String> {
        let key = format!("{:08x}", cryptomatte_id(kind).to_bits());
        let name = format!("cryptomatte/{}/manifest", &key[..7]);
        let found = texts.get(&Text::new_or_panic(&name));
        let Some(AttributeValue::Text(text)) = found else { panic!("no {name}") };
        serde_json::from_str(&text.to_string()).expect("JSON")
    };
    for (kind, wall, card) in [("CryptoObject", "wall \"süd\"", "node_1"), ("CryptoMaterial", "material_0", "paper")] {
        let manifest = manifest(kind);
        assert_eq!(manifest.len(), 2, "{manifest:?}");
        let channel = |rank: usize, part: usize| {
            let names = [["R", "G"], ["B", "A"]][rank % 2];
            layers.channel(&format!("{kind}{:02}.{}", rank / 2, names[part])).expect("the channel")
        };
        let mut areas: BTreeMap<u32, f64> = BTreeMap::new();
        for pixel in 0..SIZE.0 * SIZE.1 {
            let pairs: Vec<(f32, f32)> =
                (0..6).map(|rank| (channel(rank, 0)[pixel], channel(rank, 1)[pixel])).collect();
            assert_eq!(pairs.iter().map(|(_, share)| share).sum::<f32>(), 1.0, "the wall is behind all: {pairs:?}");
            assert!(pairs.is_sorted_by(|a, b| a.1 >= b.1), "{pairs:?}");
            for (id, share) in pairs.into_iter().filter(|&(_, share)| share > 0.0) {
                *areas.entry(id.to_bits()).or_default() += f64::from(share);
            }
        }
        // Area of the card \[pixels\]; pixels at its outline are sampled by sixteen rays.
        let scale = SIZE.1 as f32 / (2.0 * 0.45f32.tan() * DISTANCES[0]);
        let area = f64::from(CARD.0 * CARD.1 * scale * scale);
        let [wall, card] = [wall, card].map(|name| {
            assert_eq!(manifest[name], format!("{:08x}", cryptomatte_id(name).to_bits()));
            areas[&cryptomatte_id(name).to_bits()]
        });
        assert_eq!((areas.len(), wall + card), (2, (SIZE.0 * SIZE.1) as f64));
        assert!((card / area - 1.0).abs() < 0.03, "{card} pixels of {area}");
    }
}

#[test]
fn colors_are_halves_unless_floats_are_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let [half, float] =
        [("half", ""), ("float", "--exr-depth float")].map(|(name, more)| second_frame(folder.path(), name, more));
    let types = |path: &Path| -> BTreeMap<String, SampleType> {
        header(path).channels.list.iter().map(|channel| (channel.name.to_string(), channel.sample_type)).collect()
    };
    assert!(types(&float).values().all(|&known| known == SampleType::F32));
    for (name, known) in types(&half) {
        let is_color = ["R", "G", "B"].contains(&name.as_str()) || name.starts_with("albedo.");
        assert_eq!(known, if is_color { SampleType::F16 } else { SampleType::F32 }, "{name}");
    }
    let [half, float] = [half, float].map(|path| read_layers(&path).unwrap().channels);
    for ((name, half), (_, float)) in half.iter().zip(&float) {
        // The tolerance is half of the last of eleven bits.
        let off = |(a, b): (&f32, &f32)| (a - b).abs() <= b.abs() / 2048.0;
        assert!(half.iter().zip(float).all(off), "{name}");
    }
    let size = |name: &str| std::fs::metadata(folder.path().join(name).join("frame_00001.exr")).unwrap().len();
    assert!(size("half") < size("float"));
}
