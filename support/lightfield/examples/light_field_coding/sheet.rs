//! Contact sheet: the light of an object in one direction with several codings, and the magnified errors.

use crate::light::{self, DIRECTIONS, PLACES};
use crate::scene::{Object, Scene};
use crate::segments::{SegmentRule, Segmented};
use lightfield::{LookUp, NearLossless};
use std::fs::File;
use std::io::BufWriter;

/// Gap between pictures \[pixels\].
const GAP: usize = 8;
/// Magnification of errors, which are displayed around gray.
const MAGNIFIED: f32 = 24.0;

/// Writes the contact sheet as PNG. The top row shows the light of `object` raw, as segments with T = 9, and
/// near-lossless with δ = 3. The bottom row shows the errors.
pub fn write(path: &str, scene: &Scene, object: &Object) -> Result<(), Box<dyn std::error::Error>> {
    let field = light::field(scene, object, false)?;
    let segmented = Segmented::encode(&field, 9, SegmentRule::Checked);
    let (linear, near) = (segmented.linear(), NearLossless::encode(&field, 3)?);
    let ways: [&dyn LookUp; 3] = [&field, &linear, &near];

    // View from 45° to the normal, at an azimuth where the lobe is visible.
    let direction = PLACES / 2 + DIRECTIONS * 7 / 8 / PLACES * PLACES;
    let (width, height) = (object.width, object.height);
    let (across, down) = (3 * width + 2 * GAP, 2 * height + GAP);
    let mut pixels = vec![255; across * down * 3];
    for (column, way) in ways.iter().enumerate() {
        for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
            let slot = light::slot(object, [x, y]);
            let exact = field.codes(slot, direction).unwrap_or_default();
            let found = way.codes(slot, direction).unwrap_or_default();
            let above = (y * across + column * (width + GAP) + x) * 3;
            let below = above + (height + GAP) * across * 3;
            for c in 0..3 {
                pixels[above + c] = found[c].round() as u8;
                pixels[below + c] = (128.0 + MAGNIFIED * (found[c] - exact[c])).clamp(0.0, 255.0) as u8;
            }
        }
    }
    let mut encoder = png::Encoder::new(BufWriter::new(File::create(path)?), across as u32, down as u32);
    encoder.set_color(png::ColorType::Rgb);
    encoder.write_header()?.write_image_data(&pixels)?;
    println!("{path}");
    Ok(())
}
