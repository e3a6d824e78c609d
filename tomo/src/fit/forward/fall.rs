//! Matter that changes its radius: its place at the reference time.

use super::sightlines::Sightlines;
use kerrlight_geodesic::interrupt;
use kerrlight_geodesic::vector::norm;
use kerrlight_render::dynamics::infall::{Falling, Origin};
use rayon::prelude::*;
use std::sync::Arc;

/// The nodes of all rays on the fall of their matter.
#[derive(Clone, Debug)]
pub(in crate::fit) struct Fall {
    flow: Arc<Falling>,
    origins: Vec<Origin>,
    limits: [f64; 2],
}

impl Fall {
    /// Takes the nodes of sight lines.
    pub fn new(flow: &Arc<Falling>, lines: &Sightlines) -> Self {
        let origin = |k: usize| {
            interrupt::check();
            flow.origin(norm([0, 1, 2].map(|c| lines.position[c][k])))
        };
        Self {
            flow: flow.clone(),
            origins: (0..lines.points()).into_par_iter().map(origin).collect(),
            limits: lines.limits.unwrap_or([0.0, f64::INFINITY]),
        }
    }

    /// Bytes of its nodes.
    pub fn bytes(&self) -> usize {
        size_of_val(&*self.origins)
    }

    /// The flow, where its nodes are, and the least and largest radius of the region (M).
    #[cfg(feature = "wgpu")]
    pub fn parts(&self) -> (&Falling, &[Origin], [f64; 2]) {
        (&self.flow, &self.origins, self.limits)
    }

    /// Returns the factor by which node number k is stretched, and the angle by which it is turned, to where its
    /// matter was `elapsed` (M) before: no numbers where that is outside of the region, so that nothing shines.
    #[inline]
    pub fn before(&self, node: usize, elapsed: f64) -> [f64; 2] {
        let origin = &self.origins[node];
        let [stretch, angle] = self.flow.before(origin, elapsed);
        let ([least, most], radius) = (self.limits, stretch * origin.radius());
        if radius >= least && radius <= most { [stretch, angle] } else { [f64::NAN; 2] }
    }
}
