//! Summary of draws: intervals of the geometry, mean and spread of the volume, features, and how often a known truth lies
//! inside.

use super::Kept;
use super::predictive::{self, Check};
use kerrlight_render::volume::ranks::{Ranks, rank};
use kerrlight_render::volume::{Coverage, Ensemble, Feature, Volume};
use kerrlight_tomo::fit::geometry::Parameter;
use kerrlight_tomo::fit::settings::{FieldKind, FitFile, Kind};
use kerrlight_tomo::fit::setup;
use kerrlight_tomo::recovery::results::GeometryResults;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use serde_json::{Map, Value, json};

/// A parameter of the geometry over the draws, in its own unit.
pub struct Interval {
    /// Which.
    pub parameter: Parameter,
    /// The draws.
    pub values: Vec<f64>,
    /// Their mean.
    pub mean: f64,
    /// Standard deviation.
    pub deviation: f64,
    /// Least and largest value that the prior allows.
    pub bounds: [f64; 2],
    /// True if the data say nothing about it.
    pub open: bool,
    /// Simulated value.
    pub truth: Option<f64>,
    /// Its rank among the draws, 0 to 1.
    pub rank: Option<f64>,
}

/// Summary of draws.
pub struct Summary {
    /// Mean and standard deviation of the volume.
    pub ensemble: Ensemble,
    /// The geometry, where it is not known.
    pub geometry: Vec<Interval>,
    /// Bright features, the brightest first.
    pub features: Vec<Feature>,
    /// Share of truths inside: at random nodes of the region, and at those that shine.
    pub coverage: Option<[Coverage; 2]>,
    /// Ranks of the truth among the draws: at random nodes, where the mean is bright, and of the first feature's radius.
    pub ranks: Option<[Ranks; 3]>,
    samples: usize,
    /// Noise of the draws over the errors of the data.
    factor: f64,
    /// True if the fit explains its data.
    is_explained: bool,
    /// Part of the mean's light at nodes whose mean is above three standard deviations.
    certain: f64,
    /// Posterior predictive checks, one for each kind of data with errors.
    pub predicted: Vec<Check>,
    /// Standard deviation over that of the prior, where there is one: 1 where the data say nothing.
    pub open: Option<Volume>,
    /// Part of the region's nodes of which the data say nothing.
    open_part: Option<f64>,
}

/// Nodes are open where the draws have at least this part of the prior's standard deviation.
const OPEN: f32 = 0.8;
/// Random nodes at which a truth is looked at.
const NODES: f64 = 1000.0;
/// Nodes shine where the truth is brighter than this part of its maximum.
const SHINES: f32 = 0.05;
/// Nodes are bright where the mean of the draws is above this part of its maximum: which nodes these are must not depend
/// on the truth.
const BRIGHT: f32 = 0.25;
/// Quantities with ranks, as [`Summary::ranks`] and keys of the numbers.
pub const RANKED: [&str; 3] = ["random_nodes", "bright_nodes", "feature_radius"];
/// Text between the name of a parameter of the geometry and a part, in keys that say whether the middle draws hold its
/// truth.
pub const WITHIN: &str = "_drawn_within_";

impl Summary {
    /// Summarises draws of a fit, with the geometry that its run has found, the truth where there is one, and whether the fit
    /// explains its data.
    pub fn new(
        file: &FitFile,
        geometry: Option<&GeometryResults>,
        draws: &[Kept],
        truth: Option<Volume>,
        is_explained: bool,
    ) -> anyhow::Result<Self> {
        let volumes: Vec<Volume> = draws.iter().map(|draw| draw.volume.clone()).collect();
        let ensemble = Ensemble::of(&volumes)?;
        let features = ensemble.features(&volumes);
        let geometry = geometry.map_or(Vec::new(), |found| intervals(file, found, draws));
        let coverage = truth.as_ref().map(|truth| covered(file, &ensemble, truth)).transpose()?;
        let ranked = |truth: &Volume| ranks(file, &ensemble, &features, &volumes, truth);
        let ranks = truth.as_ref().map(ranked).transpose()?;
        let certain = certain(&ensemble);
        let open = open(file, &ensemble, &volumes)?;
        let open_part = open.as_ref().map(|open| part_of_region(file, open, |ratio| ratio > OPEN));
        let factors = draws.iter().map(|draw| draw.numbers.noise_factor);
        let factor = factors.fold(0.0, f64::max);
        Ok(Self {
            ensemble,
            geometry,
            features,
            coverage,
            ranks,
            samples: draws.len(),
            factor,
            is_explained,
            certain,
            predicted: predictive::checks(draws),
            open,
            open_part,
        })
    }

    /// Numbers for a script.
    pub fn numbers(&self) -> Value {
        let geometry: Map<String, Value> = self.geometry.iter().map(Interval::numbers).collect();
        let degrees = |[mean, deviation]: [f64; 2]| [mean.to_degrees(), deviation.to_degrees()];
        let feature = |f: &Feature| {
            json!({
                "radius": f.radius, "azimuth_deg": degrees(f.azimuth), "height": f.height,
                "light": f.light, "peak": f.peak,
            })
        };
        let coverage = |c: &Coverage| json!({ "nodes": c.nodes, "within_1_sigma": c.one, "within_1.96_sigma": c.two });
        let [random, bright] = self
            .coverage
            .as_ref()
            .map_or([Value::Null, Value::Null], |all| [coverage(&all[0]), coverage(&all[1])]);
        let mut all = json!({
            "samples": self.samples,
            "effective_samples": self.samples,
            "noise_factor": self.factor,
            "geometry": geometry,
            "features": self.features.iter().map(feature).collect::<Vec<_>>(),
            "light_above_3_sigma": self.certain,
            "predicted": self.predicted,
            "open_nodes": self.open_part,
            "coverage_random_nodes": random,
            "coverage_bright_nodes": bright,
        });
        for (key, within) in self.geometry.iter().flat_map(Interval::within) {
            all[key] = json!(within);
        }
        for (name, ranks) in RANKED.iter().zip(self.ranks.iter().flatten()) {
            if ranks.count > 0 {
                all[format!("{name}_within_68")] = json!(ranks.within_68);
                all[format!("{name}_within_95")] = json!(ranks.within_95);
                all[format!("{name}_ranks")] = json!(ranks.histogram);
            }
        }
        all
    }

    /// Describes what a person wants to know.
    pub fn sentences(&self) -> Vec<String> {
        let mut all = Vec::new();
        if !self.is_explained {
            let noise = match self.factor {
                factor if factor > 1.05 => {
                    format!("draws have noise {factor:.1} times as large as the errors, and ")
                }
                _ => String::new(),
            };
            all.push(format!(
                "The model does not explain the data: {noise}intervals are those of a model that is wrong."
            ));
        }
        all.extend(self.predicted.iter().map(Check::sentence));
        all.extend(self.geometry.iter().map(Interval::sentence));
        all.extend(self.features.iter().enumerate().map(|(k, f)| {
            let ([r, dr], [phi, dphi]) = (f.radius, f.azimuth.map(f64::to_degrees));
            format!(
                "Feature {}: radius {r:.2} ± {dr:.2} M, azimuth {phi:.1} ± {dphi:.1}°, light {:.3} ± {:.3}.",
                k + 1,
                f.light[0],
                f.light[1]
            )
        }));
        all.push(format!(
            "{:.0} % of the light is at nodes where the mean of {} draws is above three standard deviations.",
            100.0 * self.certain,
            self.samples
        ));
        all.extend(self.open_part.map(|part| match (100.0 * part).round() {
            0.0 => "The data say something about all parts of the region.".to_owned(),
            part => format!(
                "The data say nothing about {part:.0} % of the region: emission there is as uncertain as before."
            ),
        }));
        all
    }
}

impl Interval {
    /// Its values at some quantiles.
    pub fn quantile(&self, share: f64) -> f64 {
        let mut sorted = self.values.clone();
        sorted.sort_by(f64::total_cmp);
        let at = share * (sorted.len() - 1) as f64;
        let below = at.floor() as usize;
        let above = (below + 1).min(sorted.len() - 1);
        sorted[below] + (at - at.floor()) * (sorted[above] - sorted[below])
    }

    /// Returns the interval of 95 %: that of a normal distribution, inside the bounds.
    pub fn ends(&self) -> [f64; 2] {
        let reach = 1.96 * self.deviation;
        let ([low, high], unit) = (self.bounds, self.parameter.unit());
        // A full circle has no ends.
        let (low, high) = match self.parameter.difference(low * unit, high * unit).abs() < 1e-6 {
            true => (f64::NEG_INFINITY, f64::INFINITY),
            false => (low, high),
        };
        [(self.mean - reach).max(low), (self.mean + reach).min(high)]
    }

    fn numbers(&self) -> (String, Value) {
        let quantiles: Vec<f64> =
            [0.025, 0.16, 0.5, 0.84, 0.975].iter().map(|share| self.quantile(*share)).collect();
        let value = json!({
            "mean": self.mean, "deviation": self.deviation, "quantiles": quantiles, "truth": self.truth,
            "rank": self.rank,
        });
        (self.parameter.name().to_owned(), value)
    }

    /// Returns whether the truth lies within the middle 68 and 95 % of the draws, 0 or 1, with their keys.
    fn within(&self) -> Vec<(String, f64)> {
        let (name, ranks) = (self.parameter.name(), Ranks::of(self.rank.into_iter()));
        let name = name.strip_suffix("_deg").unwrap_or(name);
        let all = [(68, ranks.within_68), (95, ranks.within_95)];
        let all = all.into_iter().filter(|_| ranks.count > 0);
        all.map(|(part, within)| (format!("{name}{WITHIN}{part}"), within)).collect()
    }

    fn sentence(&self) -> String {
        let (words, unit) = self.parameter.label();
        // A truth that rounds to 0 is printed without a sign.
        let truth = self.truth.map(|truth| if truth.abs() < 5e-4 { 0.0 } else { truth });
        let truth = truth.map_or(String::new(), |truth| format!(" (truth: {truth:.3}{unit})"));
        let ([from, to], [low, high]) = (self.ends(), self.bounds);
        if self.open || to - from >= high - low {
            return format!("The {words} is not constrained{truth}.");
        }
        format!("The {words} is between {from:.3}{unit} and {to:.3}{unit} at 95 %{truth}.")
    }
}

fn intervals(file: &FitFile, found: &GeometryResults, draws: &[Kept]) -> Vec<Interval> {
    // A stream of its own: coverage and the ranks of nodes have the seed plus 0, 1 and 2.
    let mut places = Pcg64::seed_from_u64(file.seed.wrapping_add(3));
    let one = |(parameter, best): (&Parameter, &f64)| {
        let (parameter, best) = (*parameter, *best);
        let unit = parameter.unit();
        // Angles that differ by a whole turn are the same: the short way from the best one.
        let near = |x: f64| best + parameter.difference(x * unit, best * unit) / unit;
        let of = |draw: &Kept| draw.numbers.geometry.as_ref()?.get(&parameter).copied().map(near);
        let values: Vec<f64> = draws.iter().filter_map(of).collect();
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let squares: f64 = values.iter().map(|x| (x - mean).powi(2)).sum();
        let truth = found.truth.as_ref().and_then(|truth| truth.get(&parameter)).copied().map(near);
        Some(Interval {
            rank: truth.map(|truth| rank(truth, values.iter().copied(), &mut places)),
            parameter,
            mean,
            deviation: (squares / (n - 1.0)).sqrt(),
            values,
            bounds: *found.bounds.get(&parameter)?,
            open: found.open.get(&parameter) == Some(&true),
            truth,
        })
    };
    found.geometry.iter().filter_map(one).collect()
}

fn covered(file: &FitFile, ensemble: &Ensemble, truth: &Volume) -> anyhow::Result<[Coverage; 2]> {
    let region = file.region.limits();
    let inside = (0..truth.values().len()).filter(|k| region.holds(truth.position(*k))).count();
    let mut random = Pcg64::seed_from_u64(file.seed);
    // Each node is taken with this probability: about NODES of them on any grid.
    let part = NODES / inside.max(1) as f64;
    let mut chosen = || random.random::<f64>() < part;
    let of_all = ensemble.coverage(truth, |x, _| chosen() && region.holds(x))?;
    let least = SHINES * truth.values().iter().fold(0.0f32, |most, x| most.max(*x));
    let of_bright = ensemble.coverage(truth, |x, value| value > least && region.holds(x))?;
    Ok([of_all, of_bright])
}

/// Ranks of the truth among the draws, of what is listed in [`RANKED`].
fn ranks(
    file: &FitFile,
    ensemble: &Ensemble,
    features: &[Feature],
    draws: &[Volume],
    truth: &Volume,
) -> anyhow::Result<[Ranks; 3]> {
    let (region, mean) = (file.region.limits(), &ensemble.mean);
    let holds = |node: &usize| region.holds(truth.position(*node));
    let inside = (0..truth.values().len()).filter(holds).count();
    let [mut chosen, mut places] = [1, 2].map(|k| Pcg64::seed_from_u64(file.seed.wrapping_add(k)));
    let part = NODES / inside.max(1) as f64;
    let random = Ranks::of_nodes(draws, truth, &mut places, |node| {
        chosen.random::<f64>() < part && holds(&node)
    })?;
    let least = BRIGHT * mean.values().iter().fold(0.0f32, |most, x| most.max(*x));
    let bright = Ranks::of_nodes(draws, truth, &mut places, |node| {
        mean.values()[node] > least && holds(&node)
    })?;
    let radius = |feature: &Feature| {
        let drawn = draws.iter().map(|draw| feature.radius_in(draw));
        rank(feature.radius_in(truth), drawn, &mut places)
    };
    Ok([random, bright, Ranks::of(features.first().map(radius).into_iter())])
}

/// The standard deviation of the draws over that of the prior: of the logarithm where that is normal. None where the prior is that
/// of a start alone.
fn open(file: &FitFile, ensemble: &Ensemble, draws: &[Volume]) -> anyhow::Result<Option<Volume>> {
    if file.representation.kind != Kind::LinearGrid {
        return Ok(None);
    }
    let Some(prior) = setup::deviation_of_prior(file)? else { return Ok(None) };
    let drawn = &ensemble.deviation;
    let ratio = match file.linear.as_ref().and_then(|linear| linear.prior_of(FieldKind::LogNormal))
    {
        // A few draws tell nothing of the deviation of what has a heavy tail.
        Some(_) => (0..drawn.values().len()).map(|k| log_deviation(draws, k) / prior).collect(),
        None => drawn.values().iter().map(|x| f64::from(*x) / prior).collect::<Vec<f64>>(),
    };
    let ratio = ratio.into_iter().map(|x| x as f32).collect();
    Ok(Some(Volume::new(drawn.nodes(), drawn.low(), drawn.high(), ratio)?))
}

/// The standard deviation of the logarithm of draws at a node.
fn log_deviation(draws: &[Volume], node: usize) -> f64 {
    let logs = draws.iter().map(|draw| f64::from(draw.values()[node].max(f32::MIN_POSITIVE)).ln());
    let count = draws.len() as f64;
    let mean = logs.clone().sum::<f64>() / count;
    (logs.map(|x| (x - mean).powi(2)).sum::<f64>() / (count - 1.0)).sqrt()
}

/// Part of the nodes of the region at which a volume is such.
fn part_of_region(file: &FitFile, volume: &Volume, is: impl Fn(f32) -> bool) -> f64 {
    let region = file.region.limits();
    let (mut inside, mut such) = (0, 0);
    for (node, value) in volume.values().iter().enumerate() {
        if region.holds(volume.position(node)) {
            inside += 1;
            such += usize::from(is(*value));
        }
    }
    such as f64 / f64::from(inside.max(1))
}

fn certain(ensemble: &Ensemble) -> f64 {
    let (mean, deviation) = (ensemble.mean.values(), ensemble.deviation.values());
    let light = |only: bool| -> f64 {
        let counted = mean.iter().zip(deviation).filter(|(m, d)| !only || **m > 3.0 * **d);
        counted.map(|(m, _)| f64::from(*m)).sum()
    };
    let all = light(false);
    // A sum of nothing is -0.
    if all > 0.0 { light(true) / all + 0.0 } else { 0.0 }
}
