//! A linear picture as it goes into a file: channels, and facts for the header.

/// Bits of a channel's samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SampleDepth {
    /// 16 bits where they suffice: 11 of precision, values up to 65504.
    Half,
    /// 32 bits.
    #[default]
    Float,
}

/// A channel of a picture.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FrameChannel {
    /// Name of the layer with a dot, then that of the channel: `albedo.R`; without a layer, the channel's alone.
    pub name: String,
    /// Samples in raster order.
    pub samples: Vec<f32>,
    /// Bits that they are to have.
    pub depth: SampleDepth,
}

/// A camera as headers describe it. Matrices are stored column after column, and apply to columns.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameCamera {
    /// Camera space from the world \[m\], left-handed: x to the right, y up, z along the view.
    pub camera_from_world: [f32; 16],
    /// Picture space from the world: x and y are 0…1 from the upper left to the lower right corner, once divided by w.
    pub picture_from_world: [f32; 16],
    /// Width of what the picture shows at a distance of 1 m, in meters; `None` where it depends on no distance.
    pub window_width: Option<f32>,
    /// Width of a pixel as a share of its height.
    pub pixel_aspect: f32,
}

/// Place of a frame in its film.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FramePlace {
    /// Number of the frame, from 0.
    pub number: u32,
    /// Numerator of the frame rate, of which [`seconds`](Self::seconds) is the denominator: 30000 for 29.97 frames a second.
    pub frames: u32,
    /// Denominator of the frame rate, at least 1: 1001 for 29.97 frames a second.
    pub seconds: u32,
}

/// A text of a header, under a name of its own.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct HeaderText {
    /// Name of the attribute, in ASCII.
    pub name: String,
    /// The text, in ASCII: others have characters that a reader takes for others.
    pub text: String,
}

/// Facts that the header of a linear picture tells.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FrameHeader {
    /// The camera that the picture was seen by.
    pub camera: Option<FrameCamera>,
    /// Place of the frame in its film.
    pub place: Option<FramePlace>,
    /// Further texts, such as the names of a Cryptomatte.
    pub texts: Vec<HeaderText>,
}
