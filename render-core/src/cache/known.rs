//! What is known of the neighbors of a frame's records, kept for further pictures of that frame: through other places of its
//! pixels, records have the same neighbors and a few new ones.

use super::predict::{Predicted, Taught};
use super::record::Record;
use super::tile::Tiles;
use glam::Vec3A;

/// What the records of a frame predict, as its pictures so far have found it.
#[derive(Default)]
pub(super) struct KnownPredictions {
    pictures: Vec<OfPicture>,
}

/// What the records that were listed for one picture predict.
struct OfPicture {
    /// Numbers of the records, ascending.
    numbers: Vec<u32>,
    predicted: Vec<Predicted>,
    /// Number of the first record that was made afterwards.
    next: u32,
}

/// A listed record that was made after the first picture of the frame.
pub(super) struct Fresh {
    number: u32,
    position: Vec3A,
    /// Its index among the records.
    pub index: usize,
}

/// What a record's neighbors have taught it before, and those of the fresh ones that came later.
pub(super) struct Before<'a> {
    pub taught: &'a Taught,
    pub since: &'a [Fresh],
}

impl Fresh {
    /// Whether it is less than `reach` away from `position` \[m\].
    pub fn is_within(&self, reach: f32, position: Vec3A) -> bool {
        self.position.distance_squared(position) < reach * reach
    }
}

impl KnownPredictions {
    /// Keeps what the listed records predict, before the record with the number `next` is made.
    pub fn keep<R>(&mut self, tiles: &Tiles, records: &[Record<R>], predicted: Vec<Predicted>, next: u32) {
        let numbers = tiles.listed.iter().map(|&index| records[index as usize].number).collect();
        self.pictures.push(OfPicture { numbers, predicted, next });
    }

    /// The listed records that were made after the first picture, in their order.
    pub fn fresh<R>(&self, tiles: &Tiles, records: &[Record<R>]) -> Vec<Fresh> {
        let Some(first) = self.pictures.first() else { return Vec::new() };
        let of = |&index: &u32| {
            let record = &records[index as usize];
            Fresh { number: record.number, position: record.site.position, index: index as usize }
        };
        tiles.listed.iter().map(of).filter(|fresh| is_since(fresh.number, first.next)).collect()
    }

    /// What is known of `record`, if its radius was the same then \[m\].
    pub fn of<'a, R>(&'a self, record: &Record<R>, radius: f32, fresh: &'a [Fresh]) -> Option<Before<'a>> {
        for picture in self.pictures.iter().rev() {
            let Ok(place) = picture.numbers.binary_search(&record.number) else { continue };
            let Predicted { radius: then, taught, .. } = &picture.predicted[place];
            let since = fresh.partition_point(|other| !is_since(other.number, picture.next));
            return (*then == radius).then_some(Before { taught, since: &fresh[since..] });
        }
        None
    }
}

/// Whether the record with this `number` was made when `next` was the next number, or later. Numbers wrap around.
fn is_since(number: u32, next: u32) -> bool {
    number.wrapping_sub(next) < 1 << 31
}
