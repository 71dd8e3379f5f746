//! render2mpeg: an animated glTF scene in, an MPEG-2 video with global illumination out.
