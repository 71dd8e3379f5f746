//! Typical rooms of users' scenes: closed, dim, behind thin walls. Films are compared with path tracing in blocks of 8×8
//! pixels.

mod animated;
mod blends;
mod coincidence;
mod lamps;
mod plain;
mod walls;

use glam::{Vec3, vec3};
use std::path::PathBuf;
use tempfile::TempDir;
use tests::{Blocks, Comparison, Glb, Quad};

/// Returns the faces of a box, facing outward.
fn outside(low: Vec3, high: Vec3) -> Vec<Quad> {
    let (x, y, z) = (Vec3::X * (high - low), Vec3::Y * (high - low), Vec3::Z * (high - low));
    vec![[low, z, y], [low, x, z], [low, y, x], [high, -y, -z], [high, -z, -x], [high, -x, -y]]
}

/// Returns the faces of a box, facing inward.
fn inside(low: Vec3, high: Vec3) -> Vec<Quad> {
    outside(low, high).into_iter().map(|[corner, a, b]| [corner, b, a]).collect()
}

/// A scene in its own folder, with its TOML file.
struct Room {
    folder: TempDir,
}

impl Room {
    fn new(glb: &Glb, toml: &str) -> Self {
        let room = Self { folder: tempfile::tempdir().expect("a folder") };
        glb.write(&room.scene());
        std::fs::write(room.folder.path().join("room.toml"), toml).expect("a file");
        room
    }

    fn scene(&self) -> PathBuf {
        self.folder.path().join("room.glb")
    }

    /// Compares the film's light with path tracing, and prints the row.
    fn blocks(&self, name: &str, comparison: Comparison) -> Blocks {
        let blocks = Blocks::of(self.folder.path(), &self.scene(), comparison);
        println!("{}", blocks.row(name));
        blocks
    }

    /// Returns the mean luminance of a film without light and of its brightest block, and prints both.
    fn leak(&self, name: &str, film: &str) -> (f32, f32) {
        let blocks =
            Blocks::of(self.folder.path(), &self.scene(), Comparison { paths: 1, film, ..Comparison::default() });
        let most = blocks.found.iter().fold(0.0f32, |most, &found| most.max(found));
        println!("{name:32} mean {:.2e}, brightest block {most:.2e}", blocks.mean());
        assert!(blocks.expected.iter().all(|&expected| expected == 0.0), "{name}: paths find light");
        (blocks.mean(), most)
    }
}

/// Adds a camera at `from` that looks at `to`, with level horizontal lines.
fn look(glb: &mut Glb, from: Vec3, to: Vec3) {
    let node = glb.add_camera(from);
    let back = (from - to).normalize();
    let right = Vec3::Y.cross(back).normalize();
    let turn = glam::Quat::from_mat3(&glam::Mat3::from_cols(right, back.cross(right), back));
    glb.json["nodes"][node]["rotation"] = serde_json::json!(turn.to_array());
}

/// A uniform sky of radiance 1.
const WHITE_SKY: &str = "[sky]\nzenith = [1, 1, 1]\nhorizon = [1, 1, 1]\nground = [1, 1, 1]\n";

/// Adds a square lamp of `side` meters at `center` that emits `radiance` downwards.
fn lamp(center: Vec3, side: f32, radiance: f32, glb: &mut Glb) {
    let corner = center - vec3(side, 0.0, side) / 2.0;
    glb.add(&[[corner, Vec3::X * side, Vec3::Z * side]], Vec3::ZERO, Vec3::splat(radiance));
}
