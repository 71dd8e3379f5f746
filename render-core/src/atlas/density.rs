//! Search for the density at which charts use a requested number of texels.

use super::cover::{Bits, ChartRect};
use super::flatten::{AtlasError, FlatChart, FlatMesh};
use rayon::prelude::*;

/// Maximum length of a chart \[texels\]. Positions in a chart of this length are accurate to 0.001 texels.
const LONGEST: f32 = 8192.0;
/// Maximum total number of texels in the rectangles of charts.
const MOST_AREA: u64 = 1 << 28;
/// Maximum number of texels that can be requested.
const MOST_TEXELS: usize = 1 << 26;
/// Maximum relative difference between the used and the requested number of texels.
const NEAR: f64 = 0.01;
/// Maximum number of bisection steps.
const STEPS: usize = 24;

/// Chart, and the number of its sides that need texels.
type Needed<'a> = (&'a FlatChart, usize);

/// Returns the density \[1/m\] at which `meshes` use about `wish` texels, or fewer if a limit is reached.
pub(super) fn fitting(meshes: &[FlatMesh], wish: usize) -> Result<f32, AtlasError> {
    // Collect the charts, each of which needs at least one texel per side.
    let mut charts: Vec<Needed> = Vec::new();
    for mesh in meshes {
        charts.extend(mesh.charts.iter().map(|chart| (chart, mesh.sides)));
    }
    let sides = charts.iter().map(|(_, sides)| sides).sum::<usize>();
    if wish < sides {
        return Err(AtlasError::TooFewTexels { texels: wish, charts: sides });
    }
    if wish > MOST_TEXELS {
        return Err(AtlasError::TooManyTexels { texels: wish, most: MOST_TEXELS });
    }

    // Bound the density from above: the number of texels is at least the area in texels. The longest chart provides
    // another bound.
    let area = |(chart, sides): &Needed| chart.size.as_dvec2().element_product() * *sides as f64;
    let longest = charts.iter().map(|(chart, _)| chart.size.x).fold(f32::MIN_POSITIVE, f32::max);
    let most = f64::from(LONGEST / longest).min(f64::from(f32::MAX));
    let mut low = (wish as f64 / charts.iter().map(area).sum::<f64>()).sqrt().min(most);

    // Find bounds with a ratio of two.
    while low < most && !is_over(&charts, low, wish) {
        low = (2.0 * low).min(most);
    }
    let mut high = low;
    while is_over(&charts, low, wish) {
        (low, high) = (low / 2.0, low);
    }

    // Bisect between the bounds. The number of texels increases with the density, except for a few texels.
    for _ in 0..STEPS {
        if low == high || (texels(&charts, low) as f64) >= (1.0 - NEAR) * wish as f64 {
            break;
        }
        let middle = (low * high).sqrt();
        *(if is_over(&charts, middle, wish) { &mut high } else { &mut low }) = middle;
    }
    Ok(low as f32)
}

/// Returns whether charts at this `density` use more texels than requested, or their rectangles exceed a limit.
fn is_over(charts: &[Needed], density: f64, wish: usize) -> bool {
    let mut area = 0;
    for (chart, sides) in charts {
        let frame = ChartRect::new(chart.size, density as f32);
        area += u64::from(frame.columns) * u64::from(frame.rows) * *sides as u64;
    }
    area > MOST_AREA || texels(charts, density) > wish
}

/// Returns the number of texels that the charts use at this `density`.
fn texels(charts: &[Needed], density: f64) -> usize {
    let count = |bits: &mut Bits, &(chart, sides): &Needed| {
        let frame = ChartRect::new(chart.size, density as f32);
        let flat = chart.triangles.iter().filter(|triangle| triangle.has_area);
        sides * bits.count(&frame, flat.map(|triangle| triangle.corners.map(|corner| frame.place(corner))))
    };
    charts.par_iter().map_init(Bits::default, count).sum()
}
