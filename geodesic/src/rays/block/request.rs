//! Requests for blocks of rays.

use crate::simd::NodeRequest;

/// Quantities to be found for the rays of a block.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct BlockRequest {
    /// Number of crossings of the equatorial plane that are located. 0: they are counted, not located.
    pub crossings: usize,
    /// True if a ray with more crossings, the first of which are not opaque, is traced step by step and has them
    /// all.
    pub all_crossings: bool,
    /// The rates dw/dτ and d cos θ/dτ at crossings, and η.
    pub rates: bool,
    /// The direction in which rays escape.
    pub exit: bool,
    /// True if [`RayVisitor::take_beam`](crate::RayVisitor::take_beam) is given the beams of rays that escape; takes
    /// `exit`.
    pub beams: bool,
    /// The number of half-orbits after which rays are cut off: half-way between crossing number
    /// `half_orbits` (from 0) and the next.
    pub half_orbits: Option<u32>,
    /// True if [`RayVisitor::needs_path`](crate::RayVisitor::needs_path) decides of which rays the path is traced.
    pub paths: bool,
    /// Coarse nodes by which [`RayVisitor::needs_path_at`](crate::RayVisitor::needs_path_at) decides it too.
    pub probes: Option<NodeRequest>,
    /// The number of samples equidistant in Mino time along the whole ray, both ends included but for those at
    /// infinity; see [`RayVisitor::take_samples`](crate::RayVisitor::take_samples).
    pub samples: usize,
    /// Nodes inside spheres.
    pub nodes: Vec<SphereNodes>,
}

/// Nodes of a quadrature along rays inside a sphere.
#[derive(Debug, Clone, PartialEq)]
pub struct SphereNodes {
    /// The coarsest nodes.
    pub request: NodeRequest,
    /// Largest number of panels that a panel of the coarsest nodes is cut into.
    pub finest: u32,
}
