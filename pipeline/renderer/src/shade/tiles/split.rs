//! Split of a frame into tiles of equal cost.
//!
//! A map defines the cost in advance, for example the number of rays of each pixel: "each tile contains an equal number
//! of primary rays to be shot" \[Debattista05, 4.2\]. The paper does not describe how to split frames. This module
//! halves rectangles recursively.
//!
//! ```text
//! n = 5          3 tiles   2 tiles          2   1     2              1│1│1 │ 1
//! ┌─────────┐   ┌─────┬─────────┐       ┌───┬─┬─────────┐           ┌─┬─┬─┬─────┐
//! │ costly  │ ► │     │         │   ►   │   │ │         │     ►     │ │ │ ├─────┤
//! └─────────┘   └─────┴─────────┘       └───┴─┴─────────┘           └─┴─┴─┴─────┘
//! ```

use plane::Plane;
use std::ops::Range;

/// Rectangle of pixels.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Tile {
    /// Range of columns, counted from the left.
    pub columns: Range<usize>,
    /// Range of rows, counted from the top.
    pub rows: Range<usize>,
}

/// Splits a frame into `count` tiles of about equal cost, given the `cost` of each pixel in any unit.
///
/// A rectangle of n tiles is halved across its longer side; a square is halved into left and right. The first half has
/// ⌈n/2⌉ tiles. The length of that half is chosen so that the half's cost is nearest to ⌈n/2⌉/n of the rectangle's
/// cost. Among equal costs, the length nearest to this fraction of the side is chosen, then the first length. Tiles of
/// the left or upper half precede tiles of the right or lower half.
///
/// Negative, infinite and NaN costs are treated as zero. If all costs are zero, tiles have about equal area. The number
/// of tiles is at least one and at most the number of pixels; an empty frame has no tiles.
///
/// A half with k of n tiles costs at most k/n of its rectangle, plus ⌈k/w⌉ times the most expensive line. Lines are
/// parallel to the split and have w pixels each.
///
/// Therefore, if rectangles are wider than their number of tiles, a tile costs less than the mean plus 2.3 times the
/// most expensive line. The halves on the way to a tile have at least 1, 2, 3, 5, 9 … tiles. The sum of the reciprocals
/// of these numbers is less than 2.3.
pub fn equal_tiles(cost: &Plane<f32>, count: usize) -> Vec<Tile> {
    let whole = Tile { columns: 0..cost.width(), rows: 0..cost.height() };
    let pixels = whole.pixels();
    let mut tiles = Vec::new();
    if pixels == 0 {
        return tiles;
    }

    // Keep the rectangles to be split in a stack, the next one last.
    let sums = CostSums::new(cost);
    let mut parts = vec![(whole, count.clamp(1, pixels))];
    while let Some((part, count)) = parts.pop() {
        match count {
            1 => tiles.push(part),
            _ => {
                let [first, second] = sums.halves(&part, count);
                // Push the first half last: it is split next, so tiles are in order.
                parts.extend([second, first]);
            }
        }
    }
    tiles
}

impl Tile {
    /// Returns the column and the row of each pixel in raster order.
    pub fn places(&self) -> impl Iterator<Item = (usize, usize)> + use<> {
        let columns = self.columns.clone();
        self.rows.clone().flat_map(move |y| columns.clone().map(move |x| (x, y)))
    }

    fn pixels(&self) -> usize {
        self.columns.len() * self.rows.len()
    }

    /// Returns the rectangles before and from the column or row `at`, counted from the start of this tile.
    fn split(&self, is_wide: bool, at: usize) -> [Self; 2] {
        let Self { columns, rows } = self.clone();
        let (column, row) = (columns.start + at, rows.start + at);
        match is_wide {
            true => [
                Self { columns: columns.start..column, rows: rows.clone() },
                Self { columns: column..columns.end, rows },
            ],
            false => [Self { columns: columns.clone(), rows: rows.start..row }, Self { columns, rows: row..rows.end }],
        }
    }
}

/// Sums of cost over all pixels above and to the left of each corner. The plane has one more column and row than the
/// frame.
struct CostSums(Plane<f64>);

impl CostSums {
    fn new(cost: &Plane<f32>) -> Self {
        let mut sums = Plane::filled(cost.width() + 1, cost.height() + 1, 0.0);
        for (y, row) in cost.rows().enumerate() {
            let mut of_row = 0.0;
            for (x, &cost) in row.iter().enumerate() {
                let is_cost = cost.is_finite() && cost > 0.0;
                of_row += if is_cost { f64::from(cost) } else { 0.0 };
                // Add the sum of the row to the sum above (summed-area table).
                sums.set(x + 1, y + 1, sums.get(x + 1, y) + of_row);
            }
        }
        Self(sums)
    }

    /// Returns the cost of a rectangle.
    fn of(&self, Tile { columns, rows }: &Tile) -> f64 {
        let above = |y: usize| self.0.get(columns.end, y) - self.0.get(columns.start, y);
        above(rows.end) - above(rows.start)
    }

    /// Returns the two halves of a rectangle, each with its number of tiles. `n` is the rectangle's number of tiles,
    /// from 2 to its number of pixels.
    fn halves(&self, part: &Tile, n: usize) -> [(Tile, usize); 2] {
        let is_wide = part.columns.len() >= part.rows.len();
        let (length, width) = match is_wide {
            true => (part.columns.len(), part.rows.len()),
            false => (part.rows.len(), part.columns.len()),
        };

        // Reserve a pixel for each tile in both halves. If lines do not fit evenly, the first half has enough pixels.
        // The number of tiles in the second half is then limited by the pixels left.
        let first = n.div_ceil(2);
        let least = first.div_ceil(width);
        let most = (length - (n - first).div_ceil(width)).max(least);

        // Compare distances to the target fraction, multiplied by n to avoid rounding of quotients.
        let total = self.of(part);
        let distance = |at: usize| {
            let [before, _] = part.split(is_wide, at);
            (self.of(&before) * n as f64 - total * first as f64).abs()
        };
        let from_share = |at: usize| (at * n).abs_diff(length * first);
        let nearest = (least..=most)
            .min_by(|&a, &b| distance(a).total_cmp(&distance(b)).then_with(|| from_share(a).cmp(&from_share(b))));
        // Move tiles that do not fit into the second half to the first half.
        let [before, after] = part.split(is_wide, nearest.expect("a rectangle can be split"));
        let second = (n - first).min(after.pixels());
        [(before, n - second), (after, second)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::collection::vec;
    use proptest::prelude::*;

    /// Generates frames of up to 24×24 pixels with integer costs, many of them zero. Sums of these costs are exact.
    fn pictures() -> impl Strategy<Value = Plane<f32>> {
        (1usize..=24, 1usize..=24).prop_flat_map(|(width, height)| {
            let cost = prop_oneof![Just(0.0f32), Just(1.0), (0u32..1000).prop_map(|cost| cost as f32)];
            vec(cost, width * height).prop_map(move |costs| Plane::from_vec(width, height, costs))
        })
    }

    /// Returns the cost of a tile, summed pixel by pixel.
    fn cost_of(picture: &Plane<f32>, tile: &Tile) -> f64 {
        let rows = tile.rows.clone().map(|y| &picture.row(y)[tile.columns.clone()]);
        rows.flatten().map(|&cost| f64::from(cost)).sum()
    }

    /// Returns the cost of the most expensive line parallel to the rectangle's split, and the number of pixels per
    /// line.
    fn dearest_line(picture: &Plane<f32>, part: &Tile) -> (f64, usize) {
        let Tile { columns, rows } = part.clone();
        let (lines, width): (Vec<Tile>, usize) = match columns.len() >= rows.len() {
            true => (columns.map(|x| Tile { columns: x..x + 1, rows: part.rows.clone() }).collect(), rows.len()),
            false => (rows.map(|y| Tile { columns: part.columns.clone(), rows: y..y + 1 }).collect(), columns.len()),
        };
        (lines.iter().map(|line| cost_of(picture, line)).fold(0.0, f64::max), width)
    }

    /// Checks the bound for each half of a rectangle. Returns the rectangle's tiles, each with its maximum cost.
    fn bounded(picture: &Plane<f32>, (part, n): (Tile, usize), mean: f64) -> Vec<(Tile, f64)> {
        if n == 1 {
            return vec![(part, mean)];
        }
        let (line, width) = dearest_line(picture, &part);
        let (total, mut tiles) = (cost_of(picture, &part), Vec::new());
        for (half, k) in CostSums::new(picture).halves(&part, n) {
            let above = k.div_ceil(width) as f64 * line;
            let cost = cost_of(picture, &half);
            assert!(
                cost * n as f64 <= total * k as f64 + above * n as f64,
                "{half:?} of {part:?}, {k} of {n}: {cost} of {total}, lines of {line}"
            );
            tiles.extend(bounded(picture, (half, k), mean + above / k as f64));
        }
        tiles
    }

    proptest! {
        /// Checks that tiles cover each pixel once, with invalid costs and more tiles than pixels, too.
        #[test]
        fn tiles_cover_each_pixel_once(picture in pictures(), odd in vec(any::<f32>(), 576), count in 0usize..700) {
            let mut odd = odd.into_iter();
            let odd = picture.map(|_| odd.next().expect("enough"));
            let pixels = picture.width() * picture.height();
            for picture in [picture, odd] {
                let mut covered = Plane::filled(picture.width(), picture.height(), 0);
                let tiles = equal_tiles(&picture, count);
                prop_assert_eq!(tiles.len(), count.clamp(1, pixels));
                for Tile { columns, rows } in tiles {
                    prop_assert!(!columns.is_empty() && !rows.is_empty());
                    for y in rows {
                        covered.row_mut(y)[columns.clone()].iter_mut().for_each(|times| *times += 1);
                    }
                }
                prop_assert!(covered.samples().iter().all(|&times| times == 1));
            }
        }

        #[test]
        fn no_tile_costs_more_than_its_bound(picture in pictures(), count in 1usize..80) {
            let whole = Tile { columns: 0..picture.width(), rows: 0..picture.height() };
            let count = count.min(whole.pixels());
            let mean = cost_of(&picture, &whole) / count as f64;
            let bounded = bounded(&picture, (whole, count), mean);
            for (tile, most) in &bounded {
                let cost = cost_of(&picture, tile);
                prop_assert!(cost <= most * (1.0 + 1e-12), "{tile:?}: {cost}, at most {most}");
            }
            let tiles: Vec<Tile> = bounded.into_iter().map(|(tile, _)| tile).collect();
            prop_assert_eq!(tiles, equal_tiles(&picture, count));
        }

        /// Checks that the split is optimal: no other column or row is closer to the target fraction.
        #[test]
        fn halves_are_the_nearest_to_their_share(picture in pictures(), n in 2usize..12) {
            let whole = Tile { columns: 0..picture.width(), rows: 0..picture.height() };
            let (is_wide, first) = (picture.width() >= picture.height(), n.div_ceil(2));
            let length = picture.width().max(picture.height());
            // Give a line enough pixels for all tiles, so that each split is valid.
            prop_assume!(length > 1 && picture.width().min(picture.height()) >= n);
            let share = cost_of(&picture, &whole) * first as f64 / n as f64;
            let [(half, k), _] = CostSums::new(&picture).halves(&whole, n);
            prop_assert_eq!(k, first);
            let distance = |half: &Tile| (cost_of(&picture, half) - share).abs();
            let best = (1..length).map(|at| distance(&whole.split(is_wide, at)[0])).fold(f64::INFINITY, f64::min);
            prop_assert!(distance(&half) <= best + 1e-9, "{} where {best} is possible", distance(&half));
        }

        /// Checks that tiles have equal area for uniform costs if their number is a power of two. Invalid costs are
        /// treated as uniform.
        #[test]
        fn even_costs_give_even_areas(width in 0u32..5, height in 0u32..5, count in 0u32..9) {
            let (width, height, count) = (1usize << width, 1usize << height, (1usize << count).min(1 << (width + height)));
            let tiles = equal_tiles(&Plane::filled(width, height, 1.0), count);
            prop_assert_eq!(tiles.len(), count);
            prop_assert!(tiles.iter().all(|tile| tile.pixels() * count == width * height), "{:?}", tiles);
            for none in [0.0, -1.0, f32::INFINITY, f32::NEG_INFINITY, f32::NAN] {
                prop_assert_eq!(&equal_tiles(&Plane::filled(width, height, none), count), &tiles);
            }
        }
    }

    /// Checks that expensive pixels have small tiles, and that tiles are in the order of the recursion.
    #[test]
    fn tiles_are_those_made_by_hand() {
        // The left half costs three quarters of the total, and contains three of four tiles.
        let picture = Plane::from_fn(12, 4, |x, _| if x < 6 { 3.0 } else { 1.0 });
        let tile = |columns, rows| Tile { columns, rows };
        let expected = [tile(0..2, 0..4), tile(2..4, 0..4), tile(4..6, 0..4), tile(6..12, 0..4)];
        assert_eq!(equal_tiles(&picture, 4), expected);

        // Three of five tiles need 3.6 columns, rounded to 4. Two of these three need 2⅔, rounded to 3, less than their
        // height.
        let expected = [tile(0..3, 0..2), tile(0..3, 2..4), tile(3..4, 0..4), tile(4..6, 0..2), tile(4..6, 2..4)];
        assert_eq!(equal_tiles(&Plane::filled(6, 4, 1.0), 5), expected);
        assert_eq!(equal_tiles(&Plane::filled(0, 4, 1.0), 5), []);
    }
}
