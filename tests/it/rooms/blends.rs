//! Rooms behind partly transparent cards: light compared with path tracing, and stable, small films.

use super::{Room, inside, lamp, look, outside};
use glam::{Vec3, vec3};
use serde_json::json;
use tests::{Comparison, Glb, decode_ffmpeg, render};

/// Builds a room with a box behind a card of this opacity; opaque for `None`.
fn room(opacity: Option<f32>) -> Glb {
    let mut glb = Glb::default();
    glb.add(&inside(vec3(-2.0, 0.0, -2.0), vec3(2.0, 2.5, 2.0)), Vec3::splat(0.7), Vec3::ZERO);
    glb.add(&outside(vec3(-0.3, 0.001, -1.2), vec3(0.3, 1.2, -0.7)), Vec3::splat(0.4), Vec3::ZERO);
    lamp(vec3(0.3, 2.49, 0.2), 0.5, 20.0, &mut glb);
    glb.add(&[[vec3(-0.8, 0.4, 0.0), Vec3::X * 1.6, Vec3::Y * 1.4]], vec3(0.8, 0.2, 0.1), Vec3::ZERO);
    let card = glb.json["materials"].as_array_mut().and_then(|all| all.last_mut()).expect("the card's material");
    card["doubleSided"] = json!(true);
    if let Some(opacity) = opacity {
        card["alphaMode"] = json!("BLEND");
        card["pbrMetallicRoughness"]["baseColorFactor"][3] = json!(opacity);
    }
    look(&mut glb, vec3(0.6, 1.5, 1.9), vec3(0.0, 0.9, -0.4));
    glb
}

/// Path tracing hits the card at random, with independent numbers: its mean includes all layers and all shadows.
#[test]
fn light_around_blended_cards_is_that_of_paths() {
    for opacity in [0.2, 0.9] {
        let blocks = Room::new(&room(Some(opacity)), "").blocks(&format!("card of {opacity}"), Comparison::default());
        assert!((blocks.mean_ratio() - 1.0).abs() < 0.015, "{opacity}: {}", blocks.mean_ratio());
        let far_off = blocks.ratios().into_iter().filter(|ratio| (ratio - 1.0).abs() > 0.05).count();
        assert!(far_off * 20 <= blocks.ratios().len(), "{opacity}: {far_off} blocks are off by more than 5 %");
    }
}

/// In a static scene, pictures differ by at most 0.3 codes of 255. A film of a half-transparent card takes at most 1.1 times
/// the bits of an opaque one.
#[test]
fn films_of_blended_cards_are_still_and_small() {
    let (side, arguments) = (128, "--size 128x128 --frames 8");
    let bytes = [Some(0.5), None].map(|opacity| {
        let room = Room::new(&room(opacity), "");
        let film = render(room.folder.path(), "film", &room.scene(), arguments);
        let pictures = decode_ffmpeg(&room.folder.path().join("film.m2v"), (side, side));
        for pair in pictures.windows(2) {
            let [before, after] = [&pair[0], &pair[1]].map(|picture| picture.luma().samples());
            let apart: f64 = before.iter().zip(after).map(|(a, b)| f64::from(a.abs_diff(*b))).sum();
            let mean = apart / (side * side) as f64;
            assert!(mean <= 0.3, "static frames differ by {mean}");
        }
        film.stream.len()
    });
    println!("{bytes:?} bytes of half a card and of a whole one");
    assert!(bytes[0] as f64 <= 1.1 * bytes[1] as f64, "{bytes:?}");
}
