//! A quadrature rule on panels that also integrates up to each of its own nodes.

use super::lanes::Lanes;
use crate::numbers::legendre;
use crate::numbers::quadrature::gauss_legendre;

/// Longest panel in units of 1/√max(1, η + λ²) of Mino time.
pub(crate) const LONGEST_PANEL: f64 = 0.4;

/// The Gauss–Legendre rule on [0, 1] with the integrals from 0 to its nodes.
///
/// Rule of panels. On its last panel before the horizon, where what is integrated may go like a
/// half-integer power of the distance, a ray is followed at a pace that falls linearly to zero: τ =
/// L (1 − (1 − s)²).
#[derive(Debug, Clone, PartialEq)]
pub struct PanelRule {
    nodes: Vec<f64>,
    weights: Vec<f64>,
    /// Row i: what the values at the nodes contribute to the integral from 0 to node i.
    cumulative: Vec<f64>,
}

impl PanelRule {
    /// The rule with `order` ≥ 1 nodes.
    pub fn new(order: usize) -> Self {
        let (nodes, weights): (Vec<f64>, Vec<f64>) = gauss_legendre(order).into_iter().unzip();
        let mut cumulative = Vec::with_capacity(order * order);
        for x in &nodes {
            let areas = legendre_areas(order, *x);
            for (node, weight) in nodes.iter().zip(&weights) {
                // The interpolating polynomial of a node is Σ (2k + 1) w P_k(node) P_k.
                let values = legendre_values(order, *node);
                let terms = values.iter().zip(&areas).enumerate();
                let sum: f64 = terms.map(|(k, (p, area))| (2 * k + 1) as f64 * p * area).sum();
                cumulative.push(weight * sum);
            }
        }
        PanelRule { nodes, weights, cumulative }
    }

    /// Nodes a panel.
    pub fn order(&self) -> usize {
        self.nodes.len()
    }

    /// The nodes, in (0, 1), as parts of a panel.
    pub fn nodes(&self) -> &[f64] {
        &self.nodes
    }

    /// The weights, which add up to 1.
    pub fn weights(&self) -> &[f64] {
        &self.weights
    }

    /// The place on a panel, and the pace there, at the rule's variable s: on the panel before the
    /// horizon the pace falls to zero.
    #[inline]
    pub(crate) fn pace(s: f64, falls: bool) -> (f64, f64) {
        if falls { (s * (2.0 - s), 2.0 * (1.0 - s)) } else { (s, 1.0) }
    }

    /// Row i: factors of f at the nodes in the integral of f from 0 to node i.
    pub fn cumulative(&self, i: usize) -> &[f64] {
        let order = self.order();
        &self.cumulative[i * order..(i + 1) * order]
    }
}

/// P_k(2x − 1) for k < n.
fn legendre_values(n: usize, x: f64) -> Vec<f64> {
    legendre::values(2.0 * x - 1.0).take(n).collect()
}

/// ∫₀ˣ P_k(2t − 1) dt for k < n.
fn legendre_areas(n: usize, x: f64) -> Vec<f64> {
    let values = legendre_values(n + 1, x);
    let area = |k: usize| match k {
        0 => x,
        k => (values[k + 1] - values[k - 1]) / (2 * (2 * k + 1)) as f64,
    };
    (0..n).map(area).collect()
}

/// `sum + length Σ factors · rates`.
#[inline(always)]
pub(super) fn integral<V: Lanes<f64>>(
    factors: &[f64],
    rates: &[[V; 2]],
    length: V,
    sum: [V; 2],
) -> [V; 2] {
    let (mut time, mut azimuth) = (V::splat(0.0), V::splat(0.0));
    for (factor, rate) in factors.iter().zip(rates) {
        time = rate[0].mul_add(V::splat(*factor), time);
        azimuth = rate[1].mul_add(V::splat(*factor), azimuth);
    }
    [time.mul_add(length, sum[0]), azimuth.mul_add(length, sum[1])]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_integrals_of_powers_up_to_every_node() {
        for order in [1, 2, 4, 8, 12] {
            let rule = PanelRule::new(order);
            for power in 0..order as i32 {
                let whole: f64 =
                    rule.nodes().iter().zip(rule.weights()).map(|(x, w)| w * x.powi(power)).sum();
                assert!((whole * f64::from(power + 1) - 1.0).abs() < 1e-13);
                for (i, end) in rule.nodes().iter().enumerate() {
                    let part = rule.cumulative(i).iter().zip(rule.nodes());
                    let part: f64 = part.map(|(a, x)| a * x.powi(power)).sum();
                    let expected = end.powi(power + 1) / f64::from(power + 1);
                    assert!((part - expected).abs() < 1e-14, "{order} {power} {i}");
                }
            }
        }
    }
}
