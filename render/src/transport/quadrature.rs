//! Sums of emission and absorption over the nodes of a ray.

use super::result::{Light, Place};
use crate::emission::medium::Emission;
use kerrlight_geodesic::legendre;
use kerrlight_geodesic::simd::{PanelRule, RayNodes};

/// Optical depth beyond which nothing is seen.
const DARK: f64 = 45.0;

/// A quadrature rule with what sums over its panels need.
#[derive(Debug, Clone)]
pub(super) struct Quadrature {
    pub rule: PanelRule,
    /// Factors that take gains at the nodes to the first two and the last two Legendre
    /// coefficients of the integrand.
    spectrum: Vec<[f64; 4]>,
}

impl Quadrature {
    /// The rule with `order` ≥ 4 nodes.
    pub fn new(order: usize) -> Self {
        let rule = PanelRule::new(order);
        let row = |x: &f64| {
            let values: Vec<f64> = legendre::values(2.0 * x - 1.0).take(order).collect();
            [0, 1, order - 2, order - 1].map(|k| (2 * k + 1) as f64 * values[k])
        };
        let spectrum = rule.nodes().iter().map(row).collect();
        Quadrature { rule, spectrum }
    }

    /// An estimate of what the rule of p nodes misses of a panel with these gains. It is about the
    /// Legendre coefficient number 2p of the integrand, and coefficients of smooth functions fall
    /// geometrically: from the first two to the last two of p by a factor x over p − 2 numbers,
    /// and then by x^{3/2} over as many and half as many more.
    fn missed(&self, gains: &[f64]) -> f64 {
        let mut sums = [0.0; 4];
        for (gain, row) in gains.iter().zip(&self.spectrum) {
            for (sum, factor) in sums.iter_mut().zip(row) {
                *sum += gain * factor;
            }
        }
        let first = sums[0].abs().max(sums[1].abs());
        let rest = sums[2].abs().max(sums[3].abs());
        let x = if first > 0.0 { (rest / first).min(1.0) } else { 1.0 };
        rest * x * x.sqrt()
    }

    /// Returns the part of a panel's light, with these gains at these Mino times, from behind the Mino time `cut`:
    /// the integral of the polynomial through the nodes, by its Legendre series.
    fn rest(&self, times: &[f64], gains: &[f64], cut: f64) -> f64 {
        let whole: f64 = gains.iter().sum();
        let place = self.place(times, cut);
        if place <= 0.0 || place >= 1.0 {
            return if place <= 0.0 { whole } else { 0.0 };
        }
        let x = 2.0 * place - 1.0;
        let basis: Vec<f64> = legendre::values(x).take(gains.len() + 1).collect();
        let mut before = 0.5 * whole * (x + 1.0);
        for k in 1..gains.len() {
            let at = |node: &f64| legendre::values(2.0 * node - 1.0).nth(k).unwrap_or(0.0);
            let nodes = self.rule.nodes().iter().map(at).zip(gains);
            let coefficient: f64 = nodes.map(|(p, gain)| p * gain).sum();
            // ∫P_k = (P_{k+1} − P_{k−1})/(2k + 1).
            before += 0.5 * coefficient * (basis[k + 1] - basis[k - 1]);
        }
        // The polynomial may overshoot, but no part is brighter than the whole.
        whole - before.clamp(0.0, whole)
    }

    /// Returns the place in a panel, from 0 to 1, of a Mino time: linear between the nodes and beyond them.
    fn place(&self, times: &[f64], cut: f64) -> f64 {
        let last = times.len() - 1;
        let k = times.partition_point(|time| *time < cut).clamp(1, last);
        let [a, b] = [k - 1, k].map(|k| self.rule.nodes()[k]);
        a + (b - a) * (cut - times[k - 1]) / (times[k] - times[k - 1])
    }

    /// Optical depths at the nodes of a panel and at its end, from the gains of each node.
    fn absorb(&self, gains: &[f64], depth: &mut f64, depths: &mut Vec<f64>) {
        let mut rates = [0.0; MOST_NODES];
        for ((rate, gain), weight) in rates.iter_mut().zip(gains).zip(self.rule.weights()) {
            *rate = gain / weight;
        }
        for i in 0..gains.len() {
            let terms = self.rule.cumulative(i).iter().zip(&rates);
            let part: f64 = terms.map(|(factor, rate)| factor * rate).sum();
            // The interpolating polynomial may dip below 0.
            depths.push(*depth + part.max(0.0));
        }
        *depth += gains.iter().sum::<f64>();
    }
}

/// Sums of single nodes and panels.
#[derive(Debug, Default)]
pub(super) struct Sums {
    /// Optical depth at each node; empty without absorption.
    pub depths: Vec<f64>,
    /// Estimated error of each panel's intensity.
    pub misses: Vec<f64>,
    /// Estimated error of the part of light from behind that is seen.
    pub transmission_error: f64,
}

/// Sums emission up, front to back: I = ∫ j e^{−D} ds, D = ∫ κ ds. The sums' depths are
/// those of every node if there is absorption. With `cuts` the light after these Mino times is summed up too.
pub(super) fn integrate(
    quadrature: &Quadrature,
    nodes: &RayNodes<'_>,
    emission: &Emission,
    cuts: Option<[f64; 2]>,
    Sums { depths, misses, transmission_error }: &mut Sums,
) -> Light {
    let order = quadrature.rule.order();
    let mut light = Light::default();
    depths.clear();
    misses.clear();
    *transmission_error = 0.0;
    let (mut most, mut brightest) = (0.0, None);
    let mut gains = [0.0; MOST_NODES];
    let gains = &mut gains[..order];
    let panels = nodes.weight.chunks_exact(order).zip(emission.emissivity.chunks_exact(order));
    let panels = panels.zip(emission.redshift.chunks_exact(order));
    for (number, ((weights, emissivity), redshift)) in panels.enumerate() {
        let start = number * order;
        for ((gain, weight), j) in gains.iter_mut().zip(weights).zip(emissivity) {
            *gain = weight * j;
        }
        let absorption = emission.absorption.get(start..start + order);
        let miss = absorption.and_then(|absorption| {
            let (miss, of_depth) =
                shade(quadrature, [weights, absorption], gains, &mut light.depth, depths);
            // Of a panel that is opaque itself nothing behind is seen.
            *transmission_error += of_depth * (-light.depth).exp();
            miss
        });
        for (i, (gain, g)) in gains.iter().zip(redshift).enumerate() {
            light.intensity += gain;
            light.shift += g * gain;
            // By light per length: a long panel is not brighter for its length.
            if *gain > most * weights[i] {
                (most, brightest) = (gain / weights[i], Some(start + i));
            }
        }
        if let Some(shares) = emission.polarization.get(start..start + order) {
            for (gain, share) in gains.iter().zip(shares) {
                for (sum, x) in light.stokes.iter_mut().zip(share) {
                    *sum += gain * x;
                }
            }
        }
        if let Some(cuts) = cuts {
            let times = &nodes.mino_time[start..start + order];
            for (later, cut) in light.later.iter_mut().zip(cuts) {
                *later += quadrature.rest(times, gains, cut);
            }
        }
        let miss = miss.unwrap_or_else(|| quadrature.missed(gains));
        misses.push(miss);
        light.error += miss;
        if light.depth > DARK {
            break;
        }
    }
    if let Some(k) = brightest {
        (light.place, light.mino_time) = (Place::of_node(nodes, k), nodes.mino_time[k]);
    }
    light
}

/// Dims the gains of a panel by what lies before its nodes, whose weights and absorption are given. The error, if it
/// is not that of the rule, and that of the panel's depth.
fn shade(
    quadrature: &Quadrature,
    [weights, absorption]: [&[f64]; 2],
    gains: &mut [f64],
    depth: &mut f64,
    depths: &mut Vec<f64>,
) -> (Option<f64>, f64) {
    let (mut thick, start) = ([0.0; MOST_NODES], depths.len());
    for ((thick, weight), k) in thick.iter_mut().zip(weights).zip(absorption) {
        *thick = weight * k;
    }
    let thick = &thick[..gains.len()];
    let missed = quadrature.missed(thick);
    if thick.iter().sum::<f64>() > OPAQUE {
        return (Some(shade_opaque(thick, gains, depth, depths)), missed);
    }
    quadrature.absorb(thick, depth, depths);
    for (gain, depth) in gains.iter_mut().zip(&depths[start..]) {
        *gain *= (-depth).exp();
    }
    (None, missed)
}

/// Optical depth of a panel beyond which e^{−D} is no polynomial over it.
const OPAQUE: f64 = 2.0;

/// Shades a panel that is optically thick: each node stands for a cell with a constant source function S = j/κ, of
/// which S (1 − e^{−ΔD}) is seen. `gains` are those without absorption before and those that are seen after; the
/// error is that of S taken from the neighbouring cell instead.
fn shade_opaque(thick: &[f64], gains: &mut [f64], depth: &mut f64, depths: &mut Vec<f64>) -> f64 {
    let (mut error, mut last) = (0.0, None);
    for (gain, thick) in gains.iter_mut().zip(thick) {
        let seen = (-*depth).exp() * -(-thick).exp_m1();
        depths.push(*depth + 0.5 * thick);
        *depth += thick;
        if *thick > 0.0 {
            let source = *gain / thick;
            *gain = source * seen;
            error += (source - last.unwrap_or(source)).abs() * seen;
            last = Some(source);
        }
    }
    error
}

/// The most nodes of a panel.
const MOST_NODES: usize = 16;
