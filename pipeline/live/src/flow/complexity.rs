//! Complexities of pictures: bits · quantiser, which is nearly independent of the quantiser.

/// Kind of picture; pictures of a kind have similar complexities.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PictureKind {
    /// I picture.
    Intra,
    /// P picture of a moving view or scene.
    Moving,
    /// P picture that refines a static view.
    Resting,
}

/// Weight of the newest picture in a mean.
const WEIGHT: f64 = 0.5;

/// Mean complexity of each kind of picture; `None` before the first one.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Complexities([Option<f64>; 3]);

impl Complexities {
    /// Adds the complexity of a picture.
    pub fn add(&mut self, kind: PictureKind, complexity: f64) {
        let mean = &mut self.0[kind as usize];
        *mean = Some(mean.map_or(complexity, |mean| mean + WEIGHT * (complexity - mean)));
    }

    /// Returns the mean complexity of a kind.
    pub fn of(&self, kind: PictureKind) -> Option<f64> {
        self.0[kind as usize]
    }
}
