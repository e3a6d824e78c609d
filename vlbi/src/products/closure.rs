//! Closure phases and log closure amplitudes of scans.

use super::independent::keep_independent;
use crate::observation::{Measured, Observation};
use std::collections::HashMap;

/// Kind of closure quantity.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum ClosureKind {
    /// Sums of phases around triangles, in radians.
    Phase,
    /// Sums of logarithms of amplitudes around quadrangles.
    LogAmplitude,
}

/// A visibility's part in a closure quantity.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Leg {
    /// Index of the visibility.
    pub visibility: usize,
    /// +1 or −1.
    pub sign: i8,
}

/// A closure quantity: Σ sign·arg V, or Σ sign·ln|V|.
#[derive(Debug, Clone, PartialEq)]
pub struct Closure {
    /// Stations: a triangle 1, 2, 3, or a quadrangle 1, 2, 3, 4 of |V₁₂V₃₄|/|V₁₃V₂₄|.
    pub stations: Vec<u16>,
    /// Three or four visibilities.
    pub legs: Vec<Leg>,
    /// Its value: radians in (−π, π], or a logarithm.
    pub value: f64,
    /// Its standard deviation for high signal to noise, √Σ(σ/|V|)²: radians of a phase, dimensionless of an amplitude.
    pub noise_sigma: f64,
}

/// Independent closure quantities of one scan, with what they share.
#[derive(Debug, Clone, PartialEq)]
pub struct ClosureSet {
    /// Hours of UTC.
    pub time_h: f64,
    /// The quantities, least noisy first.
    pub closures: Vec<Closure>,
    /// Covariance of their errors, row after row: Σ sign·sign′·(σ/|V|)² over shared visibilities.
    pub covariance: Vec<f64>,
}

/// A visibility of Stokes I in a scan, by its stations in ascending order.
struct Baseline {
    stations: [u16; 2],
    visibility: usize,
    /// +1 if the data have the stations in ascending order, −1 otherwise.
    sense: i8,
    measured: Measured,
}

impl Baseline {
    /// (σ/|V|)².
    fn variance(&self) -> f64 {
        (self.measured.noise_sigma / self.measured.visibility.norm()).powi(2)
    }
}

/// A candidate: stations, and baselines with signs.
struct Candidate {
    stations: Vec<u16>,
    legs: Vec<(usize, i8)>,
}

impl ClosureSet {
    /// Returns for every scan of an observation (rows of the same time and channel) a largest set of independent
    /// closure quantities, chosen with the least noisy first, so that weak baselines are in as few of them as
    /// possible. Visibility indices count rows that have Stokes I, in the order of [`Observation::stokes_i`].
    /// Baselines weaker than `least_snr` times their noise are left out, and those without error. Rows that repeat a
    /// baseline of their scan make sets of their own.
    pub fn of(observation: &Observation, kind: ClosureKind, least_snr: f64) -> Vec<ClosureSet> {
        let mut scans: HashMap<(u64, u16, usize), Vec<Baseline>> = HashMap::new();
        let mut counts = HashMap::new();
        for (visibility, (row, measured)) in observation.stokes_i().enumerate() {
            // Above, not at, the limit: a visibility of 0 has no phase, even where the limit is 0.
            let strong = measured.visibility.norm() > least_snr * measured.noise_sigma;
            if !strong || measured.noise_sigma <= 0.0 {
                continue;
            }
            let ascending = row.stations[0] < row.stations[1];
            let [a, b] = row.stations;
            let (stations, sense) = if ascending { ([a, b], 1) } else { ([b, a], -1) };
            let baseline = Baseline { stations, visibility, sense, measured };
            // The first rows of all baselines, the second ones, and so on: none is lost.
            let (time, channel) = (row.time_h.to_bits(), row.channel);
            let layer = counts.entry((time, channel, stations)).or_insert(0);
            scans.entry((time, channel, *layer)).or_default().push(baseline);
            *layer += 1;
        }
        let sets = scans.into_iter().map(|((time, channel, layer), rows)| {
            ((channel, layer), scan(f64::from_bits(time), &rows, kind))
        });
        let mut sets: Vec<((u16, usize), ClosureSet)> =
            sets.filter(|(_, set)| !set.closures.is_empty()).collect();
        // A HashMap has no order.
        sets.sort_by(|(j, a), (k, b)| a.time_h.total_cmp(&b.time_h).then(j.cmp(k)));
        sets.into_iter().map(|(_, set)| set).collect()
    }
}

fn scan(time_h: f64, baselines: &[Baseline], kind: ClosureKind) -> ClosureSet {
    let index: HashMap<[u16; 2], usize> =
        baselines.iter().enumerate().map(|(k, b)| (b.stations, k)).collect();
    let mut stations: Vec<u16> = index.keys().flatten().copied().collect();
    stations.sort_unstable();
    stations.dedup();
    let find = |a: u16, b: u16| index.get(&[a.min(b), a.max(b)]).copied();
    let candidates = match kind {
        ClosureKind::Phase => triangles(&stations, find),
        ClosureKind::LogAmplitude => quadrangles(&stations, find),
    };
    let closures = choose(candidates, baselines, kind);
    let variance: HashMap<usize, f64> =
        baselines.iter().map(|b| (b.visibility, b.variance())).collect();
    let shared = |a: &Closure, b: &Closure| -> f64 {
        let pairs = a.legs.iter().flat_map(|x| b.legs.iter().map(move |y| (x, y)));
        pairs
            .filter(|(x, y)| x.visibility == y.visibility)
            .map(|(x, y)| f64::from(x.sign * y.sign) * variance[&x.visibility])
            .sum()
    };
    let pairs = closures.iter().flat_map(|a| closures.iter().map(move |b| (a, b)));
    let covariance = pairs.map(|(a, b)| shared(a, b)).collect();
    ClosureSet { time_h, closures, covariance }
}

/// All triangles of stations in ascending order: V₁₂ V₂₃ V₃₁.
fn triangles(stations: &[u16], find: impl Fn(u16, u16) -> Option<usize>) -> Vec<Candidate> {
    let mut found = Vec::new();
    for (i, &a) in stations.iter().enumerate() {
        for (j, &b) in stations.iter().enumerate().skip(i + 1) {
            let Some(ab) = find(a, b) else { continue };
            for &c in &stations[j + 1..] {
                if let (Some(bc), Some(ac)) = (find(b, c), find(a, c)) {
                    // V₃₁ is the conjugate of V₁₃.
                    let legs = vec![(ab, 1), (bc, 1), (ac, -1)];
                    found.push(Candidate { stations: vec![a, b, c], legs });
                }
            }
        }
    }
    found
}

/// The three quadrangles of every four stations: |V₁₂V₃₄|/|V₁₃V₂₄|, |V₁₂V₃₄|/|V₁₄V₂₃| and
/// |V₁₃V₂₄|/|V₁₄V₂₃|, all in the form of the first.
fn quadrangles(stations: &[u16], find: impl Fn(u16, u16) -> Option<usize>) -> Vec<Candidate> {
    let mut found = Vec::new();
    let n = stations.len();
    for i in 0..n {
        for j in i + 1..n {
            for k in j + 1..n {
                for l in k + 1..n {
                    let [a, b, c, d] = [i, j, k, l].map(|m| stations[m]);
                    for [p, q, r, s] in [[a, b, c, d], [a, b, d, c], [a, c, d, b]] {
                        let legs = [find(p, q), find(r, s), find(p, r), find(q, s)];
                        if let [Some(x), Some(y), Some(z), Some(w)] = legs {
                            let legs = vec![(x, 1), (y, 1), (z, -1), (w, -1)];
                            found.push(Candidate { stations: vec![p, q, r, s], legs });
                        }
                    }
                }
            }
        }
    }
    found
}

fn choose(candidates: Vec<Candidate>, baselines: &[Baseline], kind: ClosureKind) -> Vec<Closure> {
    let variance =
        |c: &Candidate| -> f64 { c.legs.iter().map(|(b, _)| baselines[*b].variance()).sum() };
    let mut candidates: Vec<(f64, Candidate)> =
        candidates.into_iter().map(|candidate| (variance(&candidate), candidate)).collect();
    candidates.sort_by(|(a, _), (b, _)| a.total_cmp(b));
    let members = candidates.iter().map(|(_, c)| c.legs.iter().map(|(b, _)| *b));
    let kept = keep_independent(baselines.len(), members);
    let of = |k: usize| {
        let (variance, candidate) = &candidates[k];
        closure(candidate, variance.sqrt(), baselines, kind)
    };
    kept.into_iter().map(of).collect()
}

fn closure(
    candidate: &Candidate,
    noise_sigma: f64,
    baselines: &[Baseline],
    kind: ClosureKind,
) -> Closure {
    let legs = || candidate.legs.iter().map(|(b, sign)| (&baselines[*b], *sign));
    let value = match kind {
        // A product instead of a sum of angles stays in (−π, π].
        ClosureKind::Phase => legs()
            .map(|(b, sign)| {
                if sign * b.sense > 0 {
                    b.measured.visibility
                } else {
                    b.measured.visibility.conj()
                }
            })
            .map(|v| v / v.norm())
            .product::<super::super::Complex64>()
            .arg(),
        // The mean of ln|V| under noise is ln|V₀| + E₁(|V₀|²/2σ²)/2: nothing to take off, other
        // than of |V| itself.
        ClosureKind::LogAmplitude => {
            legs().map(|(b, sign)| f64::from(sign) * b.measured.visibility.norm().ln()).sum()
        }
    };
    // The order of stations turns a phase's sign, not an amplitude's.
    let sign = |b: &Baseline, sign: i8| match kind {
        ClosureKind::Phase => sign * b.sense,
        ClosureKind::LogAmplitude => sign,
    };
    Closure {
        stations: candidate.stations.clone(),
        legs: legs().map(|(b, s)| Leg { visibility: b.visibility, sign: sign(b, s) }).collect(),
        value,
        noise_sigma,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Complex64;
    use crate::noise::{GainErrors, apply_gains};
    use crate::observation::{Basis, Row};
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    /// Two scans of `n` stations with random visibilities, some baselines exchanged.
    fn random(n: u16) -> Observation {
        let mut random = Pcg64Mcg::seed_from_u64(9);
        let mut observation = Observation::empty(Basis::Stokes);
        observation.stations =
            (0..n).map(|k| crate::array::Station::named(&k.to_string())).collect();
        for time in [1.0, 2.0] {
            for (a, b) in (0..n).flat_map(|a| (a + 1..n).map(move |b| (a, b))) {
                let mut part = || random.random_range(-1.0..1.0);
                let visibility = Complex64::new(part(), part());
                let i = Measured { visibility, noise_sigma: 1e-4 * (1.0 + part().abs()) };
                let stations = if (a + b) % 3 == 0 { [b, a] } else { [a, b] };
                observation.rows.push(Row::total_intensity(time, stations, [0.0; 2], i));
            }
        }
        observation
    }

    #[test]
    fn exact_numbers_of_independent_closures() {
        for n in 3..12usize {
            let observation = random(n as u16);
            for (kind, count) in [
                (ClosureKind::Phase, (n - 1) * (n - 2) / 2),
                (ClosureKind::LogAmplitude, n * (n - 3) / 2),
            ] {
                let sets = ClosureSet::of(&observation, kind, 0.0);
                assert_eq!(sets.len(), if count > 0 { 2 } else { 0 });
                for set in &sets {
                    assert_eq!(set.closures.len(), count, "{n} stations, {kind:?}");
                    // Independent: their covariance has a Cholesky decomposition.
                    let matrix = nalgebra::DMatrix::from_row_slice(count, count, &set.covariance);
                    assert!(matrix.cholesky().is_some());
                }
            }
        }
    }

    /// Gains change every visibility and no closure quantity.
    #[test]
    fn exact_gains_cancel() {
        let clean = random(7);
        let mut spoilt = clean.clone();
        let errors = GainErrors {
            constant_amplitude: 0.3,
            scan_amplitude: 0.2,
            random_phases: true,
            ..GainErrors::default()
        };
        apply_gains(&mut spoilt, &errors, 4);
        // The relative errors shall stay what they were.
        for (a, b) in clean.rows.iter().zip(&mut spoilt.rows) {
            assert!((a.products[0] - b.products[0]).norm() > 1e-3);
            b.noise_sigma[0] *= b.products[0].norm() / a.products[0].norm();
        }
        for kind in [ClosureKind::Phase, ClosureKind::LogAmplitude] {
            let sets = |o: &Observation| ClosureSet::of(o, kind, 0.0);
            for (a, b) in sets(&clean).iter().zip(sets(&spoilt)) {
                for (x, y) in a.closures.iter().zip(&b.closures) {
                    assert_eq!(x.legs, y.legs);
                    let miss = x.value - y.value;
                    let turns = (miss / core::f64::consts::TAU).round();
                    assert!((miss - turns * core::f64::consts::TAU).abs() < 1e-12, "{x:?} {y:?}");
                }
            }
        }
    }

    /// A station without flux to speak of is in as few triangles as possible: one less than the
    /// number of the others.
    #[test]
    fn exact_weak_baselines_are_avoided() {
        let mut observation = random(6);
        for row in &mut observation.rows {
            row.noise_sigma[0] = if row.stations.contains(&0) { 1e-2 } else { 1e-6 };
        }
        for set in ClosureSet::of(&observation, ClosureKind::Phase, 0.0) {
            let weak = set.closures.iter().filter(|c| c.stations.contains(&0)).count();
            assert_eq!(weak, 4);
        }
    }
}
