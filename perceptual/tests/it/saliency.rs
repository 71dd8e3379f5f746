//! Tests of saliency: odd items are found, flat pictures stay flat, and no input panics.

use perceptual::{saliency, steady_saliency};
use plane::{Correspondence, NO_MATCH, Plane};

/// Number of items per side of the grid.
const GRID: usize = 5;
/// Display value of the background.
const FIELD: f32 = 0.5;

/// Property in which the odd item differs from the other items. k is the contrast.
#[derive(Clone, Copy, Debug)]
enum Oddity {
    /// Difference from the background, larger by the factor 1 + k.
    Brightness,
    /// Tint towards red, with a strength k. The other items are gray.
    Tint,
    /// Hue, rotated by k · 180° at equal intensity and chroma.
    Hue,
    /// Radius, larger by the factor 1 + k.
    Size,
    /// Orientation of a bar, rotated by k · 90°.
    Orientation,
    /// Speed, larger by the factor 1 + k. The other items move with the background.
    Speed,
    /// Speed, larger by the factor 1 + k. All items move over a static background.
    Overtaking,
    /// Direction of motion, rotated by k · 180°. All items move over a static background.
    Direction,
}

/// Returns the covered fraction of a pixel at a distance of `inside` pixels inside a border.
fn coverage(inside: f32) -> f32 {
    (inside + 0.5).clamp(0.0, 1.0)
}

/// Returns the color of the odd item if k is the contrast, or of another item if k is 0.
fn color(oddity: Oddity, k: f32) -> [f32; 3] {
    match oddity {
        Oddity::Brightness => [FIELD + 0.15 * (1.0 + k); 3],
        Oddity::Tint => [1.0 + 0.5 * k, 1.0 - 0.25 * k, 1.0 - 0.25 * k].map(|c| 0.6 * c),
        Oddity::Hue => {
            let (sin, cos) = (std::f32::consts::PI * k).sin_cos();
            // The hue rotates from green to red, and towards blue, at equal I.
            let axes: [[f32; 2]; 3] = [[-0.5, -1.0 / 3.0], [0.5, -1.0 / 3.0], [0.0, 2.0 / 3.0]];
            axes.map(|[green, blue]| 0.55 + 0.25 * (green * cos + blue * sin))
        }
        _ => [0.75; 3],
    }
}

/// Returns the motion of an item and of the background.
fn motion(oddity: Oddity, k: f32) -> Option<[[f32; 2]; 2]> {
    let (sin, cos) = (std::f32::consts::PI * k).sin_cos();
    match oddity {
        Oddity::Speed => Some([[2.0 * (1.0 + k), 0.0], [2.0, 0.0]]),
        Oddity::Overtaking => Some([[2.0 * (1.0 + k), 0.0], [0.0; 2]]),
        Oddity::Direction => Some([[2.0 * cos, 2.0 * sin], [0.0; 2]]),
        _ => None,
    }
}

/// Returns the fraction of a pixel that an item around the origin covers, in a cell of `cell` pixels.
fn shape(oddity: Oddity, k: f32, cell: f32, [x, y]: [f32; 2]) -> f32 {
    match oddity {
        Oddity::Orientation => {
            let (sin, cos) = (std::f32::consts::FRAC_PI_2 * k).sin_cos();
            let (across, along) = (x * cos + y * sin, y * cos - x * sin);
            coverage(0.06 * cell - across.abs()) * coverage(0.3 * cell - along.abs())
        }
        Oddity::Size => coverage(0.2 * (1.0 + k) * cell - x.hypot(y)),
        _ => coverage(0.2 * cell - x.hypot(y)),
    }
}

/// Returns a picture of `size` × `size` pixels with a grid of items, and its motion.
fn search(oddity: Oddity, k: f32, odd: usize, size: usize) -> (Plane<[f32; 3]>, Option<Plane<[f32; 2]>>) {
    let cell = size as f32 / GRID as f32;
    let place = |x: usize, y: usize| {
        let center = [x, y].map(|at| at as f32 + 0.5);
        let [column, row] = center.map(|at| (at / cell) as usize);
        let k = if row * GRID + column == odd { k } else { 0.0 };
        let from_middle = [center[0] - (column as f32 + 0.5) * cell, center[1] - (row as f32 + 0.5) * cell];
        (k, shape(oddity, k, cell, from_middle))
    };
    let rgb = Plane::from_fn(size, size, |x, y| {
        let (k, covered) = place(x, y);
        color(oddity, k).map(|c| FIELD + covered * (c - FIELD))
    });
    let motion = motion(oddity, 0.0).map(|_| {
        Plane::from_fn(size, size, |x, y| {
            let (k, covered) = place(x, y);
            let [item, field] = motion(oddity, k).expect("an oddity of motion");
            if covered > 0.5 { item } else { field }
        })
    });
    (rgb, motion)
}

/// Returns the rank of the odd item, with items sorted by their largest saliency. In a tie the odd item ranks last.
fn rank(map: &Plane<f32>, odd: usize) -> usize {
    let cell = map.width() as f32 / GRID as f32;
    let mut maxima = [0.0f32; GRID * GRID];
    for (y, row) in map.rows().enumerate() {
        for (x, &s) in row.iter().enumerate() {
            let [column, row] = [x, y].map(|at| ((at as f32 + 0.5) / cell) as usize);
            let item = row * GRID + column;
            maxima[item] = maxima[item].max(s);
        }
    }
    maxima.iter().filter(|&&maximum| maximum >= maxima[odd]).count()
}

/// Returns the ranks of the odd item at six positions.
fn ranks(oddity: Oddity, k: f32, size: usize) -> [usize; 6] {
    [0, 3, 7, 12, 22, 24].map(|odd| {
        let (rgb, motion) = search(oddity, k, odd, size);
        rank(&saliency(&rgb, motion.as_ref()), odd)
    })
}

#[test]
fn saliency_of_the_odd_item_ranks_first() {
    // Test each oddity with the smallest contrast that is found in all cases.
    let oddities = [
        (Oddity::Brightness, 0.25),
        (Oddity::Tint, 0.25),
        (Oddity::Hue, 0.25),
        (Oddity::Size, 0.25),
        (Oddity::Orientation, 0.25),
        (Oddity::Speed, 0.25),
        (Oddity::Overtaking, 0.75),
        (Oddity::Direction, 0.25),
    ];
    for size in [256, 512] {
        for (oddity, least) in oddities {
            for k in [0.25, 0.5, 0.75, 1.0].into_iter().filter(|&k| k >= least) {
                assert_eq!(ranks(oddity, k, size), [1; 6], "{size} {oddity:?} {k}");
            }
        }
    }
}

/// Returns random numbers from a fixed seed, −1…1, with a variance of ⅓.
fn noise() -> impl FnMut() -> f32 {
    let mut state = 7u32;
    move || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / (1 << 23) as f32 - 1.0
    }
}

fn largest(map: &Plane<f32>) -> f32 {
    map.samples().iter().copied().fold(0.0, f32::max)
}

/// Returns a picture with items, waves and faint noise.
fn busy(width: usize, height: usize) -> Plane<[f32; 3]> {
    let mut noise = noise();
    Plane::from_fn(width, height, |x, y| {
        let (u, v) = (x as f32, y as f32);
        let wave = 0.1 * (0.07 * u).sin() * (0.11 * v + 0.02 * u).cos();
        let red = 0.2 * coverage(0.06 * width as f32 - (u - 0.3 * width as f32).hypot(v - 0.4 * height as f32));
        [0.5 + wave + red, 0.45 + wave - 0.5 * red, 0.4 + wave - 0.5 * red].map(|c| c + 0.01 * noise())
    })
}

#[test]
fn saliency_of_flat_pictures_and_of_noise_is_next_to_nothing() {
    for rgb in [[0.0; 3], [0.5; 3], [1.0; 3], [0.7, 0.2, 0.1]] {
        let map = saliency(&Plane::filled(200, 150, rgb), Some(&Plane::filled(200, 150, [3.0, -1.0])));
        assert!(largest(&map) < 1e-4, "{rgb:?}: {}", largest(&map));
    }
    // Scale the noise to a standard deviation of 0.01.
    let mut noise = noise();
    let mut sample = || 0.5 + 0.01 * 3.0f32.sqrt() * noise();
    let colored = Plane::from_fn(256, 256, |_, _| [sample(), sample(), sample()]);
    let gray = Plane::from_fn(256, 256, |_, _| [sample(); 3]);
    for rgb in [colored, gray] {
        let map = saliency(&rgb, None);
        assert!(largest(&map) < 0.01, "{}", largest(&map));
    }
}

#[test]
fn saliency_does_not_depend_on_exposure() {
    for factor in [0.5, 0.8, 1.2] {
        let rgb = busy(300, 200);
        let scaled = rgb.map(|rgb| rgb.map(|c| factor * c));
        let (a, b) = (saliency(&rgb, None), saliency(&scaled, None));
        let difference = Plane::from_fn(300, 200, |x, y| (a.get(x, y) - b.get(x, y)).abs());
        assert!(largest(&difference) < 0.05 * largest(&a), "{factor}: {} of {}", largest(&difference), largest(&a));
    }
}

#[test]
fn saliency_of_the_mirror_image_is_mirrored() {
    let rgb = busy(256, 128);
    let map = saliency(&rgb, None);
    let mirrored = saliency(&Plane::from_fn(256, 128, |x, y| rgb.get(255 - x, 127 - y)), None);
    let difference = Plane::from_fn(256, 128, |x, y| (map.get(x, y) - mirrored.get(255 - x, 127 - y)).abs());
    assert!(largest(&difference) < 1e-3, "{}", largest(&difference));
}

#[test]
fn saliency_of_small_pictures_is_flat_or_within_range() {
    let narrow = [(1000, 1), (1, 1000), (600, 3), (33, 17)];
    let small = (0..=20).flat_map(|width| (0..=20).map(move |height| (width, height)));
    for (width, height) in small.chain(narrow) {
        let motion = Plane::from_fn(width, height, |x, y| [x as f32, (y % 3) as f32]);
        for motion in [None, Some(&motion)] {
            let map = saliency(&busy(width, height), motion);
            assert_eq!((map.width(), map.height()), (width, height));
            assert!(map.samples().iter().all(|s| (0.0..=1.0).contains(s)), "{width}x{height}");
            assert!(width.max(height) > 16 || largest(&map) == 0.0, "{width}x{height} has no pair of levels");
        }
    }
}

#[test]
fn saliency_takes_what_is_not_finite_as_black_and_at_rest() {
    let (mut rgb, mut motion) = (busy(128, 96), Plane::filled(128, 96, [1.0f32, 0.0]));
    let (mut black, mut at_rest) = (rgb.clone(), motion.clone());
    let pixels = [[f32::NAN, 0.2, 0.3], [f32::INFINITY; 3], [0.1, f32::NEG_INFINITY, 0.0]];
    for (i, pixel) in pixels.into_iter().enumerate() {
        rgb.set(40 * i, 30 + i, pixel);
        black.set(40 * i, 30 + i, [0.0; 3]);
        motion.set(30 * i, 20, [pixel[0], pixel[1]]);
        at_rest.set(30 * i, 20, [0.0; 2]);
    }
    let map = saliency(&rgb, Some(&motion));
    assert_eq!(map, saliency(&black, Some(&at_rest)));
    assert!(map.samples().iter().all(|s| (0.0..=1.0).contains(s)));
    // Test finite values far outside any plausible range.
    let wild = saliency(&rgb.map(|rgb| rgb.map(|c| 1e30 * c)), Some(&motion.map(|u| u.map(|c| -1e38 * c))));
    assert!(wild.samples().iter().all(|s| (0.0..=1.0).contains(s)));
}

#[test]
fn saliency_of_a_pan_is_that_of_the_picture() {
    let rgb = busy(200, 200);
    let (still, pan) = (saliency(&rgb, None), saliency(&rgb, Some(&Plane::filled(200, 200, [-7.0, 2.5]))));
    // The motion channel is empty, so three of four channels remain.
    assert!(still.samples().iter().zip(pan.samples()).all(|(a, b)| (0.75 * a - b).abs() < 1e-4));
}

#[test]
#[should_panic(expected = "every pixel needs its motion")]
fn saliency_needs_the_motion_of_every_pixel() {
    let _ = saliency(&busy(30, 20), Some(&Plane::filled(20, 30, [0.0; 2])));
}

/// A new object is an area without matches. Along the rim of an old object, only some matches are missing.
#[test]
fn saliency_of_new_things_is_full_and_that_of_rims_is_not() {
    let new = |x: usize, y: usize| (2..6).contains(&x) && (2..6).contains(&y);
    let rim = |x: usize, y: usize| x == 9 && y < 7;
    let known = Plane::from_fn(12, 8, |x, y| if new(x, y) || rim(x, y) { NO_MATCH } else { (12 * y + x) as u32 });
    let (now, before) = (Plane::filled(12, 8, 0.5), Plane::filled(12, 8, 0.1));
    let steady = steady_saliency(&now, &before, &Correspondence::from_matches(known));
    for (x, y) in (0..8).flat_map(|y| (0..12).map(move |x| (x, y))) {
        let is_inside = (3..5).contains(&x) && (3..5).contains(&y);
        let expected = match (new(x, y), rim(x, y)) {
            (true, _) if is_inside => 1.0,
            (true, _) => 0.5,
            (_, true) => 0.5,
            _ => 0.3,
        };
        assert!((steady.get(x, y) - expected).abs() < 1e-6, "{x}, {y}: {}", steady.get(x, y));
    }
}

/// A pan reveals a strip at the border, which is no new object. A hole inside of the picture is one.
#[test]
fn saliency_of_a_strip_that_enters_the_picture_is_its_own() {
    let strip = |x: usize| x >= 12;
    let hole = |x: usize, y: usize| (4..9).contains(&x) && (3..8).contains(&y);
    let known = Plane::from_fn(16, 12, |x, y| if strip(x) || hole(x, y) { NO_MATCH } else { (16 * y + x) as u32 });
    let now = Plane::filled(16, 12, 0.25);
    let steady = steady_saliency(&now, &now, &Correspondence::from_matches(known));
    for (x, y) in (0..12).flat_map(|y| (0..16).map(move |x| (x, y))) {
        let is_new = (5..8).contains(&x) && (4..7).contains(&y);
        assert_eq!(steady.get(x, y), if is_new { 1.0 } else { 0.25 }, "{x}, {y}");
    }
}

#[test]
fn saliency_is_steadied_along_the_motion() {
    let (now, before) = (Plane::filled(4, 1, 0.5), Plane::from_vec(4, 1, vec![0.1, 0.3, f32::NAN, 0.9]));
    let known = Correspondence::from_matches(Plane::from_vec(4, 1, vec![1, 3, NO_MATCH, 2]));
    let steady = steady_saliency(&now, &before, &known);
    // The third pixel is not a new object, because its neighbors have matches.
    let expected = [0.4, 0.7, 0.5, 0.25];
    assert!(steady.samples().iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6), "{steady:?}");
    // Without previous saliency, all pixels have that of the frame.
    assert_eq!(steady_saliency(&now, &Plane::default(), &known).samples(), [0.5; 4]);
    // Disoccluded pixels converge within a few frames.
    let still = Correspondence::still(4, 1);
    let settled = (0..8).fold(Plane::filled(4, 1, 1.0), |before, _| steady_saliency(&now, &before, &still));
    assert!(settled.samples().iter().all(|s| (s - 0.5).abs() < 0.01));
}
