//! Choice between I, P and B for each picture.

use super::Lookahead;
use crate::{Config, PictureType, rate_control::Upcoming};

/// An I or P picture and the B pictures that precede it in display order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Span {
    /// Display index of the I or P picture.
    pub anchor: usize,
    pub is_intra: bool,
    /// Number of B pictures that precede the I or P picture in display order.
    pub b_pictures: usize,
}

/// Weight of B picture costs, in sixteenths of other costs. It is lower because no picture predicts from B pictures, and they are
/// coded with a coarser quantiser. The standard does not define this value; it was tuned on the clips of README.md.
const B_WEIGHT_SIXTEENTHS: u64 = 13;

impl Lookahead {
    /// Plans the spans of all frames after the last anchor, at display index `last`.
    pub fn plan(&mut self, config: &Config, last: Option<usize>) -> Vec<Span> {
        let end = self.end();
        // The film begins with an I picture.
        let Some(anchor) = last else {
            let first = Span { anchor: 0, is_intra: true, b_pictures: 0 };
            let mut spans = vec![first];
            if end > 1 {
                spans.extend(self.plan(config, Some(0)));
            }
            return spans;
        };
        let count = end - anchor - 1;
        // Mark the frames that must be I pictures, by distance from `anchor`, which is coded already.
        let is_intra: Vec<bool> = (anchor..end).map(|index| index > anchor && self.get(index).begins_group).collect();
        // Find the least cost of all frames up to each later anchor, and the number of B pictures before that anchor, by
        // distance from `anchor`.
        let mut best = vec![(0u64, 0usize); count + 1];
        for j in 1..=count {
            best[j].0 = u64::MAX;
            for b in 0..=(config.b_pictures as usize).min(j - 1) {
                let from = j - b - 1;
                // B pictures must not span an I picture, nor precede one in a closed group.
                let crosses = (from + 1..j).any(|k| is_intra[k]);
                if crosses || best[from].0 == u64::MAX || is_intra[j] && config.closed_gop && b > 0 {
                    continue;
                }
                let cost = if config.adapts_types() {
                    best[from].0 + self.span_cost(anchor + from, anchor + j, is_intra[j])
                } else {
                    // Prefer few anchors, and therefore long runs of B pictures.
                    best[from].0 + 1
                };
                if cost < best[j].0 {
                    best[j] = (cost, b);
                }
            }
        }
        // Follow the decisions back from the last frame.
        let mut spans = Vec::new();
        let mut j = count;
        while j > 0 {
            let b_pictures = best[j].1;
            spans.push(Span { anchor: anchor + j, is_intra: is_intra[j], b_pictures });
            j -= b_pictures + 1;
        }
        spans.reverse();
        spans
    }

    /// Returns the costs of the individual pictures of `spans`, in the order of coding.
    pub fn upcoming(&mut self, last_anchor: Option<usize>, spans: &[Span]) -> Vec<Upcoming> {
        let mut out = Vec::new();
        let mut from = last_anchor;
        for span in spans {
            let picture_type = if span.is_intra { PictureType::I } else { PictureType::P };
            out.push(Upcoming { picture_type, cost: self.anchor_cost(from, span) });
            if let Some(from) = from {
                for index in from + 1..span.anchor {
                    out.push(Upcoming { picture_type: PictureType::B, cost: self.b_cost(from, index, span.anchor) });
                }
            }
            from = Some(span.anchor);
        }
        out
    }

    fn anchor_cost(&mut self, from: Option<usize>, span: &Span) -> u64 {
        let intra = self.intra_costs(span.anchor).clone();
        match from.filter(|_| !span.is_intra) {
            None => intra.iter().map(|&cost| u64::from(cost)).sum(),
            Some(from) => {
                let matches = self.matches(span.anchor, distance(span.anchor, from));
                // Each macroblock uses the cheaper of prediction and intra coding.
                matches.iter().zip(intra.iter()).map(|(m, &intra)| u64::from(m.cost.min(intra))).sum()
            }
        }
    }

    fn b_cost(&mut self, from: usize, index: usize, anchor: usize) -> u64 {
        let found = self.two_sided(index, distance(index, from), distance(index, anchor));
        let intra = self.intra_costs(index);
        found.iter().zip(intra.iter()).map(|(t, &intra)| u64::from(t.cost.min(intra))).sum()
    }

    /// Returns the cost of the frames after `from` up to `anchor`, with B pictures between them.
    fn span_cost(&mut self, from: usize, anchor: usize, is_intra: bool) -> u64 {
        let span = Span { anchor, is_intra, b_pictures: anchor - from - 1 };
        let mut cost = self.anchor_cost(Some(from), &span);
        for index in from + 1..anchor {
            cost += self.b_cost(from, index, anchor) * B_WEIGHT_SIXTEENTHS / 16;
        }
        cost
    }
}

fn distance(a: usize, b: usize) -> isize {
    b as isize - a as isize
}
