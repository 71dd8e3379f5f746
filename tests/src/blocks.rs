//! The light of a film next to that of paths, by blocks of 8×8 pixels: a mean over the picture hides local errors.

use crate::{render, render2mpeg};
use glam::Vec3;
use plane::Plane;
use render_core::{image_file::read_exr, luminance};
use std::path::Path;

/// Pixels along the side of a block.
const BLOCK: usize = 8;
/// Blocks darker than this share of the mean have no ratio: the noise of paths is too large there.
const DARK: f32 = 0.05;

/// A frame by the film's light and by paths.
#[derive(Clone, Copy, Debug)]
pub struct Comparison<'a> {
    /// Side of the square picture \[pixels\].
    pub side: usize,
    /// Number of the frame.
    pub frame: usize,
    /// Paths for each pixel.
    pub paths: u32,
    /// More arguments of `render`; the film has one frame where they name no other number.
    pub film: &'a str,
    /// More arguments of `reference`.
    pub reference: &'a str,
}

impl Default for Comparison<'_> {
    fn default() -> Self {
        Self { side: 64, frame: 0, paths: 512, film: "", reference: "" }
    }
}

/// Mean luminance of each block, of its pixels that do not glow.
#[derive(Clone, Debug)]
pub struct Blocks {
    /// By the film.
    pub found: Vec<f32>,
    /// By paths.
    pub expected: Vec<f32>,
}

impl Blocks {
    /// Renders `scene` in `folder` both ways. Blocks of which more than three quarters glow are left out.
    ///
    /// # Panics
    /// If either fails.
    #[must_use]
    pub fn of(folder: &Path, scene: &Path, comparison: Comparison) -> Self {
        let Comparison { side, frame, paths, film, reference } = comparison;
        let frames = if film.contains("--frames") { "" } else { "--frames 1" };
        let film = format!("--size {side}x{side} {frames} --antialiasing off --exr linear {film}");
        render(folder, "film", scene, &film);
        let film = read_exr(&folder.join(format!("linear/frame_{frame:05}.exr"))).expect("a linear frame");

        // Paths, and what is seen without any reflection: what glows.
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

    /// Of two pictures, and one of what glows.
    #[must_use]
    pub fn between(film: &Plane<Vec3>, truth: &Plane<Vec3>, glowing: &Plane<Vec3>) -> Self {
        let (width, height) = (film.width(), film.height());
        let mut blocks = Self { found: Vec::new(), expected: Vec::new() };
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
            if count >= BLOCK * BLOCK / 4 {
                blocks.found.push(found / count as f32);
                blocks.expected.push(expected / count as f32);
            }
        }
        blocks
    }

    /// Mean of the film over that by paths.
    #[must_use]
    pub fn mean_ratio(&self) -> f32 {
        self.found.iter().sum::<f32>() / self.expected.iter().sum::<f32>()
    }

    /// Mean luminance of the film.
    #[must_use]
    pub fn mean(&self) -> f32 {
        self.found.iter().sum::<f32>() / self.found.len() as f32
    }

    /// Film over paths, for each block that is not too dark, in rising order.
    #[must_use]
    pub fn ratios(&self) -> Vec<f32> {
        let mean = self.expected.iter().sum::<f32>() / self.expected.len() as f32;
        let blocks = self.found.iter().zip(&self.expected).filter(|(_, expected)| **expected > DARK * mean);
        let mut ratios: Vec<f32> = blocks.map(|(found, expected)| found / expected).collect();
        ratios.sort_by(f32::total_cmp);
        ratios
    }

    /// A row of a table: mean, median, 5 % and 95 % of the blocks, extremes.
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
