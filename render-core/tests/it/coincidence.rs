//! Tests of coplanar sheets: a rule, not rounding, determines which sheet a ray hits.

use crate::common::{add, quad, rest};
use glam::{Affine3A, Quat, Vec2, Vec3, Vec3A, vec3};
use render_core::Geometry;
use render_core::sampling::hash_unit;
use render_core::scene::{Channel, Interpolation, Material, Scene, Track, Transform};

/// Rectangle in the plane z = 0.
#[derive(Clone, Copy)]
struct Sheet {
    low: Vec2,
    size: Vec2,
    /// Whether the sheet's front faces +z.
    up: bool,
    double_sided: bool,
    glows: bool,
    other_diagonal: bool,
    mirrored: bool,
    moves: bool,
}

impl Sheet {
    fn random(seed: u64, k: u64) -> Self {
        let random = |dimension| hash_unit(seed, k, dimension);
        let is = |dimension| random(dimension) < 0.5;
        Self {
            low: Vec2::new(random(0), random(1)) - 1.0,
            size: Vec2::new(random(2), random(3)) + 0.5,
            up: is(4),
            double_sided: random(5) < 0.2,
            glows: random(6) < 0.3,
            other_diagonal: is(7),
            mirrored: is(8),
            moves: random(9) < 0.3,
        }
    }

    /// Adds the sheet to `scene`, with its plane transformed by `world`.
    fn add(self, scene: &mut Scene, world: Transform) {
        // Mirror the sheet along x with its node.
        let (sign, low) = if self.mirrored { (-1.0, -self.low.x - self.size.x) } else { (1.0, self.low.x) };
        let (corner, a, b) = (vec3(low, self.low.y, 0.0), Vec3::X * self.size.x, Vec3::Y * self.size.y);
        let [corner, a, b] = if self.other_diagonal { [corner + a, b, -a] } else { [corner, a, b] };
        let mesh = if self.up { quad(corner, a, b) } else { quad(corner, b, a) };
        let emission = if self.glows { Vec3::ONE } else { Vec3::ZERO };
        let material = Material { double_sided: self.double_sided, emission, ..Material::default() };
        let node = add(scene, Transform { scale: world.scale * vec3(sign, 1.0, 1.0), ..world }, mesh, material);
        if self.moves {
            let track = Track::Translation(vec![world.translation, world.translation + Vec3::X]);
            let interpolation = Interpolation::Linear;
            scene.channels.push(Channel { node, times: vec![0.0, 1.0], track, interpolation });
        }
    }

    /// Returns whether the sheet covers `place`, or `None` near the sheet's border.
    fn covers(&self, place: Vec2) -> Option<bool> {
        let from_border = (place - self.low).min(self.low + self.size - place).min_element();
        (from_border.abs() > 1e-3).then_some(from_border > 0.0)
    }
}

/// Returns the sheet that the rule selects at `place` from above or below, or `None` near a border or outside all
/// sheets.
fn expected(sheets: &[Sheet], place: Vec2, above: bool) -> Option<usize> {
    let covers: Option<Vec<bool>> = sheets.iter().map(|sheet| sheet.covers(place)).collect();
    let covers = covers?;
    let rank = |&k: &usize| {
        let Sheet { up, double_sided, glows, .. } = sheets[k];
        (up != above && !double_sided, !glows, k)
    };
    (0..sheets.len()).filter(|&k| covers[k]).min_by_key(rank)
}

#[test]
fn of_sheets_in_one_plane_the_rule_finds_the_one_that_is_met() {
    let mut checked = 0;
    for seed in 0..60 {
        let random = |dimension| hash_unit(seed, 99, dimension) * 2.0 - 1.0;
        let scale = [1e-3, 1.0, 1.0, 1e3][seed as usize % 4];
        let far = [0.0, 1.0, 30.0][seed as usize % 3];
        let rotation = Quat::from_scaled_axis(vec3(random(0), random(1), random(2)) * 3.0);
        let translation = vec3(random(3), random(4), random(5)) * scale * far;
        let world = Transform { translation, rotation, scale: Vec3::splat(scale) };
        let sheets: Vec<Sheet> = (0..6).map(|k| Sheet::random(seed, k)).collect();
        let mut scene = Scene::default();
        for sheet in &sheets {
            sheet.add(&mut scene, world);
        }
        let (geometry, pose) = (Geometry::new(&scene), scene.pose(0.0));
        let (vector, scalar) = (geometry.place(&pose), geometry.place(&pose).without_vector_instructions());
        let to_world = Affine3A::from_scale_rotation_translation(world.scale, rotation, translation);
        for above in [true, false] {
            let eye = to_world.transform_point3a(Vec3A::new(0.2, -0.1, if above { 1.5 } else { -1.5 }));
            let place = |k: u64| Vec2::new(hash_unit(seed, k, 20), hash_unit(seed, k, 21)) * 2.5 - 1.0;
            let towards = |k| (to_world.transform_point3a(place(k).extend(0.0).into()) - eye).normalize();
            let directions: Vec<Vec3A> = (1000..1128).map(towards).collect();
            let mut hits = vec![None; directions.len()];
            vector.closest_packet(eye, &directions, &mut hits);
            for ((k, &direction), hit) in (1000..).zip(&directions).zip(hits) {
                assert_eq!(hit, vector.closest(eye, direction), "alone and together");
                assert_eq!(hit, scalar.closest(eye, direction), "with and without vector instructions");
                let Some(sheet) = expected(&sheets, place(k), above) else { continue };
                let found = hit.unwrap_or_else(|| panic!("ray {k} of scene {seed} misses sheet {sheet}"));
                assert_eq!(found.instance, sheet as u32, "ray {k} of scene {seed}, above: {above}");
                checked += 1;
            }
        }
    }
    assert!(checked > 5_000, "only {checked} rays are checked");
}

#[test]
fn sheets_a_little_apart_are_met_in_their_order() {
    // Sheets of 2 m are 0.1 mm apart, which is fifty times the tolerance for coincidence.
    let mut scene = Scene::default();
    for (z, up) in [(-1e-4, true), (0.0, true), (1e-4, false)] {
        let (corner, a, b) = (vec3(-1.0, -1.0, z), Vec3::X * 2.0, Vec3::Y * 2.0);
        add(
            &mut scene,
            rest(Vec3::ZERO),
            if up { quad(corner, a, b) } else { quad(corner, b, a) },
            Material::default(),
        );
    }
    let accelerator = Geometry::new(&scene).place(&scene.pose(0.0));
    for k in 0..200 {
        let eye = Vec3A::new(0.3, 0.2, if k % 2 == 0 { 1.0 } else { -1.0 });
        let place = Vec3A::new(hash_unit(7, k, 0) - 0.5, hash_unit(7, k, 1) - 0.5, 0.0);
        let hit = accelerator.closest(eye, (place - eye).normalize()).expect("a sheet");
        assert_eq!(hit.instance, if k % 2 == 0 { 2 } else { 0 });
    }
}
