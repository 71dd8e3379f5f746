//! Excess light of single reflection rays, spread over nearby pixels.
//!
//! Each pixel spreads its excess light s by a tent filter t, first along its row, then along columns, within coats of
//! the same instance. Energy is conserved:
//!
//! ```text
//! S(x) = Σ_u t(x − u) s(u) / T(u)          T(u) = Σ_x t(x − u)
//! ```

use crate::shade::macroblock::{by_macroblock, places};
use glam::Vec3;
use plane::Plane;
use render_core::ranks::Alone;
use render_core::{Busy, GBuffer, NOTHING};

/// Radius of the tent filter \[pixels\].
const REACH: usize = 10;

/// Returns the radiance S that each pixel receives from the `sparks` around it \[W·m⁻²·sr⁻¹\]. Adds the CPU time to
/// `busy`.
pub(super) fn spread(sparks: &Plane<Vec3>, seen: &GBuffer, busy: &Busy) -> Plane<Vec3> {
    if sparks.samples().iter().all(|&spark| spark == Vec3::ZERO) {
        return sparks.clone();
    }
    let carriers = seen.pixels.map(|pixel| if pixel.specular == [0.0; 3] { NOTHING } else { pixel.instance });
    let in_rows = along(Line::Row, sparks, &carriers, busy);
    along(Line::Column, &in_rows, &carriers, busy)
}

#[derive(Clone, Copy)]
enum Line {
    Row,
    Column,
}

/// Spreads `light` along rows or columns.
fn along(line: Line, light: &Plane<Vec3>, carriers: &Plane<u32>, busy: &Busy) -> Plane<Vec3> {
    let (width, height) = (light.width(), light.height());
    // Find the positions within reach on the same coat, with their weights.
    let alike = |(x, y): (usize, usize)| {
        let own = carriers.get(x, y);
        let (center, end) = match line {
            Line::Row => (x, width),
            Line::Column => (y, height),
        };
        let reach = center.saturating_sub(REACH)..(center + REACH + 1).min(end);
        let place = move |k: usize| match line {
            Line::Row => (k, y),
            Line::Column => (x, k),
        };
        let with_weight = reach.map(move |k| (place(k), (REACH + 1 - k.abs_diff(center)) as f32));
        with_weight.filter(move |&((u, v), _)| own != NOTHING && carriers.get(u, v) == own)
    };
    let picture = |of: &(dyn Fn((usize, usize)) -> Vec3 + Sync)| {
        let block = |(): &mut (), columns, rows| places(columns, rows).map(of).collect();
        busy.take(by_macroblock(&Alone, width, height, || (), block))
    };
    // Divide the light by the sum of the weights, T, so that energy is conserved.
    let share = picture(&|(x, y)| match alike((x, y)).map(|(_, weight)| weight).sum::<f32>() {
        0.0 => Vec3::ZERO,
        whole => light.get(x, y) / whole,
    });
    // Gather the divided light from all positions within reach.
    picture(&|place| alike(place).map(|((u, v), weight)| weight * share.get(u, v)).sum())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Checks that light at the border of two coats stays on its own coat, without loss.
    #[test]
    fn no_light_is_lost() {
        let (width, height) = (40, 30);
        let carriers = Plane::from_fn(width, height, |x, y| match (x + y / 3, y) {
            (30.., _) => NOTHING,
            (12.., 0..20) => 1,
            _ => 2,
        });
        let light = Plane::from_fn(width, height, |x, y| if (x, y) == (11, 4) { Vec3::splat(7.0) } else { Vec3::ZERO });
        let busy = Busy::default();
        let spread = along(Line::Column, &along(Line::Row, &light, &carriers, &busy), &carriers, &busy);
        let of = |carrier| {
            let lit = places(0..width, 0..height).filter(|&(x, y)| carriers.get(x, y) == carrier);
            lit.map(|(x, y)| spread.get(x, y).x).sum::<f32>()
        };
        let own = carriers.get(11, 4);
        assert!((of(own) - 7.0).abs() < 1e-4, "{} of 7", of(own));
        assert_eq!(of(if own == 1 { 2 } else { 1 }) + of(NOTHING), 0.0);
        assert!(spread.samples().iter().all(|light| light.x < 0.5));
    }
}
