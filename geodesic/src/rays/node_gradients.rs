//! Exact derivatives of the nodes of a quadrature with respect to spin, inclination and screen: what a fit of the
//! spacetime needs.
//!
//! [`Nodes`] places nodes on many rays in closed form; this module says how each of them moves.
//!
//! ```
//! use kerrlight_geodesic::node_gradients;
//! use kerrlight_geodesic::simd::{NodeRequest, PanelRule};
//! use kerrlight_geodesic::{Inclination, Kerr, Observer, Quantities};
//! let hole = Kerr::new(0.9)?;
//! let observer = Observer::at_infinity(Inclination::from_degrees(60.0)?);
//! let (rule, quantities) = (PanelRule::new(6), Quantities::ALL);
//! let request = NodeRequest { radius: 10.0, rule, split: 1, quantities };
//! let nodes = node_gradients::trace(&hole, &observer, &[-6.0], &[2.0], 1e-12, &request)?;
//! let node = nodes.ray(0)[0];
//! let ([x, _, _], [dx, _, _]) = (node.value.position, node.gradient.position);
//! println!("x = {x} M, dx/da = {} M, dx/di = {} M/rad", dx.spin, dx.inclination);
//! # Ok::<(), kerrlight_geodesic::Error>(())
//! ```
//!
//! A derivative follows the node: its Mino time moves with the entry into the sphere and with the turning point or
//! the horizon, as the layout of the panels says. Differences of [`Nodes`] at two neighbouring parameters converge
//! to it wherever both have the same number of panels. The observer's radius and azimuth are fixed.
//!
//! Rays are followed with dual numbers by Taylor series, about 60 µs a ray and 1.5 µs a node.

use crate::error::Error;
use crate::integrate::path::Path;
use crate::integrate::trace::{Tracer, trace_series};
use crate::numbers::dual::Dual;
use crate::numbers::quadrature::gauss_legendre;
use crate::numbers::scalar::Scalar;
use crate::rays::blocks::{BLOCK, check_columns, in_blocks};
use crate::rays::derivatives::{Gradient, with_parameters};
use crate::rays::sampling::Trajectory;
use crate::rays::trajectory::MinoPath;
use crate::screen::observer::{Observer, Ray};
use crate::simd::{GROWTH, Key, NodeRequest, Nodes, PanelRule, span};
use crate::spacetime::kerr::Kerr;
use crate::spacetime::point::PathPoint;

type Number = Dual<f64, 4>;

/// State at a node: numbers, or their derivatives.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct NodeState<N> {
    /// The point r n (x, y and z, M).
    pub position: [N; 3],
    /// The arriving photon's angular momentum per energy, k_θ φ̂ − k_φ θ̂/sin θ (x, y and z, M).
    pub momentum: [N; 3],
    /// d(1/r)/dτ of the backward ray, dimensionless.
    pub radial: N,
    /// t_o − t, M (its finite part for an observer at infinity); 0 unless requested.
    pub delay: N,
    /// The weight Σ dτ, M.
    pub weight: N,
}

impl NodeState<Number> {
    fn map<N>(self, f: impl Fn(Number) -> N) -> NodeState<N> {
        NodeState {
            position: self.position.map(&f),
            momentum: self.momentum.map(&f),
            radial: f(self.radial),
            delay: f(self.delay),
            weight: f(self.weight),
        }
    }
}

/// A node, and how it moves.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct DifferentiatedNode {
    /// Position, as [`Nodes`] has it.
    pub value: NodeState<f64>,
    /// Its derivatives.
    pub gradient: NodeState<Gradient>,
}

/// The nodes of many rays with their derivatives.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct DifferentiatedNodes {
    ends: Vec<usize>,
    nodes: Vec<DifferentiatedNode>,
}

impl DifferentiatedNodes {
    /// Number of rays.
    pub fn rays(&self) -> usize {
        self.ends.len()
    }

    /// Those of ray `k`, one for each of [`Nodes::ray`]; none if there is no such ray.
    pub fn ray(&self, k: usize) -> &[DifferentiatedNode] {
        &self.nodes[span(&self.ends, k)]
    }

    fn append(&mut self, other: Self) {
        let before = self.nodes.len();
        self.nodes.extend(other.nodes);
        self.ends.extend(other.ends.into_iter().map(|end| end + before));
    }
}

/// Derivatives of the nodes that [`Nodes::trace`] places on the rays arriving at (`alpha[k]`, `beta[k]`), M, on all
/// cores with the feature `rayon`. `tolerance` is that of the rays, dimensionless.
///
/// # Errors
/// As for [`Nodes::trace`]; if the tolerance is out of range, or |a| = 1, where the horizon's radius has no
/// derivative.
pub fn trace(
    hole: &Kerr,
    observer: &Observer,
    alpha: &[f64],
    beta: &[f64],
    tolerance: f64,
    request: &NodeRequest,
) -> Result<DifferentiatedNodes, Error> {
    check_columns(alpha, beta)?;
    Tracer::new(tolerance)?;
    let dual = {
        let (hole, observer) = with_parameters(hole, observer)?;
        DualRays { hole, observer, tolerance, request }
    };
    let pieces =
        in_blocks(BLOCK, alpha, beta, |alpha, beta| -> Result<DifferentiatedNodes, Error> {
            let mut nodes = Nodes::default();
            nodes.trace(hole, observer, alpha, beta, None, request)?;
            dual.block(&nodes.layouts(), alpha, beta)
        });
    let mut whole = DifferentiatedNodes::default();
    for piece in pieces {
        whole.append(piece?);
    }
    Ok(whole)
}

/// Quantities common to the rays of a block.
struct DualRays<'a> {
    hole: Kerr<Number>,
    observer: Observer<Number>,
    tolerance: f64,
    request: &'a NodeRequest,
}

impl DualRays<'_> {
    fn block(
        &self,
        layouts: &[Key],
        alpha: &[f64],
        beta: &[f64],
    ) -> Result<DifferentiatedNodes, Error> {
        let mut found = DifferentiatedNodes::default();
        let mut path = Path::empty();
        for ((layout, alpha), beta) in layouts.iter().zip(alpha).zip(beta) {
            if layout.sampled() > 0 {
                let [alpha, beta] = [Number::parameter(*alpha, 2), Number::parameter(*beta, 3)];
                let ray = self.observer.ray(&self.hole, alpha, beta)?;
                let quantities = self.request.quantities;
                trace_series(self.tolerance, &self.hole, &ray, quantities, &mut path)?;
                self.nodes(layout, &MinoPath::new(&path, &ray), &mut found.nodes);
            }
            found.ends.push(found.nodes.len());
        }
        Ok(found)
    }

    /// The nodes of a ray, leg after leg.
    fn nodes(
        &self,
        layout: &Key,
        path: &MinoPath<'_, Number>,
        nodes: &mut Vec<DifferentiatedNode>,
    ) {
        let mut pieces = Vec::new();
        path.within(0.0, self.request.radius, &mut pieces);
        let mut time = pieces.first().map_or(Number::constant(0.0), |piece| piece[0]);
        for (length, panels, falls) in self.legs(layout, path, time) {
            let panel = length * Number::constant(1.0 / f64::from(panels.max(1)));
            for _ in 0..panels {
                self.panel(path, [time, panel], falls, nodes);
                time = time + panel;
            }
        }
    }

    /// Length and panels of each leg inside the sphere, and whether it ends on the horizon.
    fn legs(
        &self,
        layout: &Key,
        path: &MinoPath<'_, Number>,
        approach: Number,
    ) -> Vec<(Number, u32, bool)> {
        let s = Number::constant;
        let since = if layout.entry > 0 { self.since(path.ray, approach) } else { approach };
        let growing = |k: u32| since * s((GROWTH - 1.0) * GROWTH.powi(k as i32));
        let entry = (0..layout.entry).map(|k| (growing(k), layout.split, false));
        let end =
            if path.turning_radius().is_some() { path.total() * s(0.5) } else { path.total() };
        let far = since * s(GROWTH.powi(layout.entry as i32) - 1.0);
        let rest = end - approach - far;
        let last = if layout.falls { rest / s(f64::from(layout.inward + 1)) } else { rest };
        let inward = if layout.falls { rest - last } else { rest };
        let exit = (0..layout.exit).rev().map(|k| (growing(k), layout.split, false));
        let middle = [(inward, layout.inward, false), (last, layout.last, layout.falls)];
        entry.chain(middle).chain(exit).collect()
    }

    /// Mino time from infinity to the sphere.
    fn since(&self, ray: &Ray<Number>, approach: Number) -> Number {
        if self.observer.is_at_infinity() {
            return approach;
        }
        // Legs only grow where the sphere is far outside of the turning point: what is integrated is smooth.
        let entry = 1.0 / self.request.radius;
        let rate = |(x, weight): (f64, f64)| {
            let speed = ray.potential.value(Number::constant(entry * x)).sqrt();
            Number::constant(entry * weight) / speed
        };
        let rates = gauss_legendre(24).into_iter().map(rate);
        rates.fold(Number::constant(0.0), |sum, rate| sum + rate)
    }

    fn panel(
        &self,
        path: &MinoPath<'_, Number>,
        [start, length]: [Number; 2],
        falls: bool,
        nodes: &mut Vec<DifferentiatedNode>,
    ) {
        let rule = &self.request.rule;
        for (s, weight) in rule.nodes().iter().zip(rule.weights()) {
            let (place, pace) = PanelRule::pace(*s, falls);
            let point = path.at(start + length * Number::constant(place));
            nodes.push(self.node(&point, length * Number::constant(weight * pace)));
        }
    }

    fn node(&self, point: &PathPoint<Number>, step: Number) -> DifferentiatedNode {
        let ([x, y, z], [a, b, c]) = (point.direction, point.velocity);
        let state = NodeState {
            position: point.cartesian(),
            // −n × velocity.
            momentum: [z * b - y * c, x * c - z * a, y * a - x * b],
            radial: point.inverse_radius_rate,
            delay: point.delay,
            weight: self.hole.sigma(point.radius(), point.cos_theta()) * step,
        };
        let value = state.map(|number| number.value);
        DifferentiatedNode { value, gradient: state.map(Gradient::of) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::screen::observer::Inclination;
    use crate::simd::RayNodes;
    use crate::spacetime::quantities::Quantities;

    /// A place in the space of parameters: spin, inclination, α and β.
    type Place = [f64; 4];

    fn observed(place: Place, distance: Option<f64>) -> (Kerr, Observer) {
        let inclination = Inclination::from_radians(place[1]).unwrap();
        let observer = match distance {
            None => Observer::at_infinity(inclination),
            Some(radius) => Observer::at_radius(inclination, radius).unwrap(),
        };
        (Kerr::new(place[0]).unwrap(), observer)
    }

    /// x, y, z, the momentum's, d(1/r)/dτ, delay and weight of a node.
    fn numbers(ray: &RayNodes<'_>, i: usize, lambda: f64) -> [f64; 9] {
        let (r, u) = (ray.radius[i], ray.cos_theta[i]);
        let (s, (sin, cos)) = ((1.0 - u * u).sqrt(), ray.azimuth[i].sin_cos());
        let (of_theta, of_phi) = (ray.polar_velocity[i] / s, lambda / s);
        let (phi, theta) = ([-sin, cos, 0.0], [u * cos, u * sin, -s]);
        let momentum = [0, 1, 2].map(|c| of_theta * phi[c] - of_phi * theta[c]);
        let [a, b, c] = momentum;
        let radial = ray.radial_velocity[i];
        [r * s * cos, r * s * sin, r * u, a, b, c, radial, ray.delay[i], ray.weight[i]]
    }

    fn nodes(place: Place, distance: Option<f64>, request: &NodeRequest) -> Vec<[f64; 9]> {
        let (hole, observer) = observed(place, distance);
        let mut nodes = Nodes::default();
        nodes.trace(&hole, &observer, &[place[2]], &[place[3]], None, request).unwrap();
        let (ray, lambda) = (nodes.ray(0), observer.lambda(place[2]));
        (0..ray.radius.len()).map(|i| numbers(&ray, i, lambda)).collect()
    }

    fn slopes(node: &NodeState<Gradient>, parameter: usize) -> [f64; 9] {
        let of = |gradient: Gradient| gradient.to_array()[parameter];
        let [[x, y, z], [a, b, c]] = [node.position.map(of), node.momentum.map(of)];
        [x, y, z, a, b, c, of(node.radial), of(node.delay), of(node.weight)]
    }

    /// Central differences of the closed form, of fourth order.
    fn compare(place: Place, distance: Option<f64>, radius: f64) {
        let quantities = Quantities::ALL;
        let request = NodeRequest { radius, rule: PanelRule::new(12), split: 1, quantities };
        let (hole, observer) = observed(place, distance);
        let (alpha, beta) = ([place[2]], [place[3]]);
        let found = trace(&hole, &observer, &alpha, &beta, 1e-13, &request).unwrap();
        let count = nodes(place, distance, &request).len();
        assert!(count > 10 && found.ray(0).len() == count, "{place:?}");
        for parameter in 0..4 {
            let h = 1e-3;
            let moved = |by: f64| {
                let mut place = place;
                place[parameter] += by * h;
                nodes(place, distance, &request)
            };
            let [a, b, c, d] = [-2.0, -1.0, 1.0, 2.0].map(moved);
            for (k, node) in found.ray(0).iter().enumerate() {
                let NodeState { position: [x, y, z], momentum: [u, v, w], radial, delay, weight } =
                    node.value;
                let here = nodes(place, distance, &request)[k];
                for (found, here) in [x, y, z, u, v, w, radial, delay, weight].into_iter().zip(here)
                {
                    assert!(
                        (found - here).abs() < 1e-10 * (1.0 + here.abs()),
                        "{place:?}: node {k} of {count}, r {}: {found} {here}",
                        x.hypot(y).hypot(z)
                    );
                }
                for (c8, slope) in slopes(&node.gradient, parameter).into_iter().enumerate() {
                    let difference =
                        (a[k][c8] - d[k][c8] + 8.0 * (c[k][c8] - b[k][c8])) / (12.0 * h);
                    let scale = 1.0 + slope.abs();
                    assert!(
                        (difference - slope).abs() < 2e-7 * scale,
                        "{place:?}: node {k} of {count}, number {c8}, parameter {parameter}: {difference} {slope}"
                    );
                }
            }
        }
    }

    #[test]
    fn exact_derivatives_of_nodes_are_those_of_the_closed_form() {
        for place in [[0.9, 1.0, -6.0, 2.0], [-0.5, 0.4, 3.0, 7.0], [0.3, 2.0, 1.5, -2.0]] {
            compare(place, None, 10.0);
            compare(place, Some(1000.0), 10.0);
        }
        // Legs that grow: far from the hole the observer's distance is seen in them.
        compare([0.7, 1.2, 4.0, 5.0], None, 200.0);
        compare([0.7, 1.2, 4.0, 5.0], Some(1000.0), 200.0);
    }

    #[test]
    fn exact_refusals_name_what_is_wrong() {
        let (hole, observer) = observed([0.9, 1.0, 0.0, 0.0], None);
        let rule = PanelRule::new(4);
        let request = NodeRequest { radius: 10.0, rule, split: 1, quantities: Quantities::ALL };
        let extreme = Kerr::new(1.0).unwrap();
        let error = trace(&extreme, &observer, &[1.0], &[1.0], 1e-12, &request).unwrap_err();
        assert_eq!(error.field(), "spin");
        let error = trace(&hole, &observer, &[1.0], &[], 1e-12, &request).unwrap_err();
        assert_eq!(error.field(), "number of beta");
        let none = NodeRequest { radius: 0.5, ..request };
        assert!(trace(&hole, &observer, &[1.0], &[1.0], 1e-12, &none).is_err());
    }
}
