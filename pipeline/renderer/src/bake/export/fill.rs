//! Filling of texels between charts with the color of their surroundings.
//!
//! Viewers may sample slightly outside of a chart. If a triangle's edge covers only a fraction of a pixel, coordinates
//! are evaluated at the pixel's center. On slanted surfaces, that center may be many texels away; mip levels reach even
//! further.

/// Image with holes, in raster order.
pub(super) type Holed = Vec<Option<[u8; 4]>>;

/// Fills the holes of an image with `width` columns from the image at half resolution, which averages the existing
/// texels.
pub(super) fn filled(picture: Holed, width: usize) -> Vec<[u8; 4]> {
    if picture.iter().all(Option::is_some) || picture.len() <= 1 {
        return picture.into_iter().map(Option::unwrap_or_default).collect();
    }
    let half = width.div_ceil(2);
    let coarse = filled(halved(&picture, width), half);
    let mut colors = Vec::with_capacity(picture.len());
    for (place, texel) in picture.into_iter().enumerate() {
        let (x, y) = (place % width, place / width);
        colors.push(texel.unwrap_or(coarse[y / 2 * half + x / 2]));
    }
    colors
}

/// Returns the image at half resolution, rounded up. A texel is a hole if its four source texels are holes.
fn halved(picture: &Holed, width: usize) -> Holed {
    let rows = picture.len().div_ceil(width);
    let (half, mut coarse) = (width.div_ceil(2), Vec::new());
    for y in (0..rows).step_by(2) {
        for x in (0..width).step_by(2) {
            let (mut sum, mut count) = ([0; 4], 0);
            for (x, y) in [(x, y), (x + 1, y), (x, y + 1), (x + 1, y + 1)] {
                let place = (x < width && y < rows).then_some(y * width + x);
                if let Some(texel) = place.and_then(|place| picture[place]) {
                    sum.iter_mut().zip(texel).for_each(|(sum, code)| *sum += u32::from(code));
                    count += 1;
                }
            }
            // Round the mean of the existing texels, to avoid darkening by repeated halving.
            coarse.push((count > 0).then(|| sum.map(|sum| ((sum + count / 2) / count) as u8)));
        }
    }
    debug_assert_eq!(coarse.len(), half * rows.div_ceil(2));
    coarse
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn holes_have_the_color_of_what_is_near_and_no_other_texel_changes() {
        let (left, right) = ([200, 0, 0, 255], [0, 100, 0, 255]);
        let mut picture: Holed = vec![None; 16 * 5];
        (picture[2 * 16 + 1], picture[2 * 16 + 14]) = (Some(left), Some(right));
        let filled = filled(picture, 16);
        assert_eq!((filled[2 * 16 + 1], filled[2 * 16 + 14]), (left, right));
        assert_eq!((filled[0], filled[4 * 16 + 15]), (left, right), "the nearer one");
        assert!(filled.iter().all(|texel| texel[3] == 255));
    }

    #[test]
    fn a_picture_of_nothing_is_black() {
        assert_eq!(filled(vec![None; 3 * 3], 3), vec![[0; 4]; 9]);
        assert!(filled(Vec::new(), 0).is_empty());
    }
}
