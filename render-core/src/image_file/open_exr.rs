//! OpenEXR files: linear images with any channels.

use super::{ImageFileError, attributes, check_size};
use exr::meta::MetaData;
use exr::prelude::{
    AnyChannel, AnyChannels, Compression, Encoding, FlatSamples, Image, Layer, ReadChannels, ReadLayers, SmallVec,
    WritableImage, f16, read, read_first_rgba_layer_from_file,
};
use glam::Vec3;
use plane::Plane;
use plane::{FrameChannel, FrameHeader, SampleDepth};
use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::Path;

/// Minimum for the largest sample of a layer stored as half floats. Samples down to 2⁻¹⁰ of the largest then have full
/// relative precision, 2⁻¹¹.
const LEAST_LARGEST: f32 = 0.0625;

/// Writes linear Rec.709 RGB radiance with [`write_layers`].
///
/// # Errors
/// The file cannot be written; the message names the path.
pub fn write_exr(path: &Path, radiance: &Plane<Vec3>) -> Result<(), ImageFileError> {
    let channel = |c: usize| radiance.samples().iter().map(|rgb| rgb[c]).collect::<Vec<f32>>();
    let channels = ["R", "G", "B"].into_iter().enumerate().map(|(c, name)| (name.to_owned(), channel(c))).collect();
    write_layers(path, radiance.width(), radiance.height(), channels)
}

/// Writes named channels of 32-bit floats with [`write_frame`]. The header contains neither camera nor time.
///
/// # Panics
/// If a channel does not have `width * height` samples.
///
/// # Errors
/// The file cannot be written; the message names the path.
pub fn write_layers(
    path: &Path,
    width: usize,
    height: usize,
    channels: Vec<(String, Vec<f32>)>,
) -> Result<(), ImageFileError> {
    let channel = |(name, samples)| FrameChannel { name, samples, depth: SampleDepth::Float };
    write_frame(path, (width, height), &FrameHeader::default(), channels.into_iter().map(channel).collect())
}

/// Writes a linear Rec.709 image of `size` = (width, height) to a zip-compressed OpenEXR file. The file has a temporary
/// name until it is complete.
///
/// Names are unique; `R`, `G`, `B` are the image. A name such as `variance.R` is channel R of a layer "variance", as
/// viewers group it. A layer that requests half floats is written with full floats if halves would lose light: if a
/// sample exceeds 65504, or if the largest sample is below 1/16.
///
/// # Panics
/// If a channel does not have `width * height` samples.
///
/// # Errors
/// The file cannot be written; the message names the path.
pub fn write_frame(
    path: &Path,
    size: (usize, usize),
    header: &FrameHeader,
    channels: Vec<FrameChannel>,
) -> Result<(), ImageFileError> {
    // Use one sample type for all channels of a layer: some readers require it for colors.
    let mut largest: BTreeMap<String, f32> = BTreeMap::new();
    for channel in &channels {
        let own = channel.samples.iter().map(|sample| sample.abs()).fold(0.0, f32::max);
        let of_layer = largest.entry(layer_of(&channel.name).to_owned()).or_default();
        *of_layer = of_layer.max(own);
    }
    // Convert each channel, and check the number of samples.
    let mut list = SmallVec::new();
    for FrameChannel { name, samples, depth } in channels {
        assert_eq!(samples.len(), size.0 * size.1, "channel {name} of {}x{} pixels", size.0, size.1);
        let samples = match depth {
            SampleDepth::Half if halves_suffice(largest[layer_of(&name)]) => {
                FlatSamples::F16(samples.into_iter().map(f16::from_f32).collect())
            }
            _ => FlatSamples::F32(samples),
        };
        list.push(AnyChannel::new(name.as_str(), samples));
    }

    // Write one part, as scan lines.
    let encoding = Encoding {
        compression: Compression::ZIP16,
        blocks: exr::image::Blocks::ScanLines,
        line_order: exr::meta::attribute::LineOrder::Increasing,
    };
    let layer = Layer::new(size, attributes::of_layer(header), encoding, AnyChannels::sort(list));
    let image = Image { attributes: attributes::of_image(header, size), layer_data: layer };

    // Write under a temporary name, and rename the file once it is complete.
    let mut name = path.file_name().unwrap_or_default().to_owned();
    name.push(".part");
    let partial = path.with_file_name(name);
    let mut file = Vec::new();
    image.write().to_buffered(Cursor::new(&mut file)).map_err(ImageFileError::format(path))?;
    attributes::sort_attributes(&mut file);
    // Remove the incomplete file after an error.
    let written = std::fs::write(&partial, file).and_then(|()| std::fs::rename(&partial, path));
    let whole = written.map_err(ImageFileError::system(path));
    if whole.is_err() {
        let _ = std::fs::remove_file(&partial);
    }
    whole
}

/// Returns the name of a channel's layer, empty for the image itself.
fn layer_of(channel: &str) -> &str {
    channel.rsplit_once('.').map_or("", |(layer, _)| layer)
}

/// Returns whether half floats suffice for a layer with the largest sample `largest`. Also returns true for
/// a layer of zeros.
fn halves_suffice(largest: f32) -> bool {
    largest == 0.0 || (LEAST_LARGEST..=f16::MAX.to_f32()).contains(&largest)
}

/// Image of named channels.
#[derive(Clone, Debug, PartialEq)]
pub struct Layers {
    /// Width of the image \[pixels\].
    pub width: usize,
    /// Height of the image \[pixels\].
    pub height: usize,
    /// Names and samples of the channels. Channels are sorted by name, samples are in raster order.
    pub channels: Vec<(String, Vec<f32>)>,
}

impl Layers {
    /// Returns the samples of the channel `name`.
    #[must_use]
    pub fn channel(&self, name: &str) -> Option<&[f32]> {
        self.channels.iter().find(|(own, _)| own == name).map(|(_, samples)| samples.as_slice())
    }

    /// Returns the channels `prefix` + R, G, B as colors, or `None` if a channel is missing.
    #[must_use]
    pub fn colors(&self, prefix: &str) -> Option<Plane<[f32; 3]>> {
        let [r, g, b] = ["R", "G", "B"].map(|c| self.channel(&format!("{prefix}{c}")));
        let (r, g, b) = (r?, g?, b?);
        // Interleave the planes.
        let mut samples = Vec::with_capacity(r.len());
        for ((&r, &g), &b) in r.iter().zip(g).zip(b) {
            samples.push([r, g, b]);
        }
        Some(Plane::from_vec(self.width, self.height, samples))
    }
}

/// Reads all channels of the first part of an OpenEXR file.
///
/// # Errors
/// The file is not an OpenEXR file, or is larger than 2²⁷ pixels; the message names the path.
pub fn read_layers(path: &Path) -> Result<Layers, ImageFileError> {
    decode_layers(path, &std::fs::read(path).map_err(ImageFileError::system(path))?)
}

/// Decodes all channels of the first part of an OpenEXR file. `bytes` is the content of the file at `path`.
pub(super) fn decode_layers(path: &Path, bytes: &[u8]) -> Result<Layers, ImageFileError> {
    // Check sizes before decoding, because the decoder allocates memory for the whole image.
    let meta = MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(ImageFileError::format(path))?;
    check_headers(path, &meta)?;
    let reader = read().no_deep_data().largest_resolution_level().all_channels().first_valid_layer().all_attributes();
    let image = reader.from_buffered(Cursor::new(bytes)).map_err(ImageFileError::format(path))?;
    let (width, height) = (image.layer_data.size.x(), image.layer_data.size.y());
    let channels = image.layer_data.channel_data.list.into_iter();
    let channels = channels.map(|c| (c.name.to_string(), c.sample_data.values_as_f32().collect())).collect();
    Ok(Layers { width, height, channels })
}

fn check_headers(path: &Path, meta: &MetaData) -> Result<(), ImageFileError> {
    meta.headers.iter().try_for_each(|header| check_size(path, header.layer_size.0, header.layer_size.1))
}

/// Reads the color of an OpenEXR file.
///
/// # Errors
/// The file is not an OpenEXR file, has no color, or is larger than 2²⁷ pixels; the message names the path.
pub fn read_exr(path: &Path) -> Result<Plane<Vec3>, ImageFileError> {
    check_headers(path, &MetaData::read_from_file(path, false).map_err(ImageFileError::format(path))?)?;
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
    use exr::meta::attribute::{AttributeValue, SampleType, Text};
    use glam::Mat4;
    use plane::{FrameCamera, FramePlace, HeaderText};

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

    /// Returns the sample type of each channel in the file, by name.
    fn types(path: &Path) -> Vec<(String, SampleType)> {
        let meta = MetaData::read_from_file(path, false).unwrap();
        meta.headers[0].channels.list.iter().map(|channel| (channel.name.to_string(), channel.sample_type)).collect()
    }

    #[test]
    fn halves_hold_colors_to_eleven_bits_and_floats_take_over_where_they_fail() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        let half = |name: &str, samples: [f32; 2]| FrameChannel {
            name: name.into(),
            samples: samples.into(),
            depth: SampleDepth::Half,
        };
        let colors = [("R", [0.1, 65504.0]), ("G", [1.0 / 3.0, 777.7]), ("B", [0.0, 0.002])];
        let mut channels: Vec<_> = colors.into_iter().map(|(name, samples)| half(name, samples)).collect();
        channels.push(half("bright.R", [1.0, 65505.0]));
        channels.push(half("bright.G", [1.0, 0.0]));
        channels.push(half("dim.Y", [1e-7, 0.0624]));
        channels.push(FrameChannel { depth: SampleDepth::Float, ..half("depth.Z", [0.1, 1e30]) });
        write_frame(&path, (2, 1), &FrameHeader::default(), channels.clone()).unwrap();
        for (name, sample_type) in types(&path) {
            let is_color = !name.contains('.');
            assert_eq!(sample_type, if is_color { SampleType::F16 } else { SampleType::F32 }, "{name}");
        }
        let read = read_layers(&path).unwrap();
        for FrameChannel { name, samples, .. } in &channels {
            let own = read.channel(name).unwrap();
            match name.contains('.') {
                true => assert_eq!(own, samples, "{name}"),
                false => {
                    let off = |(a, b): (&f32, &f32)| (a - b).abs() <= a.abs() / 2048.0;
                    assert!(samples.iter().zip(own).all(off), "{name}: {own:?}");
                }
            }
        }
        assert_eq!(read.channel("R").unwrap()[1], 65504.0, "the largest half is no infinity");
    }

    #[test]
    fn headers_tell_camera_time_and_texts() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        let matrix = Mat4::from_cols_array(&std::array::from_fn(|index| index as f32));
        let camera = FrameCamera {
            camera_from_world: matrix.to_cols_array(),
            picture_from_world: matrix.transpose().to_cols_array(),
            window_width: None,
            pixel_aspect: 1.0,
        };
        let place = FramePlace { number: 61, frames: 30_000, seconds: 1001 };
        let text = HeaderText { name: "cryptomatte/0123456/name".into(), text: "CryptoObject".into() };
        let header = FrameHeader { camera: Some(camera), place: Some(place), texts: vec![text] };
        let channel = FrameChannel { name: "R".into(), samples: vec![1.0; 8], depth: SampleDepth::Half };
        write_frame(&path, (4, 2), &header, vec![channel]).unwrap();
        let read = MetaData::read_from_file(&path, false).unwrap().headers.remove(0);
        let (shared, own) = (read.shared_attributes, read.own_attributes);
        assert_eq!(own.frames_per_second, Some((30_000, 1001)));
        assert_eq!(shared.time_code.map(|code| (code.seconds, code.frame)), Some((2, 1)));
        assert_eq!(shared.chromaticities.map(|known| known.white.0), Some(0.3127));
        assert!(own.software_name.unwrap().to_string().starts_with("render2mpeg "));
        assert_eq!(own.world_to_normalized_device, Some(matrix.transpose().to_cols_array()));
        let other = |name: &str| own.other.get(&Text::new_or_panic(name)).cloned();
        assert_eq!(other("imageCounter"), Some(AttributeValue::I32(61)));
        let name = AttributeValue::Text(Text::new_or_panic("CryptoObject"));
        assert_eq!(other("cryptomatte/0123456/name"), Some(name));
    }

    #[test]
    fn equal_frames_are_equal_files() {
        let folder = tempfile::tempdir().unwrap();
        let name = |index| HeaderText { name: format!("cryptomatte/{index:07x}/name"), text: "x".into() };
        let header = FrameHeader { texts: (0..20).map(name).collect(), ..FrameHeader::default() };
        let bytes = |name: &str| {
            let path = folder.path().join(name);
            let channel = FrameChannel { name: "R".into(), samples: vec![0.5; 6], depth: SampleDepth::Half };
            write_frame(&path, (3, 2), &header, vec![channel]).unwrap();
            assert_eq!(read_layers(&path).unwrap().channel("R"), Some(&[0.5; 6][..]));
            std::fs::read(path).unwrap()
        };
        assert_eq!(bytes("a.exr"), bytes("b.exr"));
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
