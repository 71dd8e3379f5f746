//! The renderer's exact motion saves bits in the encoder.

use glam::{Vec3, vec3};
use mpeg2enc::{Packet, Picture, PictureType};
use plane::Correspondence;
use render2mpeg::Options;
use renderer::settings::{SampleCount, Thresholds};
use std::path::Path;
use std::sync::Arc;
use tests::{Moving, checkered_room, cornell, correspondences, encode, load, read_y4m, render_as_coded};

const SIZE: (usize, usize) = (96, 96);
const FRAMES: u32 = 12;

/// Returns bits and mean PSNR of the P pictures.
fn predicted(packets: &[Packet]) -> (f64, f64) {
    let predicted: Vec<&Packet> = packets.iter().filter(|packet| packet.picture_type == PictureType::P).collect();
    assert!(!predicted.is_empty());
    let psnr = predicted.iter().map(|packet| packet.psnr_y).sum::<f64>() / predicted.len() as f64;
    (predicted.iter().map(|packet| packet.bits).sum::<u64>() as f64, psnr)
}

/// Returns the bits of all P pictures with exact motion, the encoder's own search, and zero vectors. All are for the quality
/// of exact motion at quantiser 8. As rate-distortion decisions spread a worse prediction over bits and errors, the other two
/// are coded at two quantisers. The logarithm of their bits is interpolated over PSNR.
fn bits(folder: &Path, name: &str, path: &Path) -> [f64; 3] {
    let options = Options {
        frames: Some(FRAMES),
        size: "96x96".parse().ok(),
        // Motion belongs to the surfaces at the pixels' centers.
        samples: Some(SampleCount::Each(1)),
        vpls: Some(400),
        photons: Some(20_000),
        output: Some(folder.join(format!("{name}.m2v"))),
        y4m: Some(folder.join(format!("{name}.y4m"))),
        ..Options::default()
    };
    // Render once, and encode the same frames with each kind of motion.
    let (scene, settings) = load(path, options.clone());
    let (_, perceptual) = load(path, Options { thresholds: Some(Thresholds::Perceptual), ..options });
    render_as_coded(&scene, &perceptual);
    let frames: Vec<Picture> = read_y4m(&folder.join(format!("{name}.y4m")), SIZE);
    let exact = correspondences(&scene, &settings);
    let still = Arc::new(Correspondence::still(SIZE.0, SIZE.1));
    let at = |qscale: u32, motion: &[Option<Arc<Correspondence>>]| {
        let mut coarser = settings.clone();
        coarser.render.qscale = qscale;
        predicted(&encode(&coarser, &frames, motion).1)
    };
    let (exact_bits, quality) = at(8, &exact);
    let kinds = [("searched", vec![None; frames.len()]), ("zero", vec![Some(still); frames.len()])];
    // Interpolate the bits at the quality of exact motion.
    let [searched, zero] = kinds.map(|(kind, motion)| {
        let ((coarse_bits, coarse), (fine_bits, fine)) = (at(8, &motion), at(6, &motion));
        let share = (quality - coarse) / (fine - coarse);
        let bits = (coarse_bits.ln() + (fine_bits / coarse_bits).ln() * share).exp().round();
        println!("{name}, {kind} motion: {coarse_bits} bits at {coarse:.2} dB, {fine_bits} at {fine:.2}: {bits:.0}");
        bits
    });
    println!("{name}, exact motion: {exact_bits} bits in P pictures, {quality:.2} dB");
    [exact_bits, searched, zero]
}

#[test]
fn exact_vectors_cost_fewer_bits_than_none() {
    let folder = tempfile::tempdir().unwrap();
    let room = folder.path().join("room.glb");
    // Five pixels per frame, beyond the range of a search around zero.
    let mut fast = checkered_room(Moving::Nothing);
    let camera = fast.add_camera(Vec3::ZERO);
    fast.animate(camera, vec3(-2.0, 1.5, 4.5), vec3(6.0, 1.5, 4.5));
    fast.write(&room);
    let [exact, searched, zero] = bits(folder.path(), "camera", &room);
    assert!(exact * 10.0 < zero * 9.0, "a moving camera: {exact} bits with exact motion, {zero} without");
    assert!(exact <= searched, "a search does no better than knowing: {exact} and {searched}");
    // Slow motion is found from zero vectors and by a search too: exact motion must not cost bits.
    checkered_room(Moving::Box).write(&room);
    for (name, path) in [("box", &room), ("cornell", &cornell())] {
        let [exact, searched, zero] = bits(folder.path(), name, path);
        assert!(exact <= zero && exact <= searched, "{name}: {exact} bits, {searched} searched, {zero} from zero");
    }
}
