//! Cameras: mapping between points in the world and pixels.

use super::{Channel, Scene};
use crate::image_file::FrameCamera;
use glam::{Affine3A, Mat4, Vec2, Vec3, Vec3A, Vec4};

/// Projection of a camera.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum Projection {
    /// Perspective projection.
    Perspective {
        /// Vertical field of view \[rad\].
        yfov: f32,
    },
    /// Orthographic projection.
    Orthographic {
        /// Half the height of the picture \[m\].
        ymag: f32,
    },
}

/// Point projected onto the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Projected {
    /// Position in the picture \[pixels\].
    pub pixel: Vec2,
    /// Depth along the camera's axis \[m\].
    pub depth: f32,
}

/// Camera on a node, looking along the node's −z with +y up.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// Name of the node or of the camera, or an empty string.
    pub name: String,
    /// Index into the scene's nodes.
    pub node: usize,
    /// Projection of the camera.
    pub projection: Projection,
    /// Aspect ratio, width over height. Pictures with a different aspect ratio show the whole view, and more.
    pub aspect: Option<f32>,
    /// Range of depths at which surfaces are visible \[m\].
    pub depths: DepthRange,
}

impl Default for Camera {
    fn default() -> Self {
        let projection = Projection::Perspective { yfov: std::f32::consts::FRAC_PI_4 };
        Self { name: String::new(), node: 0, projection, aspect: None, depths: DepthRange::ALL }
    }
}

/// Animated property of a lens.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum CameraProperty {
    /// Vertical field of view \[rad\].
    FieldOfView,
    /// Distance from the axis to the upper border \[m\].
    HalfHeight,
    /// Distance from the axis to the right border \[m\].
    HalfWidth,
    /// Aspect ratio, width over height.
    Aspect,
    /// Minimum visible depth \[m\].
    Near,
    /// Maximum visible depth \[m\].
    Far,
}

/// Animation of a lens.
#[derive(Clone, Debug)]
pub struct CameraChannel {
    /// Index into the scene's cameras.
    pub camera: usize,
    /// Property of the lens that the keys animate.
    pub property: CameraProperty,
    /// Keys with one weight each.
    pub keys: Channel,
}

impl Scene {
    /// Returns the cameras at `time` seconds, or an empty list if no lens is animated. Values that are invalid for a
    /// lens are ignored.
    pub(super) fn cameras_at(&self, time: f32) -> Vec<Camera> {
        if self.camera_channels.is_empty() {
            return Vec::new();
        }
        // Replace the animated properties by their values at `time`.
        let mut cameras = self.cameras.clone();
        for CameraChannel { camera, property, keys } in &self.camera_channels {
            let (mut value, camera) = ([f32::NAN], &mut cameras[*camera]);
            keys.apply_weights(time, &mut value);
            camera.set(*property, value[0]);
        }
        cameras
    }
}

impl Camera {
    /// Sets a property if the value is valid for a lens.
    fn set(&mut self, property: CameraProperty, value: f32) {
        let is_size = value > 0.0 && value.is_finite();
        match (property, &mut self.projection) {
            (CameraProperty::FieldOfView, Projection::Perspective { yfov }) if is_size => {
                *yfov = value.min(MOST_YFOV);
            }
            (CameraProperty::HalfHeight, Projection::Orthographic { ymag }) if is_size => {
                // Keep the width, which `xmag` sets independently of the height.
                self.aspect = self.aspect.map(|aspect| aspect * *ymag / value);
                *ymag = value;
            }
            (CameraProperty::HalfWidth, Projection::Orthographic { ymag }) if is_size => {
                self.aspect = Some(value / *ymag);
            }
            (CameraProperty::Aspect, _) if is_size => self.aspect = Some(value),
            (CameraProperty::Near, _) if value >= 0.0 => self.depths.near = value,
            (CameraProperty::Far, _) if value > 0.0 => self.depths.far = value,
            _ => {}
        }
    }
}

/// Maximum field of view \[rad\], slightly below π.
const MOST_YFOV: f32 = 3.1;

/// Range of depths at which a camera shows surfaces. Light and shadows ignore the range.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct DepthRange {
    /// Minimum depth along the axis \[m\]: `znear`.
    pub near: f32,
    /// Maximum depth along the axis \[m\], or infinity: `zfar`.
    pub far: f32,
}

impl DepthRange {
    /// All depths, from the camera to infinity.
    pub const ALL: Self = Self { near: 0.0, far: f32::INFINITY };
}

/// Camera at one time, with the size of its picture. Pixel centers are at `(x + 0.5, y + 0.5)`, with y pointing down.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct View {
    world_from_camera: Affine3A,
    camera_from_world: Affine3A,
    projection: Projection,
    half_height: f32,
    width: f32,
    height: f32,
    /// Aspect ratio of a pixel, width over height.
    pixel_aspect: f32,
    depths: DepthRange,
    /// Aspect ratio of the camera, width over height. The picture shows at least this view.
    shape: f32,
}

/// Returns a transform without scale and shear: the axes are orthonormal, and the viewing direction is kept.
fn rigid(world_from_camera: Affine3A) -> Affine3A {
    let m = world_from_camera.matrix3;
    let z = m.z_axis.try_normalize().unwrap_or(Vec3A::Z);
    let x = m.y_axis.cross(z).try_normalize().unwrap_or_else(|| z.any_orthonormal_vector());
    let mut rigid = Affine3A::IDENTITY;
    rigid.matrix3 = glam::Mat3A::from_cols(x, z.cross(x), z);
    rigid.translation = world_from_camera.translation;
    rigid
}

impl View {
    /// Builds a view from the node transform `world_from_camera` on `width × height` pixels. The scale of the transform
    /// is ignored.
    #[must_use]
    pub fn new(world_from_camera: Affine3A, projection: Projection, width: usize, height: usize) -> Self {
        let rigid = rigid(world_from_camera);
        let half_height = match projection {
            Projection::Perspective { yfov } => (yfov / 2.0).tan(),
            Projection::Orthographic { ymag } => ymag,
        };
        Self {
            world_from_camera: rigid,
            camera_from_world: rigid.inverse(),
            projection,
            half_height,
            width: width as f32,
            height: height as f32,
            pixel_aspect: 1.0,
            depths: DepthRange::ALL,
            shape: 0.0,
        }
    }

    /// Returns the view of the same lens at another position, from the node transform `world_from_camera`. The scale of
    /// the transform is ignored.
    #[must_use]
    pub fn moved_to(self, world_from_camera: Affine3A) -> Self {
        let rigid = rigid(world_from_camera);
        Self { world_from_camera: rigid, camera_from_world: rigid.inverse(), ..self }
    }

    /// Returns the view with pixels of this aspect ratio, width over height. The vertical extent stays unchanged,
    /// unless the camera's whole width would not fit.
    #[must_use]
    pub fn with_pixel_aspect(self, pixel_aspect: f32) -> Self {
        // Undo the previous widening, because the pixel's shape changes it.
        let before = self.widening();
        let view = Self { pixel_aspect, ..self };
        Self { half_height: view.half_height * view.widening() / before, ..view }
    }

    /// Returns the factor on the height that fits the camera's whole width into a narrower picture.
    fn widening(&self) -> f32 {
        (self.shape / (self.width / self.height * self.pixel_aspect)).max(1.0)
    }

    /// Builds the view of a camera from the node transform `world_from_camera` on `width × height` pixels. A picture
    /// narrower than the camera's view shows the camera's whole width. (glTF 2.0, 3.10.3: "The viewport's aspect ratio
    /// SHOULD NOT crop or stretch".)
    #[must_use]
    pub fn of(camera: &Camera, world_from_camera: Affine3A, width: usize, height: usize) -> Self {
        // Widen the vertical extent if the picture is narrower than the camera's view.
        let mut view = Self::new(world_from_camera, camera.projection, width, height);
        (view.depths, view.shape) = (camera.depths, camera.aspect.unwrap_or(0.0));
        view.half_height *= view.widening();
        view
    }

    /// Returns the minimum and maximum distance at which a ray in the unit `direction` shows surfaces \[m\].
    #[must_use]
    pub fn distances(&self, direction: Vec3A) -> (f32, f32) {
        let depth_per_meter = self.depth_per_meter(direction);
        (self.depths.near / depth_per_meter, self.depths.far / depth_per_meter)
    }

    /// Returns the increase in depth per meter along a ray in the unit `direction`.
    pub(crate) fn depth_per_meter(&self, direction: Vec3A) -> f32 {
        match self.projection {
            Projection::Perspective { .. } => -direction.dot(self.world_from_camera.matrix3.z_axis),
            Projection::Orthographic { .. } => 1.0,
        }
    }

    /// Returns the minimum and maximum depth of `points` along the axis \[m\], and the range of visible depths.
    pub(super) fn depths_of(&self, points: &[Vec3A]) -> (f32, f32, DepthRange) {
        let depths = points.iter().map(|&point| -self.camera_from_world.transform_point3a(point).z);
        let (nearest, farthest) =
            depths.fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), depth| (low.min(depth), high.max(depth)));
        (nearest, farthest, self.depths)
    }

    /// Returns the width and height of the picture \[pixels\].
    #[must_use]
    pub fn size(&self) -> Vec2 {
        Vec2::new(self.width, self.height)
    }

    /// Returns the origin and unit direction of the ray through `pixel`.
    #[must_use]
    pub fn ray(&self, pixel: Vec2) -> (Vec3A, Vec3A) {
        // Convert the pixel to camera space, at a distance of 1 m.
        let scale = 2.0 * self.half_height / self.height;
        let x = (pixel.x - self.width / 2.0) * scale * self.pixel_aspect;
        let y = (self.height / 2.0 - pixel.y) * scale;
        let m = &self.world_from_camera;
        match self.projection {
            Projection::Perspective { .. } => (m.translation, m.transform_vector3a(Vec3A::new(x, y, -1.0)).normalize()),
            Projection::Orthographic { .. } => (m.transform_point3a(Vec3A::new(x, y, 0.0)), -m.matrix3.z_axis),
        }
    }

    /// Projects a point onto the picture. Returns `None` behind the camera.
    #[must_use]
    pub fn project(&self, point: Vec3A) -> Option<Projected> {
        let p = self.camera_from_world.transform_point3a(point);
        self.pixel_of(p, -p.z).map(|(pixel, depth)| Projected { pixel, depth })
    }

    /// Returns the pixel of a point at infinity in `direction`, or `None` behind the camera and for orthographic
    /// projection.
    #[must_use]
    pub fn project_direction(&self, direction: Vec3A) -> Option<Vec2> {
        let d = self.camera_from_world.transform_vector3a(direction);
        match self.projection {
            Projection::Perspective { .. } => self.pixel_of(d, -d.z).map(|(pixel, _)| pixel),
            Projection::Orthographic { .. } => None,
        }
    }

    fn pixel_of(&self, p: Vec3A, depth: f32) -> Option<(Vec2, f32)> {
        // Reject points behind the camera, and NaN.
        if depth.is_nan() || depth <= 0.0 {
            return None;
        }
        // Divide by the depth only in perspective.
        let divisor = match self.projection {
            Projection::Perspective { .. } => depth,
            Projection::Orthographic { .. } => 1.0,
        };
        let scale = self.height / (2.0 * self.half_height * divisor);
        let pixel = Vec2::new(self.width / 2.0 + p.x * scale / self.pixel_aspect, self.height / 2.0 - p.y * scale);
        pixel.is_finite().then_some((pixel, depth))
    }

    /// Returns the width of a pixel at `depth` meters, facing the camera \[m\].
    #[must_use]
    pub fn pixel_width(&self, depth: f32) -> f32 {
        let at_one = 2.0 * self.half_height / self.height;
        match self.projection {
            Projection::Perspective { .. } => at_one * depth,
            Projection::Orthographic { .. } => at_one,
        }
    }

    /// Returns half the width of the picture \[m\]. For a perspective projection, the width is measured at a distance
    /// of 1 m.
    fn half_width(&self) -> f32 {
        self.half_height * self.width / self.height * self.pixel_aspect
    }

    /// Returns the transform from world space to left-handed camera space \[m\]: x to the right, y up, z along the
    /// view.
    ///
    /// OpenEXR stores this matrix as the attribute `worldToCamera`. RenderMan uses the same camera space.
    fn left_handed_camera(&self) -> Mat4 {
        Mat4::from_scale(Vec3::new(1.0, 1.0, -1.0)) * Mat4::from(self.camera_from_world)
    }

    /// Returns the transform from world space to picture space. After division by w, x and y are 0…1 from the upper
    /// left to the lower right corner.
    ///
    /// ```text
    /// perspective      w = d    z / w = 1 − 1 m / d        d  meters along the camera's axis
    /// orthographic     w = 1    z = d
    /// ```
    /// OpenEXR stores this matrix as the attribute `worldToNDC`. Readers of the attribute ignore z, but with z the matrix
    /// is invertible.
    fn normalized_device(&self) -> Mat4 {
        let half = Vec2::new(self.half_width(), self.half_height);
        // Scale to the unit square, with y pointing down.
        let (x, y) = (0.5 / half.x, -0.5 / half.y);
        let [column_x, column_y] = [Vec4::new(x, 0.0, 0.0, 0.0), Vec4::new(0.0, y, 0.0, 0.0)];
        let picture_from_camera = match self.projection {
            Projection::Perspective { .. } => {
                Mat4::from_cols(column_x, column_y, Vec4::new(0.5, 0.5, 1.0, 1.0), Vec4::new(0.0, 0.0, -1.0, 0.0))
            }
            Projection::Orthographic { .. } => {
                Mat4::from_cols(column_x, column_y, Vec4::Z, Vec4::new(0.5, 0.5, 0.0, 1.0))
            }
        };
        picture_from_camera * self.left_handed_camera()
    }

    /// Returns the camera for the header of an image file.
    #[must_use]
    pub fn frame_camera(&self) -> FrameCamera {
        let width = 2.0 * self.half_width();
        FrameCamera {
            camera_from_world: self.left_handed_camera().to_cols_array(),
            picture_from_world: self.normalized_device().to_cols_array(),
            window_width: matches!(self.projection, Projection::Perspective { .. }).then_some(width),
            pixel_aspect: self.pixel_aspect,
        }
    }

    /// Returns the position of the camera \[m\].
    #[must_use]
    pub fn position(&self) -> Vec3A {
        self.world_from_camera.translation
    }

    /// Returns the transform from camera space to world space, with x to the right, y up and −z along the view.
    #[must_use]
    pub fn world_from_camera(&self) -> Affine3A {
        self.world_from_camera
    }

    /// Builds a view of the whole box from the front and slightly above, for scenes without a camera.
    #[must_use]
    pub fn around(min: Vec3A, max: Vec3A, width: usize, height: usize) -> Self {
        // Choose a distance from which the bounding sphere fills the field of view.
        let (center, radius) = ((min + max) / 2.0, ((max - min).length() / 2.0).max(1e-6));
        let yfov = 0.6f32;
        let from = center + Vec3A::new(0.35, 0.3, 1.0).normalize() * radius / (yfov / 2.0).sin();
        // Look at the center with +y up.
        let z = (from - center).normalize();
        let x = Vec3::Y.cross(z.into()).normalize();
        let mut world = Affine3A::IDENTITY;
        world.matrix3 = glam::Mat3A::from_cols(x.into(), z.cross(x.into()), z);
        world.translation = from;
        Self::new(world, Projection::Perspective { yfov }, width, height)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn matrices_lead_to_the_pixels_of_projections() {
        let world = Affine3A::from_rotation_translation(glam::Quat::from_rotation_y(0.7), Vec3::new(1.0, 2.0, 3.0));
        for projection in [Projection::Perspective { yfov: 0.8 }, Projection::Orthographic { ymag: 2.0 }] {
            let view = View::new(world, projection, 640, 360);
            for pixel in [Vec2::new(0.5, 0.5), Vec2::new(400.0, 20.0), Vec2::new(639.5, 359.5)] {
                let (origin, direction) = view.ray(pixel);
                let point = origin + direction * 5.0;
                let Projected { depth, .. } = view.project(point).unwrap();
                let seen = view.normalized_device().project_point3(point.into());
                assert!((seen.truncate() * Vec2::new(640.0, 360.0) - pixel).length() < 1e-3, "{pixel} became {seen}");
                let before = view.left_handed_camera().transform_point3(point.into());
                assert!((before.z - depth).abs() < 1e-5, "{before} is {depth} m away");
                assert!(
                    before.x.signum() == (pixel.x - 320.0).signum() && before.y.signum() == (180.0 - pixel.y).signum()
                );
            }
        }
        let view = View::new(world, Projection::Perspective { yfov: 0.8 }, 640, 360);
        assert!((view.frame_camera().window_width.unwrap() - 2.0 * 0.4f32.tan() * 640.0 / 360.0).abs() < 1e-6);
    }

    /// A 16:9 camera shows its whole view in pictures of any aspect ratio, and more if the picture's aspect ratio
    /// differs.
    #[test]
    fn all_of_a_camera_is_shown_on_any_picture() {
        let perspective = Projection::Perspective { yfov: 0.8 };
        for (projection, half) in [(perspective, 0.4f32.tan()), (Projection::Orthographic { ymag: 1.0 }, 1.0)] {
            let camera = Camera { projection, aspect: Some(16.0 / 9.0), ..Camera::default() };
            for (width, height) in [(682, 384), (512, 512), (100, 400), (800, 100)] {
                let view = View::of(&camera, Affine3A::IDENTITY, width, height);
                let corner = Vec3A::new(half * 16.0 / 9.0, half, -1.0);
                let Projected { pixel, .. } = view.project(corner).unwrap();
                let size = Vec2::new(width as f32, height as f32);
                assert!(pixel.x <= size.x + 0.01 && pixel.y >= -0.01, "{pixel} of {size}");
                // The view touches the border on one of the two axes.
                assert!(pixel.x >= size.x - 0.01 || pixel.y <= 0.01, "{pixel} of {size}");
            }
        }
    }

    #[test]
    fn projecting_a_ray_gives_its_pixel_back() {
        let world = Affine3A::from_rotation_translation(glam::Quat::from_rotation_y(0.7), Vec3::new(1.0, 2.0, 3.0));
        for projection in [Projection::Perspective { yfov: 0.8 }, Projection::Orthographic { ymag: 2.0 }] {
            let view = View::new(world, projection, 640, 360);
            for pixel in [Vec2::new(0.5, 0.5), Vec2::new(320.0, 180.0), Vec2::new(639.5, 359.5)] {
                let (origin, direction) = view.ray(pixel);
                let Projected { pixel: back, depth } = view.project(origin + direction * 5.0).unwrap();
                assert!((back - pixel).length() < 1e-3, "{pixel} became {back}");
                assert!(depth > 0.0 && depth <= 5.001);
                assert!(view.project(origin - direction * 5.0).is_none());
            }
        }
    }
}
