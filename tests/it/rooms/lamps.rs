//! Implicit lamps: emissive meshes all around, bright texels of screens and skies, and light in only a few frames.

use super::{Room, inside, look, outside};
use glam::{Vec3, vec3};
use std::io::Write;
use tests::{Ball, Comparison, Glb, read_y4m, render};

/// Column, row and radiance of a texel.
type Texel = (usize, usize, f32);

/// Facets around the axis, rows from pole to pole, and whether the sphere ends at the equator.
const SURROUNDINGS: [(u32, u32, bool); 4] = [(8, 4, false), (48, 24, false), (200, 100, false), (48, 12, true)];

/// In a sphere with inward emission 5, a ball of albedo 0.75 has radiance 0.75 · 5 everywhere, for any number of facets.
#[test]
fn a_glowing_sphere_lights_a_ball_evenly() {
    for (columns, rows, _) in SURROUNDINGS.into_iter().filter(|(.., half)| !half) {
        let mut glb = Glb::default();
        let sphere = Ball { center: Vec3::ZERO, radius: 2.0, columns, rows, half: false, inward: true };
        glb.add_ball(sphere, Vec3::ZERO, Vec3::splat(5.0));
        glb.add_ball(
            Ball { radius: 0.5, inward: false, columns: 48, rows: 24, ..sphere },
            Vec3::splat(0.75),
            Vec3::ZERO,
        );
        look(&mut glb, Vec3::Z * 1.6, Vec3::ZERO);
        let room = Room::new(&glb, "");
        let blocks = room.blocks(&format!("{columns}×{rows} facets"), Comparison::default());
        let mean = blocks.mean();
        assert!((mean / 3.75 - 1.0).abs() < 0.015, "{columns}×{rows}: {mean}");
        let (least, most) = (blocks.ratios()[0], blocks.ratios()[blocks.ratios().len() - 1]);
        assert!(least > 0.95 && most < 1.05, "{columns}×{rows}: {least} … {most}");
    }
}

/// A faceted dome, whole or half, lights a ball on a floor as path tracing does.
#[test]
fn a_glowing_dome_is_a_sky() {
    for (columns, rows, half) in SURROUNDINGS {
        let mut glb = on_a_floor();
        let dome = Ball { center: Vec3::ZERO, radius: 8.0, columns, rows, half, inward: true };
        glb.add_ball(dome, Vec3::ZERO, Vec3::ONE);
        let name = format!("dome of {columns}×{rows}, half: {half}");
        let blocks = Room::new(&glb, "").blocks(&name, Comparison::default());
        assert!((blocks.mean_ratio() - 1.0).abs() < 0.015, "{name}: {}", blocks.mean_ratio());
        assert_within(&blocks.ratios(), 0.06, &name);
    }
}

/// Each area of a screen emits by the brightness of its texture.
#[test]
fn bright_texels_of_a_screen_are_lamps() {
    let texture = |is_white: fn(usize, usize) -> bool| -> Vec<u8> {
        (0..128 * 128).map(|i| if is_white(i % 128, i / 128) { 255 } else { 0 }).collect()
    };
    let gradient = (0..128 * 128).map(|i| (2 * (i % 128)) as u8).collect();
    let cases: [(&str, Vec<u8>, f32, bool); 5] = [
        ("4×4 texels", texture(|x, y| (80..84).contains(&x) && (60..64).contains(&y)), 2000.0, false),
        ("two spots", texture(|x, y| (10..12).contains(&x) && y / 2 == 5 || x / 4 == 22 && y / 4 == 25), 2000.0, false),
        ("a thin line", texture(|_, y| y == 40), 200.0, false),
        ("4×4 texels on both sides", texture(|x, y| x / 4 == 20 && y / 4 == 15), 2000.0, true),
        ("a gradient", gradient, 20.0, false),
    ];
    for (name, codes, emission, double_sided) in cases {
        let mut glb = Glb::default();
        glb.add(&inside(vec3(-2.0, 0.0, -2.0), vec3(2.0, 3.0, 2.0)), Vec3::splat(0.6), Vec3::ZERO);
        glb.add(&outside(vec3(-0.8, 0.0, -0.4), vec3(-0.3, 0.9, 0.3)), Vec3::splat(0.6), Vec3::ZERO);
        let corner = vec3(-0.5, 1.0, if double_sided { -1.0 } else { -1.9 });
        glb.add_screen([corner, Vec3::X, Vec3::Y], emission, (128, &codes), double_sided);
        look(&mut glb, vec3(0.0, 1.6, 1.9), vec3(0.0, 1.0, -0.5));
        let blocks = Room::new(&glb, "").blocks(name, Comparison { paths: 1024, ..Comparison::default() });
        assert!((blocks.mean_ratio() - 1.0).abs() < 0.03, "{name}: {}", blocks.mean_ratio());
        assert_within(&blocks.ratios(), 0.07, name);
    }
}

/// Very bright texels of a sky cast sharp shadows, also at the image's seam and pole.
#[test]
fn bright_texels_of_a_sky_are_suns() {
    let cases: [(&str, &[Texel]); 4] = [
        ("one texel", &[(40, 18, 40_000.0)]),
        ("at the seam", &[(0, 20, 40_000.0)]),
        ("at the pole", &[(5, 0, 300_000.0)]),
        ("two texels", &[(20, 14, 20_000.0), (100, 24, 20_000.0)]),
    ];
    for (name, bright) in cases {
        let room = Room::new(&on_a_floor(), "[sky]\nimage = \"sky.hdr\"\n");
        write_sky(&room.scene().with_file_name("sky.hdr"), bright);
        let blocks = room.blocks(name, Comparison { paths: 1024, ..Comparison::default() });
        assert!((blocks.mean_ratio() - 1.0).abs() < 0.02, "{name}: {}", blocks.mean_ratio());
        assert_within(&blocks.ratios(), 0.05, name);
    }
}

/// A film with a late lamp is exposed by its lit frames, for any power of the lamp.
#[test]
fn a_film_is_exposed_by_its_lit_frames() {
    for radiance in [1200.0, 0.12] {
        let (mut glb, node) = (Glb::default(), 1);
        glb.add(&inside(vec3(-2.0, 0.0, -2.0), vec3(2.0, 3.0, 2.0)), Vec3::splat(0.6), Vec3::ZERO);
        let lamp = [vec3(-0.2, 2.9, -0.2), Vec3::X * 0.4, Vec3::Z * 0.4];
        assert_eq!(glb.add(&[lamp], Vec3::ZERO, Vec3::splat(radiance)), node);
        // Far below the floor, except for a moment in the middle of the film.
        glb.animate_in_steps(node, &[(0.0, -Vec3::Y * 9.0), (0.48, Vec3::ZERO), (0.52, -Vec3::Y * 9.0)]);
        look(&mut glb, vec3(0.0, 1.6, 1.9), vec3(0.0, 1.0, -0.5));
        let room = Room::new(&glb, "");
        let luma = |extra: &str| {
            render(room.folder.path(), "film", &room.scene(), &format!("--size 48x48 --fps 25 --frames 25 {extra}"));
        };
        luma("--y4m film.y4m");
        let pictures = read_y4m(&room.folder.path().join("film.y4m"), (48, 48));
        let mean = |n: usize| {
            let luma = pictures[n].luma().samples();
            luma.iter().map(|&code| f32::from(code)).sum::<f32>() / luma.len() as f32
        };
        println!("lamp of {radiance}: mean luma of frame 0 {}, of frame 12 {}", mean(0), mean(12));
        assert!(mean(0) <= 17.0 && (60.0..200.0).contains(&mean(12)), "{radiance}: {} and {}", mean(0), mean(12));

        // A range of the film has the same exposure.
        luma("--chunk 5 --range 10-14 --y4m part.y4m");
        let part = read_y4m(&room.folder.path().join("part.y4m"), (48, 48));
        let part = part[2].luma().samples();
        let difference = part.iter().map(|&code| f32::from(code)).sum::<f32>() / part.len() as f32 - mean(12);
        assert!(difference.abs() < 2.0, "{radiance}: {difference}");
    }
}

/// Builds a ball on a floor, seen from slightly above.
fn on_a_floor() -> Glb {
    let mut glb = Glb::default();
    glb.add(&[[vec3(-3.0, 0.0, -3.0), Vec3::Z * 6.0, Vec3::X * 6.0]], Vec3::splat(0.5), Vec3::ZERO);
    let ball = Ball { center: vec3(0.0, 0.6, 0.0), radius: 0.5, columns: 32, rows: 16, half: false, inward: false };
    glb.add_ball(ball, Vec3::splat(0.75), Vec3::ZERO);
    look(&mut glb, vec3(0.0, 2.5, 4.0), vec3(0.0, 0.3, 0.0));
    glb
}

/// Checks that 95 % of the sorted `ratios` are within `most` of 1, and the others within four times `most`. Shadow edges are
/// narrower than a block, and path tracing is noisy.
fn assert_within(ratios: &[f32], most: f32, name: &str) {
    let apart = ratios.iter().filter(|ratio| (*ratio - 1.0).abs() > most).count();
    assert!(apart <= ratios.len().div_ceil(20), "{name}: {apart} of {} blocks, {ratios:?}", ratios.len());
    let worst = ratios.iter().map(|ratio| (ratio - 1.0).abs()).fold(0.0, f32::max);
    assert!(worst <= 4.0 * most, "{name}: {worst}");
}

/// Writes a sky of 128×64 texels of radiance 0.2, with some bright texels: column, row, radiance.
fn write_sky(path: &std::path::Path, bright: &[(usize, usize, f32)]) {
    let mut file = std::fs::File::create(path).expect("a file");
    file.write_all(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 64 +X 128\n").expect("written");
    let texel = |i: usize| {
        let found = bright.iter().find(|&&(x, y, _)| (x, y) == (i % 128, i / 128));
        let radiance = found.map_or(0.2, |texel| texel.2);
        // Mantissa and exponent of Ward's RGBE: L = m / 256 · 2^(e − 128).
        let exponent = radiance.log2().floor() as i32 + 1;
        let mantissa = (radiance * 256.0 / 2f32.powi(exponent)) as u8;
        [mantissa, mantissa, mantissa, (exponent + 128) as u8]
    };
    let texels: Vec<u8> = (0..128 * 64).flat_map(texel).collect();
    file.write_all(&texels).expect("written");
}
