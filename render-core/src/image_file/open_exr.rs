//! OpenEXR: linear pictures of any channels.

use super::{ImageFileError, check_size};
use exr::prelude::{
    AnyChannel, AnyChannels, Compression, Encoding, FlatSamples, Image, Layer, LayerAttributes, WritableImage,
    read_first_flat_layer_from_file, read_first_rgba_layer_from_file,
};
use glam::Vec3;
use plane::Plane;
use std::path::Path;

/// Writes linear Rec.709 RGB radiance, as [`write_layers`] does.
///
/// # Errors
/// The message of the file system, with the path.
pub fn write_exr(path: &Path, radiance: &Plane<Vec3>) -> Result<(), ImageFileError> {
    let channel = |c: usize| radiance.samples().iter().map(|rgb| rgb[c]).collect::<Vec<f32>>();
    let channels = ["R", "G", "B"].into_iter().enumerate().map(|(c, name)| (name.to_owned(), channel(c))).collect();
    write_layers(path, radiance.width(), radiance.height(), channels)
}

/// Writes named channels of 32-bit floats into one OpenEXR file, zip-compressed, under a temporary name until it is whole.
///
/// Names are unique; `R`, `G`, `B` are the picture, and `variance.R` is channel R of a layer "variance", as viewers group
/// them. Each list of samples is in raster order.
///
/// # Panics
/// If a list has not `width * height` samples.
///
/// # Errors
/// The message of the file system, with the path.
pub fn write_layers(
    path: &Path,
    width: usize,
    height: usize,
    channels: Vec<(String, Vec<f32>)>,
) -> Result<(), ImageFileError> {
    let channel = |(name, samples): (String, Vec<f32>)| {
        assert_eq!(samples.len(), width * height, "channel {name} of {width}x{height} pixels");
        AnyChannel::new(name.as_str(), FlatSamples::F32(samples))
    };
    let channels = AnyChannels::sort(channels.into_iter().map(channel).collect());
    let encoding = Encoding {
        compression: Compression::ZIP16,
        blocks: exr::image::Blocks::ScanLines,
        line_order: exr::meta::attribute::LineOrder::Increasing,
    };
    let layer = Layer::new((width, height), LayerAttributes::default(), encoding, channels);
    let mut name = path.file_name().unwrap_or_default().to_owned();
    name.push(".part");
    let partial = path.with_file_name(name);
    let written = Image::from_layer(layer).write().to_file(&partial).map_err(ImageFileError::format(path));
    let whole = written.and_then(|()| std::fs::rename(&partial, path).map_err(ImageFileError::system(path)));
    if whole.is_err() {
        let _ = std::fs::remove_file(&partial);
    }
    whole
}

/// A picture of named channels.
#[derive(Clone, Debug, PartialEq)]
pub struct Layers {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Names and samples in raster order, sorted by name.
    pub channels: Vec<(String, Vec<f32>)>,
}

impl Layers {
    /// Samples of the channel `name`.
    #[must_use]
    pub fn channel(&self, name: &str) -> Option<&[f32]> {
        self.channels.iter().find(|(own, _)| own == name).map(|(_, samples)| samples.as_slice())
    }

    /// The channels `prefix` + R, G, B as colors.
    #[must_use]
    pub fn colors(&self, prefix: &str) -> Option<Plane<[f32; 3]>> {
        let [r, g, b] = ["R", "G", "B"].map(|c| self.channel(&format!("{prefix}{c}")));
        let (r, g, b) = (r?, g?, b?);
        let samples = r.iter().zip(g).zip(b).map(|((&r, &g), &b)| [r, g, b]).collect();
        Some(Plane::from_vec(self.width, self.height, samples))
    }
}

/// Reads all channels of the first part of an OpenEXR file.
///
/// # Errors
/// Not an EXR file, or larger than 2²⁷ pixels; the message names the path.
pub fn read_layers(path: &Path) -> Result<Layers, ImageFileError> {
    check_headers(path)?;
    let image = read_first_flat_layer_from_file(path).map_err(ImageFileError::format(path))?;
    let (width, height) = (image.layer_data.size.x(), image.layer_data.size.y());
    let channels = image.layer_data.channel_data.list.into_iter();
    let channels = channels.map(|c| (c.name.to_string(), c.sample_data.values_as_f32().collect())).collect();
    Ok(Layers { width, height, channels })
}

fn check_headers(path: &Path) -> Result<(), ImageFileError> {
    let meta = exr::meta::MetaData::read_from_file(path, false).map_err(ImageFileError::format(path))?;
    meta.headers.iter().try_for_each(|header| check_size(path, header.layer_size.0, header.layer_size.1))
}

/// Reads the color of an OpenEXR file.
///
/// # Errors
/// Not an EXR file, no color in it, or larger than 2²⁷ pixels; the message names the path.
pub fn read_exr(path: &Path) -> Result<Plane<Vec3>, ImageFileError> {
    check_headers(path)?;
    let image = read_first_rgba_layer_from_file(
        path,
        |size, _| Plane::filled(size.0, size.1, Vec3::ZERO),
        |plane: &mut Plane<Vec3>, at, (r, g, b, _): (f32, f32, f32, f32)| plane.set(at.x(), at.y(), Vec3::new(r, g, b)),
    )
    .map_err(ImageFileError::format(path))?;
    Ok(image.layer_data.channel_data.pixels)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        let picture = Plane::from_fn(7, 5, |x, y| Vec3::new(x as f32, y as f32 * 1e6, 1e-6));
        write_exr(&path, &picture).unwrap();
        assert_eq!(read_exr(&path).unwrap(), picture);
        let folder_as_file = folder.path().join("none").join("b.exr");
        assert!(write_exr(&folder_as_file, &picture).unwrap_err().to_string().contains("b.exr"));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "nothing half-written stays");
        assert!(read_exr(&folder.path().join("none.exr")).unwrap_err().to_string().contains("none.exr"));
    }

    #[test]
    fn channels_keep_their_names() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        let picture = |of: f32| (0..6).map(|i| of + i as f32).collect::<Vec<f32>>();
        let names = ["B", "G", "R", "variance.B", "variance.G", "variance.R"];
        let channels: Vec<(String, Vec<f32>)> =
            names.iter().enumerate().map(|(i, name)| (name.to_string(), picture(10.0 * i as f32))).collect();
        write_layers(&path, 3, 2, channels.clone()).unwrap();
        let layers = read_layers(&path).unwrap();
        assert_eq!(layers, Layers { width: 3, height: 2, channels });
        assert_eq!(layers.colors("variance.").unwrap().get(0, 0), [50.0, 40.0, 30.0]);
        assert_eq!(layers.colors("albedo."), None);
        assert_eq!(read_exr(&path).unwrap().get(2, 1), Vec3::new(25.0, 15.0, 5.0));
    }
}
