//! Rays of the closed form that may meet a spot, found from their positions alone.
//!
//! A spot's light is summed along a path that is traced step by step, which costs several times as
//! much as all else of a ray. Most rays that pass the spot's radii miss it: their positions in
//! closed form, a few per radian, show that in coordinates carried along with the matter they stay
//! farther from its centre than its light reaches.

use super::Spots;
use crate::emission::spot::{MatterPoint, SpotModel};
use crate::transport::optics::Optics;
use kerrlight_geodesic::simd::{NodeRequest, PanelRule, RayNodes};
use kerrlight_geodesic::vector::distance;
use kerrlight_geodesic::{Outcome, Quantities, TracedRay};

/// Pairs of a spot and a time of observation beyond which asking each of them on each node would
/// cost more than stepping.
const MOST_PAIRS: usize = 4;

/// Spots that shine closer to the hole than this, in M, are not sighted: there rays bend too much from
/// one position to the next.
const NEAREST: f64 = 4.0;

/// Positions on a panel: panels are at most 0.4 radians long.
const ORDER: usize = 4;

/// Distance from the last node of a panel to its end, over that of the last two nodes: 0.27.
const END_GAP: f64 = 0.3;

/// Largest ratio of a piece of path to its chord, in coordinates that are sheared.
const SLACK: f64 = 1.25;

/// Positions are needed as far outside the spots as the gap at the end of a panel, in M.
const MARGIN: f64 = 0.5;

impl Spots {
    /// Returns whether it is found from rays' positions which of them may meet spots, at so many times
    /// of observation.
    pub fn sight(&self, optics: &Optics, times: usize) -> bool {
        let far = self.models.iter().all(|spot| spot.shell()[0] >= NEAREST);
        far && !optics.one_by_one && (1..=MOST_PAIRS).contains(&(self.models.len() * times))
    }

    /// The nodes that sighting takes.
    pub fn probes(&self, optics: &Optics) -> NodeRequest {
        let reach = self.models.iter().map(|spot| spot.shell()[1]).fold(0.0, f64::max);
        NodeRequest {
            radius: reach + MARGIN,
            rule: PanelRule::new(ORDER),
            split: 1,
            quantities: Quantities { azimuth: true, time: optics.slow_light, velocity: false },
        }
    }

    /// Returns whether a ray with these nodes may meet a spot at one of `times`.
    pub fn may_be_met(
        &self,
        optics: &Optics,
        ray: &TracedRay,
        nodes: &RayNodes<'_>,
        times: &[f64],
    ) -> bool {
        let (falls, slow_light) = (ray.outcome == Outcome::Captured, optics.slow_light);
        times.iter().any(|observed| {
            let (observed, nodes) = (*observed, *nodes);
            let sees = |spot| Sighting { spot, observed, slow_light, nodes, falls }.may_meet();
            self.models.iter().any(sees)
        })
    }
}

/// One ray asked about one spot at one time of observation.
struct Sighting<'a> {
    spot: &'a SpotModel,
    observed: f64,
    slow_light: bool,
    nodes: RayNodes<'a>,
    /// True if the ray ends at the horizon.
    falls: bool,
}

/// A node as a spot sees it.
struct Seen {
    node: usize,
    at: MatterPoint,
    /// A lower bound of its distance from the spot's centre.
    least: f64,
    /// The position, carried along with the matter and as it is, once it is needed.
    positions: Option<[[f64; 3]; 2]>,
}

impl Sighting<'_> {
    fn may_meet(&self) -> bool {
        let count = self.nodes.radius.len();
        if count < 2 {
            return count == 1;
        }
        let mut before = self.seen(0);
        for k in 1..count {
            let mut now = self.seen(k);
            if self.may_meet_between(&mut before, &mut now, k + 1 == count) {
                return true;
            }
            before = now;
        }
        false
    }

    /// Returns whether the spot may shine between two nodes that follow each other, or before the
    /// first or after the last node of the ray.
    fn may_meet_between(&self, before: &mut Seen, now: &mut Seen, last: bool) -> bool {
        let [low, high] = self.spot.shell();
        let starts = before.node == 0 && before.at.radius < high;
        // A falling ray that is inside of the shell does not come back.
        let ends = last && now.at.radius < high && !(self.falls && now.at.radius <= low);
        let may = |apart: [f64; 2], length: f64| {
            let (gap, reach) = (END_GAP * length, self.spot.reach());
            // By the triangle inequality the way between comes as near as (d₁ + d₂ − length)/2.
            apart[0] + apart[1] <= 2.0 * reach + length
                || starts && apart[0] - gap <= reach
                || ends && apart[1] - gap <= reach
        };
        let sheared = self.spot.sheared_length([before.at, now.at]);
        // A node stands for half of the way to either neighbour, about.
        let weights = self.nodes.weight[before.node] + self.nodes.weight[now.node];
        let longest = 0.5 * weights * self.spot.stretch();
        // Bounds first: few nodes come so near that their positions are worth a sine.
        if !may([before.least, now.least], SLACK * (longest + sheared)) {
            return false;
        }
        let [a, b] = [before, now].map(|seen| self.positions(seen));
        let apart = [a, b].map(|[carried, _]| self.spot.offset(carried));
        may(apart, SLACK * (distance(a[1], b[1]) + sheared))
    }

    fn seen(&self, node: usize) -> Seen {
        let radius = self.nodes.radius[node];
        let delay = if self.slow_light { self.nodes.delay[node] } else { 0.0 };
        let at = self.spot.matter_at(radius, self.observed - delay);
        let least = self.spot.least_offset(radius, radius * self.nodes.cos_theta[node]);
        Seen { node, at, least, positions: None }
    }

    fn positions(&self, seen: &mut Seen) -> [[f64; 3]; 2] {
        *seen.positions.get_or_insert_with(|| {
            let (radius, u) = (seen.at.radius, self.nodes.cos_theta[seen.node]);
            let (sin, cos) = self.nodes.azimuth[seen.node].sin_cos();
            let s = ((1.0 - u) * (1.0 + u)).sqrt();
            let position = [radius * s * cos, radius * s * sin, radius * u];
            [self.spot.carried(position, &seen.at), position]
        })
    }
}
