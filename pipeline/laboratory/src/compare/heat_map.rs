//! Heat maps of differences between pictures.

use super::false_color::{false_color, log_share};
use super::picture::View;
use plane::Plane;

/// Luma differences at the dark end and at the bright end of the colors \[code values; luma spans 219\]. Differences at
/// the dark end are below rounding, and differences at the bright end are obvious.
pub const RANGE: (f32, f32) = (0.25, 64.0);

/// Sum of the luma differences of many pictures.
#[derive(Clone, Debug, Default)]
pub struct HeatMap {
    sum: Plane<f32>,
    count: u32,
}

impl HeatMap {
    /// Adds |a − b| for two pictures.
    ///
    /// # Panics
    /// If the sizes differ from each other or from earlier pictures.
    pub fn add(&mut self, a: &View, b: &View) {
        // Size the sum by the first picture.
        if self.count == 0 {
            self.sum = Plane::filled(a.fine_luma.width(), a.fine_luma.height(), 0.0);
        }
        assert_eq!(self.sum.samples().len(), a.fine_luma.samples().len(), "pictures of one size");
        let differences = a.fine_luma.samples().iter().zip(b.fine_luma.samples()).map(|(a, b)| (a - b).abs());
        self.sum.samples_mut().iter_mut().zip(differences).for_each(|(sum, difference)| *sum += difference);
        self.count += 1;
    }

    /// Returns the mean difference in false colors, on a logarithmic scale over [`RANGE`].
    pub fn picture(&self) -> Plane<[u8; 3]> {
        let count = self.count.max(1) as f32;
        self.sum.map(|sum| false_color(log_share(sum / count, RANGE.0, RANGE.1)))
    }
}
