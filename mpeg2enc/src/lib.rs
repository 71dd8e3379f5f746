//! An MPEG-2 video encoder that takes the motion it is given.
