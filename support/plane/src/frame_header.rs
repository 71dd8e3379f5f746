//! Header metadata and channels of a linear picture for a file.

/// Storage format of a channel's samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SampleDepth {
    /// 16 bits, with a significand of 11 bits and values up to 65504. Channels that exceed this range use 32 bits.
    Half,
    /// 32 bits, single precision.
    #[default]
    Float,
}

/// One channel of a picture.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FrameChannel {
    /// Name of the layer, a dot and the name of the channel, such as `albedo.R`. If there is no layer, only the name of
    /// the channel.
    pub name: String,
    /// Samples in raster order.
    pub samples: Vec<f32>,
    /// Requested storage format of the samples.
    pub depth: SampleDepth,
}

/// Camera in the form used by file headers. Matrices are in column-major order and multiply column vectors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameCamera {
    /// Transform from world to camera space \[m\]. Camera space is left-handed: x to the right, y up, z along the
    /// view.
    pub camera_from_world: [f32; 16],
    /// Transform from world to picture space. After division by w, x and y range from 0 in the upper left corner to 1
    /// in the lower right corner.
    pub picture_from_world: [f32; 16],
    /// Width of the visible area at a distance of 1 m \[m\]. `None` if the width does not depend on distance.
    pub window_width: Option<f32>,
    /// Width of a pixel divided by its height.
    pub pixel_aspect: f32,
}

/// Position of a frame in its film.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FramePlace {
    /// Index of the frame in its film, starting at 0.
    pub number: u32,
    /// Numerator of the frame rate, such as 30000 for 29.97 frames per second. [`seconds`](Self::seconds) is the
    /// denominator.
    pub frames: u32,
    /// Denominator of the frame rate, at least 1, such as 1001 for 29.97 frames per second.
    pub seconds: u32,
}

/// Text attribute of a header.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct HeaderText {
    /// Name of the attribute, in ASCII.
    pub name: String,
    /// Value of the attribute, in ASCII. Readers disagree on the encoding of other characters.
    pub text: String,
}

/// Metadata for the header of a linear picture.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FrameHeader {
    /// Camera of the picture.
    pub camera: Option<FrameCamera>,
    /// Position of the frame in its film.
    pub place: Option<FramePlace>,
    /// Additional text attributes, such as the names of a Cryptomatte.
    pub texts: Vec<HeaderText>,
}
