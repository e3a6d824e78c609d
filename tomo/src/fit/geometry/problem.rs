//! Geometries as data see them: for each, the volume that explains the data best is solved for.

use super::{Geometry, GeometryModel, Parameter, Prior};
use crate::Error;
use crate::fit::ForwardModel;
use crate::fit::journal::Memory;
use crate::fit::linear::{
    Change, GaussianField, Least, LinearProblem, Prior as Penalty, StopRule, Voxels, Weighted,
};
use crate::representation::Degree;
use core::f64::consts::{PI, TAU};
use kerrlight_common::simd::Float;

/// Part of its prior's deviation from which on the data say nothing about a parameter.
const OPEN: f64 = 0.8;

/// Probability that an interval holds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Span {
    /// Its part.
    pub probability: f64,
    /// Standard deviations to each side of the middle of a normal distribution.
    pub deviations: f64,
}

impl Span {
    /// 68 %: one standard deviation.
    pub const ONE_SIGMA: Self = Span { probability: 0.682_689_492, deviations: 1.0 };
    /// 95 %.
    pub const NEARLY_ALL: Self = Span { probability: 0.95, deviations: 1.959_963_985 };
}

/// A parameter that is not known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Free {
    /// Which.
    pub parameter: Parameter,
    /// Its prior.
    pub prior: Prior,
}

impl Free {
    /// Least and largest value.
    pub fn bounds(&self) -> [f64; 2] {
        let ([low, high], [least, most]) = (self.parameter.range(), self.prior.bounds());
        [low.max(least), high.min(most)]
    }

    /// A value brought inside the bounds; a whole circle has none, and of its copies the one about which the prior lies.
    pub fn inside(&self, value: f64) -> f64 {
        let [low, high] = self.bounds();
        if !self.is_circle() {
            return value.clamp(low, high);
        }
        let near = self.near_prior(low + (value - low).rem_euclid(TAU));
        // The copy near a bell curve at the end of the range may lie one turn beyond it.
        match near {
            near if near < low => near + TAU,
            near if near > high => near - TAU,
            near => near,
        }
    }

    /// The value below which a part `share` of the probability lies that the prior has where the parameter has values.
    pub fn quantile(&self, share: f64) -> f64 {
        // An angle has other copies of itself beyond its range.
        if self.parameter == Parameter::PositionAngle {
            return self.prior.quantile(share);
        }
        let [low, high] = self.bounds();
        let [below, until] = [low, high].map(|bound| self.prior.below(bound));
        self.prior.quantile(below + share * (until - below)).clamp(low, high)
    }

    /// −ln of the prior's density at a value up to a constant, infinite where it is not possible.
    pub fn penalty(&self, value: f64) -> f64 {
        self.prior.penalty(self.near_prior(value))
    }

    /// Slope and second derivative of that; `width` is the distance that is kept from a pole.
    pub(super) fn curve(&self, value: f64, width: f64) -> [f64; 2] {
        self.prior.curve(self.near_prior(value), width)
    }

    /// The copy of an angle on the sky within half a circle of a bell curve's middle: 40° is as good as −320°.
    fn near_prior(&self, value: f64) -> f64 {
        match self.prior {
            Prior::Normal { mean, .. } => mean + self.parameter.difference(value, mean),
            _ => value,
        }
    }

    /// The width of populations in which geometries are looked for: what changes images by about as much as for any other
    /// parameter, or a bell curve that is narrower, which has no bounds to keep them inside.
    fn width(&self) -> f64 {
        match self.prior {
            Prior::Normal { sigma, .. } => self.parameter.scale().min(sigma),
            _ => self.parameter.scale(),
        }
    }

    /// Returns whether data that leave this standard deviation, in the parameter's own unit, say nothing about it.
    pub fn is_open(&self, sigma: f64) -> bool {
        sigma >= OPEN * self.prior.deviation()
    }

    /// Returns the interval that holds the parameter with the probability of `span`, in its own unit: about its best value,
    /// within its bounds, or where the data say nothing, the middle of its prior.
    pub fn interval(&self, value: f64, sigma: Option<f64>, span: Span) -> [f64; 2] {
        let Some(sigma) = sigma.filter(|sigma| !self.is_open(*sigma)) else {
            return [-0.5, 0.5].map(|half| self.quantile(0.5 + half * span.probability));
        };
        let [low, high] = match self.is_circle() {
            true => [f64::NEG_INFINITY, f64::INFINITY],
            false => self.bounds(),
        };
        [-1.0, 1.0].map(|side| (value + side * span.deviations * sigma).clamp(low, high))
    }

    /// A value with bounds as mirrors; a whole circle has none.
    pub fn mirrored(&self, value: f64) -> f64 {
        let [low, high] = self.bounds();
        if self.is_circle() { self.inside(value) } else { mirrored(value, low, high) }
    }

    pub(super) fn is_circle(&self) -> bool {
        let [low, high] = self.bounds();
        // Degrees of settings become a whole circle only to rounding.
        self.parameter == Parameter::PositionAngle && high - low > TAU - 1e-6
    }
}

/// Data, and what of the geometry is not known.
#[derive(Clone, Copy)]
pub struct GeometryProblem<'a, T: Float> {
    /// The screen and what all geometries share.
    pub model: &'a GeometryModel,
    /// Values of the parameters that are known; those of the others are not used.
    pub known: Geometry,
    /// The others.
    pub free: &'a [Free],
    /// The frames of the movie that count.
    pub frames: &'a [usize],
    /// The data, each with the factor on its χ² times its number of data: the loss is then a sum of χ². Beside a
    /// Gaussian prior the factors are 1.
    pub terms: &'a [Weighted<'a, T>],
    /// Half the width of the grid of voxels, M.
    pub half_width: f64,
    /// The largest emission that is allowed, dimensionless.
    pub upper: f64,
    /// Mean flux of a frame in Jy, for data none of which knows it.
    pub flux: Option<f64>,
    /// Penalties on the volume, in units of χ².
    pub penalties: &'a [Penalty],
    /// Change of emission while matter carries it, its weight in units of χ²; [`Change::NONE`] is the usual.
    pub change: Change,
    /// A Gaussian prior of the voxels that are solved for, if there is one.
    pub gaussian: Option<&'a GaussianField>,
    /// Factor of χ² against the priors: 1 for data with errors.
    pub scale: f64,
    /// Effort of the solution for each geometry.
    pub effort: Effort,
    /// Results of an earlier search, where data are convex.
    pub memory: Memory<'a>,
}

/// Effort of the solution for a volume.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Effort {
    /// Voxels along each axis.
    pub nodes: usize,
    /// Degree of the interpolation.
    pub degree: Degree,
    /// Rule that stops the solution.
    pub patience: StopRule,
}

/// A geometry with the volume that explains the data best in it.
#[derive(Clone, Debug)]
pub struct Estimate {
    /// The geometry.
    pub geometry: Geometry,
    /// Emission at all voxels.
    pub x: Vec<f64>,
    /// χ² and the volume's penalties; −2 ln of a Gaussian prior's density, up to a constant, is one of them.
    pub chi2: f64,
    /// Half of that times the problem's scale, and −ln of the priors' densities.
    pub value: f64,
}

impl<T: Float> GeometryProblem<'_, T> {
    /// Places to begin: shares of the priors by an additive recurrence in all dimensions (Roberts 2018), the first one
    /// in the middle.
    pub fn starts(&self, count: usize) -> Vec<Geometry> {
        let dimensions = self.free.len() as f64;
        // The positive root of x^(d + 1) = x + 1; near it a round leaves less than ⅓ of the error.
        let root = (0..64).fold(2.0f64, |x, _| (1.0 + x).powf(1.0 / (dimensions + 1.0)));
        let start = |k: usize| {
            let share = |d: usize| (0.5 + k as f64 * root.powi(-(d as i32 + 1))).fract();
            let free = self.free.iter().enumerate();
            free.fold(self.known, |geometry, (d, free)| {
                geometry.with(free.parameter, free.quantile(share(d)))
            })
        };
        (0..count).map(start).collect()
    }

    /// The best volume of a geometry, from a dark one: the same for the same geometry.
    ///
    /// # Errors
    /// If a number is out of its range, or χ² is not finite.
    pub fn solve(&self, geometry: Geometry) -> Result<Estimate, Error> {
        let forward: ForwardModel<T> = self.model.forward(&geometry)?;
        let least = self.linear(&forward).settled(None, self.effort.patience)?;
        Ok(self.estimate(geometry, least))
    }

    /// Returns whether χ² is convex in the volume of each geometry.
    pub fn is_convex(&self) -> bool {
        self.terms.iter().all(|data| data.term.is_convex())
    }

    /// χ² over the number of data.
    pub fn reduced(&self, chi2: f64) -> f64 {
        chi2 / self.data()
    }

    /// χ² over the number of data in a geometry with its volume, without penalties and what changes of emission cost: these are no
    /// noise. −2 ln of a Gaussian prior is part of it: voxels that follow noise there cost as much as they gain.
    ///
    /// # Errors
    /// If a number is out of its range.
    pub fn left(&self, estimate: &Estimate) -> Result<f64, Error> {
        let has_penalties = self.gaussian.is_none() && !self.penalties.is_empty();
        if !self.change.is_any() && !has_penalties {
            return Ok(self.reduced(estimate.chi2));
        }
        let forward: ForwardModel<T> = self.model.forward(&estimate.geometry)?;
        let x: Vec<T> = estimate.x.iter().map(|x| T::of(*x)).collect();
        Ok(self.reduced(self.unit() * self.linear(&forward).misfit(&x)?))
    }

    /// Number of data, each times the factor on its χ².
    pub fn data(&self) -> f64 {
        // Beside a prior weights are bare factors; elsewhere they hold the number of data already.
        let of = |term: &Weighted<'_, T>| match self.gaussian {
            Some(_) => term.weight * term.count(self.frames) as f64,
            None => term.weight,
        };
        self.terms.iter().map(of).sum()
    }

    /// χ² of one that a linear problem minimises: a prior makes that a mean over the data.
    pub(super) fn unit(&self) -> f64 {
        self.gaussian.map_or(1.0, |_| self.data())
    }

    /// The voxels that are solved for.
    pub fn voxels(&self) -> Voxels {
        Voxels::cube(self.effort.nodes, self.half_width, self.effort.degree)
    }

    pub(super) fn linear<'b>(&'b self, forward: &'b ForwardModel<T>) -> LinearProblem<'b, T> {
        LinearProblem {
            model: forward,
            axis: self.model.axis,
            frames: self.frames,
            terms: self.terms,
            voxels: self.voxels(),
            upper: self.upper,
            flux: self.flux,
            priors: self.penalties,
            gaussian: self.gaussian,
            change: self.change,
        }
    }

    pub(super) fn estimate(&self, geometry: Geometry, Least { x, value }: Least) -> Estimate {
        let value = self.unit() * value;
        let penalty = |free: &Free| free.penalty(geometry.get(free.parameter));
        let penalties: f64 = self.free.iter().map(penalty).sum();
        Estimate { geometry, x, chi2: value, value: 0.5 * self.scale * value + penalties }
    }

    /// The geometry at a place about another one, in units of [`Parameter::scale`] or of a narrower prior; bounds are mirrors,
    /// a whole circle has none.
    pub(super) fn place(&self, about: &Geometry, u: &[f64]) -> Geometry {
        let one = |geometry: Geometry, (free, u): (&Free, &f64)| {
            geometry.with(free.parameter, about.get(free.parameter) + u * free.width())
        };
        bounded(self.free, self.free.iter().zip(u).fold(*about, one), Free::mirrored)
    }
}

/// The geometry with each parameter brought inside its bounds by `inside`. An inclination beyond the pole of the spin comes down
/// on the other side, where the position angle is the opposite one.
pub fn bounded(
    free: &[Free],
    mut geometry: Geometry,
    inside: impl Fn(&Free, f64) -> f64,
) -> Geometry {
    // Before the bounds: beyond the pole another position angle has to be brought inside its own.
    let inclination = geometry.get(Parameter::Inclination);
    let pole = if inclination < 0.0 { 0.0 } else { PI };
    if !(0.0..=PI).contains(&inclination) && crosses_pole(free, pole) {
        let angle = geometry.get(Parameter::PositionAngle);
        geometry = geometry
            .with(Parameter::Inclination, 2.0 * pole - inclination)
            .with(Parameter::PositionAngle, angle + PI);
    }
    free.iter().fold(geometry, |geometry, free| {
        geometry.with(free.parameter, inside(free, geometry.get(free.parameter)))
    })
}

/// Returns whether geometries go on beyond a pole of the spin: the prior of the inclination reaches it, and that of the position
/// angle is a whole circle.
pub(super) fn crosses_pole(free: &[Free], pole: f64) -> bool {
    let has = |is: &dyn Fn(&Free) -> bool| free.iter().any(is);
    has(&|free| free.parameter == Parameter::Inclination && free.bounds().contains(&pole))
        && has(&Free::is_circle)
}

/// x between two mirrors.
fn mirrored(x: f64, low: f64, high: f64) -> f64 {
    let width = high - low;
    let folded = (x - low).rem_euclid(2.0 * width);
    low + if folded > width { 2.0 * width - folded } else { folded }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::geometry::tests::uniform;

    /// A direction is a direction: −319.55° is 40.45°, and as probable.
    #[test]
    fn exact_angles_lie_where_their_prior_does() {
        let free = |mean: f64, sigma: f64| Free {
            parameter: Parameter::PositionAngle,
            prior: Prior::Normal { mean: mean.to_radians(), sigma: sigma.to_radians() },
        };
        for (mean, value, expected) in [
            (40.0f64, -319.55f64, 40.45),
            (40.0, 40.45, 40.45),
            (-170.0, 175.0, -185.0),
            (170.0, -175.0, 185.0),
            // Not beyond a whole turn.
            (350.0, 370.0, 10.0),
            (-350.0, -370.0, -10.0),
        ] {
            let free = free(mean, 5.0);
            let inside = free.inside(value.to_radians()).to_degrees();
            assert!((inside - expected).abs() < 1e-9, "{mean} {value}: {inside}");
            let away = (value - mean + 180.0).rem_euclid(360.0) - 180.0;
            for turn in [-360.0, 0.0, 360.0] {
                let penalty = free.penalty((value + turn).to_radians());
                assert!((penalty - 0.5 * (away / 5.0).powi(2)).abs() < 1e-9, "{mean} {value}");
            }
        }
        assert!((free(40.0, 0.01).width().to_degrees() - 0.01).abs() < 1e-12);
        assert_eq!(free(40.0, 50.0).width(), Parameter::PositionAngle.scale());
        let whole = uniform(Parameter::PositionAngle, 0.0, TAU);
        assert!((whole.inside(-0.5) - (TAU - 0.5)).abs() < 1e-14);
    }

    /// One degree beyond the pole is one degree from it, on the other side; priors that end there or know the position angle keep
    /// geometries on their own.
    #[test]
    fn exact_geometries_go_on_beyond_the_pole() {
        let uniform = |of, low: f64, high: f64| uniform(of, low.to_radians(), high.to_radians());
        let (angle, tilt) = (Parameter::PositionAngle, Parameter::Inclination);
        let all = [uniform(tilt, 0.0, 180.0), uniform(angle, -180.0, 180.0)];
        let known = [uniform(tilt, 0.0, 180.0), uniform(angle, 0.0, 90.0)];
        let below = [uniform(tilt, 3.0, 90.0), all[1]];
        for (free, from, expected) in [
            (all, [-1.0f64, 30.0f64], [1.0, -150.0]),
            (all, [182.0, -30.0], [178.0, 150.0]),
            (all, [50.0, 200.0], [50.0, -160.0]),
            (known, [-1.0, 30.0], [0.0, 30.0]),
            (below, [-1.0, 30.0], [3.0, 30.0]),
            (below, [91.0, 30.0], [90.0, 30.0]),
        ] {
            let raw = Geometry::new(0.5, from[0].to_radians()).with(angle, from[1].to_radians());
            let found = bounded(&free, raw, Free::inside);
            let found = [tilt, angle].map(|parameter| found.get(parameter).to_degrees());
            assert!((found[0] - expected[0]).abs() < 1e-9, "{from:?}: {found:?}");
            assert!((found[1] - expected[1]).abs() < 1e-9, "{from:?}: {found:?}");
        }
    }

    /// Starts and draws of a spin whose prior goes on beyond 1 have its density, where there are spins.
    #[test]
    fn exact_quantiles_lie_within_the_bounds() {
        let prior = Prior::Normal { mean: 0.95, sigma: 0.1 };
        let free = Free { parameter: Parameter::Spin, prior };
        let [low, high] = free.bounds();
        let density = |x: f64| (-free.penalty(x)).exp();
        let part = |to: f64| {
            let step = (to - low) / 4000.0;
            (0..4000).map(|k| density(low + (f64::from(k) + 0.5) * step) * step).sum::<f64>()
        };
        for k in 0..=20 {
            let share = f64::from(k) / 20.0;
            let x = free.quantile(share);
            assert!((low..=high).contains(&x), "{share}");
            assert!((part(x) / part(high) - share).abs() < 1e-5, "{share}");
        }
        let far =
            Free { parameter: Parameter::Spin, prior: Prior::Normal { mean: 0.1, sigma: 0.01 } };
        assert_eq!(far.quantile(0.2), far.prior.quantile(0.2));
    }

    #[test]
    fn exact_mirrors_keep_values_inside() {
        for (x, expected) in [(0.2, 0.2), (-0.3, 0.3), (1.4, 0.6), (2.3, 0.3), (-1.1, 0.9)] {
            assert!((mirrored(x, 0.0, 1.0) - expected).abs() < 1e-14, "{x}");
        }
    }
}
