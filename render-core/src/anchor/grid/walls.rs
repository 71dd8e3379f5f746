//! Walls that hide neighboring points from each other.
//!
//! Most points are not near a wall. Each point therefore has a list of the points in its kernel that a wall hides.
//! Light is distributed without rays if all these lists are empty.

use super::{Grid, Spot};
use crate::accel::PACKET;
use crate::anchor::{Anchor, Sight};
use crate::ranks::{Ranks, share_blocks};
use rayon::prelude::*;

/// Number of points that a thread tests together.
const AT_ONCE: usize = 64;

/// Kind of occluder between a point and its neighbors.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) enum Doubt {
    /// No occluder.
    Nothing,
    /// A static wall.
    Wall,
    /// A moving occluder, or an unknown result.
    Anything,
}

/// Lists of hidden points for the points of a grid.
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Walls {
    doubts: Vec<Doubt>,
    /// First list entry of each point, followed by the total number of entries.
    first: Vec<u32>,
    /// Indices of points hidden by a wall, ascending within each list.
    hidden: Vec<u32>,
}

impl Walls {
    /// Returns the state of `count` points before any test.
    pub fn unknown(count: usize) -> Self {
        Self { doubts: vec![Doubt::Anything; count], first: vec![0; count + 1], hidden: Vec::new() }
    }

    /// Returns empty lists for `count` points.
    fn none(count: usize) -> Self {
        Self { doubts: vec![Doubt::Nothing; count], ..Self::unknown(count) }
    }

    /// Tests all pairs of neighboring points of `grid` by rays, which the `ranks` share.
    fn between(grid: &Grid, sight: &Sight, ranks: &dyn Ranks) -> Self {
        // Test each pair once, from its first point.
        let later_hidden = |p: usize| {
            let p = p as u32;
            let spot = Spot::of(&grid.points[p as usize], false);
            let (mut later, mut places) = (Vec::new(), Vec::new());
            grid.near(&spot, |k, _| {
                if k > p && later.len() < PACKET {
                    later.push(grid.points[k as usize]);
                    places.push(k);
                }
            });
            let hidden = sight.hidden(spot.position, spot.normal, &later, grid.height_at(spot.position));
            let mut hidden_places: Vec<u32> = Vec::new();
            for (i, k) in places.into_iter().enumerate() {
                if hidden >> i & 1 == 1 {
                    hidden_places.push(k);
                }
            }
            hidden_places
        };
        let later: Vec<Vec<u32>> = share_blocks(ranks, grid.points.len(), AT_ONCE, later_hidden).value;

        // Add each hidden pair to both lists, because visibility is symmetric.
        let mut lists = vec![Vec::new(); later.len()];
        for (p, later) in (0u32..).zip(&later) {
            for &k in later {
                lists[p as usize].push(k);
                lists[k as usize].push(p);
            }
        }

        // Concatenate the sorted lists. A point with a non-empty list is near a wall.
        let mut walls = Self { doubts: Vec::new(), first: vec![0], hidden: Vec::new() };
        for mut list in lists {
            list.sort_unstable();
            walls.doubts.push(if list.is_empty() { Doubt::Nothing } else { Doubt::Wall });
            walls.hidden.extend(list);
            walls.first.push(walls.hidden.len() as u32);
        }
        walls.doubt_neighbors(grid);
        walls
    }

    /// Also marks the neighbors of points near a wall. A spot may be close to the other side of the wall, where the
    /// points are too far from the wall to have lists.
    fn doubt_neighbors(&mut self, grid: &Grid) {
        let is_near_wall = |p: u32| {
            let mut found = false;
            grid.near(&Spot::of(&grid.points[p as usize], false), |k, _| found |= self.doubt(k) == Doubt::Wall);
            if found { Doubt::Wall } else { self.doubt(p) }
        };
        self.doubts = (0..self.doubts.len() as u32).into_par_iter().map(is_near_wall).collect();
    }

    /// Returns the kind of occluder near point `p`.
    #[inline]
    pub fn doubt(&self, p: u32) -> Doubt {
        self.doubts[p as usize]
    }

    /// Returns whether a wall separates points `p` and `k`. One point must be within the kernel around the other.
    fn stand_between(&self, p: u32, k: u32) -> bool {
        let list = &self.hidden[self.first[p as usize] as usize..self.first[p as usize + 1] as usize];
        list.binary_search(&k).is_ok()
    }
}

impl Grid {
    /// Finds the walls between the points by rays, which the `ranks` share. Without `sight`, assumes that no walls exist.
    pub fn find_walls(&mut self, sight: Option<&Sight>, ranks: &dyn Ranks) {
        self.walls = match sight {
            Some(sight) => Walls::between(self, sight, ranks),
            None => Walls::none(self.points.len()),
        };
    }

    /// Marks the points that moving geometry may approach. `may_meet` is true for their indices.
    pub fn expect_movement(&mut self, may_meet: &[bool]) {
        for (doubt, &index) in self.walls.doubts.iter_mut().zip(&self.index) {
            if may_meet[index as usize] {
                *doubt = Doubt::Anything;
            }
        }
    }

    /// Returns the mask of the points in `parts` that are hidden from `spot`. `doubt` is the maximum doubt of these
    /// points.
    pub(super) fn hidden(&self, spot: &Spot, sight: &Sight, parts: &[(u32, f32)], doubt: Doubt) -> u64 {
        match doubt {
            Doubt::Nothing => 0,
            Doubt::Wall => self.hidden_by_lists(spot, sight, parts),
            Doubt::Anything => self.hidden_by_rays(spot, sight, parts),
        }
    }

    fn hidden_by_rays(&self, spot: &Spot, sight: &Sight, parts: &[(u32, f32)]) -> u64 {
        let mut points = [Anchor::NOWHERE; PACKET];
        for (point, &(p, _)) in points.iter_mut().zip(parts) {
            *point = self.points[p as usize];
        }
        sight.hidden(spot.position, spot.normal, &points[..parts.len()], self.height_at(spot.position))
    }

    /// Tests visibility by the list of the nearest visible point, because points visible from there are visible from
    /// `spot`. Rays find this nearest point and test points outside its kernel.
    fn hidden_by_lists(&self, spot: &Spot, sight: &Sight, parts: &[(u32, f32)]) -> u64 {
        let is_hidden = |i: usize| self.hidden_by_rays(spot, sight, &parts[i..=i]) != 0;
        let all = u64::MAX >> (PACKET - parts.len().max(1));
        let mut hidden = 0;
        while hidden != all {
            // Choose the heaviest point not yet hidden as hub: it is usually the nearest.
            let mut hub = usize::MAX;
            for i in (0..parts.len()).filter(|i| hidden >> i & 1 == 0) {
                if hub == usize::MAX || parts[i].1 > parts[hub].1 {
                    hub = i;
                }
            }
            // Test the hub by a ray. If it is hidden, try the next point.
            if is_hidden(hub) {
                hidden |= 1 << hub;
                continue;
            }

            // Read the visibility of the other points from the hub's list. The list covers its kernel only.
            let center = &self.points[parts[hub].0 as usize];
            let radius = self.radius_at(center.position);
            let found = hidden;
            for i in (0..parts.len()).filter(|&i| i != hub && found >> i & 1 == 0) {
                let (p, _) = parts[i];
                let reach2 = center.position.distance_squared(self.points[p as usize].position);
                let is_known = reach2 < radius * radius;
                let is_behind = match is_known {
                    true => self.walls.stand_between(parts[hub].0, p),
                    false => is_hidden(i),
                };
                hidden |= u64::from(is_behind) << i;
            }
            break;
        }
        hidden
    }
}

#[cfg(test)]
mod tests {
    use super::super::SplatScratch;
    use super::*;
    use crate::accel::Geometry;
    use crate::ranks::Alone;
    use crate::sampling::hash_unit;
    use crate::scene::{Material, Mesh, Scene};
    use glam::{Vec3, Vec3A};

    /// Returns a floor of 4×4 m with a wall along x = 0 and a curb of 1 cm height along x = 1.
    fn parted_floor() -> Scene {
        let mut mesh = Mesh::default();
        for [corner, a, b] in [
            [Vec3::new(-2.0, 0.0, -2.0), Vec3::Z * 4.0, Vec3::X * 4.0],
            [Vec3::new(0.0, -0.1, -2.0), Vec3::Z * 4.0, Vec3::Y * 2.0],
            [Vec3::new(1.0, -0.1, -2.0), Vec3::Z * 4.0, Vec3::Y * 0.11],
        ] {
            let first = mesh.positions.len() as u32;
            mesh.positions.extend([corner, corner + a, corner + a + b, corner + b]);
            mesh.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
        }
        Scene::of_mesh(mesh, Material::default())
    }

    fn on_floor(key: u64) -> Vec3A {
        Vec3A::new(hash_unit(3, key, 0) * 4.0 - 2.0, 1e-4, hash_unit(3, key, 1) * 4.0 - 2.0)
    }

    #[test]
    fn lists_hide_what_rays_hide_and_walls_part_the_floor() {
        let scene = parted_floor();
        let accelerator = Geometry::new(&scene).place(&scene.pose(0.0));
        let sight = Sight { accelerator: &accelerator, epsilon: 1e-4 };
        let count = 2000;
        let points: Vec<Anchor> =
            (0..count).map(|k| Anchor { position: on_floor(k), normal: Vec3A::Y, instance: 0 }).collect();
        let share = 16.0 / count as f32;
        let mut by_lists = Grid::new(&points, &[], share);
        by_lists.find_walls(Some(&sight), &Alone);
        let by_rays = Grid::new(&points, &[], share);

        let (mut differing, mut over_curb) = (0, 0);
        let spots: Vec<(Spot, usize)> = (0..4000)
            .map(|k| {
                let place = Anchor { position: on_floor(90_000 + k), normal: Vec3A::Y, instance: 0 };
                (Spot::of(&place, false), k as usize)
            })
            .collect();
        by_lists.splat_all(&spots, Some(&sight), &mut SplatScratch::default(), |k, parts| {
            let spot = &spots[k].0;
            let mut of_lists: Vec<(usize, f32)> =
                parts.iter().map(|&(p, weight)| (by_lists.index[p as usize] as usize, weight)).collect();
            let mut of_rays = Vec::new();
            by_rays.splat(spot, Some(&sight), |point, weight| of_rays.push((point, weight)));
            of_lists.sort_by_key(|part| part.0);
            of_rays.sort_by_key(|part| part.0);
            // Allow differences across the low curb, where only one of two adjacent points may see a third.
            let near_curb = (spot.position.x - 1.0).abs() < 2.0 * by_lists.radius;
            let is_same = of_lists.iter().map(|part| part.0).eq(of_rays.iter().map(|part| part.0));
            differing += usize::from(!is_same && !near_curb);
            for (point, weight) in of_lists {
                let [from, to] = [spot.position.x, points[point].position.x];
                assert!(from * to > 0.0, "{weight} of the light at {from} goes to {to}");
                over_curb += usize::from((from - 1.0) * (to - 1.0) < 0.0);
            }
        });
        assert_eq!(differing, 0, "places share light as rays say, but next to the curb");
        assert!(over_curb > 100, "a curb is no wall: {over_curb}");
    }
}
