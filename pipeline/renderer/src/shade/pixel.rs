//! Pixels that have indirect light of their own, and what all ways to it have in common.

use super::counts::Counts;
use super::layer::Visible;
use super::visibility::{Visibility, receiver};
use crate::frame::Frame;
use glam::Vec3;
use lighttree::Lambert;
use render_core::{NOTHING, ShadingPoint};
use std::f32::consts::PI;

/// A pixel whose matte surface reflects light.
pub(super) struct MattePixel {
    pub x: usize,
    pub y: usize,
    pub receiver: ShadingPoint,
    pub lambert: Lambert,
}

/// Indirect light of single pixels of a picture.
pub(super) struct PixelLight<'a> {
    pub visible: &'a Visible<'a>,
    pub visibility: Visibility<'a>,
    pub counts: &'a Counts,
    /// Whether the light that softening takes is found by final gather.
    pub compensates: bool,
}

impl PixelLight<'_> {
    /// The surface of a pixel; none where nothing reflects.
    pub fn pixel(&self, x: usize, y: usize) -> Option<MattePixel> {
        let pixel = self.visible.matte.pixels.get(x, y);
        let albedo = Vec3::from(pixel.albedo);
        if pixel.instance == NOTHING || albedo == Vec3::ZERO {
            return None;
        }
        let receiver = receiver(&pixel, self.visible.frame.epsilon);
        let lambert =
            Lambert { position: receiver.position.into(), normal: receiver.normal.into(), reflectance: albedo };
        Some(MattePixel { x, y, receiver, lambert })
    }

    /// Bias compensation: radiance of the light from close by that softening took.
    pub fn compensation(&self, pixel: &MattePixel) -> Vec3 {
        if !self.compensates {
            return Vec3::ZERO;
        }
        let found = self.visibility.final_gather(&pixel.receiver, (pixel.y as u64) << 32 | pixel.x as u64);
        pixel.lambert.reflectance / PI * self.visible.frame.gather.compensation(&found).irradiance
    }
}

/// Whether nothing shines that the tree has: lamps that pixels sample for themselves are not in it.
pub(super) fn is_dark(frame: &Frame<'_>) -> bool {
    frame.tree.is_empty() && frame.direct.dynamic().anchors.is_empty()
}
