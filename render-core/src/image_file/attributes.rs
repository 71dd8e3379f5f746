//! Metadata of a picture as OpenEXR's standard attributes (ASWF, *OpenEXR: Standard Attributes*).

use exr::math::Vec2;
use exr::meta::attribute::{AttributeValue, Chromaticities, Text, TimeCode};
use exr::meta::header::{ImageAttributes, LayerAttributes};
use plane::{FrameCamera, FrameHeader, FramePlace};

/// Name and version of the program that made a picture.
const SOFTWARE: &str = concat!("render2mpeg ", env!("CARGO_PKG_VERSION"));

/// Primaries and white point D65 of ITU-R BT.709-6, as CIE 1931 (x, y).
const REC_709: Chromaticities = Chromaticities {
    red: Vec2(0.64, 0.33),
    green: Vec2(0.30, 0.60),
    blue: Vec2(0.15, 0.06),
    white: Vec2(0.3127, 0.3290),
};

/// Maximum frame rate at which SMPTE ST 12-1 numbers frames individually \[s⁻¹\].
const MOST_NUMBERED: u32 = 30;

/// Returns the attributes of the whole image: chromaticities and time code.
pub(super) fn of_image(header: &FrameHeader, size: (usize, usize)) -> ImageAttributes {
    let time_code = header.place.as_ref().and_then(time_code);
    let pixel_aspect = header.camera.as_ref().map_or(1.0, |camera| camera.pixel_aspect);
    ImageAttributes { chromaticities: Some(REC_709), time_code, pixel_aspect, ..ImageAttributes::with_size(size) }
}

/// Returns the attributes of the layer: camera, frame rate, frame number, software, and additional texts.
///
/// Column-major matrices for column vectors equal OpenEXR's row-major matrices for row vectors.
pub(super) fn of_layer(header: &FrameHeader) -> LayerAttributes {
    let FrameHeader { camera, place, texts } = header;
    let mut attributes = LayerAttributes { software_name: Text::new_or_none(SOFTWARE), ..LayerAttributes::default() };
    // Add the camera, for compositing programs that project points.
    if let Some(FrameCamera { camera_from_world, picture_from_world, window_width, .. }) = camera {
        attributes.world_to_camera = Some(*camera_from_world);
        attributes.world_to_normalized_device = Some(*picture_from_world);
        attributes.screen_window_width = window_width.unwrap_or(attributes.screen_window_width);
    }
    // Add frame rate and frame number, saturated to the attribute's type.
    if let Some(FramePlace { number, frames, seconds }) = *place {
        attributes.frames_per_second = i32::try_from(frames).ok().map(|frames| (frames, seconds));
        let number = i32::try_from(number).unwrap_or(i32::MAX);
        attributes.other.insert(Text::new_or_panic("imageCounter"), AttributeValue::I32(number));
    }
    for text in texts {
        // Skip texts that are not ASCII, since they would not be read back unchanged.
        if let (Some(name), Some(value)) = (Text::new_or_none(&text.name), Text::new_or_none(&text.text)) {
            attributes.other.insert(name, AttributeValue::Text(value));
        }
    }
    attributes
}

/// Returns the time code of a frame by SMPTE ST 12-1, without drop frames. Returns `None` at frame rates for which
/// SMPTE numbers frames in pairs.
fn time_code(&FramePlace { number, frames, seconds }: &FramePlace) -> Option<TimeCode> {
    // Number frames at the nominal rate: 29.97 frames per second count as 30.
    let nominal = frames.div_ceil(seconds.max(1));
    if !(1..=MOST_NUMBERED).contains(&nominal) {
        return None;
    }
    let (second, frame) = (number / nominal, number % nominal);
    let [hours, minutes, seconds, frame] =
        [second / 3600 % 24, second / 60 % 60, second % 60, frame].map(|part| u8::try_from(part).unwrap_or_default());
    Some(TimeCode { hours, minutes, seconds, frame, ..TimeCode::default() })
}

/// Sorts the attributes in the header of `file`, a complete single-part OpenEXR file. The encoder writes additional
/// attributes in a different order in each run. Pixel offsets stay valid, since the header keeps its length. Returns
/// `None` if the header is invalid.
///
/// ```text
/// file        magic number, version (4 bytes each), attribute…, 0, offsets and pixels
/// attribute   name, 0, type, 0, count of bytes (4), bytes
/// ```
pub(super) fn sort_attributes(file: &mut [u8]) -> Option<()> {
    const BEGIN: usize = 8;
    let text_end = |from: usize| Some(from + file.get(from..)?.iter().position(|&byte| byte == 0)? + 1);
    // Collect the attributes up to the empty name that ends the header.
    let (mut list, mut at) = (Vec::new(), BEGIN);
    while *file.get(at)? != 0 {
        let size_at = text_end(text_end(at)?)?;
        let size = file.get(size_at..)?.first_chunk().map(|size| u32::from_le_bytes(*size))?;
        let end = size_at.checked_add(4)?.checked_add(size as usize)?;
        list.push(file.get(at..end)?.to_vec());
        at = end;
    }
    // Each attribute begins with its name, and names differ, so sorting bytes sorts by name.
    list.sort_unstable();
    file.get_mut(BEGIN..at)?.copy_from_slice(&list.concat());
    Some(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn attributes_are_sorted_and_all_else_stays() {
        let attribute = |name: &str, bytes: &[u8]| {
            let size = (bytes.len() as u32).to_le_bytes();
            [name.as_bytes(), b"\0int\0", &size, bytes].concat()
        };
        let [a, b, c] = [attribute("a", &[0, 7]), attribute("b", &[]), attribute("c", &[1, 0, 0, 0])];
        let mut file = [b"MAGIC+VE", &c[..], &a, &b, b"\0pixels"].concat();
        assert_eq!(sort_attributes(&mut file), Some(()));
        assert_eq!(file, [b"MAGIC+VE", &a[..], &b, &c, b"\0pixels"].concat());
        for length in 0..file.len() - 7 {
            assert_eq!(sort_attributes(&mut file[..length]), None, "{length} bytes");
        }
    }
    use glam::{Mat4, Vec3};

    #[test]
    fn time_codes_count_frames_seconds_minutes_and_hours() {
        let code = |number, frames, seconds| time_code(&FramePlace { number, frames, seconds });
        let parts = |code: TimeCode| [code.hours, code.minutes, code.seconds, code.frame];
        assert_eq!(code(25 * 3661 + 7, 25, 1).map(parts), Some([1, 1, 1, 7]));
        assert_eq!(code(59, 30_000, 1001).map(parts), Some([0, 0, 1, 29]), "29.97 frames a second count as 30");
        assert_eq!(code(24 * 86_400, 24, 1).map(parts), Some([0; 4]), "time codes wrap after a day");
        assert_eq!(code(7, 50, 1), None);
    }

    #[test]
    fn matrices_apply_to_rows() {
        let camera_from_world = Mat4::from_translation(Vec3::new(-1.0, -2.0, 3.0));
        let camera = FrameCamera {
            camera_from_world: camera_from_world.to_cols_array(),
            picture_from_world: Mat4::IDENTITY.to_cols_array(),
            window_width: Some(2.0),
            pixel_aspect: 1.0,
        };
        let header = FrameHeader { camera: Some(camera), ..FrameHeader::default() };
        let matrix = of_layer(&header).world_to_camera.unwrap();
        // The translation is in the last row: [x y z 1] · M.
        assert_eq!(matrix, [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, -1.0, -2.0, 3.0, 1.0]);
        assert_eq!(of_layer(&header).screen_window_width, 2.0);
    }
}
