//! Drawings as pictures.

use crate::error::{Context, Error, Result};
use crate::laboratory::page::Svg;
use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg::{Options, Tree, fontdb::Database};
use std::sync::Arc;

/// The bytes of a PNG file of `svg`, `scale` pixels to its unit. Text is in a font that comes with the program.
///
/// # Errors
/// A fault of our own, or a size that fits no memory.
pub fn png_of(svg: &Svg, scale: f32) -> Result<Vec<u8>> {
    let mut fonts = Database::new();
    fonts.load_font_data(dejavu::sans::regular().to_vec());
    let options = Options { fontdb: Arc::new(fonts), font_family: "DejaVu Sans".into(), ..Options::default() };
    let tree = Tree::from_str(&svg.file(), &options).context("a plot cannot be read back")?;
    let size = tree.size().to_int_size().scale_by(scale).ok_or_else(|| Error::Fault("a plot has no size".into()))?;
    let mut picture =
        Pixmap::new(size.width(), size.height()).ok_or_else(|| Error::Fault("a plot is too large".into()))?;
    resvg::render(&tree, Transform::from_scale(scale, scale), &mut picture.as_mut());
    picture.encode_png().context("a plot cannot be put into PNG")
}
