//! The choice between I, P and B for each picture.

use super::Lookahead;
use crate::{Config, PictureType, rate_control::Upcoming};

/// An I or P picture, and the B pictures in front of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Span {
    /// Display index of the I or P picture.
    pub anchor: usize,
    pub is_intra: bool,
    /// B pictures in front of it, in display order.
    pub b_pictures: usize,
}

/// Differences of B pictures count this many sixteenths of others: nothing is predicted from them, and they are coded
/// coarser. Ours, tuned on the clips of README.md.
const B_WEIGHT_SIXTEENTHS: u64 = 13;

impl Lookahead {
    /// The spans of all frames after the last anchor, whose display index is `last`.
    pub fn plan(&mut self, config: &Config, last: Option<usize>) -> Vec<Span> {
        let end = self.end();
        let Some(anchor) = last else {
            let first = Span { anchor: 0, is_intra: true, b_pictures: 0 };
            let mut spans = vec![first];
            if end > 1 {
                spans.extend(self.plan(config, Some(0)));
            }
            return spans;
        };
        let count = end - anchor - 1;
        // By distance from `anchor`: frames that must be I pictures. The anchor itself is coded.
        let is_intra: Vec<bool> = (anchor..end).map(|index| index > anchor && self.get(index).begins_group).collect();
        // The least cost of all frames up to each that may be an anchor, and the B pictures in front of it.
        let mut best = vec![(0u64, 0usize); count + 1];
        for j in 1..=count {
            best[j].0 = u64::MAX;
            for b in 0..=(config.b_pictures as usize).min(j - 1) {
                let from = j - b - 1;
                let crosses = (from + 1..j).any(|k| is_intra[k]);
                if crosses || best[from].0 == u64::MAX || is_intra[j] && config.closed_gop && b > 0 {
                    continue;
                }
                let cost = if config.adapts_types() {
                    best[from].0 + self.span_cost(anchor + from, anchor + j, is_intra[j])
                } else {
                    // As many B pictures as there may be: few anchors.
                    best[from].0 + 1
                };
                if cost < best[j].0 {
                    best[j] = (cost, b);
                }
            }
        }
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

    /// Costs of the pictures of `spans` by themselves, in the order of coding.
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
                matches.iter().zip(intra.iter()).map(|(m, &intra)| u64::from(m.cost.min(intra))).sum()
            }
        }
    }

    fn b_cost(&mut self, from: usize, index: usize, anchor: usize) -> u64 {
        let found = self.two_sided(index, distance(index, from), distance(index, anchor));
        let intra = self.intra_costs(index);
        found.iter().zip(intra.iter()).map(|(t, &intra)| u64::from(t.cost.min(intra))).sum()
    }

    /// Cost of the frames after `from` up to `anchor`, those between as B pictures.
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
