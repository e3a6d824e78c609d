//! What fills space, and the light of it that one ray gathers.

use super::Part;
use super::result::Place;
use kerrlight_geodesic::Quantities;
use kerrlight_geodesic::simd::{PanelRule, RayNodes};

/// Something that shines, and may absorb, all over a sphere.
pub trait Medium: core::fmt::Debug + Send + Sync {
    /// Whose cost it is part of.
    fn part(&self) -> Part;
    /// Radius in M of the sphere outside of which there is nothing.
    fn sphere(&self) -> f64;
    /// What it is made of, if its light is not smooth along panels of any length.
    fn cell_size(&self) -> Option<CellSize>;
    /// Size of its finest features by their radius, at most about 1: structure of cells is some of them
    /// wide.
    fn relative_size(&self) -> f64 {
        self.cell_size().map_or(1.0, |cell| 2.0 * cell.size / self.sphere())
    }
    /// What it has to be told of its nodes besides r and cos θ.
    fn quantities(&self) -> Quantities;
    /// Linear colour.
    fn color(&self) -> [f32; 3];
    /// Intensity that its brightest parts may reach: what errors of faint rays are measured by.
    fn scale(&self) -> f64;
    /// Contravariant Boyer–Lindquist four-velocity of its matter, for polarised light; `None` where
    /// there is none. The azimuth is 0 where it is not among its needs.
    fn four_velocity(&self, r: f64, cos_theta: f64, azimuth: f64) -> Option<[f64; 4]>;
    /// Whether it looks different at different times.
    fn changes(&self) -> bool;
    /// `false` only if it is dark all along a segment of a ray.
    fn may_shine(&self, segment: &PathSegment, moment: Moment) -> bool {
        let _ = (segment, moment);
        true
    }
    /// Whether [`fill`](Self::fill) gives absorption.
    fn absorbs(&self) -> bool;
    /// Appends emission and absorption at the nodes of a ray with angular momentum `lambda`.
    fn fill(&self, nodes: &RayNodes<'_>, lambda: f64, moment: Moment, out: &mut Emission);
}

/// A short piece of a ray.
#[derive(Debug, Clone, Copy)]
pub struct PathSegment {
    /// r n of its ends, in M.
    pub positions: [[f64; 3]; 2],
    /// Its least and its largest radius, in M.
    pub radii: [f64; 2],
    /// Its largest and its least delay, in M; 0 where delays are not asked for.
    pub delays: [f64; 2],
    /// How far it may lie from its chord, in M; infinite if that is not known.
    pub off: f64,
}

/// Cells in which a medium is smooth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CellSize {
    /// Shortest edge of a cell in M. Panels are never longer, and not cut any more once they are
    /// shorter than a quarter of it.
    pub size: f64,
    /// Radius in M of the sphere inside of which there is nothing.
    pub inner: f64,
}

impl CellSize {
    /// The part of a cell below which panels are not cut for the sake of the tolerance.
    pub(super) const FINEST: f64 = 0.25;

    /// The longest panel of a ray outside of the inner sphere, M.
    pub(super) fn longest(&self, nodes: &RayNodes<'_>, order: usize) -> f64 {
        let panels = nodes.weight.chunks_exact(order).zip(nodes.radius.chunks_exact(order));
        let outside = panels.filter(|(_, radius)| radius.iter().any(|r| *r >= self.inner));
        outside.map(|(weights, _)| weights.iter().sum()).fold(0.0, f64::max)
    }
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
    /// Q, U, V over I; empty without polarisation.
    pub polarization: Vec<[f64; 3]>,
}

impl Emission {
    /// Empty, with its memory.
    pub fn clear(&mut self) {
        self.emissivity.clear();
        self.absorption.clear();
        self.redshift.clear();
        self.polarization.clear();
    }
}

/// Light of a medium along a ray.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Light {
    /// What is seen of it.
    pub intensity: f64,
    /// ∫ g dI.
    pub shift: f64,
    /// Q, U, V.
    pub stokes: [f64; 3],
    /// Optical depth of the whole way.
    pub depth: f64,
    /// Its brightest node.
    pub place: Place,
    /// An estimate of the error of the intensity.
    pub error: f64,
}

/// Beyond this optical depth nothing is seen.
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
        let row = |x: &f64| [0, 1, order - 2, order - 1].map(|k| legendre(k, 2.0 * x - 1.0));
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

    /// Optical depths at the nodes of a panel and at its end, from the gains of each node.
    fn absorb(&self, gains: &[f64], depth: &mut f64, depths: &mut Vec<f64>) {
        let mut rates = [0.0; MOST_NODES];
        for ((rate, gain), weight) in rates.iter_mut().zip(gains).zip(self.rule.weights()) {
            *rate = gain / weight;
        }
        for i in 0..gains.len() {
            let terms = self.rule.cumulative(i).iter().zip(&rates);
            let part: f64 = terms.map(|(factor, rate)| factor * rate).sum();
            depths.push(*depth + part.max(0.0));
        }
        *depth += gains.iter().sum::<f64>();
    }
}

/// (2k + 1) P_k(z).
fn legendre(k: usize, z: f64) -> f64 {
    let (mut last, mut value) = (0.0, 1.0);
    for j in 0..k {
        let j = j as f64;
        (last, value) = (value, ((2.0 * j + 1.0) * z * value - j * last) / (j + 1.0));
    }
    (2 * k + 1) as f64 * value
}

/// What is known of single nodes and panels of a sum.
#[derive(Debug, Default)]
pub(super) struct Sums {
    /// Optical depth at each node; empty without absorption.
    pub depths: Vec<f64>,
    /// Estimated error of each panel's intensity.
    pub misses: Vec<f64>,
}

/// Sums emission up, front to back: I = ∫ j e^{−D} ds, D = ∫ κ ds. The sums' depths are
/// those of every node if there is absorption.
pub(super) fn integrate(
    quadrature: &Quadrature,
    nodes: &RayNodes<'_>,
    emission: &Emission,
    Sums { depths, misses }: &mut Sums,
) -> Light {
    let order = quadrature.rule.order();
    let mut light = Light::default();
    depths.clear();
    misses.clear();
    let (mut most, mut brightest) = (0.0, None);
    let mut gains = [0.0; MOST_NODES];
    let gains = &mut gains[..order];
    let panels = nodes.weight.chunks_exact(order).zip(emission.emissivity.chunks_exact(order));
    let panels = panels.zip(emission.redshift.chunks_exact(order));
    for (number, ((weights, emissivity), redshift)) in panels.enumerate() {
        let start = number * order;
        let mut miss = None;
        for ((gain, weight), j) in gains.iter_mut().zip(weights).zip(emissivity) {
            *gain = weight * j;
        }
        if !emission.absorption.is_empty() {
            let absorption = &emission.absorption[start..start + order];
            let mut thick = [0.0; MOST_NODES];
            for ((thick, weight), k) in thick.iter_mut().zip(weights).zip(absorption) {
                *thick = weight * k;
            }
            let thick = &thick[..order];
            if thick.iter().sum::<f64>() > OPAQUE {
                miss = Some(shade_opaque(thick, gains, &mut light.depth, depths));
            } else {
                quadrature.absorb(thick, &mut light.depth, depths);
                for (gain, depth) in gains.iter_mut().zip(&depths[start..]) {
                    *gain *= (-depth).exp();
                }
            }
        }
        for (i, (gain, g)) in gains.iter().zip(redshift).enumerate() {
            light.intensity += gain;
            light.shift += g * gain;
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
        let miss = miss.unwrap_or_else(|| quadrature.missed(gains));
        misses.push(miss);
        light.error += miss;
        if light.depth > DARK {
            break;
        }
    }
    light.place = brightest.map_or_else(Place::default, |k| Place::of_node(nodes, k));
    light
}

/// Optical depth of a panel beyond which e^{−D} is no polynomial over it.
const OPAQUE: f64 = 2.0;

/// What is seen of a panel that is optically thick: each node stands for a cell with a constant
/// source function S = j/κ, of which S (1 − e^{−ΔD}) is seen. `gains` are those without
/// absorption before and those that are seen after; the error is that of S taken from the
/// neighbouring cell instead.
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
