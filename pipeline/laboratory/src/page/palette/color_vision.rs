//! Differences between colors for normal and deficient color vision \[Machado09\], in CIELAB.

/// Matrices that simulate protanopia, deuteranopia and tritanopia on linear R, G, B (\[Machado09\], table 1, severity
/// 1.0).
const DEFICIENCIES: [(&str, [[f64; 3]; 3]); 3] = [
    ("protanopia", [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]]),
    (
        "deuteranopia",
        [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
    ),
    ("tritanopia", [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]]),
];
/// Matrix from linear sRGB to CIE XYZ (IEC 61966-2-1).
const TO_XYZ: [[f64; 3]; 3] =
    [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]];
/// White point D65 of sRGB in CIE XYZ.
const WHITE: [f64; 3] = [0.95047, 1.0, 1.08883];

/// Perceived color: name of the color vision, and L*, a*, b*.
type Seen = (&'static str, [f64; 3]);

/// Converts a color `#rrggbb` to linear R, G, B.
fn linear(color: &str) -> [f64; 3] {
    std::array::from_fn(|c| {
        let code = u8::from_str_radix(&color[2 * c + 1..2 * c + 3], 16).expect("#rrggbb");
        let value = f64::from(code) / 255.0;
        if value <= 0.04045 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
    })
}

fn times(matrix: &[[f64; 3]; 3], color: [f64; 3]) -> [f64; 3] {
    matrix.map(|row| row.iter().zip(color).map(|(weight, value)| weight * value).sum())
}

/// Converts linear R, G, B to L*, a*, b*, clamped to the display's range 0…1.
fn lab(color: [f64; 3]) -> [f64; 3] {
    let xyz = times(&TO_XYZ, color.map(|value| value.clamp(0.0, 1.0)));
    let [x, y, z] = std::array::from_fn(|c| {
        let t = xyz[c] / WHITE[c];
        if t > 216.0 / 24389.0 { t.cbrt() } else { (24389.0 / 27.0 * t + 16.0) / 116.0 }
    });
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

/// Returns a color as perceived with each kind of color vision.
pub(super) fn seen(color: &str) -> [Seen; 4] {
    let color = linear(color);
    let [p, d, t] = &DEFICIENCIES;
    let of = |(name, matrix): &(&'static str, _)| (*name, lab(times(matrix, color)));
    [("normal vision", lab(color)), of(p), of(d), of(t)]
}

/// Returns the smallest difference between two colors over all kinds of color vision. The difference is ΔE*ab (CIE
/// 1976), returned with the name of the color vision.
pub(super) fn least_difference(a: &str, b: &str) -> (f64, &'static str) {
    let pairs = seen(a).into_iter().zip(seen(b));
    let differences = pairs.map(|((name, a), (_, b))| {
        let square: f64 = a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum();
        (square.sqrt(), name)
    });
    differences.min_by(|a, b| a.0.total_cmp(&b.0)).expect("four visions")
}

/// Returns the contrast between two colors as defined in WCAG 2, from 1 to 21.
pub(super) fn contrast(a: &str, b: &str) -> f64 {
    let luminance = |color: &str| times(&TO_XYZ, linear(color))[1];
    let (a, b) = (luminance(a), luminance(b));
    (a.max(b) + 0.05) / (a.min(b) + 0.05)
}

#[test]
fn colors_of_known_differences() {
    // White and black differ by 100. In CIELAB, sRGB red is L* 53.24, a* 80.09, b* 67.20.
    assert!((least_difference("#ffffff", "#000000").0 - 100.0).abs() < 1e-3);
    let (name, red) = seen("#ff0000")[0];
    let known = red.iter().zip([53.24, 80.09, 67.20]).all(|(found, known)| (found - known).abs() < 0.02);
    assert!(name == "normal vision" && known, "{red:?}");
    // Without M cones, the red and green of traffic lights look alike, and gray remains gray.
    let [.., deuteranopia, _] = seen("#808080");
    assert!(deuteranopia.1[1].abs() < 0.1 && deuteranopia.1[2].abs() < 0.1, "{deuteranopia:?}");
    let (difference, name) = least_difference("#c04000", "#7a6a00");
    assert!(difference < 12.0 && name != "normal vision", "{difference} {name}");
    assert!((contrast("#ffffff", "#000000") - 21.0).abs() < 1e-3);
}
