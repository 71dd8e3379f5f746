//! Marks of plotted lines. Each line has its own shape of mark in addition to its color.

use super::palette::COLORS;

/// Corners of the marks, approximately within a circle of radius 1; y points down.
const SHAPES: [&[(f64, f64)]; COLORS] = [
    // Disk, square, triangle, diamond.
    &[
        (0.0, -0.95),
        (0.475, -0.82),
        (0.82, -0.475),
        (0.95, 0.0),
        (0.82, 0.475),
        (0.475, 0.82),
        (0.0, 0.95),
        (-0.475, 0.82),
        (-0.82, 0.475),
        (-0.95, 0.0),
        (-0.82, -0.475),
        (-0.475, -0.82),
    ],
    &[(-0.85, -0.85), (0.85, -0.85), (0.85, 0.85), (-0.85, 0.85)],
    &[(0.0, -1.15), (1.1, 0.85), (-1.1, 0.85)],
    &[(0.0, -1.25), (1.1, 0.0), (0.0, 1.25), (-1.1, 0.0)],
    // Triangles in other directions, and a plus.
    &[(0.0, 1.15), (1.1, -0.85), (-1.1, -0.85)],
    &[
        (-0.4, -1.15),
        (0.4, -1.15),
        (0.4, -0.4),
        (1.15, -0.4),
        (1.15, 0.4),
        (0.4, 0.4),
        (0.4, 1.15),
        (-0.4, 1.15),
        (-0.4, 0.4),
        (-1.15, 0.4),
        (-1.15, -0.4),
        (-0.4, -0.4),
    ],
    &[(1.15, 0.0), (-0.85, -1.1), (-0.85, 1.1)],
    &[(-1.15, 0.0), (0.85, -1.1), (0.85, 1.1)],
    // Star, hourglass, bow tie, horizontal bar.
    &[
        (0.0, -1.35),
        (0.35, -0.45),
        (1.3, -0.4),
        (0.55, 0.2),
        (0.8, 1.1),
        (0.0, 0.6),
        (-0.8, 1.1),
        (-0.55, 0.2),
        (-1.3, -0.4),
        (-0.35, -0.45),
    ],
    &[(-1.0, -1.1), (1.0, -1.1), (-1.0, 1.1), (1.0, 1.1)],
    &[(-1.1, -1.0), (-1.1, 1.0), (1.1, -1.0), (1.1, 1.0)],
    &[(-1.3, -0.45), (1.3, -0.45), (1.3, 0.45), (-1.3, 0.45)],
    // Vertical bar, roof, halves of a square, house.
    &[(-0.45, -1.3), (0.45, -1.3), (0.45, 1.3), (-0.45, 1.3)],
    &[(0.0, -1.1), (1.2, 0.3), (1.2, 1.1), (0.0, -0.2), (-1.2, 1.1), (-1.2, 0.3)],
    &[(-1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)],
    &[(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0)],
    &[(0.0, -1.3), (0.8, -0.3), (0.8, 1.1), (-0.8, 1.1), (-0.8, -0.3)],
];

/// Returns the SVG path of mark `number` at (x, y). Numbers wrap around.
pub(super) fn outline(number: usize, x: f64, y: f64, radius: f64) -> String {
    let mut path = String::new();
    for (i, (dx, dy)) in SHAPES[number % SHAPES.len()].iter().enumerate() {
        let step = if i == 0 { 'M' } else { 'L' };
        path.push_str(&format!("{step}{:.1} {:.1}", x + radius * dx, y + radius * dy));
    }
    path.push('Z');
    path
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_two_colors_have_one_mark() {
        for a in 0..COLORS {
            for b in 0..a {
                assert_ne!(outline(a, 0.0, 0.0, 4.0), outline(b, 0.0, 0.0, 4.0), "{a} and {b}");
            }
        }
    }
}
