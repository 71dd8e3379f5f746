//! Indirect light computed per pixel: code shared by the layers without a cache.

use super::counts::Counts;
use super::layer::Visible;
use super::visibility::{Visibility, receiver};
use crate::frame::Frame;
use glam::Vec3;
use lighttree::Lambert;
use render_core::{NOTHING, ShadingPoint};
use std::f32::consts::PI;

/// Pixel with a matte surface that reflects light.
pub(super) struct MattePixel {
    pub x: usize,
    pub y: usize,
    pub receiver: ShadingPoint,
    pub lambert: Lambert,
}

/// Indirect light of single pixels.
pub(super) struct PixelLight<'a> {
    pub visible: &'a Visible<'a>,
    pub visibility: Visibility<'a>,
    pub counts: &'a Counts,
    /// Whether final gather restores the light lost by clamping virtual lights.
    pub compensates: bool,
}

impl PixelLight<'_> {
    /// Returns the surface of a pixel; `None` if the surface reflects no light.
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

    /// Returns the bias compensation of a pixel: nearby radiance lost by clamping virtual lights.
    pub fn compensation(&self, pixel: &MattePixel) -> Vec3 {
        if !self.compensates {
            return Vec3::ZERO;
        }
        let found = self.visibility.final_gather(&pixel.receiver, (pixel.y as u64) << 32 | pixel.x as u64);
        pixel.lambert.reflectance / PI * self.visible.frame.gather.compensation(&found).irradiance
    }
}

/// Returns whether neither the light tree nor dynamic anchors emit light. Directly sampled lamps are ignored.
pub(super) fn is_dark(frame: &Frame<'_>) -> bool {
    frame.tree.is_empty() && frame.direct.dynamic().anchors.is_empty()
}
