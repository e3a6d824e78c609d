//! Closure traces: what four baselines say that no gain and no leakage of any station changes (Broderick & Pesce 2020, ApJ
//! 904, 126).

use super::coherency::{Coherency, HANDS};
use super::layers::Layers;
use crate::Complex64;
use crate::observation::{Basis, Observation, Row};
use std::collections::HashMap;

/// A baseline of a trace.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TraceLeg {
    /// Index of the row among [`TraceSet::rows`].
    pub row: usize,
    /// Whether the row has its stations in the other order.
    pub is_reversed: bool,
}

/// The closure trace of stations 1, 2, 3, 4: T = ½ tr(V₁₂ V₃₂⁻¹ V₃₄ V₁₄⁻¹), with V the coherency matrices of baselines.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ClosureTrace {
    /// The four stations.
    pub stations: [u16; 4],
    /// Baselines 12, 32, 34 and 14.
    pub legs: [TraceLeg; 4],
}

/// ln T, and what it changes by when the products of each leg's row do: d ln T = Σ c dV, or Σ c dV̄ where the row is reversed,
/// in the order RR, LL, RL, LR.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LogTrace {
    /// Natural logarithm of the modulus, and phase in radians.
    pub value: Complex64,
    /// The c of the four legs.
    pub slopes: [[Complex64; 4]; 4],
}

impl ClosureTrace {
    /// Its logarithm, of the coherencies of all rows; `None` where a matrix has no inverse or the trace is 0.
    pub fn log(&self, rows: &[Coherency]) -> Option<LogTrace> {
        let of = |leg: TraceLeg| match leg.is_reversed {
            false => rows[leg.row],
            true => rows[leg.row].reversed(),
        };
        let [v12, v32, v34, v14] = self.legs.map(of);
        let [i32, i14] = [v32.inverse(), v14.inverse()];
        let [first, second] = [v12.times(&i32), v34.times(&i14)];
        let around = first.times(&second);
        let trace = around.trace();
        let value = (trace * 0.5).ln();
        // d tr X = Σ tr(G dV), with X cut open at each of its factors.
        let minus = Complex64::new(-1.0, 0.0);
        let cut = [
            i32.times(&second),
            i32.times(&second).times(&first).scaled(minus),
            i14.times(&first),
            i14.times(&around).scaled(minus),
        ];
        let slopes = [0, 1, 2, 3].map(|k| self.slopes(k, &cut[k].scaled(trace.inv())));
        let is_finite = value.is_finite() && slopes.iter().flatten().all(|c| c.is_finite());
        is_finite.then_some(LogTrace { value, slopes })
    }

    /// tr(G dV) in terms of the products of a leg's row.
    fn slopes(&self, leg: usize, cut: &Coherency) -> [Complex64; 4] {
        let is_reversed = self.legs[leg].is_reversed;
        HANDS.map(|[p, q]| if is_reversed { cut.0[p][q] } else { cut.0[q][p] })
    }
}

/// The two real numbers of a trace.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TracePart {
    /// ln|T|.
    LogAmplitude,
    /// arg T.
    Phase,
}

impl TracePart {
    /// Of a logarithm.
    pub fn of(self, log: Complex64) -> f64 {
        match self {
            TracePart::LogAmplitude => log.re,
            TracePart::Phase => log.im,
        }
    }
}

/// A real number of a trace, with its error.
#[derive(Debug, Clone, PartialEq)]
pub struct TraceQuantity {
    /// The trace.
    pub trace: ClosureTrace,
    /// Which of its numbers.
    pub part: TracePart,
    /// ln|T|, or arg T in radians in (−π, π].
    pub value: f64,
    /// Standard deviation, to first order in the errors of the products.
    pub noise_sigma: f64,
}

/// Independent numbers of the closure traces of one scan, with what they share.
#[derive(Debug, Clone, PartialEq)]
pub struct TraceSet {
    /// Hours of UTC.
    pub time_h: f64,
    /// The numbers, least noisy first.
    pub quantities: Vec<TraceQuantity>,
    /// Covariance of their errors to first order, row after row.
    pub covariance: Vec<f64>,
}

/// The most candidates of n stations that are looked at are these times n², the least noisy ones: all of them up to 8 stations.
const MOST_CANDIDATES: usize = 16;

/// A number is kept if what is its own, beside those that were kept, has a variance of more than so many times that of its
/// errors of second order, which are the square of the error of each number in it.
const LEAST_OWN_VARIANCE: f64 = 30.0;

/// Stations of a row in its order, and its index.
type Oriented = ([u16; 2], usize);

impl TraceSet {
    /// Rows that have all four products of circular feeds with errors above 0, and a Stokes I above `least_snr` times its noise.
    pub fn rows(observation: &Observation, least_snr: f64) -> Vec<&Row> {
        let is_complete = |row: &&Row| {
            observation.basis == Basis::Circular
                && (0..4).all(|k| {
                    row.product(k).is_some_and(|m| m.noise_sigma > 0.0 && m.visibility.is_finite())
                })
        };
        let is_strong = |row: &&Row| {
            let i = row.stokes_i(observation.basis);
            i.is_some_and(|i| i.visibility.norm() > least_snr * i.noise_sigma)
        };
        observation.rows.iter().filter(is_complete).filter(is_strong).collect()
    }

    /// For every scan (rows of the same time and channel) a set of independent numbers, chosen with the least noisy first.
    /// Rows that repeat a baseline of their scan make sets of their own.
    pub fn of(observation: &Observation, least_snr: f64) -> Vec<TraceSet> {
        let rows = Self::rows(observation, least_snr);
        let coherencies: Vec<Coherency> = rows.iter().map(|r| Coherency::of(r.products)).collect();
        let mut scans: HashMap<(u64, u16), Layers<Oriented>> = HashMap::new();
        for (k, row) in rows.iter().enumerate() {
            let [a, b] = row.stations;
            let layers = scans.entry((row.time_h.to_bits(), row.channel)).or_default();
            layers.add([a.min(b), a.max(b)], (row.stations, k));
        }
        let layers = scans.into_iter().flat_map(|((time, channel), layers)| {
            layers.all().map(move |layer| (time, channel, layer.into_iter().collect()))
        });
        let mut sets: Vec<(u16, TraceSet)> = layers
            .map(|(time, channel, index)| {
                let quantities = choose(&quadrangles(&index), &coherencies, &rows);
                (channel, set(f64::from_bits(time), quantities))
            })
            .filter(|(_, set)| !set.quantities.is_empty())
            .collect();
        sets.sort_by(|(j, a), (k, b)| a.time_h.total_cmp(&b.time_h).then(j.cmp(k)));
        sets.into_iter().map(|(_, set)| set).collect()
    }
}

/// The six traces of every four stations that differ by more than a complex conjugate: three ways around, each with two
/// directions.
fn quadrangles(index: &HashMap<[u16; 2], usize>) -> Vec<ClosureTrace> {
    let mut stations: Vec<u16> = index.keys().flatten().copied().collect();
    stations.sort_unstable();
    stations.dedup();
    let leg = |a: u16, b: u16| {
        let forward = index.get(&[a, b]).map(|row| TraceLeg { row: *row, is_reversed: false });
        forward.or_else(|| index.get(&[b, a]).map(|row| TraceLeg { row: *row, is_reversed: true }))
    };
    let trace = |[a, b, c, d]: [u16; 4]| {
        let legs = [leg(a, b)?, leg(c, b)?, leg(c, d)?, leg(a, d)?];
        Some(ClosureTrace { stations: [a, b, c, d], legs })
    };
    let mut found = Vec::new();
    fours(&stations, |[a, b, c, d]| {
        let orders =
            [[a, b, c, d], [a, d, c, b], [a, b, d, c], [a, c, d, b], [a, c, b, d], [a, d, b, c]];
        found.extend(orders.into_iter().filter_map(trace));
    });
    found
}

/// Calls back with all sets of four of the stations, in order.
fn fours(stations: &[u16], mut each: impl FnMut([u16; 4])) {
    for (i, &a) in stations.iter().enumerate() {
        for (j, &b) in stations.iter().enumerate().skip(i + 1) {
            for (k, &c) in stations.iter().enumerate().skip(j + 1) {
                stations[k + 1..].iter().for_each(|&d| each([a, b, c, d]));
            }
        }
    }
}

/// What a number changes by when real and imaginary parts of products do, each in units of its error.
type Gradient = Vec<((usize, usize), [f64; 2])>;

/// A number that may be kept.
struct Candidate {
    quantity: TraceQuantity,
    gradient: Gradient,
}

impl Candidate {
    fn of(trace: &ClosureTrace, part: TracePart, log: &LogTrace, rows: &[&Row]) -> Self {
        let slope = |c: Complex64, is_reversed: bool| {
            let sign = if is_reversed { 1.0 } else { -1.0 };
            match part {
                TracePart::LogAmplitude => [c.re, sign * c.im],
                TracePart::Phase => [c.im, -sign * c.re],
            }
        };
        let mut gradient: Gradient = Vec::with_capacity(16);
        for (leg, slopes) in trace.legs.iter().zip(&log.slopes) {
            gradient.extend(slopes.iter().enumerate().map(|(k, c)| {
                let sigma = rows[leg.row].noise_sigma[k];
                ((leg.row, k), slope(*c, leg.is_reversed).map(|x| x * sigma))
            }));
        }
        gradient.sort_unstable_by_key(|(place, _)| *place);
        let variance: f64 = gradient.iter().map(|(_, [re, im])| re * re + im * im).sum();
        let value = part.of(log.value);
        let quantity = TraceQuantity { trace: *trace, part, value, noise_sigma: variance.sqrt() };
        Self { quantity, gradient }
    }

    fn variance(&self) -> f64 {
        self.quantity.noise_sigma.powi(2)
    }

    /// Covariance of the errors of two numbers, whose gradients are in order.
    fn shared(&self, other: &Self) -> f64 {
        let (mut sum, mut at) = (0.0, other.gradient.iter().peekable());
        for (place, [re, im]) in &self.gradient {
            while at.next_if(|(other, _)| other < place).is_some() {}
            if let Some((_, [other_re, other_im])) = at.next_if(|(other, _)| other == place) {
                sum += re * other_re + im * other_im;
            }
        }
        sum
    }
}

/// Numbers whose errors are independent enough, least noisy first: Cholesky's decomposition of their covariance, row by row.
fn choose(traces: &[ClosureTrace], coherencies: &[Coherency], rows: &[&Row]) -> Vec<Candidate> {
    let parts = [TracePart::LogAmplitude, TracePart::Phase];
    let mut candidates: Vec<Candidate> = traces
        .iter()
        .filter_map(|trace| Some((trace, trace.log(coherencies)?)))
        .flat_map(|(trace, log)| parts.map(|part| Candidate::of(trace, part, &log, rows)))
        .collect();
    candidates.sort_by(|a, b| a.variance().total_cmp(&b.variance()));
    let mut stations: Vec<u16> = traces.iter().flat_map(|trace| trace.stations).collect();
    stations.sort_unstable();
    stations.dedup();
    candidates.truncate(MOST_CANDIDATES * stations.len().pow(2));
    let mut kept: Vec<Candidate> = Vec::new();
    let mut factor: Vec<Vec<f64>> = Vec::new();
    for candidate in candidates {
        let row = next_row(&factor, &kept, &candidate);
        let own = candidate.variance() - row.iter().map(|x| x * x).sum::<f64>();
        let second = second_order(&factor, &kept, &candidate, &row);
        if own > LEAST_OWN_VARIANCE * second {
            factor.push([row, vec![own.sqrt()]].concat());
            kept.push(candidate);
        }
    }
    kept
}

/// The row of the decomposition that another number would have, without its diagonal.
fn next_row(factor: &[Vec<f64>], kept: &[Candidate], candidate: &Candidate) -> Vec<f64> {
    let mut row: Vec<f64> = Vec::with_capacity(kept.len());
    for (before, above) in kept.iter().zip(factor) {
        let known: f64 = row.iter().zip(above).map(|(a, b)| a * b).sum();
        row.push((candidate.shared(before) - known) / above[row.len()]);
    }
    row
}

/// Variance of the errors of second order in what a number has of its own: the number less the combination of those kept that
/// has the same errors to first order.
fn second_order(
    factor: &[Vec<f64>],
    kept: &[Candidate],
    candidate: &Candidate,
    row: &[f64],
) -> f64 {
    let mut combination = row.to_vec();
    for k in (0..row.len()).rev() {
        combination[k] /= factor[k][k];
        let (before, at) = combination.split_at_mut(k);
        before.iter_mut().zip(&factor[k]).for_each(|(x, f)| *x -= at[0] * f);
    }
    let of = |(part, number): (&f64, &Candidate)| (part * number.variance()).powi(2);
    candidate.variance().powi(2) + combination.iter().zip(kept).map(of).sum::<f64>()
}

fn set(time_h: f64, kept: Vec<Candidate>) -> TraceSet {
    let pairs = kept.iter().flat_map(|a| kept.iter().map(move |b| (a, b)));
    let covariance = pairs.map(|(a, b)| a.shared(b)).collect();
    TraceSet { time_h, quantities: kept.into_iter().map(|c| c.quantity).collect(), covariance }
}

#[cfg(test)]
mod tests;
