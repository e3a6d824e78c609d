//! Light of the hot spots.

use super::glimpse::{Gather, Place};
use super::{Scratch, Stage};
use crate::emission::spot::{Comoving, SpotModel};
use kerrlight_geodesic::flow::rotating_redshift;
use kerrlight_geodesic::quadrature::gauss_4;
use kerrlight_geodesic::{Path, PathPoint};

impl Stage {
    /// Light of the spots between the observer and Mino time `end`: ∫ g^{2+α} j Σ dτ.
    pub(super) fn add_spots(
        &self,
        time: f64,
        path: &Path,
        scratch: &mut Scratch,
        end: f64,
        gather: &mut Gather,
    ) {
        for spot in &self.spots {
            let [lo, hi] = spot.shell();
            let lo = lo.max(self.hole.horizon());
            let mut total =
                SpotLight { spot, observed: time, before: gather.intensity, brightest: None };
            path.intervals_within(lo, hi, &mut scratch.intervals);
            for &[from, to] in &scratch.intervals {
                let to = to.min(end);
                if from < to {
                    self.add_stretch(path, &mut total, from, to, gather);
                }
            }
            if let Some((_, point)) = total.brightest {
                gather.mark(gather.intensity - total.before, Place::of_point(&point));
            }
        }
    }

    /// A stretch of the path inside the spot's shell, cut so that no piece turns by much.
    fn add_stretch(
        &self,
        path: &Path,
        light: &mut SpotLight<'_>,
        from: f64,
        to: f64,
        gather: &mut Gather,
    ) {
        let pieces = ((to - from) * path.angular_rate() / LARGEST_TURN).ceil().max(1.0);
        let step = (to - from) / pieces;
        let mut start = self.node(light, path.at(from));
        for k in 1..=pieces as usize {
            let end = self.node(light, path.at(from + step * k as f64));
            self.add_piece(path, light, [&start, &end], 0, gather);
            start = end;
        }
    }

    fn node(&self, light: &SpotLight<'_>, point: PathPoint) -> SpotNode {
        let (position, time) = (point.cartesian(), self.emission_time(light.observed, &point));
        SpotNode { point, position, time, carried: light.spot.comoving(position, time) }
    }

    /// Halves a piece until it is short against the spot or lies outside of it, then sums.
    fn add_piece(
        &self,
        path: &Path,
        light: &mut SpotLight<'_>,
        [start, end]: [&SpotNode; 2],
        depth: u32,
        gather: &mut Gather,
    ) {
        let carried = [&start.carried, &end.carried];
        let length = light.spot.comoving_length([start.position, end.position], carried);
        if light.spot.is_missed(carried, length) {
            return;
        }
        let (from, to) = (start.point.mino_time, end.point.mino_time);
        if length > light.spot.sigma() && depth < DEEPEST {
            let middle = self.node(light, path.at(0.5 * (from + to)));
            self.add_piece(path, light, [start, &middle], depth + 1, gather);
            self.add_piece(path, light, [&middle, end], depth + 1, gather);
            return;
        }
        for (mino_time, weight) in gauss_4(from, to) {
            self.add_node(&self.node(light, path.at(mino_time)), weight, light, gather);
        }
    }

    /// One node of the quadrature.
    fn add_node(
        &self,
        node: &SpotNode,
        weight: f64,
        light: &mut SpotLight<'_>,
        gather: &mut Gather,
    ) {
        let emissivity = light.spot.emissivity(&node.carried, node.time);
        if emissivity <= 0.0 {
            return;
        }
        let point = &node.point;
        let r = point.radius();
        let g = match self.redshift {
            Some(_) => rotating_redshift(&self.hole, point, light.spot.angular_velocity(r)),
            None => Some(1.0),
        };
        // Where matter cannot move like this there is none.
        let Some(g) = g else { return };
        let boost = self.redshift.map_or(1.0, |index| g.powf(2.0 + index));
        let path_length = self.hole.sigma(r, point.cos_theta()) * weight;
        gather.add(boost * emissivity * path_length, g, light.spot.color);
        let density = boost * emissivity;
        if light.brightest.is_none_or(|(most, _)| density > most) {
            light.brightest = Some((density, *point));
        }
    }
}

/// One spot's light along one ray.
struct SpotLight<'a> {
    spot: &'a SpotModel,
    /// Time of observation.
    observed: f64,
    /// Intensity gathered before this spot.
    before: f64,
    /// The brightest point, and its emission per length.
    brightest: Option<(f64, PathPoint)>,
}

/// A point of the path as a spot sees it.
struct SpotNode {
    point: PathPoint,
    position: [f64; 3],
    /// When the light that is seen passed here.
    time: f64,
    carried: Comoving,
}

/// Largest angle in radians by which a piece of path may turn before it is compared with
/// a spot.
const LARGEST_TURN: f64 = 0.5;

/// A piece is halved at most this often.
const DEEPEST: u32 = 24;
