//! Search for the cheapest partner among the clusters that are not merged yet.

use glam::Vec3A;

use super::cluster::{Cluster, Kind, Metric, union_cosine};

/// A cluster's cheapest partner, and the cost of the union of both.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Partner {
    pub cost: f32,
    pub id: u32,
}

impl Partner {
    /// Returns the partner as a number, for loops that other crates run.
    pub fn to_bits(self) -> u64 {
        u64::from(self.cost.to_bits()) << 32 | u64::from(self.id)
    }

    /// Returns the partner of [`to_bits`](Self::to_bits).
    pub fn from_bits(bits: u64) -> Self {
        Self { cost: f32::from_bits((bits >> 32) as u32), id: bits as u32 }
    }
}

/// Number of clusters per leaf of the search tree. Builds with 4 to 8 took the same time.
const LEAF_SIZE: usize = 6;
/// Scale from the extent of axes (at most 2) to a length for splits of the search tree, in units of c. Two lights at
/// right angles (β = 45°) cost as much as lights at a distance of about 0.3 c.
const AXIS_SCALE: f32 = 0.3;
/// Index that marks a missing cluster.
pub(super) const DEAD: u32 = u32::MAX;

/// Static search tree over the clusters that were not merged when it was built. A union reuses the slot of one of its
/// children. It contains that child, so the bounds of the nodes stay lower bounds of costs.
pub(super) struct Neighborhood<'a> {
    metric: &'a Metric,
    slots: Vec<Cluster>,
    /// Slot of each cluster, indexed by cluster number, or [`DEAD`].
    slot_of: Vec<u32>,
    nodes: Vec<SearchNode>,
    alive: usize,
}

/// Lower bound of the extent of a union with any cluster below this node.
struct SearchNode {
    /// Largest `low` and smallest `high` of the clusters' boxes.
    low: Vec3A,
    high: Vec3A,
    /// Box of the member axes of oriented clusters. It is empty (low > high) if no cluster is oriented.
    axis_low: Vec3A,
    axis_high: Vec3A,
    luminance: f32,
    has_omni: bool,
    first: u32,
    last: u32,
    /// Index of the second child, or 0 in leaves. The first child follows its parent.
    second: u32,
}

impl<'a> Neighborhood<'a> {
    /// Creates a search tree with room for cluster numbers below `capacity`.
    pub fn new(clusters: Vec<Cluster>, capacity: usize, metric: &'a Metric) -> Self {
        let mut this =
            Self { metric, alive: clusters.len(), slots: clusters, slot_of: vec![DEAD; capacity], nodes: Vec::new() };
        for (slot, cluster) in (0u32..).zip(&this.slots) {
            this.slot_of[cluster.id as usize] = slot;
        }
        this.rebuild();
        this
    }

    /// Returns the clusters that are not merged yet. Neighbors in space are next to each other.
    pub fn alive(&self) -> impl Iterator<Item = u32> {
        self.slots.iter().map(|cluster| cluster.id).filter(|&id| id != DEAD)
    }

    pub fn is_alive(&self, id: u32) -> bool {
        self.slot_of[id as usize] != DEAD
    }

    /// Returns whether a quarter of the slots have become empty since the last rebuild.
    pub fn is_sparse(&self) -> bool {
        4 * self.alive < 3 * self.slots.len()
    }

    /// Replaces two clusters by their union.
    pub fn merge(&mut self, a: u32, b: u32, id: u32, cone: crate::bounds::Cone) {
        let (slot_a, slot_b) = (self.slot_of[a as usize], self.slot_of[b as usize]);
        let merged = self.slots[slot_a as usize].merged(&self.slots[slot_b as usize], id, cone);
        self.slots[slot_a as usize] = merged;
        self.slots[slot_b as usize].id = DEAD;
        self.slot_of[id as usize] = slot_a;
        self.slot_of[a as usize] = DEAD;
        self.slot_of[b as usize] = DEAD;
        self.alive -= 1;
    }

    /// Drops the empty slots and rebuilds the tree.
    pub fn rebuild(&mut self) {
        self.slots.retain(|cluster| cluster.id != DEAD);
        self.nodes.clear();
        let mut slots = std::mem::take(&mut self.slots);
        self.split(&mut slots, 0);
        for (slot, cluster) in (0u32..).zip(&slots) {
            self.slot_of[cluster.id as usize] = slot;
        }
        self.slots = slots;
    }

    fn split(&mut self, clusters: &mut [Cluster], first: usize) {
        let node = self.nodes.len();
        self.nodes.push(SearchNode::around(clusters, first));
        if clusters.len() <= LEAF_SIZE {
            return;
        }
        let key = widest_dimension(clusters, AXIS_SCALE * self.metric.orientation2.sqrt());
        let middle = clusters.len() / 2;
        clusters.select_nth_unstable_by(middle, |a, b| key(a).total_cmp(&key(b)).then(a.id.cmp(&b.id)));
        let (left, right) = clusters.split_at_mut(middle);
        self.split(left, first);
        self.nodes[node].second = self.nodes.len() as u32;
        self.split(right, first + middle);
    }

    /// Returns the cluster with the cheapest union among the clusters that are not merged yet, and the cost of the
    /// union. The cluster is [`DEAD`] if no other cluster remains. `hint` is a nearby cluster.
    pub fn nearest(&self, id: u32, hint: Option<u32>) -> Partner {
        let own = *self.cluster(id);
        let mut best = hint.map_or((f32::INFINITY, DEAD), |hint| (own.cost(self.cluster(hint), self.metric), hint));
        // Median splits keep the tree balanced, so 40 entries suffice for fewer than 2³² slots.
        let mut stack = [(0.0f32, 0u32); 40];
        let mut top = 1;
        while top > 0 {
            top -= 1;
            let (bound, index) = stack[top];
            // A partner with a cost that overflows is still valid.
            if bound >= best.0 && best.1 != DEAD {
                continue;
            }
            let node = &self.nodes[index as usize];
            if node.second == 0 {
                for cluster in &self.slots[node.first as usize..node.last as usize] {
                    if cluster.id != id && cluster.id != DEAD {
                        let cost = own.cost(cluster, self.metric);
                        if cost < best.0 || best.1 == DEAD || (cost == best.0 && cluster.id < best.1) {
                            best = (cost, cluster.id);
                        }
                    }
                }
                continue;
            }
            let near = (self.nodes[index as usize + 1].lower_bound(&own, self.metric), index + 1);
            let far = (self.nodes[node.second as usize].lower_bound(&own, self.metric), node.second);
            let (near, far) = if near.0 <= far.0 { (near, far) } else { (far, near) };
            stack[top] = far;
            stack[top + 1] = near;
            top += 2;
        }
        Partner { cost: best.0, id: best.1 }
    }

    fn cluster(&self, id: u32) -> &Cluster {
        &self.slots[self.slot_of[id as usize] as usize]
    }
}

impl SearchNode {
    fn around(clusters: &[Cluster], first: usize) -> Self {
        let mut node = Self {
            low: Vec3A::NEG_INFINITY,
            high: Vec3A::INFINITY,
            axis_low: Vec3A::INFINITY,
            axis_high: Vec3A::NEG_INFINITY,
            luminance: f32::INFINITY,
            has_omni: false,
            first: first as u32,
            last: (first + clusters.len()) as u32,
            second: 0,
        };
        for cluster in clusters {
            node.low = node.low.max(cluster.low);
            node.high = node.high.min(cluster.high);
            node.luminance = node.luminance.min(cluster.luminance);
            node.has_omni |= cluster.kind == Kind::Omni;
            if cluster.kind == Kind::Oriented {
                node.axis_low = node.axis_low.min(cluster.member_axis);
                node.axis_high = node.axis_high.max(cluster.member_axis);
            }
        }
        node
    }

    /// Returns a lower bound of the cost of a union of `cluster` with any cluster below this node, up to rounding.
    #[inline]
    fn lower_bound(&self, cluster: &Cluster, metric: &Metric) -> f32 {
        let diagonal2 = (cluster.high.max(self.high) - cluster.low.min(self.low)).length_squared();
        let spread = match cluster.kind {
            Kind::Omni if self.has_omni => 0.0,
            Kind::Oriented if self.axis_low.x <= self.axis_high.x => {
                let products = (cluster.axis * self.axis_low).max(cluster.axis * self.axis_high);
                1.0 - union_cosine(cluster, products.element_sum().min(1.0), 1.0, 0.0)
            }
            _ => 2.0,
        };
        let turn = metric.orientation2 * spread * spread;
        (cluster.luminance + self.luminance) * (metric.coincidence2 + diagonal2 + turn)
    }
}

/// Returns the function from a cluster to the coordinate with the largest extent: a position coordinate, or an axis
/// coordinate times a length.
fn widest_dimension(clusters: &[Cluster], axis_length: f32) -> impl Fn(&Cluster) -> f32 + use<> {
    let coordinates = move |c: &Cluster| {
        let axis = if c.kind == Kind::Oriented { c.member_axis } else { Vec3A::ZERO };
        [0.5 * (c.low + c.high), axis * axis_length]
    };
    let mut low = [Vec3A::INFINITY; 2];
    let mut high = [Vec3A::NEG_INFINITY; 2];
    for cluster in clusters {
        for ((low, high), c) in low.iter_mut().zip(&mut high).zip(coordinates(cluster)) {
            *low = low.min(c);
            *high = high.max(c);
        }
    }
    let extent = [high[0] - low[0], high[1] - low[1]];
    let which = usize::from(extent[1].max_element() > extent[0].max_element());
    let dimension = extent[which].max_position();
    move |c| coordinates(c)[which][dimension]
}
