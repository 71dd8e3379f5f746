//! Figures of a sweep as JSON and CSV.

use super::Swept;
use super::figures::{MethodRun, Outcome};
use super::table::Finding;
use render2mpeg::error::{Context, Error, Result};
use serde::Serialize;
use std::path::Path;

/// Contents of `sweep.json`: figures, and findings as text.
#[derive(Serialize)]
struct SweepFile<'a> {
    #[serde(flatten)]
    outcome: &'a Outcome,
    findings: Vec<Finding>,
}

impl Swept {
    /// Returns the text of `sweep.json`.
    pub(super) fn json(&self) -> Result<String> {
        let written = SweepFile { outcome: &self.outcome, findings: self.outcome.findings() };
        let mut json = serde_json::to_string_pretty(&written).context("the figures cannot be written as JSON")?;
        json.push('\n');
        Ok(json)
    }

    /// Returns the text of `sweep.json` for a page, with file names in place of paths.
    pub(super) fn json_without_folders(&self) -> Result<String> {
        let mut value: serde_json::Value = serde_json::from_str(&self.json()?)?;
        for name in ["scene", "output", "baked"] {
            let Some(path) = value["settings"].get_mut(name) else { continue };
            let file = path.as_str().and_then(|path| Path::new(path).file_name());
            let file = file.map(|file| file.to_string_lossy().into_owned());
            *path = file.into();
        }
        Ok(serde_json::to_string(&value)?)
    }
}

/// Formats runs as CSV, one line per run. Unknown figures are empty.
pub(super) fn csv_of(runs: &[MethodRun]) -> Result<Vec<u8>> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    for run in runs {
        let beside = run.against_baseline.as_ref();
        let known = |value: Option<f64>| value.map_or(String::new(), |value| format!("{value}"));
        let seconds = &run.seconds;
        // Identify the run in the first columns.
        let mut columns: Vec<(&str, String)> = vec![
            ("method", run.method.into()),
            ("qscale", run.qscale.to_string()),
            ("cache", run.cache.to_string()),
            ("kappa", run.kappa.map_or(String::new(), |kappa| kappa.to_string())),
        ];
        // List the numeric figures; figures that are unknown for a run stay empty.
        let numbers = [
            ("threshold_mean_relative", Some(run.threshold_mean_relative)),
            ("tree_swaps_share", Some(run.tree_swaps_share)),
            ("cut_size_mean", Some(run.cut_size_mean)),
            ("shadow_rays", Some(run.shadow_rays)),
            ("anchors_seconds", Some(seconds.anchors)),
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
        // Write the names of the first run's columns as headings, so that names and values stay aligned.
        if std::ptr::eq(run, &runs[0]) {
            writer.write_record(columns.iter().map(|(name, _)| name)).map_err(Error::other)?;
        }
        writer.write_record(columns.iter().map(|(_, value)| value)).map_err(Error::other)?;
    }
    writer.into_inner().map_err(|error| error.into_error()).context("the table cannot be written")
}
