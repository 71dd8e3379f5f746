//! Output of a sweep's figures to files.

use super::data::csv_of;
use super::maps::MapPicture;
use super::{Swept, maps, page, plots};
use crate::compare::png_file;
use pipeline::output::Output;
use pipeline::streams::make_folder;
use plane::Plane;
use render2mpeg::error::{Error, Result};
use std::path::Path;

impl Swept {
    /// Writes `sweep.json` and `sweep.csv` into `folder`, each atomically.
    ///
    /// # Errors
    /// If a file cannot be written.
    fn write_figures(&self, folder: &Path) -> Result<()> {
        write(&folder.join("sweep.json"), self.json()?.as_bytes())?;
        write(&folder.join("sweep.csv"), &csv_of(&self.outcome.runs)?)
    }
}

impl Swept {
    /// Writes all results into `folder`: the figures, `sweep.html`, plots as SVG under `plots`, and the maps and last
    /// decoded frames under `maps`.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn write(&self, folder: &Path) -> Result<()> {
        self.write_figures(folder)?;
        let plots = plots::plots(&self.outcome);
        write(&folder.join("sweep.html"), page::page(self, &plots)?.as_bytes())?;
        let made = |name: &str| {
            let path = folder.join(name);
            make_folder(&path)?;
            Ok::<_, Error>(path)
        };
        // Write each plot as an SVG file.
        let drawn = made("plots")?;
        for plot in &plots {
            write(&drawn.join(format!("{}.svg", plot.name)), plot.svg.file().as_bytes())?;
        }
        // Write the reference, and the decoded picture and maps of each run.
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

/// Writes a file atomically.
pub(super) fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    let mut output = Output::create(path)?;
    output.write(bytes)?;
    Ok(output.finish()?)
}
