//! Packing of rectangles into a larger rectangle.

use super::cover::ChartRect;
use std::cmp::Reverse;

/// Minimum distance between rectangles \[texels\].
const GAP: u32 = 2;

/// Packs the rectangles `frames`, and returns the column and row of the first texel of each.
///
/// Rectangles are placed in order of decreasing height. Each rectangle is placed with its upper edge as far up as
/// possible, below the rectangles already placed.
pub(super) fn packed(frames: &[ChartRect]) -> Packed {
    // Choose the side so that the rectangles cover at most 90 % of the square.
    let with_gap = |frame: &ChartRect| (frame.columns + GAP, frame.rows + GAP);
    let mut area = 0u64;
    for frame in frames {
        let (width, height) = with_gap(frame);
        area += u64::from(width) * u64::from(height);
    }
    let widest = frames.iter().map(|frame| frame.columns).max().unwrap_or(0);
    let side = ((area as f64 / 0.9).sqrt().ceil() as u32).max(widest + GAP);

    // Place high rectangles first, which leaves fewer unusable gaps.
    let mut order: Vec<usize> = (0..frames.len()).collect();
    order.sort_by_key(|&k| (Reverse(frames[k].rows), Reverse(frames[k].columns)));
    let mut skyline = Skyline(vec![Step { left: 0, right: side, top: 0 }]);
    let mut packed = Packed { corners: vec![[0; 2]; frames.len()], width: 0, height: 0 };
    for k in order {
        let (width, height) = with_gap(&frames[k]);
        let [left, top] = skyline.add(width, height);
        packed.corners[k] = [left, top];
        packed.width = packed.width.max(left + frames[k].columns);
        packed.height = packed.height.max(top + frames[k].rows);
    }
    packed
}

/// Positions of packed rectangles, and the size of the bounding box.
pub(super) struct Packed {
    pub corners: Vec<[u32; 2]>,
    pub width: u32,
    pub height: u32,
}

/// Adjacent columns that are filled down to the same row.
#[derive(Clone, Copy)]
struct Step {
    left: u32,
    right: u32,
    /// First free row below the step.
    top: u32,
}

/// Lower edge of the filled area, as steps from left to right.
struct Skyline(Vec<Step>);

impl Skyline {
    /// Places a rectangle, and returns the column and row of its first texel. The rectangle must not be wider than all
    /// steps together.
    fn add(&mut self, width: u32, height: u32) -> [u32; 2] {
        // Try the left end of each step, because the best position starts at a left end.
        let end = self.0.last().map_or(0, |step| step.right);
        let (mut best, mut best_top) = (0, u32::MAX);
        for first in 0..self.0.len() {
            let left = self.0[first].left;
            if left + width > end {
                break;
            }
            // Compute the lowest edge under the rectangle. Stop as soon as it is no better than the best.
            let under = self.0[first..].iter().take_while(|step| step.left < left + width && step.top < best_top);
            let (count, top) = under.fold((0, 0), |(count, top), step| (count + 1, step.top.max(top)));
            if self.0[first + count - 1..].first().is_some_and(|last| last.right >= left + width) && top < best_top {
                (best, best_top) = (first, top);
            }
        }

        // Merge the steps under the rectangle into one. The last step may extend beyond it.
        let left = self.0[best].left;
        let right = left + width;
        let after = self.0.partition_point(|step| step.left < right);
        let last = self.0[after - 1];
        let added = Step { left, right, top: best_top + height };
        let rest = Step { left: right, ..last };
        let new = if last.right > right { vec![added, rest] } else { vec![added] };
        self.0.splice(best..after, new);
        self.merge(best);
        [left, best_top]
    }

    /// Merges a step with adjacent steps at the same height.
    fn merge(&mut self, step: usize) {
        for left in [Some(step), step.checked_sub(1)].into_iter().flatten() {
            if left + 1 < self.0.len() && self.0[left].top == self.0[left + 1].top {
                self.0[left].right = self.0.remove(left + 1).right;
            }
        }
    }
}
