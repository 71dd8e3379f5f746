//! Search for the density at which charts use a requested number of texels.

use super::cover::{Bits, ChartRect};
use super::flatten::{AtlasError, FlatChart, FlatMesh};
use glam::Vec3;
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

/// Number of texels along the scene's diagonal at the automatic density. A room of four times four meters has texels of
/// about 5 cm.
pub(super) const ALONG_DIAGONAL: f64 = 120.0;
/// Fraction of the surfaces' area in charts that are at least two texels wide at the automatic density.
const WIDE_AREA: f64 = 0.9;
/// Maximum number of texels for that, as a multiple of the number at [`ALONG_DIAGONAL`].
pub(super) const MOST_FOR_WIDTH: f64 = 1.5;
/// Minimum and maximum number of texels at the automatic density.
pub(super) const AUTOMATIC: [usize; 2] = [20_000, 1_000_000];
/// Minimum width of charts that are not narrow \[texels\]. Such charts have two texels after stretching.
const NARROW: f64 = 1.5;

/// Chart, and the number of its sides that need texels.
type Needed<'a> = (&'a FlatChart, usize);

/// Returns the density \[1/m\] at which `meshes` use about `wish` texels, or fewer if a limit is reached.
pub(super) fn fitting(meshes: &[FlatMesh], wish: usize) -> Result<f32, AtlasError> {
    // Each chart needs at least one texel per side.
    let charts = needed(meshes);
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

/// Returns the automatic density \[1/m\]: fine enough for the scene's size and most of its charts.
pub(super) fn automatic(meshes: &[FlatMesh]) -> Result<f32, AtlasError> {
    let charts = needed(meshes);
    let most =
        f64::from(LONGEST) / charts.iter().map(|(chart, _)| f64::from(chart.size.x)).fold(f64::MIN_POSITIVE, f64::max);
    let of_size = (ALONG_DIAGONAL / diagonal(meshes)).min(most);
    let count = texels(&charts, of_size) as f64;

    // Refine until most surfaces are two texels wide, up to a limit.
    let limit = (MOST_FOR_WIDTH * count) as usize;
    let of_width = for_width(&charts).min(most);
    let is_fine = of_width <= of_size || !is_over(&charts, of_width, limit);
    let wish = if is_fine { texels(&charts, of_size.max(of_width)) } else { limit };
    let sides = charts.iter().map(|(_, sides)| sides).sum::<usize>();
    fitting(meshes, wish.clamp(AUTOMATIC[0], AUTOMATIC[1]).max(sides))
}

/// Returns the length of the diagonal of all meshes' bounding box \[m\].
fn diagonal(meshes: &[FlatMesh]) -> f64 {
    let (mut least, mut most) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for mesh in meshes {
        (least, most) = (least.min(mesh.bounds[0]), most.max(mesh.bounds[1]));
    }
    (most - least).as_dvec3().length().clamp(1e-30, 1e30)
}

/// Returns the density \[1/m\] at which [`WIDE_AREA`] of the surfaces are in charts that are not narrow.
fn for_width(charts: &[Needed]) -> f64 {
    // Sort the charts from wide to narrow. A chart's height is at most its width.
    let mut sizes: Vec<(f64, f64)> = Vec::with_capacity(charts.len());
    for (chart, sides) in charts {
        sizes.push((f64::from(chart.size.y), chart.area() * *sides as f64));
    }
    sizes.sort_by(|a, b| b.0.total_cmp(&a.0));
    let all: f64 = sizes.iter().map(|(_, area)| area).sum();
    let mut sum = 0.0;
    for (height, area) in sizes {
        sum += area;
        if sum >= WIDE_AREA * all {
            return NARROW / height.max(f64::MIN_POSITIVE);
        }
    }
    f64::MAX
}

/// Returns the number of texels at which half of the charts that are narrow at `density` are not narrow. Returns `None`
/// if no chart is narrow, or if the number exceeds the limit of an atlas.
pub(super) fn for_half_as_narrow(meshes: &[FlatMesh], density: f32) -> Option<usize> {
    // Sort the narrow charts from wide to narrow, and find the width of the middle one.
    let charts = needed(meshes);
    let mut narrow = Vec::new();
    for (chart, sides) in &charts {
        if ChartRect::new(chart.size, density).is_narrow() {
            narrow.extend(std::iter::repeat_n(f64::from(chart.size.y), *sides));
        }
    }
    narrow.sort_by(|a, b| b.total_cmp(a));
    let middle = *narrow.get(narrow.len().checked_sub(1)? / 2)?;

    // Count the texels at the density of the middle chart.
    let density = 1.001 * NARROW / middle;
    let longest = charts.iter().map(|(chart, _)| f64::from(chart.size.x)).fold(0.0, f64::max);
    let is_possible = density * longest <= f64::from(LONGEST) && !is_over(&charts, density, MOST_TEXELS);
    is_possible.then(|| texels(&charts, density))
}

/// Returns the charts of all meshes.
fn needed(meshes: &[FlatMesh]) -> Vec<Needed<'_>> {
    let mut charts = Vec::new();
    for mesh in meshes {
        charts.extend(mesh.charts.iter().map(|chart| (chart, mesh.sides)));
    }
    charts
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
