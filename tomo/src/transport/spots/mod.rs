//! Light of the hot spots.

mod meeting;
mod sighting;
mod trees;

pub(super) use meeting::Met;
pub(super) use trees::{SpotSpans, SpotTree};

use super::polarized::share;
use super::result::{Accumulator, Place};
use super::volume::DepthProfile;
use super::{PreparedScene, Scratch};
use crate::emission::spot::{Comoving, SpotModel};
use kerrlight_geodesic::flow::rotating_redshift;
use kerrlight_geodesic::quadrature::gauss_4;
use kerrlight_geodesic::{Path, PathPoint, Ray, ScreenPoint};
use meeting::join;

impl PreparedScene {
    /// Light of the spots between the observer and Mino time `end`: ∫ g^{2+α} j Σ dτ. Spots are
    /// summed in their order and piece by piece as [`add_every_spot`](Self::add_every_spot) does,
    /// less the pieces on which the tree shows that a spot does not shine: the same to the last bit.
    pub(super) fn add_spots(
        &self,
        time: f64,
        tree: &SpotTree,
        (ray, screen): (&Ray, Option<ScreenPoint>),
        scratch: &mut Scratch,
        end: f64,
        gathered: &mut Accumulator,
    ) {
        if !tree.can_be_met(ray) {
            return;
        }
        self.meet_spots(time, tree, ray, scratch, end);
        let Scratch { path, intervals, met, pieces, volume, .. } = scratch;
        let along = AlongRay { lambda: ray.lambda, screen, depths: &volume.profile };
        for same in met.chunk_by(|a, b| a.spot == b.spot) {
            join(same, pieces);
            let spot = &self.spots[same[0].spot as usize];
            self.add_spot(
                SpotLight::new(spot, time, pieces, along),
                path,
                intervals,
                end,
                gathered,
            );
        }
    }

    /// As [`add_spots`](Self::add_spots), with every spot asked along the whole ray.
    pub(super) fn add_every_spot(
        &self,
        time: f64,
        (ray, screen): (&Ray, Option<ScreenPoint>),
        scratch: &mut Scratch,
        end: f64,
        gathered: &mut Accumulator,
    ) {
        let Scratch { path, intervals, volume, .. } = scratch;
        let along = AlongRay { lambda: ray.lambda, screen, depths: &volume.profile };
        for spot in &self.spots {
            let light = SpotLight::new(spot, time, &[[0.0, f64::INFINITY]], along);
            self.add_spot(light, path, intervals, end, gathered);
        }
    }

    /// Light of one spot on the pieces of the path where it may shine.
    fn add_spot(
        &self,
        mut light: SpotLight<'_>,
        path: &Path,
        intervals: &mut Vec<[f64; 2]>,
        end: f64,
        gathered: &mut Accumulator,
    ) {
        let [lo, hi] = light.spot.shell();
        let before = gathered.intensity;
        path.intervals_within(lo.max(self.hole.horizon()), hi, intervals);
        for &[from, to] in intervals.iter() {
            let to = to.min(end);
            if from < to {
                self.add_stretch(path, &mut light, from, to, gathered);
            }
        }
        if let Some((_, point)) = light.brightest {
            gathered.mark(gathered.intensity - before, Place::of_point(&point));
        }
    }

    /// A segment of the path inside the spot's shell, cut so that no piece turns by much.
    fn add_stretch(
        &self,
        path: &Path,
        light: &mut SpotLight<'_>,
        from: f64,
        to: f64,
        gathered: &mut Accumulator,
    ) {
        let pieces = ((to - from) * path.angular_rate() / LARGEST_TURN).ceil().max(1.0);
        let step = (to - from) / pieces;
        let mut last = None;
        for k in 0..pieces as usize {
            let [start, end] = [k, k + 1].map(|k| from + step * k as f64);
            if !light.can_shine(start, end) {
                last = None;
                continue;
            }
            let start = last.unwrap_or_else(|| self.node(light, path.at(start)));
            let end = self.node(light, path.at(end));
            self.add_piece(path, light, [&start, &end], 0, gathered);
            last = Some(end);
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
        gathered: &mut Accumulator,
    ) {
        let (from, to) = (start.point.mino_time, end.point.mino_time);
        if !light.can_shine(from, to) {
            return;
        }
        let carried = [&start.carried, &end.carried];
        let length = light.spot.comoving_length([start.position, end.position], carried);
        if light.spot.is_missed(carried, length) {
            return;
        }
        if length > light.spot.sigma() && depth < DEEPEST {
            let middle = self.node(light, path.at(0.5 * (from + to)));
            self.add_piece(path, light, [start, &middle], depth + 1, gathered);
            self.add_piece(path, light, [&middle, end], depth + 1, gathered);
            return;
        }
        for (mino_time, weight) in gauss_4(from, to) {
            self.add_node(&self.node(light, path.at(mino_time)), weight, light, gathered);
        }
    }

    /// One node of the quadrature.
    fn add_node(
        &self,
        node: &SpotNode,
        weight: f64,
        light: &mut SpotLight<'_>,
        gathered: &mut Accumulator,
    ) {
        let emissivity = light.spot.emissivity(&node.carried, node.time);
        if emissivity <= 0.0 {
            return;
        }
        let point = &node.point;
        let r = point.radius();
        let g = match self.spectral_index {
            Some(_) => rotating_redshift(&self.hole, point, light.spot.angular_velocity(r)),
            None => Some(1.0),
        };
        // Where matter cannot move like this there is none.
        let Some(g) = g else { return };
        let mut boost = self.spectral_index.map_or(1.0, |index| g.powf(2.0 + index));
        let path_length = self.hole.sigma(r, point.cos_theta()) * weight;
        let AlongRay { lambda, screen, depths } = &light.along;
        // Gas in front of it.
        let depth = depths.at(point.mino_time);
        if depth > 0.0 {
            boost *= (-depth).exp();
        }
        if let Some(screen) = screen {
            let omega = light.spot.angular_velocity(r);
            let stokes = self.polarized_spot(point, *lambda, omega, screen);
            boost *= stokes.i;
            gathered.add_stokes(boost * emissivity * path_length, share(&stokes));
        }
        gathered.add(boost * emissivity * path_length, g, light.spot.color);
        let density = boost * emissivity;
        if light.brightest.is_none_or(|(most, _)| density > most) {
            light.brightest = Some((density, *point));
        }
    }
}

/// What is known of the ray that spots are seen along.
#[derive(Clone, Copy)]
struct AlongRay<'a> {
    lambda: f64,
    /// Its place on the screen, if light is polarised.
    screen: Option<ScreenPoint>,
    /// Optical depth of the gas.
    depths: &'a DepthProfile,
}

/// One spot's light along one ray.
struct SpotLight<'a> {
    spot: &'a SpotModel,
    /// Time of observation.
    observed: f64,
    /// Where it may shine, as intervals of Mino time in order.
    pieces: &'a [[f64; 2]],
    along: AlongRay<'a>,
    /// The brightest point, and its emission per length.
    brightest: Option<(f64, PathPoint)>,
}

impl<'a> SpotLight<'a> {
    fn new(
        spot: &'a SpotModel,
        observed: f64,
        pieces: &'a [[f64; 2]],
        along: AlongRay<'a>,
    ) -> Self {
        SpotLight { spot, observed, pieces, along, brightest: None }
    }

    fn can_shine(&self, from: f64, to: f64) -> bool {
        let behind = self.pieces.partition_point(|piece| piece[1] < from);
        self.pieces.get(behind).is_some_and(|piece| piece[0] <= to)
    }
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
