//! Compares a film's light with path-traced light in blocks of 8×8 pixels, as a mean over the picture hides local errors.

use crate::{render, render2mpeg};
use glam::Vec3;
use plane::Plane;
use render_core::{image_file::read_exr, luminance};
use std::path::Path;

/// Side of a block \[pixels\].
const BLOCK: usize = 8;
/// Luminance relative to the mean, below which a block has no ratio: path tracing is too noisy there.
const DARK: f32 = 0.05;

/// Settings that render one frame twice: as a film and by path tracing.
#[derive(Clone, Copy, Debug)]
pub struct Comparison<'a> {
    /// Side of the square picture \[pixels\].
    pub side: usize,
    /// Index of the frame.
    pub frame: usize,
    /// Paths per pixel.
    pub paths: u32,
    /// Additional arguments of `render`; without `--frames`, the film has one frame.
    pub film: &'a str,
    /// Additional arguments of `reference`.
    pub reference: &'a str,
}

impl Default for Comparison<'_> {
    fn default() -> Self {
        Self { side: 64, frame: 0, paths: 512, film: "", reference: "" }
    }
}

/// Mean luminance of each block over its non-emissive pixels.
#[derive(Clone, Debug)]
pub struct Blocks {
    /// Luminance in the film.
    pub found: Vec<f32>,
    /// Luminance in the path-traced picture.
    pub expected: Vec<f32>,
}

impl Blocks {
    /// Renders `scene` in `folder` both ways. Skips blocks with more than three quarters of emissive pixels.
    ///
    /// # Panics
    /// If one of the two programs fails.
    #[must_use]
    pub fn of(folder: &Path, scene: &Path, comparison: Comparison) -> Self {
        let Comparison { side, frame, paths, film, reference } = comparison;
        // Render the film's frame as linear light, with samples at pixel centers.
        let frames = if film.contains("--frames") { "" } else { "--frames 1" };
        let film = format!("--size {side}x{side} {frames} --antialiasing off --exr linear {film}");
        render(folder, "film", scene, &film);
        let film = read_exr(&folder.join(format!("linear/frame_{frame:05}.exr"))).expect("a linear frame");

        // Trace the picture, and a picture without reflections, which shows only emissive surfaces.
        let paths_of = |more: &str| {
            let scene = scene.to_str().expect("a path in UTF-8");
            let arguments =
                format!("--center --size {side}x{side} --frame {frame} -o paths.exr -q --overwrite {reference} {more}");
            let arguments: Vec<&str> = ["reference", scene].into_iter().chain(arguments.split_whitespace()).collect();
            let finished = render2mpeg(folder, &arguments);
            assert_eq!(finished.code, Some(0), "{}", finished.stderr);
            read_exr(&folder.join("paths.exr")).expect("a linear picture")
        };
        let (glowing, truth) = (paths_of("--bounces 0 --spp 1"), paths_of(&format!("--spp {paths}")));
        Self::between(&film, &truth, &glowing)
    }

    /// Compares two pictures, except pixels that are not black in `glowing`.
    #[must_use]
    pub fn between(film: &Plane<Vec3>, truth: &Plane<Vec3>, glowing: &Plane<Vec3>) -> Self {
        let (width, height) = (film.width(), film.height());
        let mut blocks = Self { found: Vec::new(), expected: Vec::new() };
        // Visit the blocks row by row.
        let corners = (0..height).step_by(BLOCK).flat_map(|y| (0..width).step_by(BLOCK).map(move |x| (x, y)));
        for (left, top) in corners {
            let (mut found, mut expected, mut count) = (0.0, 0.0, 0);
            for y in top..(top + BLOCK).min(height) {
                for x in left..(left + BLOCK).min(width) {
                    if glowing.get(x, y) == Vec3::ZERO {
                        found += luminance(film.get(x, y));
                        expected += luminance(truth.get(x, y));
                        count += 1;
                    }
                }
            }
            // Skip blocks with too few pixels that are not emissive.
            if count >= BLOCK * BLOCK / 4 {
                blocks.found.push(found / count as f32);
                blocks.expected.push(expected / count as f32);
            }
        }
        blocks
    }

    /// Returns the ratio of the film's mean to the path-traced mean.
    #[must_use]
    pub fn mean_ratio(&self) -> f32 {
        self.found.iter().sum::<f32>() / self.expected.iter().sum::<f32>()
    }

    /// Returns the mean luminance of the film.
    #[must_use]
    pub fn mean(&self) -> f32 {
        self.found.iter().sum::<f32>() / self.found.len() as f32
    }

    /// Returns the ratio of film to path tracing for each block that is not too dark, in ascending order.
    #[must_use]
    pub fn ratios(&self) -> Vec<f32> {
        let mean = self.expected.iter().sum::<f32>() / self.expected.len() as f32;
        // Omit dark blocks, because path tracing is too noisy there.
        let blocks = self.found.iter().zip(&self.expected).filter(|(_, expected)| **expected > DARK * mean);
        let mut ratios: Vec<f32> = blocks.map(|(found, expected)| found / expected).collect();
        ratios.sort_by(f32::total_cmp);
        ratios
    }

    /// Formats a table row: mean, median, 5th and 95th percentile of the blocks, minimum and maximum.
    #[must_use]
    pub fn row(&self, name: &str) -> String {
        let ratios = self.ratios();
        let at = |share: f32| ratios[((ratios.len() - 1) as f32 * share).round() as usize];
        format!(
            "{name:32} mean {:.3}, median {:.3}, blocks {:.3} … {:.3} ({:.3} … {:.3})",
            self.mean_ratio(),
            at(0.5),
            at(0.05),
            at(0.95),
            at(0.0),
            at(1.0)
        )
    }
}
