//! What fills space, and the light of it that one ray gathers.

use super::glimpse::Place;
use kerrlight_geodesic::bundle::{PanelRule, RayNodes};

/// Something that shines, and may absorb, all over a sphere.
pub trait Medium: core::fmt::Debug + Send + Sync {
    /// Radius in M of the sphere outside of which there is nothing.
    fn sphere(&self) -> f64;
    /// What it has to be told of its nodes besides r and cos θ.
    fn needs(&self) -> Needs;
    /// Linear colour.
    fn color(&self) -> [f32; 3];
    /// Intensity that its brightest parts may reach: what errors of faint rays are measured by.
    fn scale(&self) -> f64;
    /// Whether it looks different at different times.
    fn changes(&self) -> bool;
    /// Whether [`fill`](Self::fill) gives absorption.
    fn absorbs(&self) -> bool;
    /// Appends emission and absorption at the nodes of a ray with angular momentum `lambda`.
    fn fill(&self, nodes: &RayNodes<'_>, lambda: f64, moment: Moment, out: &mut Emission);
}

/// Columns of nodes that a medium needs.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Needs {
    /// Azimuth.
    pub azimuth: bool,
    /// Delay.
    pub time: bool,
    /// Rates of 1/r and cos θ.
    pub velocity: bool,
}

/// When a ray is seen.
#[derive(Debug, Clone, Copy)]
pub struct Moment {
    /// Time of observation, in M.
    pub observed: f64,
    /// Whether light takes its time.
    pub slow_light: bool,
}

/// A medium along a ray, node by node.
#[derive(Debug, Clone, Default)]
pub struct Emission {
    /// Observed intensity gained per unit of the affine parameter: g² j.
    pub emissivity: Vec<f64>,
    /// Optical depth gained per unit of the affine parameter, κ/g; empty without absorption.
    pub absorption: Vec<f64>,
    /// g; 1 where redshift is off.
    pub redshift: Vec<f64>,
}

impl Emission {
    /// Empty, with its memory.
    pub fn clear(&mut self) {
        self.emissivity.clear();
        self.absorption.clear();
        self.redshift.clear();
    }
}

/// Light of a medium along a ray.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Light {
    /// What is seen of it.
    pub intensity: f64,
    /// ∫ g dI.
    pub shift: f64,
    /// Optical depth of the whole way.
    pub depth: f64,
    /// Its brightest node.
    pub place: Place,
    /// An estimate of the error of the intensity.
    pub error: f64,
}

/// Beyond this optical depth nothing is seen.
const DARK: f64 = 45.0;

/// Sums emission up, front to back: I = ∫ j e^{−D} ds, D = ∫ κ ds. `depths` receives the optical
/// depth at every node if there is absorption.
pub(super) fn gather(
    rule: &PanelRule,
    nodes: &RayNodes<'_>,
    emission: &Emission,
    depths: &mut Vec<f64>,
) -> Light {
    let order = rule.order();
    let mut light = Light::default();
    depths.clear();
    let mut brightest = (0.0, None);
    for start in (0..nodes.weight.len()).step_by(order) {
        let panel = start..start + order;
        let weights = &nodes.weight[panel.clone()];
        if !emission.absorption.is_empty() {
            absorb(rule, weights, &emission.absorption[panel.clone()], &mut light.depth, depths);
        }
        let mut values = [0.0; MOST_NODES];
        for (i, k) in panel.enumerate() {
            let through = depths.get(k).map_or(1.0, |depth| (-depth).exp());
            let density = emission.emissivity[k] * through;
            let gain = density * weights[i];
            light.intensity += gain;
            light.shift += emission.redshift[k] * gain;
            values[i] = gain / rule.weights()[i];
            if density > brightest.0 {
                brightest = (density, Some(k));
            }
        }
        light.error += tail(rule, &values[..order]);
        if light.depth > DARK {
            break;
        }
    }
    light.place = brightest.1.map_or_else(Place::default, |k| Place::of_node(nodes, k));
    light
}

/// Optical depths at the nodes of a panel and at its end.
fn absorb(
    rule: &PanelRule,
    weights: &[f64],
    absorption: &[f64],
    depth: &mut f64,
    depths: &mut Vec<f64>,
) {
    let mut rates = [0.0; MOST_NODES];
    for (i, rate) in rates.iter_mut().take(weights.len()).enumerate() {
        *rate = absorption[i] * weights[i] / rule.weights()[i];
    }
    for i in 0..weights.len() {
        let part: f64 = rule.cumulative(i).iter().zip(&rates).map(|(a, rate)| a * rate).sum();
        depths.push(*depth + part.max(0.0));
    }
    *depth += rule.weights().iter().zip(&rates).map(|(w, rate)| w * rate).sum::<f64>();
}

/// The most nodes of a panel.
const MOST_NODES: usize = 16;

/// An estimate of what the rule misses of a panel: its error is about the Legendre coefficient
/// number 2p of the integrand, and coefficients of smooth functions fall geometrically. The square
/// of the last two of p over the first two is what number 2p − 2 would then be: on the safe side.
fn tail(rule: &PanelRule, values: &[f64]) -> f64 {
    let order = values.len();
    if order < 4 {
        return values.iter().zip(rule.weights()).map(|(f, w)| (f * w).abs()).sum();
    }
    let mut coefficients = [0.0f64; MOST_NODES];
    for ((f, w), x) in values.iter().zip(rule.weights()).zip(rule.nodes()) {
        let (z, fw) = (2.0 * x - 1.0, f * w);
        let (mut last, mut value) = (0.0, 1.0);
        for (k, c) in coefficients.iter_mut().take(order).enumerate() {
            *c += fw * value;
            let k = k as f64;
            (last, value) = (value, ((2.0 * k + 1.0) * z * value - k * last) / (k + 1.0));
        }
    }
    let size = |k: usize| (2 * k + 1) as f64 * coefficients[k].abs();
    let first = size(0).max(size(1));
    let rest = size(order - 1).max(size(order - 2));
    if first > 0.0 { rest * (rest / first).min(1.0) } else { rest }
}
