//! Regression sums over the neighbors of a frame's records, kept for further pictures of the frame. Further pictures
//! sample other positions within the pixels. Their records have nearly the same neighbors, with a few new ones.

use super::record::Record;
use glam::{Mat3A, Vec3A};

/// Regression sums of a record over its neighbors.
#[derive(Clone, Copy, Debug)]
pub(super) struct Taught {
    /// Radius of the record in the picture \[m\].
    pub radius: f32,
    /// Σ w f fᵀ. f contains the offset along both axes in radii, and the difference of openness in tolerances.
    pub square: Mat3A,
    /// Σ w f r, with one column per component of f. r is the residual of the record's own prediction.
    pub unexplained: Mat3A,
    /// Sums over all neighbors without outlier rejection: Σ w, and for luminance Σ w r², Σ w f fᵀ and Σ w f r.
    pub weights: f32,
    pub variance: f32,
    pub all_square: Mat3A,
    pub all_unexplained: Vec3A,
}

impl Taught {
    /// Returns the sums of a record without neighbors.
    pub const fn nothing(radius: f32) -> Self {
        Self {
            radius,
            square: Mat3A::ZERO,
            unexplained: Mat3A::ZERO,
            weights: 0.0,
            variance: 0.0,
            all_square: Mat3A::ZERO,
            all_unexplained: Vec3A::ZERO,
        }
    }
}

/// Neighbors of a frame's records, from all pictures of the frame so far.
#[derive(Clone, Default)]
pub(super) struct KnownNeighbors {
    pictures: Vec<OfPicture>,
}

/// Regression sums of the records that were listed for one picture.
#[derive(Clone)]
struct OfPicture {
    /// Creation numbers of the records, ascending.
    numbers: Vec<u32>,
    taught: Vec<Taught>,
    /// Number of the first record made after this picture.
    next: u32,
}

/// Listed record that was made after the first picture of the frame.
pub(super) struct Fresh {
    number: u32,
    position: Vec3A,
    /// Index of the record.
    pub index: usize,
}

/// Earlier sums of a record, and the fresh records made since.
pub(super) struct Before<'a> {
    pub taught: &'a Taught,
    pub since: &'a [Fresh],
}

impl Fresh {
    /// Returns whether the record is less than `reach` meters from `position`.
    pub fn is_within(&self, reach: f32, position: Vec3A) -> bool {
        self.position.distance_squared(position) < reach * reach
    }
}

impl KnownNeighbors {
    /// Stores the sums of the records with the indices `listed`. `next` is the creation number of the next record.
    pub fn keep<R>(&mut self, listed: &[u32], records: &[Record<R>], taught: Vec<Taught>, next: u32) {
        let numbers = listed.iter().map(|&index| records[index as usize].number).collect();
        self.pictures.push(OfPicture { numbers, taught, next });
    }

    /// Appends the sums from further pictures of the frame.
    pub fn join(&mut self, further: Self) {
        self.pictures.extend(further.pictures);
    }

    /// Returns the listed records that were made after the first picture of the frame, in the order of `listed`.
    pub fn fresh<R>(&self, listed: &[u32], records: &[Record<R>]) -> Vec<Fresh> {
        let Some(first) = self.pictures.first() else { return Vec::new() };
        let of = |&index: &u32| {
            let record = &records[index as usize];
            Fresh { number: record.number, position: record.site.position, index: index as usize }
        };
        listed.iter().map(of).filter(|fresh| is_since(fresh.number, first.next)).collect()
    }

    /// Returns the latest sums of `record`, if they were computed for this `radius` \[m\].
    pub fn of<'a, R>(&'a self, record: &Record<R>, radius: f32, fresh: &'a [Fresh]) -> Option<Before<'a>> {
        // Sums for another radius are useless, because weights depend on the radius.
        for picture in self.pictures.iter().rev() {
            let Ok(place) = picture.numbers.binary_search(&record.number) else { continue };
            let taught = &picture.taught[place];
            let since = fresh.partition_point(|other| !is_since(other.number, picture.next));
            return (taught.radius == radius).then_some(Before { taught, since: &fresh[since..] });
        }
        None
    }
}

/// Returns whether the record `number` was made when `next` was the next number, or later. Numbers wrap around.
fn is_since(number: u32, next: u32) -> bool {
    number.wrapping_sub(next) < 1 << 31
}
