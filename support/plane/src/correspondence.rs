//! Correspondence between the pixels of two pictures.

use crate::{Plane, SizeError};

/// Entry of [`Correspondence::matches`] for a pixel that has no counterpart in the other picture.
pub const NO_MATCH: u32 = u32::MAX;

/// Position of each pixel's surface point in another picture, usually the previous one.
///
/// The match of a pixel is the raster index of the pixel in the other picture that shows the same surface, or
/// [`NO_MATCH`]. The motion of a pixel is its position in the other picture minus its position in this picture.
/// Motion is in pixels, x to the right and y down. Pixels without a match have undefined motion.
///
/// ```
/// use plane::{Correspondence, NO_MATCH, Plane};
///
/// // The camera pans by 1.5 pixels to the right: all surfaces were farther right before.
/// let pan = Correspondence::from_motion(Plane::filled(64, 48, [1.5, 0.0]));
/// assert_eq!(pan.motion_of(10, 0), Some([1.5, 0.0]));
/// assert_eq!(pan.match_of(10, 2), Some(2 * 64 + 12));
///
/// // A shot change: no pixel has a match.
/// let cut = Correspondence::from_matches(Plane::filled(64, 48, NO_MATCH));
/// assert_eq!(cut.motion_of(10, 2), None);
/// ```
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(try_from = "StoredCorrespondence"))]
pub struct Correspondence {
    motion: Plane<[f32; 2]>,
    matches: Plane<u32>,
}

/// Serialized form of a correspondence, before the sizes are checked.
#[cfg(feature = "serde")]
#[derive(serde::Deserialize)]
struct StoredCorrespondence {
    motion: Plane<[f32; 2]>,
    matches: Plane<u32>,
}

#[cfg(feature = "serde")]
impl TryFrom<StoredCorrespondence> for Correspondence {
    type Error = SizeError;

    fn try_from(StoredCorrespondence { motion, matches }: StoredCorrespondence) -> Result<Self, SizeError> {
        Self::new(motion, matches)
    }
}

/// Motion stored for pixels without a match.
const NO_MOTION: [f32; 2] = [0.0; 2];

impl Correspondence {
    /// Builds a correspondence from the motion of every pixel \[pixels\] and the raster index of its match or
    /// [`NO_MATCH`].
    ///
    /// # Errors
    /// If the two planes have different sizes.
    pub fn new(motion: Plane<[f32; 2]>, matches: Plane<u32>) -> Result<Self, SizeError> {
        SizeError::check("matches", &matches, (motion.width(), motion.height()))?;
        Ok(Self { motion, matches })
    }

    /// Builds a correspondence from motion \[pixels\] between pictures of equal size.
    ///
    /// Finite motion gives the pixel nearest to its end point, clamped to the border, as the match. Motion that is not
    /// finite gives [`NO_MATCH`].
    #[must_use]
    pub fn from_motion(mut motion: Plane<[f32; 2]>) -> Self {
        let (width, height) = (motion.width(), motion.height());
        let nearest =
            |at: usize, by: f32, count: usize| (at as f32 + by).round().clamp(0.0, (count - 1) as f32) as usize;
        let matches = Plane::from_fn(width, height, |x, y| {
            let [dx, dy] = motion.get(x, y);
            if dx.is_finite() && dy.is_finite() {
                raster_index(nearest(x, dx, width), nearest(y, dy, height), width)
            } else {
                // Store finite motion, so that equal correspondences compare equal.
                motion.set(x, y, NO_MOTION);
                NO_MATCH
            }
        });
        Self { motion, matches }
    }

    /// Builds a correspondence from matches between pictures of equal size.
    ///
    /// Motion is measured between pixel centers. Indices outside the picture become [`NO_MATCH`].
    #[must_use]
    pub fn from_matches(mut matches: Plane<u32>) -> Self {
        let width = matches.width();
        let count = matches.samples().len();
        let motion = Plane::from_fn(width, matches.height(), |x, y| {
            let index = matches.get(x, y) as usize;
            if index >= count {
                matches.set(x, y, NO_MATCH);
                return NO_MOTION;
            }
            [(index % width) as f32 - x as f32, (index / width) as f32 - y as f32]
        });
        Self { motion, matches }
    }

    /// Correspondence of a static picture of `width` × `height` pixels: every pixel is its own match.
    #[must_use]
    pub fn still(width: usize, height: usize) -> Self {
        Self {
            motion: Plane::filled(width, height, NO_MOTION),
            matches: Plane::from_fn(width, height, |x, y| raster_index(x, y, width)),
        }
    }

    /// Number of pixels per row.
    #[must_use]
    pub fn width(&self) -> usize {
        self.matches.width()
    }

    /// Number of rows.
    #[must_use]
    pub fn height(&self) -> usize {
        self.matches.height()
    }

    /// Position in the other picture minus position in this picture \[pixels\]. Undefined where
    /// [`matches`](Self::matches) contains [`NO_MATCH`].
    #[must_use]
    pub fn motion(&self) -> &Plane<[f32; 2]> {
        &self.motion
    }

    /// Raster index of the pixel in the other picture that shows the same surface, or [`NO_MATCH`].
    #[must_use]
    pub fn matches(&self) -> &Plane<u32> {
        &self.matches
    }

    /// Motion of the pixel in column `x` and row `y` \[pixels\], if it has a match.
    ///
    /// # Panics
    /// If the pixel is outside the picture.
    #[must_use]
    pub fn motion_of(&self, x: usize, y: usize) -> Option<[f32; 2]> {
        self.match_of(x, y).map(|_| self.motion.get(x, y))
    }

    /// Raster index of the match of the pixel in column `x` and row `y`, if it has one.
    ///
    /// # Panics
    /// If the pixel is outside the picture.
    #[must_use]
    pub fn match_of(&self, x: usize, y: usize) -> Option<u32> {
        Some(self.matches.get(x, y)).filter(|&index| index != NO_MATCH)
    }
}

/// Returns the raster index of a pixel, or [`NO_MATCH`] if the index exceeds 32 bits.
fn raster_index(x: usize, y: usize, width: usize) -> u32 {
    u32::try_from(y * width + x).unwrap_or(NO_MATCH)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn motion_that_is_not_finite_is_no_match() {
        let motion = Plane::from_vec(4, 1, vec![[f32::NAN, 0.0], [0.6, 0.0], [0.0, f32::INFINITY], [2.0, -3.0]]);
        let known = Correspondence::from_motion(motion);
        assert_eq!(known.matches().samples(), [NO_MATCH, 2, NO_MATCH, 3]);
        assert_eq!(known.motion().samples(), [[0.0; 2], [0.6, 0.0], [0.0; 2], [2.0, -3.0]]);
        assert_eq!((known.motion_of(0, 0), known.motion_of(3, 0)), (None, Some([2.0, -3.0])));
    }

    #[test]
    fn matches_and_whole_motion_tell_the_same() {
        let matches = Plane::from_fn(5, 4, |x, y| if x == 2 { NO_MATCH } else { (4 - x + 5 * (3 - y)) as u32 });
        let known = Correspondence::from_matches(matches.clone());
        assert_eq!(known.motion_of(1, 3), Some([2.0, -3.0]));
        assert_eq!(known.matches(), &matches);
        let motion = Plane::from_fn(5, 4, |x, y| known.motion_of(x, y).unwrap_or([f32::NAN; 2]));
        assert_eq!(Correspondence::from_motion(motion), known);
    }

    #[test]
    fn indices_outside_of_the_picture_are_no_match() {
        let known = Correspondence::from_matches(Plane::from_vec(2, 1, vec![2, 1]));
        assert_eq!(known.matches().samples(), [NO_MATCH, 1]);
    }

    #[test]
    fn a_still_picture_is_one_without_motion() {
        let still = Correspondence::still(3, 2);
        assert_eq!(still, Correspondence::from_motion(Plane::filled(3, 2, [0.0; 2])));
        assert_eq!(still.match_of(1, 1), Some(4));
        assert_eq!(Correspondence::still(0, 0).matches().samples(), [0; 0]);
    }

    #[test]
    fn planes_must_be_of_one_size() {
        let error = Correspondence::new(Plane::filled(2, 2, [0.0; 2]), Plane::filled(2, 1, 0)).unwrap_err();
        assert_eq!(error.to_string(), "matches has 2x1 samples and needs 2x2");
    }
}
