//! Picture of the atlas, with the light of texels in use around them.

use glam::Vec3;

/// Light of the texels of the atlas, in rows.
pub(super) struct HoledPicture {
    known: Vec<Option<Vec3>>,
    width: usize,
}

impl HoledPicture {
    /// Creates a picture without known texels.
    pub fn new(width: u32, height: u32) -> Self {
        Self { known: vec![None; (width * height) as usize], width: width as usize }
    }

    /// Sets the light of the texel in a column and a row.
    pub fn set(&mut self, x: u32, y: u32, light: Vec3) {
        self.known[y as usize * self.width + x as usize] = Some(light);
    }

    /// Returns the light of all texels by rows.
    pub fn all(&self) -> impl Iterator<Item = Vec3> + '_ {
        (0..self.known.len()).map(|at| self.filled(at))
    }

    /// Returns the known light of the texels around and at an index.
    fn around(&self, at: usize) -> impl Iterator<Item = Vec3> + '_ {
        let (x, y) = (at % self.width, at / self.width);
        let columns = x.saturating_sub(1)..=(x + 1).min(self.width - 1);
        let rows = y.saturating_sub(1)..=y + 1;
        let texels = rows.flat_map(move |row| columns.clone().map(move |column| row * self.width + column));
        texels.filter_map(|texel| *self.known.get(texel)?)
    }

    /// Returns the light of a texel. A texel with unknown light has the mean of adjacent texels, or zero.
    fn filled(&self, at: usize) -> Vec3 {
        self.known[at].unwrap_or_else(|| {
            let (mut sum, mut count) = (Vec3::ZERO, 0);
            for light in self.around(at) {
                (sum, count) = (sum + light, count + 1);
            }
            sum / count.max(1) as f32
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Bilinear samples read at most adjacent texels, so they never read an empty texel.
    #[test]
    fn unused_texels_have_the_mean_of_their_neighbors() {
        let (one, three) = (Some(Vec3::ONE), Some(Vec3::splat(3.0)));
        let known = vec![one, None, three, None, None, None, None, None, None, None, None, None];
        let picture = HoledPicture { known, width: 4 };
        let expected = [1.0, 2.0, 3.0, 3.0, 1.0, 2.0, 3.0, 3.0, 0.0, 0.0, 0.0, 0.0];
        for (at, light) in expected.into_iter().enumerate() {
            assert_eq!(picture.filled(at), Vec3::splat(light));
        }
    }
}
