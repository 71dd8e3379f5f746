//! A sweep's figures in files.

use super::figures::{MethodRun, Outcome};
use super::maps::MapPicture;
use super::raster::png_of;
use super::table::Finding;
use super::{Swept, maps, page, plots};
use crate::error::{Context, Error, Result};
use crate::laboratory::compare::png_file;
use crate::output::Output;
use plane::Plane;
use serde::Serialize;
use std::path::Path;

/// `sweep.json`: the figures, and what they say in words.
#[derive(Serialize)]
struct Written<'a> {
    #[serde(flatten)]
    outcome: &'a Outcome,
    findings: Vec<Finding>,
}

impl Swept {
    /// Writes `sweep.json` and `sweep.csv` into `folder`, each whole or not at all.
    ///
    /// # Errors
    /// A file cannot be written.
    fn write_figures(&self, folder: &Path) -> Result<()> {
        let written = Written { outcome: &self.outcome, findings: self.outcome.findings() };
        let mut json = serde_json::to_string_pretty(&written).context("the figures cannot be put into JSON")?;
        json.push('\n');
        write(&folder.join("sweep.json"), json.as_bytes())?;
        write(&folder.join("sweep.csv"), &csv_of(&self.outcome.runs)?)
    }
}

impl Swept {
    /// Writes everything into `folder`: the figures, `sweep.html`, plots as SVG and PNG under `plots`, and the maps and last
    /// decoded frames under `maps`.
    ///
    /// # Errors
    /// A file cannot be written.
    pub fn write(&self, folder: &Path) -> Result<()> {
        self.write_figures(folder)?;
        let plots = plots::plots(&self.outcome);
        write(&folder.join("sweep.html"), page::page(self, &plots)?.as_bytes())?;
        let made = |name: &str| {
            let path = folder.join(name);
            std::fs::create_dir_all(&path).map_err(Error::file(&path, "cannot be made"))?;
            Ok::<_, Error>(path)
        };
        let drawn = made("plots")?;
        for plot in &plots {
            write(&drawn.join(format!("{}.svg", plot.name)), plot.svg.file().as_bytes())?;
            write(&drawn.join(format!("{}.png", plot.name)), &png_of(&plot.svg, PLOT_SCALE)?)?;
        }
        let drawn = made("maps")?;
        let save = |name: String, picture: &Plane<[u8; 3]>| write(&drawn.join(name), &png_file::encode(picture));
        save("reference.png".into(), &self.truth)?;
        for pictures in &self.pictures {
            let name = |kind: &str| format!("{kind}_{}_{}.png", pictures.method, pictures.qscale);
            save(name("decoded"), &pictures.decoded)?;
            for MapPicture { scale, picture } in pictures.maps.iter().flat_map(maps::pictures) {
                save(name(scale.name), &picture)?;
            }
        }
        Ok(())
    }
}

/// Pixels of a PNG file to a unit of its drawing: sharp in print.
const PLOT_SCALE: f32 = 2.0;

/// Writes a file whole or not at all.
pub(super) fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    let mut output = Output::create(path)?;
    output.write(bytes)?;
    output.finish()
}

/// A line for each run; nothing where a figure is unknown.
fn csv_of(runs: &[MethodRun]) -> Result<Vec<u8>> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    for run in runs {
        let beside = run.against_baseline.as_ref();
        let known = |value: Option<f64>| value.map_or(String::new(), |value| format!("{value}"));
        let seconds = &run.seconds;
        let mut columns: Vec<(&str, String)> = vec![
            ("method", run.method.into()),
            ("qscale", run.qscale.to_string()),
            ("cache", run.cache.to_string()),
            ("kappa", run.kappa.map_or(String::new(), |kappa| kappa.to_string())),
        ];
        let numbers = [
            ("threshold_mean_relative", Some(run.threshold_mean_relative)),
            ("tree_swaps_share", Some(run.tree_swaps_share)),
            ("cut_size_mean", Some(run.cut_size_mean)),
            ("shadow_rays", Some(run.shadow_rays)),
            ("update_seconds", Some(seconds.update)),
            ("photons_seconds", Some(seconds.photons)),
            ("tree_seconds", Some(seconds.tree)),
            ("visibility_seconds", Some(seconds.visibility)),
            ("direct_seconds", Some(seconds.direct)),
            ("indirect_seconds", Some(seconds.indirect)),
            ("tone_map_seconds", Some(seconds.tone_map)),
            ("encode_seconds", Some(seconds.encode)),
            ("thresholds_seconds", Some(seconds.thresholds)),
            ("total_seconds", Some(seconds.total)),
            ("bits", Some(run.bits)),
            ("rendered_rmse", Some(run.rendered.rmse)),
            ("rendered_relative_mse", Some(run.rendered.relative_mse)),
            ("rendered_psnr_y", run.rendered.psnr_y),
            ("rendered_ssim", Some(run.rendered.ssim)),
            ("rendered_ssimulacra2", run.rendered.ssimulacra2),
            ("decoded_psnr_y", run.decoded.psnr_y),
            ("decoded_ssim", Some(run.decoded.ssim)),
            ("decoded_ssimulacra2", run.decoded.ssimulacra2),
            ("error_within_threshold", run.error_by_threshold.as_ref().map(|histogram| histogram.within)),
            ("error_by_threshold_p95", run.error_by_threshold.as_ref().map(|histogram| histogram.p95)),
            ("psnr_difference", beside.map(|beside| beside.psnr_difference)),
            ("bits_ratio", beside.map(|beside| beside.bits_ratio)),
            ("speedup_indirect", beside.map(|beside| beside.speedup_indirect)),
            ("speedup_total", beside.map(|beside| beside.speedup_total)),
            ("cut_size_ratio", beside.map(|beside| beside.cut_size_ratio)),
            ("shadow_rays_ratio", beside.map(|beside| beside.shadow_rays_ratio)),
        ];
        columns.extend(numbers.map(|(name, value)| (name, known(value))));
        columns.push(("equal_quality", beside.map_or(String::new(), |beside| beside.equal_quality.to_string())));
        if std::ptr::eq(run, &runs[0]) {
            writer.write_record(columns.iter().map(|(name, _)| name)).map_err(Error::other)?;
        }
        writer.write_record(columns.iter().map(|(_, value)| value)).map_err(Error::other)?;
    }
    writer.into_inner().map_err(|error| error.into_error()).context("the table cannot be completed")
}
