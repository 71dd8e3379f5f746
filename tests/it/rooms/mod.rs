//! Rooms that strangers' scenes have: closed, dim, behind thin walls. Films next to paths, by blocks of 8×8 pixels.

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

/// The faces of a box, which face outward.
fn outside(low: Vec3, high: Vec3) -> Vec<Quad> {
    let (x, y, z) = (Vec3::X * (high - low), Vec3::Y * (high - low), Vec3::Z * (high - low));
    vec![[low, z, y], [low, x, z], [low, y, x], [high, -y, -z], [high, -z, -x], [high, -x, -y]]
}

/// The faces of a box, which face inward.
fn inside(low: Vec3, high: Vec3) -> Vec<Quad> {
    outside(low, high).into_iter().map(|[corner, a, b]| [corner, b, a]).collect()
}

/// A scene in a folder of its own, with the TOML file beside it.
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

    /// The film's light next to that of paths; the row is printed.
    fn blocks(&self, name: &str, comparison: Comparison) -> Blocks {
        let blocks = Blocks::of(self.folder.path(), &self.scene(), comparison);
        println!("{}", blocks.row(name));
        blocks
    }

    /// Mean luminance of the film, and that of its brightest block, where no light gets; printed.
    fn leak(&self, name: &str, film: &str) -> (f32, f32) {
        let blocks =
            Blocks::of(self.folder.path(), &self.scene(), Comparison { paths: 1, film, ..Comparison::default() });
        let most = blocks.found.iter().fold(0.0f32, |most, &found| most.max(found));
        println!("{name:32} mean {:.2e}, brightest block {most:.2e}", blocks.mean());
        assert!(blocks.expected.iter().all(|&expected| expected == 0.0), "{name}: paths find light");
        (blocks.mean(), most)
    }
}

/// A camera at `from` that looks at `to`, horizontal lines level.
fn look(glb: &mut Glb, from: Vec3, to: Vec3) {
    let node = glb.add_camera(from);
    let back = (from - to).normalize();
    let right = Vec3::Y.cross(back).normalize();
    let turn = glam::Quat::from_mat3(&glam::Mat3::from_cols(right, back.cross(right), back));
    glb.json["nodes"][node]["rotation"] = serde_json::json!(turn.to_array());
}

/// An even sky of radiance 1.
const WHITE_SKY: &str = "[sky]\nzenith = [1, 1, 1]\nhorizon = [1, 1, 1]\nground = [1, 1, 1]\n";

/// A square lamp of `side` meters that hangs at `center` and shines down with `radiance`.
fn lamp(center: Vec3, side: f32, radiance: f32, glb: &mut Glb) {
    let corner = center - vec3(side, 0.0, side) / 2.0;
    glb.add(&[[corner, Vec3::X * side, Vec3::Z * side]], Vec3::ZERO, Vec3::splat(radiance));
}
