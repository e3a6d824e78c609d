//! Starts of a problem that is not convex: lit fields, scaled to the data; the best after some iterations.

use super::Ending;
use super::error::LinearError;
use super::initial_fields::{Around, InitialField, Trials};
use super::objective::Objective;
use super::run::Run;
use super::scaled::Convex;
use crate::Error;
use crate::optimise::dot;
use kerrlight_common::simd::Float;

/// Newton steps to the best scale: one is enough where χ² is quadratic in it, as that of amplitudes is.
const SCALINGS: usize = 3;

impl<T: Float> Run<'_, '_, '_, T> {
    /// The least of the descents from lit fields; none if the watch wanted no more.
    pub fn lit(
        &mut self,
        objective: &mut Objective<'_, '_, T>,
        trials: Trials,
    ) -> Result<Option<InitialField>, Error> {
        let starts = self.starts(objective, trials)?;
        let mut best: Option<InitialField> = None;
        for (_, start) in starts {
            let end = self.minimise(objective, &start, trials.iterations);
            if end.ending == Ending::Cancelled {
                return Ok(None);
            }
            if best.as_ref().is_none_or(|best| end.value < best.value) {
                best = Some(InitialField { start, x: end.x, value: end.value });
            }
        }
        Ok(best.map(Some).ok_or_else(|| LinearError::NoLight(objective.data.names()))?)
    }

    /// The best spots and the wide fields, each with its value; none that a dark field is better than.
    fn starts(
        &mut self,
        objective: &mut Objective<'_, '_, T>,
        trials: Trials,
    ) -> Result<Vec<(f64, Vec<f64>)>, Error> {
        let around = Around::new(&objective.operator.walk.voxels, self.problem.axis);
        let seen = objective.operator.seen();
        // Closure quantities are not defined in the dark: any lit field is better there.
        let dark = match objective.data.is_scale_free() {
            true => f64::INFINITY,
            false => objective.nothing().0,
        };
        let quiescent = objective.terms.quiescent;
        let beside = vec![0.0; objective.operator.active.beside];
        let mut scaled = |shape: Vec<f64>, image: &[f64]| {
            let mut shape = objective.terms.change.steady(&shape);
            shape.extend_from_slice(image);
            let mut shape = objective.operator.active.gather(&shape);
            // Where no ray passes data have no slope: light would stay there as it was put.
            shape.iter_mut().zip(&seen).for_each(|(x, seen)| *x *= f64::from(u8::from(*seen)));
            self.scaled(objective, &shape)
        };
        let wide = around.wide().into_iter().map(|shape| scaled(shape, &beside));
        let mut wide = wide.collect::<Result<Vec<_>, _>>()?;
        // What does not move may explain the data alone.
        if let Some(image) = quiescent {
            wide.push(scaled(around.dark(), &image.round())?);
        }
        let spot = |k: usize| scaled(around.spot(trials.spots, k), &beside);
        let spots = (0..trials.spots.count()).map(spot);
        let spots = spots.collect::<Result<Vec<_>, _>>()?;
        // A dark field whose χ² is not a number is not the better one.
        let lit = |start: &(f64, Vec<f64>)| start.0 < dark || dark.is_nan();
        let mut spots: Vec<_> = spots.into_iter().flatten().filter(lit).collect();
        spots.sort_by(|a, b| a.0.total_cmp(&b.0));
        spots.truncate(trials.best);
        spots.extend(wide.into_iter().flatten().filter(lit));
        Ok(spots)
    }

    /// A field of this shape, as bright as explains the data best, or as the given flux says where data do not know
    /// it, with its value; none if no ray sees it.
    fn scaled(
        &self,
        objective: &mut Objective<'_, '_, T>,
        shape: &[f64],
    ) -> Result<Option<(f64, Vec<f64>)>, Error> {
        let largest = shape.iter().fold(0.0f64, |most, x| most.max(*x));
        let flux = if largest > 0.0 { objective.flux(shape) } else { 0.0 };
        if flux <= 0.0 {
            return Ok(None);
        }
        let times = |scale: f64| shape.iter().map(|x| scale * x).collect::<Vec<f64>>();
        let top = self.problem.upper / largest;
        let scale = if objective.data.is_scale_free() {
            let missing = || LinearError::NoFlux(objective.data.names());
            // These data do not feel the scale: a start that the bound keeps fainter is as good.
            (self.problem.flux.ok_or_else(missing)? / flux).min(top)
        } else {
            let mut gradient = Vec::new();
            newton(top, |scale| {
                objective.value_and_gradient(&times(scale), &mut gradient);
                dot(&gradient, shape)
            })
        };
        let start = times(scale);
        let value = objective.value_and_gradient(&start, &mut Vec::new());
        Ok(Some((objective.finite(value, &start)?, start)))
    }
}

/// Returns the scale from 0 to `top` at which a slope vanishes, by secants.
fn newton(top: f64, mut slope: impl FnMut(f64) -> f64) -> f64 {
    let (mut before, mut scale) = (0.5 * top, top);
    let (mut steep, mut flat) = (slope(before), slope(scale));
    for _ in 0..SCALINGS {
        let next = scale - flat * (scale - before) / (flat - steep);
        if !next.is_finite() || next == scale {
            break;
        }
        (before, steep) = (scale, flat);
        // Never dark: there amplitudes have no slope.
        scale = next.clamp(1e-9 * top, top);
        flat = slope(scale);
        // Held at the same end again: there is no secant through one point.
        if scale == before {
            break;
        }
    }
    scale
}
