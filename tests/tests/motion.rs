//! What the renderer knows of motion saves the encoder bits.

use glam::{Vec3, vec3};
use mpeg2enc::{Frame, MotionField, Packet, PictureType};
use pipeline::Wishes;
use plane::Plane;
use std::path::Path;
use tests::{Moving, checkered_room, cornell, encode, load, motion_fields, read_y4m, render};

const SIZE: (usize, usize) = (96, 96);
const FRAMES: u32 = 12;

/// Bits and mean PSNR of the P pictures.
fn predicted(packets: &[Packet]) -> (u64, f64) {
    let predicted: Vec<&Packet> = packets.iter().filter(|packet| packet.picture_type == PictureType::P).collect();
    assert!(!predicted.is_empty());
    let psnr = predicted.iter().map(|packet| packet.psnr_y).sum::<f64>() / predicted.len() as f64;
    (predicted.iter().map(|packet| packet.bits).sum(), psnr)
}

/// Bits of all P pictures with exact motion, by a search of the encoder's own, and with vectors of zero.
fn bits(folder: &Path, name: &str, path: &Path) -> [u64; 3] {
    let wishes = Wishes {
        frames: Some(FRAMES),
        size: "96x96".parse().ok(),
        vpls: Some(200),
        photons: Some(20_000),
        ..Wishes::default()
    };
    render(folder, name, path, &format!("--size 96x96 --frames {FRAMES} --vpls 200 --photons 20000 --y4m {name}.y4m"));
    let frames: Vec<Frame> = read_y4m(&folder.join(format!("{name}.y4m")), SIZE);
    let (scene, settings) = load(path, wishes);
    let exact = motion_fields(&scene, &settings);
    let still = MotionField::new(Plane::filled(SIZE.0, SIZE.1, [0.0; 2]));
    let kinds = [("exact", exact), ("searched", vec![None; frames.len()]), ("zero", vec![Some(still); frames.len()])];
    kinds.map(|(kind, motion)| {
        let (bits, psnr) = predicted(&encode(&settings, &frames, &motion).1);
        println!("{name}, {kind} motion: {bits} bits in P pictures, {psnr:.2} dB");
        bits
    })
}

#[test]
fn exact_vectors_cost_fewer_bits_than_none() {
    let folder = tempfile::tempdir().unwrap();
    let room = folder.path().join("room.glb");
    // Faster than a look around zero reaches: 5 pixels from frame to frame.
    let mut fast = checkered_room(Moving::Nothing);
    let camera = fast.add_camera(Vec3::ZERO);
    fast.animate(camera, vec3(-2.0, 1.5, 4.5), vec3(6.0, 1.5, 4.5));
    fast.write(&room);
    let [exact, searched, zero] = bits(folder.path(), "camera", &room);
    assert!(exact * 10 < zero * 9, "a moving camera: {exact} bits with exact motion, {zero} without");
    assert!(exact <= searched, "a search does no better than knowing: {exact} and {searched}");
    // What moves slowly is found from zero as well: knowing must not cost anything then.
    checkered_room(Moving::Box).write(&room);
    for (name, path) in [("box", &room), ("cornell", &cornell())] {
        let [exact, searched, zero] = bits(folder.path(), name, path);
        assert!(exact <= zero && exact <= searched, "{name}: {exact} bits, {searched} searched, {zero} from zero");
    }
}
