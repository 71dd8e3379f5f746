//! Tiles of receivers: shadow rays from a light sample to all receivers of a tile are traced together.

use super::points::LightPoints;
use super::receiver::{Disc, ShadingPoint, disc_term};
use crate::accel::{Accelerator, PACKET, Shadows, Shaft};
use glam::{Vec3, Vec3A};
use std::cell::Cell;

/// Minimum number of receivers that justifies the cost of a shaft to the light.
const WORTH_A_SHAFT: usize = 8;

/// Shafts between the receivers of a tile and a light, for opaque and for blended occluders. A shaft is `None` if it is
/// not worth its cost.
pub(super) struct Shafts {
    pub opaque: Option<Shaft>,
    pub blended: Option<Shaft>,
}

/// Occlusion of a light, or of a sample of a light, for the receivers of a tile.
pub(super) struct Hidden {
    /// Fully occluded receivers, as bits.
    pub whole: u64,
    /// Fraction of the light that arrives at each receiver, by color; `None` if each fraction is 0 or 1.
    pub passed: Option<[[f32; PACKET]; 3]>,
}

impl Hidden {
    /// Returns the fraction of the light that arrives at a receiver.
    pub fn share(&self, receiver: usize) -> Vec3 {
        match &self.passed {
            Some(passed) => Vec3::from_array(passed.map(|color| color[receiver])),
            None if self.whole >> receiver & 1 == 1 => Vec3::ZERO,
            None => Vec3::ONE,
        }
    }
}

/// Group of up to [`PACKET`] receivers that are lit together.
pub(super) struct ReceiverTile<'a> {
    shadows: &'a Shadows<'a>,
    receivers: &'a [ShadingPoint],
    /// Sample points that each light may use.
    pub points: LightPoints,
    positions: [Vec3A; PACKET],
    /// Positions and both normals of the receivers, by axis.
    columns: [[[f32; PACKET]; 3]; 3],
    /// Number of shadow rays traced so far.
    rays: Cell<u64>,
}

impl<'a> ReceiverTile<'a> {
    pub(super) fn new(shadows: &'a Shadows<'a>, receivers: &'a [ShadingPoint], points: LightPoints) -> Self {
        // Store coordinates by axis, so that the terms of a disc vectorize over receivers. Unused slots repeat the last
        // receiver.
        let mut columns = [[[0.0; PACKET]; 3]; 3];
        for i in 0..PACKET {
            let ShadingPoint { position, normal, geometric_normal } = receivers[i.min(receivers.len() - 1)];
            for (columns, v) in columns.iter_mut().zip([position, normal, geometric_normal]) {
                columns.iter_mut().zip(v.to_array()).for_each(|(column, x)| column[i] = x);
            }
        }
        let positions = std::array::from_fn(|i| receivers.get(i).map_or(Vec3A::ZERO, |receiver| receiver.position));
        Self { shadows, receivers, points, positions, columns, rays: Cell::new(0) }
    }

    /// Returns the receivers, at most [`PACKET`].
    pub(super) fn receivers(&self) -> &[ShadingPoint] {
        self.receivers
    }

    /// Returns the fraction of the light from a direction that arrives at one of the receivers.
    pub(super) fn visible_towards(&self, receiver: &ShadingPoint, towards: Vec3A) -> Vec3 {
        self.rays.set(self.rays.get() + 1);
        self.shadows.visible_towards(receiver.position, towards)
    }

    /// Returns the number of shadow rays traced so far.
    pub(super) fn shadow_rays(&self) -> u64 {
        self.rays.get()
    }

    /// Returns the irradiance from a disc at each receiver per unit of intensity \[m⁻²\].
    pub(super) fn terms(&self, disc: &Disc) -> [f32; PACKET] {
        let mut terms = [0.0; PACKET];
        let [position, normal, geometric_normal] = &self.columns;
        for i in 0..self.receivers.len().min(PACKET) {
            let at = |columns: &[[f32; PACKET]; 3]| [columns[0][i], columns[1][i], columns[2][i]];
            terms[i] = disc_term(at(position), [at(normal), at(geometric_normal)], disc);
        }
        terms
    }

    /// Returns the shafts between the receivers and a light's points, if they are worth their cost.
    pub(super) fn shafts(&self, light: &[Vec3A]) -> Shafts {
        let receivers = &self.positions[..self.receivers.len()];
        let is_worth = receivers.len() >= WORTH_A_SHAFT && !light.is_empty();
        let opaque = is_worth.then(|| self.shadows.opaque().shaft(receivers, light));
        let to = |blends: &Accelerator| is_worth.then(|| blends.shaft_if_near(receivers, light));
        Shafts { opaque, blended: self.shadows.blends().and_then(to) }
    }

    /// Returns all receivers, as bits.
    pub(super) fn all(&self) -> u64 {
        u64::MAX >> (PACKET - self.receivers.len())
    }

    /// Returns the receivers among `active` that are occluded from `light`. All shadow rays start at the light, which
    /// is inside the `shaft`, if there is one.
    pub(super) fn hidden_from(&self, light: Vec3A, active: u64, shaft: Option<&Shaft>) -> u64 {
        if active == 0 || shaft.is_some_and(Shaft::is_empty) {
            return 0;
        }

        // All rays of a packet start at the light. Inside a shaft they test fewer boxes of the tree.
        self.rays.set(self.rays.get() + u64::from(active.count_ones()));
        match shaft {
            Some(shaft) => self.shadows.opaque().occluded_packet_within(shaft, light, &self.columns[0], active),
            None => self.shadows.opaque().occluded_packet(light, &self.positions[..self.receivers.len()], active),
        }
    }

    /// Returns the occlusion of `light` for the receivers among `active`. In addition to [`ReceiverTile::hidden_from`],
    /// the result contains the fractions that blended surfaces transmit.
    pub(super) fn hidden(&self, light: Vec3A, active: u64, shafts: &Shafts) -> Hidden {
        // Trace blended surfaces only for receivers that no opaque surface occludes.
        let whole = self.hidden_from(light, active, shafts.opaque.as_ref());
        let left = active & !whole;
        let partly = match (self.shadows.blends(), &shafts.blended) {
            (None, _) => 0,
            (Some(_), Some(shaft)) if shaft.is_empty() => 0,
            (Some(blends), Some(shaft)) => blends.occluded_packet_within(shaft, light, &self.columns[0], left),
            (Some(blends), None) => blends.occluded_packet(light, &self.positions[..self.receivers.len()], left),
        };
        if partly == 0 {
            return Hidden { whole, passed: None };
        }

        // Compute the transmitted fraction only for receivers behind a blended surface.
        let mut passed = [std::array::from_fn(|i| if whole >> i & 1 == 1 { 0.0 } else { 1.0 }); 3];
        for i in bits(partly) {
            let share = self.shadows.passed(light, self.positions[i]).to_array();
            passed.iter_mut().zip(share).for_each(|(color, share)| color[i] = share);
        }
        Hidden { whole, passed: Some(passed) }
    }

    /// Returns the fraction of `light` that blended surfaces transmit to one receiver. For many receivers,
    /// use [`ReceiverTile::hidden`].
    pub(super) fn passed(&self, light: Vec3A, receiver: usize) -> Vec3 {
        self.shadows.passed(light, self.positions[receiver])
    }
}

/// Returns the indices of the set bits.
pub(super) fn bits(mut mask: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let place = mask.trailing_zeros() as usize;
        (mask != 0).then(|| {
            mask &= mask - 1;
            place
        })
    })
}
