//! Worlds of a grid over some parameters, each with the volume that explains the data best in it and, where further
//! parameters are free, with the best of these.

use super::explore::{Exploration, Explored};
use super::problem::{Free, WorldProblem};
use super::{Parameter, World, WorldWatch};
use crate::Error;
use kerrlight_common::simd::Float;
use rayon::prelude::*;

/// A parameter with the values that are tried.
#[derive(Clone, Debug, PartialEq)]
pub struct Scanned {
    /// Which.
    pub parameter: Parameter,
    /// Growing, in [`World`]'s units.
    pub values: Vec<f64>,
}

impl Scanned {
    /// Values at equal distances from the first to the last.
    pub fn even(parameter: Parameter, [from, to]: [f64; 2], count: usize) -> Self {
        let step = (to - from) / (count.max(2) - 1) as f64;
        Self { parameter, values: (0..count).map(|k| from + step * k as f64).collect() }
    }

    /// Distance of neighbouring values.
    pub fn step(&self) -> f64 {
        self.values.windows(2).map(|pair| pair[1] - pair[0]).fold(0.0, f64::max)
    }
}

/// A world of the grid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScanPoint {
    /// The world; parameters that are free beside the grid have their best values.
    pub world: World,
    /// Half of χ² times the problem's scale, and −ln of the priors' densities.
    pub value: f64,
    /// χ² over the number of data.
    pub reduced_chi2: f64,
}

/// All worlds of a grid.
#[derive(Clone, Debug, PartialEq)]
pub struct WorldScan {
    /// The grid.
    pub over: Vec<Scanned>,
    /// Its worlds, the last parameter fastest.
    pub points: Vec<ScanPoint>,
}

/// Worlds that are solved between two looks at the watch.
const AT_A_TIME: usize = 8;

impl WorldScan {
    /// The world with the least value; none of an empty grid.
    pub fn best(&self) -> Option<&ScanPoint> {
        self.points.iter().min_by(|a, b| a.value.total_cmp(&b.value))
    }

    /// Least value over all other parameters at each value of those with the numbers `kept`, the last fastest.
    pub fn profile(&self, kept: &[usize]) -> Vec<f64> {
        let size = kept.iter().map(|k| self.over[*k].values.len()).product();
        let mut least = vec![f64::INFINITY; size];
        for (at, point) in self.points.iter().enumerate() {
            let places = self.places(at);
            let to = kept.iter().fold(0, |to, k| to * self.over[*k].values.len() + places[*k]);
            least[to] = least[to].min(point.value);
        }
        least
    }

    /// The place of a world along each axis of the grid.
    fn places(&self, mut at: usize) -> Vec<usize> {
        let mut places = vec![0; self.over.len()];
        for (place, scanned) in places.iter_mut().zip(&self.over).rev() {
            *place = at % scanned.values.len();
            at /= scanned.values.len();
        }
        places
    }
}

impl<T: Float + Default> WorldProblem<'_, T> {
    /// All worlds of a grid; free parameters beside those of the grid are looked for in each of them, as `how` says,
    /// from the middle of their priors. None if it was cancelled by the watch, which is told the number of worlds and
    /// the least value so far.
    ///
    /// # Errors
    /// If a number is out of its range, or a χ² is not finite.
    pub fn scan(
        &self,
        over: &[Scanned],
        how: &Exploration,
        watch: &mut WorldWatch<'_>,
    ) -> Result<Option<WorldScan>, Error> {
        let is_scanned = |free: &&Free| over.iter().any(|s| s.parameter == free.parameter);
        let others: Vec<Free> = self.free.iter().filter(|f| !is_scanned(f)).copied().collect();
        let mut scan = WorldScan { over: over.to_vec(), points: Vec::new() };
        let count: usize = over.iter().map(|scanned| scanned.values.len()).product();
        let world = |at: usize| {
            let places = scan.places(at).into_iter().zip(over);
            places.fold(self.known, |world, (k, s)| world.with(s.parameter, s.values[k]))
        };
        let worlds: Vec<World> = (0..count).map(world).collect();
        let mut least = f64::INFINITY;
        for (at, worlds) in worlds.chunks(AT_A_TIME).enumerate() {
            let points: Result<Vec<Option<ScanPoint>>, Error> =
                worlds.par_iter().map(|world| self.best_with(*world, &others, how)).collect();
            let Some(points) = points?.into_iter().collect::<Option<Vec<_>>>() else {
                return Ok(None);
            };
            least = points.iter().map(|point| point.value).fold(least, f64::min);
            scan.points.extend(points);
            if !watch(at * AT_A_TIME + worlds.len(), least) {
                return Ok(None);
            }
        }
        Ok(Some(scan))
    }

    /// The best values of `others` in a world.
    fn best_with(
        &self,
        world: World,
        others: &[Free],
        how: &Exploration,
    ) -> Result<Option<ScanPoint>, Error> {
        if others.is_empty() {
            let found = self.solve(world)?;
            let reduced_chi2 = self.left(&found)?;
            return Ok(Some(ScanPoint { world, value: found.value, reduced_chi2 }));
        }
        let inner = WorldProblem { known: world, free: others, ..*self };
        let start = inner.starts(1)[0];
        let Some(Explored { best, .. }) = inner.explore((start, None), how, &mut |_, _| true)?
        else {
            return Ok(None);
        };
        let reduced_chi2 = self.left(&best)?;
        Ok(Some(ScanPoint { world: best.world, value: best.value, reduced_chi2 }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_profiles_are_the_least_values() {
        let over = vec![
            Scanned::even(Parameter::Spin, [-0.5, 0.5], 3),
            Scanned::even(Parameter::Inclination, [0.2, 0.5], 4),
            Scanned::even(Parameter::Xi, [0.5, 0.9], 2),
        ];
        assert!((over[1].step() - 0.1).abs() < 1e-12);
        let mut scan = WorldScan { over, points: Vec::new() };
        let value = |[a, b, c]: [usize; 3]| ((7 * a + 5 * b + 3 * c) % 11) as f64;
        let all = (0..24).map(|at| [at / 8, at / 2 % 4, at % 2]);
        let world = World::new(0.0, 0.5);
        let point = |value| ScanPoint { world, value, reduced_chi2: 1.0 };
        scan.points = all.map(|places| point(value(places))).collect();
        let of_pair = scan.profile(&[0, 2]);
        for (at, found) in of_pair.iter().enumerate() {
            let expected = (0..4).map(|b| value([at / 2, b, at % 2])).fold(f64::INFINITY, f64::min);
            assert_eq!(*found, expected, "{at}");
        }
        assert_eq!(scan.profile(&[1]).len(), 4);
        assert_eq!(scan.best().unwrap().value, 0.0);
    }
}
