//! Map of a film's mean importance per macroblock.

use super::svg::{Rectangle, Svg, TextStyle, at};
use plane::Plane;
use std::sync::Mutex;

/// Side of the drawn squares \[pixels\]: the size of an MPEG-2 macroblock.
const SQUARE: usize = 16;
/// Width of the drawing \[pixels\].
const WIDTH: f64 = 480.0;
/// Height of the title above the map \[pixels\].
const ABOVE: f64 = 34.0;

/// Sum of the importance maps of all frames.
#[derive(Debug, Default)]
pub(super) struct ImportanceSum(Mutex<Option<(Plane<f32>, u32)>>);

impl ImportanceSum {
    /// Adds the map of a frame. All maps must have the same size.
    pub fn add(&self, map: &Plane<f32>) {
        let mut held = self.0.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        let (sum, frames) = held.get_or_insert_with(|| (Plane::filled(map.width(), map.height(), 0.0), 0));
        sum.samples_mut().iter_mut().zip(map.samples()).for_each(|(sum, value)| *sum += value);
        *frames += 1;
    }

    /// Draws the mean map. Returns `None` without frames.
    pub fn draw(&self) -> Option<Svg> {
        let held = self.0.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        let (sum, frames) = held.as_ref()?;
        let (width, height) = (sum.width(), sum.height());
        // Scale the map to the width of the drawing.
        let scale = WIDTH / width.max(1) as f64;
        let title = "Mean importance";
        let mut svg = Svg::new(WIDTH, ABOVE + scale * height as f64, title);
        svg.text(at(0.0, 20.0), TextStyle { class: "ink", anchor: "start", size: 16.0 }, title);
        // Average each macroblock over its pixels and all frames.
        for top in (0..height).step_by(SQUARE) {
            for left in (0..width).step_by(SQUARE) {
                let (right, bottom) = (width.min(left + SQUARE), height.min(top + SQUARE));
                let whole: f32 = (top..bottom).map(|y| sum.row(y)[left..right].iter().sum::<f32>()).sum();
                let mean = whole / (((right - left) * (bottom - top)) as f32 * *frames as f32);
                let gray = (255.0 * mean.clamp(0.0, 1.0)).round() as u8;
                let square = Rectangle {
                    x: scale * left as f64,
                    y: ABOVE + scale * top as f64,
                    width: scale * (right - left) as f64,
                    height: scale * (bottom - top) as f64,
                };
                let about = format!("pixels from {left}, {top}: {mean:.2}");
                svg.gray(square, gray, &about);
            }
        }
        Some(svg)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn macroblocks_have_the_mean_of_their_pixels_and_frames() {
        let sum = ImportanceSum::default();
        assert!(sum.draw().is_none());
        sum.add(&Plane::from_fn(24, 16, |x, _| if x < 16 { 1.0 } else { 0.0 }));
        sum.add(&Plane::filled(24, 16, 0.0));
        let drawn = sum.draw().expect("two frames").inline();
        assert!(drawn.contains("pixels from 0, 0: 0.50") && drawn.contains("pixels from 16, 0: 0.00"), "{drawn}");
        assert_eq!((drawn.matches("#808080").count(), drawn.matches("#000000").count()), (1, 1));
    }
}
