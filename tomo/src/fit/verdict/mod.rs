//! Verdict of a fit: does it explain its data? A function of the residuals of its last state.
//!
//! For N independent data with Gaussian errors about a model that is right, χ² per datum is 1 ± √(2/N). A fit lies lower by
//! the part of the data that its parameters have used up. How much a network uses nobody knows, and of voxels only that it is
//! at most their number, so that 1 is where χ² may begin, not where it has to end: too large is judged closely, too small
//! generously. The same is let pass whoever asks: a fit, or a draw from its posterior.

mod predictive;
mod statistics;
#[cfg(test)]
mod tests;

pub use predictive::Predicted;
use serde::Serialize;
pub use statistics::{Pairs, Part, PixelSum, Statistics};
use std::collections::BTreeMap;

/// Standard deviations of χ² that chance is granted: 5 of them come about once in a million.
pub const CHANCE: f64 = 5.0;

/// Returns whether χ² per datum of so many data is what chance allows, or less.
pub fn is_chance(chi2: f64, count: usize) -> bool {
    chi2 <= 1.0 + CHANCE * (2.0 / count.max(1) as f64).sqrt()
}
/// Standard deviations below the χ² of a right model from which on a fit follows noise.
const FOLLOWED: f64 = 2.5;
/// Excess of χ² per datum that is tolerated for any number of data: an error of the model of 0.3 σ, smaller than
/// anything that single data can tell.
pub const EXCESS: f64 = 0.1;
/// Deficit of χ² per datum that is tolerated: the share of data that parameters may use up where their number tells nothing.
pub const LACK: f64 = 0.2;
/// Mean residual in σ, or correlation of neighbours, that is let pass: what an error of the model as large as
/// [`EXCESS`] allows makes, if it is the same all over.
pub const STRUCTURE: f64 = 0.3;
/// Excess of a single baseline, station or frame that is let pass.
pub const GROUP_EXCESS: f64 = 1.0;
/// Real data of a baseline, station or frame that is judged on its own.
pub const GROUP_COUNT: usize = 30;
/// Part of noise-free data that may be left over.
pub const MISFIT: f64 = 0.1;
/// Part of the flux at zero spacing that may be missing.
pub const FLUX: f64 = 0.1;

/// Meaning of σ of the data.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Errors {
    /// The noise that was added to a simulation.
    #[serde(rename = "noise")]
    Known,
    /// Errors that measured data state, with whatever was added for calibration.
    Stated,
    /// Those of a background that was taken from the data, or of what the source varies: common to many data, so that χ² may
    /// well be small.
    Shared,
    /// A number that the settings give.
    Assumed,
    /// A weight: the data have no noise.
    Weight,
}

/// Expected residuals if the model is right.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Expected {
    /// Mean of χ² per datum.
    pub chi2: f64,
    /// Its standard deviation.
    pub spread: f64,
    /// Mean residual, in σ.
    pub mean: f64,
    /// Correlation of the same datum in consecutive frames.
    pub in_time: f64,
    /// Part of the data that parameters have used up, at most; 0 where nobody knows. χ² of a fit may lie lower by as much,
    /// that of a draw from a posterior does not.
    pub taken: f64,
}

impl Expected {
    /// Largest χ² per datum that passes.
    pub fn most(&self) -> f64 {
        self.chi2 + (CHANCE * self.spread).max(EXCESS * self.chi2)
    }

    /// Least χ² per datum that passes.
    pub fn least(&self) -> f64 {
        self.chi2 - (CHANCE * self.spread).max(LACK.max(self.taken) * self.chi2)
    }
}

/// χ² per datum of some data if the model is right.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moments {
    /// Its mean.
    pub mean: f64,
    /// Its standard deviation.
    pub spread: f64,
}

impl Moments {
    /// Takes those of drawn data; none of fewer than two draws, or where they are no numbers.
    fn of(draws: impl Iterator<Item = Part>) -> Option<Self> {
        let all: Vec<Part> = draws.filter(|part| part.count() > 0).collect();
        let chi2 = || all.iter().filter_map(Part::per_datum);
        if all.len() < 2 {
            return None;
        }
        let count = all.len() as f64;
        let data = all.iter().map(|part| part.freedom).sum::<f64>() / count;
        let mean = chi2().sum::<f64>() / count;
        let square: f64 = chi2().map(|x| (x - mean).powi(2)).sum();
        // The scatter of few draws may be too small by chance.
        let spread = (square / (count - 1.0)).sqrt().max(mean * (2.0 / data).sqrt());
        (mean.is_finite() && spread.is_finite()).then_some(Self { mean, spread })
    }

    /// Returns the largest χ² per datum of one baseline, station or frame that passes.
    fn most(self) -> f64 {
        self.mean + (CHANCE * self.spread).max(GROUP_EXCESS)
    }
}

/// One kind of data.
#[derive(Clone, Debug)]
pub struct Tested {
    /// Its residuals.
    pub statistics: Statistics,
    /// Meaning of σ.
    pub errors: Errors,
    /// Expected residuals if the model is right.
    pub expected: Expected,
    /// Those of each baseline, triangle or quadrangle where draws tell them: closure quantities of faint ones scatter more.
    groups: BTreeMap<Vec<u16>, Moments>,
    /// The same of frames.
    frames: Vec<Option<Moments>>,
}

impl Tested {
    /// Expects the χ² of independent Gaussian data.
    pub fn gaussian(statistics: Statistics, errors: Errors) -> Self {
        let spread = (2.0 / statistics.all.freedom.max(1.0)).sqrt();
        let taken = statistics.taken.clamp(0.0, 1.0);
        let expected = Expected { chi2: 1.0, spread, mean: 0.0, in_time: 0.0, taken };
        Self { statistics, errors, expected, groups: BTreeMap::new(), frames: Vec::new() }
    }

    /// Returns what a right model has of the data of some stations.
    pub(super) fn of_group(&self, stations: &[u16], part: &Part) -> Moments {
        self.groups.get(stations).copied().unwrap_or_else(|| self.of_any(part))
    }

    /// The same of a frame.
    pub(super) fn of_frame(&self, frame: usize, part: &Part) -> Moments {
        self.frames.get(frame).copied().flatten().unwrap_or_else(|| self.of_any(part))
    }

    fn of_any(&self, part: &Part) -> Moments {
        let (all, some) = (self.statistics.all.freedom, part.freedom.max(1.0));
        let Expected { chi2, spread, .. } = self.expected;
        Moments { mean: chi2, spread: spread * (all / some).sqrt() }
    }

    /// Returns whether χ² is less than a right model has: what the fit learns is noise.
    pub fn follows_noise(&self) -> bool {
        let Expected { chi2, spread, .. } = self.expected;
        // A weight is no error, and errors that data share make χ² small about a right model, too.
        let knows_noise = !matches!(self.errors, Errors::Weight | Errors::Shared);
        knows_noise && self.statistics.chi2().is_some_and(|of| of < chi2 - FOLLOWED * spread)
    }

    /// Expects residuals like those of drawn data about the same model; Gaussian if that is no number.
    #[must_use]
    pub fn among(self, draws: &[Statistics]) -> Self {
        let count = draws.len() as f64;
        let all: Option<Vec<f64>> = draws.iter().map(Statistics::chi2).collect();
        let Some(all) = all.filter(|all| all.len() > 1) else { return self };
        let mean = |values: &mut dyn Iterator<Item = f64>| values.sum::<f64>() / count;
        let chi2 = mean(&mut all.iter().copied());
        let square: f64 = all.iter().map(|x| (x - chi2).powi(2)).sum();
        let expected = Expected {
            chi2,
            // The scatter of few draws may be too small by chance.
            spread: (square / (count - 1.0)).sqrt().max(self.expected.spread),
            mean: mean(&mut draws.iter().filter_map(Statistics::mean)),
            in_time: mean(&mut draws.iter().filter_map(|draw| draw.in_time.correlation())),
            taken: self.expected.taken,
        };
        let numbers = [expected.chi2, expected.spread, expected.mean, expected.in_time];
        if !numbers.iter().all(|x| x.is_finite()) {
            return self;
        }
        let of_group = |(stations, _): (&Vec<u16>, &Part)| {
            let of_draws = draws.iter().filter_map(|draw| draw.groups.get(stations));
            Some((stations.clone(), Moments::of(of_draws.copied())?))
        };
        let groups = self.statistics.groups.iter().filter_map(of_group).collect();
        let of_frame = |k| Moments::of(draws.iter().filter_map(|draw| draw.frames.get(k).copied()));
        let frames = (0..self.statistics.frames.len()).map(of_frame).collect();
        Self { expected, groups, frames, ..self }
    }
}

/// Total flux where baselines are too short to resolve anything: mean over the frames that have them, Jy.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ZeroSpacing {
    /// Flux of the data.
    pub measured_jy: f64,
    /// Its standard deviation.
    pub error_jy: f64,
    /// Flux of the model in the same frames.
    pub model_jy: f64,
    /// Visibilities that it is a mean of.
    #[serde(rename = "visibilities")]
    pub count: usize,
}

/// Verdict on a fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Outcome {
    /// All residuals are as expected.
    Explained,
    /// The data have no noise, and are reproduced.
    Reproduced,
    /// Residuals are smaller than noise can be.
    FitsNoise,
    /// Residuals are too large, or not random.
    Unexplained,
}

/// Reason why it is not [`Outcome::Explained`].
#[derive(Clone, Debug, PartialEq)]
pub struct Reason {
    /// Index of the kind of data, counted from 0; none of what all of them show.
    pub term: Option<usize>,
    /// Fault of the residuals.
    pub fault: Fault,
}

/// Fault of residuals.
#[derive(Clone, Debug, PartialEq)]
pub enum Fault {
    /// χ² is not a number.
    NotFinite,
    /// χ² per datum is too large.
    Large,
    /// χ² per datum is too small.
    Small,
    /// This part of noise-free data is left over.
    Misfit(f64),
    /// Residuals have a mean of so many σ.
    Mean(f64),
    /// Residuals of consecutive frames are alike, with this correlation.
    InTime(f64),
    /// Residuals of neighbouring pixels are alike, with this correlation.
    InSpace(f64),
    /// The stations of a baseline, triangle or quadrangle, with its χ² per datum, which is too large.
    Group(Vec<u16>, f64),
    /// A frame, with its χ² per datum, which is too large.
    Frame(usize, f64),
    /// The model has another flux than short baselines have measured.
    Flux,
}

/// A verdict with its reasons.
#[derive(Clone, Debug, PartialEq)]
pub struct Verdict {
    /// The worst of all that was found.
    pub outcome: Outcome,
    /// Why, the kinds of data in their order.
    pub reasons: Vec<Reason>,
}

impl Verdict {
    fn add(&mut self, outcome: Outcome, term: Option<usize>, fault: Fault) {
        // Outcomes stand in the order of their gravity.
        self.outcome = self.outcome.max(outcome);
        self.reasons.push(Reason { term, fault });
    }
}

/// The verdict of a fit to some kinds of data, of which `flux` is seen by those that know amplitudes.
pub fn judge<'a>(
    terms: impl Iterator<Item = &'a Tested> + Clone,
    flux: Option<ZeroSpacing>,
) -> Verdict {
    let noisy = terms.clone().any(|tested| tested.errors != Errors::Weight);
    let outcome = if noisy { Outcome::Explained } else { Outcome::Reproduced };
    let mut verdict = Verdict { outcome, reasons: Vec::new() };
    for (term, tested) in terms.enumerate() {
        let chi2 = tested.statistics.chi2().unwrap_or(f64::NAN);
        match tested.errors {
            _ if !chi2.is_finite() => {
                verdict.add(Outcome::Unexplained, Some(term), Fault::NotFinite)
            }
            Errors::Weight => judge_noise_free(term, tested, &mut verdict),
            _ => judge_noisy(term, tested, chi2, &mut verdict),
        }
    }
    if flux.is_some_and(|flux| is_missed(&flux)) {
        verdict.add(Outcome::Unexplained, None, Fault::Flux);
    }
    verdict
}

fn is_missed(flux: &ZeroSpacing) -> bool {
    let allowed = (CHANCE * flux.error_jy).max(FLUX * flux.measured_jy.abs());
    let missing = (flux.model_jy - flux.measured_jy).abs();
    // Comparisons with NaN would let it pass.
    missing > allowed || missing.is_nan()
}

fn judge_noise_free(term: usize, tested: &Tested, verdict: &mut Verdict) {
    if let Some(part) = tested.statistics.misfit().filter(|part| *part > MISFIT) {
        verdict.add(Outcome::Unexplained, Some(term), Fault::Misfit(part));
    }
}

fn judge_noisy(term: usize, tested: &Tested, chi2: f64, verdict: &mut Verdict) {
    if chi2 > tested.expected.most() {
        verdict.add(Outcome::Unexplained, Some(term), Fault::Large);
    } else {
        judge_structure(term, tested, verdict);
    }
    if chi2 < tested.expected.least() && tested.errors != Errors::Shared {
        verdict.add(Outcome::FitsNoise, Some(term), Fault::Small);
    }
}

/// Judges structure that χ² as a whole does not show.
fn judge_structure(term: usize, tested: &Tested, verdict: &mut Verdict) {
    let Statistics { all, in_time, in_space, .. } = &tested.statistics;
    let beyond = |value: Option<f64>, expected: f64, count: usize| {
        let allowed = (CHANCE / (count.max(1) as f64).sqrt()).max(STRUCTURE);
        value.filter(|value| (value - expected).abs() > allowed)
    };
    let expected = tested.expected;
    // Errors that data share make residuals alike about the right model, too.
    if tested.errors == Errors::Shared {
        return;
    }
    if let Some(mean) = beyond(tested.statistics.mean(), expected.mean, all.count()) {
        verdict.add(Outcome::Unexplained, Some(term), Fault::Mean(mean));
    }
    // Errors of calibration last for longer than a frame: only noise has to be new in every one.
    if tested.errors == Errors::Stated {
        return;
    }
    // What is alike but smaller than the errors is no error of the model that data can tell.
    let size = tested.statistics.chi2().unwrap_or(1.0).min(1.0);
    let alike = |pairs: &Pairs, expected: f64| {
        let allowed = (CHANCE / (pairs.count().max(1) as f64).sqrt()).max(STRUCTURE);
        pairs.correlation().filter(|value| size * (value - expected).abs() > allowed)
    };
    if let Some(correlation) = alike(in_time, expected.in_time) {
        verdict.add(Outcome::Unexplained, Some(term), Fault::InTime(correlation));
    }
    if let Some(correlation) = alike(in_space, 0.0) {
        verdict.add(Outcome::Unexplained, Some(term), Fault::InSpace(correlation));
    }
    judge_groups(term, tested, verdict);
}

fn judge_groups(term: usize, tested: &Tested, verdict: &mut Verdict) {
    // Each part has a limit of its own: the worst of all need not be beyond its.
    let is_bad = |part: &Part, expected: Moments| {
        part.count() >= GROUP_COUNT && part.per_datum().is_some_and(|chi2| chi2 > expected.most())
    };
    let groups = tested.statistics.groups.iter();
    let groups = groups.filter(|(stations, part)| is_bad(part, tested.of_group(stations, part)));
    if let Some((stations, _, chi2)) = worst(groups) {
        let stations = stations.clone();
        verdict.add(Outcome::Unexplained, Some(term), Fault::Group(stations, chi2));
    }
    let frames = tested.statistics.frames.iter().enumerate();
    let frames = frames.filter(|(frame, part)| is_bad(part, tested.of_frame(*frame, part)));
    if let Some((frame, _, chi2)) = worst(frames) {
        verdict.add(Outcome::Unexplained, Some(term), Fault::Frame(frame, chi2));
    }
}

/// The part with the largest χ² per datum, of those with [`GROUP_COUNT`] data or, where there are none, of all.
pub fn worst<'a, K>(
    parts: impl Iterator<Item = (K, &'a Part)> + Clone,
) -> Option<(K, &'a Part, f64)> {
    let largest = |least: usize| {
        let chosen = parts.clone().filter(move |(_, part)| part.count() >= least);
        let chosen = chosen.filter_map(|(key, part)| Some((key, part, part.per_datum()?)));
        chosen.max_by(|a, b| a.2.total_cmp(&b.2))
    };
    largest(GROUP_COUNT).or_else(|| largest(1))
}
