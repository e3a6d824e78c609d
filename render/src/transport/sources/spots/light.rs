//! Light of one spot along one ray.

use super::DEEPEST;
use crate::emission::spot::{Comoving, SpotModel};
use crate::transport::layers::Origin;
use crate::transport::optics::Optics;
use crate::transport::polarized::{PolarizedRay, share};
use crate::transport::result::{Accumulator, Place};
use crate::transport::sources::media::DepthProfile;
use kerrlight_geodesic::flow::rotating_redshift;
use kerrlight_geodesic::quadrature::gauss_legendre;
use kerrlight_geodesic::{PathOfRay, PathPoint};
use std::sync::LazyLock;

/// The ray along which spots are seen.
#[derive(Debug, Clone, Copy)]
pub(in crate::transport) struct SpotRay<'a> {
    pub optics: &'a Optics,
    pub along: PathOfRay<'a>,
    /// Mino time of the last light.
    pub end: f64,
    pub polarized: Option<PolarizedRay<'a>>,
    /// Optical depth of the gas.
    pub depths: &'a DepthProfile,
}

/// One spot's light along one ray.
pub(super) struct SpotLight<'a> {
    spot: &'a SpotModel,
    /// Its number among the spots.
    number: u32,
    /// Time of observation.
    observed: f64,
    /// Pieces in which it may shine, as intervals of Mino time in order.
    pieces: &'a [[f64; 2]],
    seen: &'a SpotRay<'a>,
    /// The brightest point, and its emission per length.
    brightest: Option<(f64, PathPoint)>,
}

/// A point of the path as a spot sees it.
struct SpotNode {
    point: PathPoint,
    position: [f64; 3],
    /// Time at which the light that is seen passed here.
    time: f64,
    carried: Comoving,
}

/// Largest angle in radians by which a piece of path may turn before it is compared with
/// a spot.
const LARGEST_TURN: f64 = 0.5;

/// Longest piece that is summed by one rule, in units of σ.
const LONGEST: f64 = 3.0;

/// The same where matter cannot turn with the spot at one end of it.
const TORN: f64 = 0.02;

/// Longest piece over the radius.
const PART: f64 = 0.5;

/// Gauss–Legendre rules for pieces of at most 1, 1.5, 2, 2.5 and 3 σ, with 4 to 8 nodes. The error of n nodes on a
/// piece of h σ of a Gaussian is below (2n − 1)!! h^(2n + 1) (n!)⁴ / ((2n + 1) ((2n)!)³) of σ: 6e-8 or less.
static RULES: LazyLock<[Vec<(f64, f64)>; 5]> =
    LazyLock::new(|| [4, 5, 6, 7, 8].map(gauss_legendre));

/// The rule for a piece of this length in units of σ.
fn rule(length: f64) -> &'static [(f64, f64)] {
    let steps = (2.0 * length).ceil() - 2.0;
    &RULES[steps.clamp(0.0, 4.0) as usize]
}

impl<'a> SpotLight<'a> {
    /// The light of a spot, seen at a time of observation, on `pieces` of a ray.
    pub fn new(
        (number, spot): (u32, &'a SpotModel),
        observed: f64,
        pieces: &'a [[f64; 2]],
        seen: &'a SpotRay<'a>,
    ) -> Self {
        SpotLight { spot, number, observed, pieces, seen, brightest: None }
    }

    /// Adds the light.
    pub fn add(mut self, intervals: &mut Vec<[f64; 2]>, light: &mut Accumulator) {
        let [lo, hi] = self.spot.shell();
        let before = light.intensity;
        let horizon = self.seen.optics.hole.horizon();
        self.seen.along.path.intervals_within(lo.max(horizon), hi, intervals);
        for &[from, to] in intervals.iter() {
            let to = self.lit_until(from, to.min(self.seen.end));
            if from < to {
                self.add_interval(from, to, light);
            }
        }
        if let Some((_, point)) = self.brightest {
            let source = self.seen.optics.numbering.spots + self.number;
            let origin = Origin { source, mino_time: point.mino_time };
            light.mark(light.intensity - before, Place::of_point(&point), origin);
        }
    }

    /// The end of a part of the path on which the spot shines already: light that left before it was sheared is none. Sums over
    /// pieces that hold that moment would be off by its share of them.
    fn lit_until(&self, from: f64, to: f64) -> f64 {
        let Some(since) = self.spot.sheared_since() else { return to };
        let path = self.seen.along.path;
        let is_dark = |mino_time: f64| {
            self.seen.optics.emission_time(self.observed, &path.at(mino_time)) < since
        };
        if from >= to || !is_dark(to) {
            return to;
        }
        // The backward ray meets ever earlier times.
        let (mut lit, mut dark) = (from, to);
        while dark - lit > 1e-12 * to {
            let middle = 0.5 * (lit + dark);
            if middle <= lit || middle >= dark {
                break;
            }
            if is_dark(middle) { dark = middle } else { lit = middle }
        }
        lit
    }

    fn can_shine(&self, from: f64, to: f64) -> bool {
        let behind = self.pieces.partition_point(|piece| piece[1] < from);
        self.pieces.get(behind).is_some_and(|piece| piece[0] <= to)
    }

    /// A part of the path inside the spot's shell, cut so that no piece turns by much.
    fn add_interval(&mut self, from: f64, to: f64, light: &mut Accumulator) {
        let rate = self.seen.along.path.angular_rate();
        let pieces = ((to - from) * rate / LARGEST_TURN).ceil().max(1.0);
        let step = (to - from) / pieces;
        let mut last = None;
        for k in 0..pieces as usize {
            let [start, end] = [k, k + 1].map(|k| from + step * k as f64);
            if !self.can_shine(start, end) {
                last = None;
                continue;
            }
            let start = last.unwrap_or_else(|| self.node(start));
            let end = self.node(end);
            self.add_piece([&start, &end], 0, light);
            last = Some(end);
        }
    }

    fn node(&self, mino_time: f64) -> SpotNode {
        let point = self.seen.along.path.at(mino_time);
        let position = point.cartesian();
        let time = self.seen.optics.emission_time(self.observed, &point);
        SpotNode { point, position, time, carried: self.spot.comoving(position, time) }
    }

    /// Halves a piece until it is short against the spot or lies outside of it, then sums.
    fn add_piece(&mut self, [start, end]: [&SpotNode; 2], depth: u32, light: &mut Accumulator) {
        let (from, to) = (start.point.mino_time, end.point.mino_time);
        if !self.can_shine(from, to) {
            return;
        }
        let carried = [&start.carried, &end.carried];
        let length = self.spot.comoving_length([start.position, end.position], carried);
        if self.spot.is_missed(carried, length) {
            return;
        }
        let longest = match self.is_torn([start, end]) {
            true => TORN * self.spot.sigma(),
            false => LONGEST * self.spot.sigma(),
        };
        // Redshifts change with the radius as the spot does over its width.
        let nearest = start.point.radius().min(end.point.radius());
        if length > longest.min(PART * nearest) && depth < DEEPEST {
            let middle = self.node(0.5 * (from + to));
            self.add_piece([start, &middle], depth + 1, light);
            self.add_piece([&middle, end], depth + 1, light);
            return;
        }
        for (part, weight) in rule(length / self.spot.sigma()) {
            let node = self.node(from + (to - from) * part);
            self.add_node(&node, (to - from) * weight, light);
        }
    }

    /// Returns whether matter can turn with the spot at one end alone.
    fn is_torn(&self, ends: [&SpotNode; 2]) -> bool {
        let optics = self.seen.optics;
        let shines = |node: &SpotNode| {
            let omega = self.spot.angular_velocity(node.point.radius());
            rotating_redshift(&optics.hole, &node.point, omega).is_some()
        };
        optics.spectral_index.is_some() && shines(ends[0]) != shines(ends[1])
    }

    /// One node of the quadrature.
    fn add_node(&mut self, node: &SpotNode, weight: f64, light: &mut Accumulator) {
        let emissivity = self.spot.emissivity(&node.carried, node.time);
        if emissivity <= 0.0 {
            return;
        }
        let (point, optics) = (&node.point, self.seen.optics);
        let r = point.radius();
        let omega = || self.spot.angular_velocity(r);
        let g = match optics.spectral_index {
            Some(_) => rotating_redshift(&optics.hole, point, omega()),
            None => Some(1.0),
        };
        // Where matter cannot move like this there is none.
        let Some(g) = g else { return };
        let mut boost = optics.spectral_index.map_or(1.0, |index| g.powf(2.0 + index));
        let path_length = optics.hole.sigma(r, point.cos_theta()) * weight;
        // Gas in front of it.
        let depth = self.seen.depths.at(point.mino_time);
        if depth > 0.0 {
            boost *= (-depth).exp();
        }
        if let Some(polarized) = &self.seen.polarized {
            let stokes = polarized.of_spot(point, omega());
            boost *= stokes.i;
            light.add_stokes(boost * emissivity * path_length, share(&stokes));
        }
        light.add(boost * emissivity * path_length, g, self.spot.color, point.mino_time);
        let density = boost * emissivity;
        if self.brightest.is_none_or(|(most, _)| density > most) {
            self.brightest = Some((density, *point));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A Gaussian in pieces of every length, against the error function: erf(6/√2) = 1 − 1.97e-9.
    #[test]
    fn exact_rules_sum_a_gaussian() {
        for pieces in [4, 5, 6, 7, 9, 12, 16, 24] {
            let h = 12.0 / f64::from(pieces);
            let sum = |piece: i32| -> f64 {
                let from = -6.0 + h * f64::from(piece);
                let at = |(part, weight): &(f64, f64)| {
                    let x = from + h * part;
                    h * weight * (-0.5 * x * x).exp()
                };
                rule(h).iter().map(at).sum()
            };
            let sum: f64 = (0..pieces).map(sum).sum::<f64>() / core::f64::consts::TAU.sqrt();
            assert!((sum - 1.0 + 1.97e-9).abs() < 6e-8, "{pieces} pieces: {sum}");
        }
    }
}
