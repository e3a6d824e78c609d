//! The redshift factor of gas that turns about any axis, and its derivative with respect to the axis.

use super::sightlines::Sightlines;
use core::f64::consts::TAU;
use kerrlight_geodesic::vector::norm;
use kerrlight_geodesic::{Kerr, interrupt};
use kerrlight_render::dynamics::{AngularVelocity, Axis};
use rayon::prelude::*;

/// Quantities on which g of one node depends: g = √N/(1 − Ω ξ·L), N = −u·u of the gas per (dt)².
///
/// With dφ/dt = −Ω ξ·θ̂/sin θ and dθ/dt = Ω ξ·φ̂ (a turn about ξ of the point r n),
/// N = −g_tt − 2 g_tφ dφ/dt − g_φφ (dφ/dt)² − g_θθ (dθ/dt)².
#[derive(Clone, Copy, Debug)]
struct Node {
    /// −g_tt.
    still: f64,
    /// Vector whose product with ξ is −2 g_tφ dφ/dt.
    drag: [f64; 3],
    /// Vectors whose squared products with ξ are g_φφ (dφ/dt)² and g_θθ (dθ/dt)².
    speeds: [[f64; 3]; 2],
    /// Ω L.
    boost: [f64; 3],
    /// 1 − p_r dr/dt, what ξ·Ω L is subtracted from: 1 for gas on spheres.
    ahead: f64,
}

/// Matter on circles, which is dark where it would be faster than light.
#[derive(Clone, Debug)]
pub struct Circles {
    spin: f64,
    velocity: AngularVelocity,
}

/// Points of a circle that are looked at.
const AROUND: usize = 8;

impl Circles {
    /// Returns whether matter that passes a point (M) is dark on its whole way about the axis.
    pub fn is_dark(&self, axis: Axis, x: [f64; 3]) -> bool {
        let is_faster_than_light = |x: [f64; 3]| {
            // The speed alone counts: no light has to arrive.
            let node = Node::new(x, [0.0; 3], self.spin, &self.velocity);
            node.shift(axis.vector()).is_none()
        };
        let rate = self.velocity.rate(norm(x));
        // Matter that rests stays where it is.
        let period = if rate == 0.0 { 0.0 } else { TAU / rate };
        let at = |k: usize| self.velocity.before(axis, x, period * k as f64 / AROUND as f64);
        (0..AROUND).map(at).all(is_faster_than_light)
    }
}

/// g^power of all nodes for any axis.
#[derive(Clone, Debug)]
pub(in crate::fit) struct Shift {
    nodes: Vec<Node>,
    power: f64,
    /// None of matter that falls, which is elsewhere at other times.
    pub circles: Option<Circles>,
}

/// Nodes that one thread takes at a time.
const SHARE: usize = 4096;

impl Shift {
    /// Takes gas on the spheres of a hole, or falling in; the sightlines must have momenta.
    pub fn new(lines: &Sightlines, hole: &Kerr, velocity: &AngularVelocity, power: f64) -> Self {
        let node = |k| {
            interrupt::check();
            let at = |columns: &[Vec<f64>; 3]| [0, 1, 2].map(|c| columns[c][k]);
            let mut node =
                Node::new(at(&lines.position), at(&lines.momentum), hole.spin(), velocity);
            if let Some(flow) = velocity.falling() {
                let r = norm(at(&lines.position));
                node.fall(lines.radial[k], flow.rates(r)[0], hole, lines.position[2][k] / r, r);
            }
            node
        };
        let circles = Circles { spin: hole.spin(), velocity: velocity.clone() };
        let circles = velocity.falling().is_none().then_some(circles);
        Self { nodes: (0..lines.points()).map(node).collect(), power, circles }
    }

    /// Bytes of its nodes.
    pub fn bytes(&self) -> usize {
        size_of_val(&*self.nodes)
    }

    /// factors[k] = g^power, 0 where the gas would be faster than light.
    pub fn factors(&self, axis: Axis, factors: &mut [f64]) {
        let axis = axis.vector();
        let shares = factors.par_chunks_mut(SHARE).zip(self.nodes.par_chunks(SHARE));
        shares.for_each(|(factors, nodes)| {
            for (factor, node) in factors.iter_mut().zip(nodes) {
                *factor = node.shift(axis).map_or(0.0, |(g, _)| g.powf(self.power));
            }
        });
    }

    /// `scale` dg^power/dξ of each node, in the space around the sphere, and nothing.
    #[cfg(feature = "wgpu")]
    pub fn slopes(&self, axis: Axis, scale: &[f64]) -> Vec<[f32; 4]> {
        let vector = axis.vector();
        let of = |(scale, node): (&f64, &Node)| {
            let Some((g, [x, y, z])) = node.shift(vector) else { return [0.0; 4] };
            let factor = scale * self.power * g.powf(self.power - 1.0);
            [x, y, z, 0.0].map(|slope| (factor * slope) as f32)
        };
        scale.par_iter().zip(&self.nodes).map(of).collect()
    }

    /// Σ cotangent · dg^power/dξ, along the sphere.
    pub fn vjp(&self, axis: Axis, cotangents: &[f64]) -> [f64; 3] {
        let vector = axis.vector();
        let of = |(cotangents, nodes): (&[f64], &[Node])| {
            let mut sum = [0.0; 3];
            for (cotangent, node) in cotangents.iter().zip(nodes).filter(|(c, _)| **c != 0.0) {
                if let Some((g, slope)) = node.shift(vector) {
                    let factor = cotangent * self.power * g.powf(self.power - 1.0);
                    sum.iter_mut().zip(slope).for_each(|(sum, slope)| *sum += factor * slope);
                }
            }
            sum
        };
        // Parts in their order: the same bits on any number of threads.
        let parts: Vec<[f64; 3]> =
            cotangents.par_chunks(SHARE).zip(self.nodes.par_chunks(SHARE)).map(of).collect();
        axis.tangent(core::array::from_fn(|c| parts.iter().map(|part| part[c]).sum()))
    }
}

impl Node {
    fn new(x: [f64; 3], momentum: [f64; 3], spin: f64, velocity: &AngularVelocity) -> Self {
        let r = norm(x);
        let (u, flat) = (x[2] / r, x[0].hypot(x[1]));
        let (s, rate) = (flat / r, velocity.rate(r));
        // On the axis every azimuth gives the same: there `round` is Σ, and `drag` is 0.
        let (cos, sin) = if flat > 0.0 { (x[0] / flat, x[1] / flat) } else { (1.0, 0.0) };
        let (theta, phi) = ([u * cos, u * sin, -s], [-sin, cos, 0.0]);
        let sigma_kerr = r * r + spin * spin * u * u;
        // g_φφ/sin²θ.
        let round = r * r + spin * spin + 2.0 * spin * spin * r * s * s / sigma_kerr;
        let scaled = |vector: [f64; 3], by: f64| vector.map(|c| by * c);
        Self {
            still: 1.0 - 2.0 * r / sigma_kerr,
            // g_tφ = −2 a r sin²θ/Σ, of which dφ/dt takes one sine.
            drag: scaled(theta, -4.0 * spin * r * s * rate / sigma_kerr),
            speeds: [scaled(theta, rate * round.sqrt()), scaled(phi, rate * sigma_kerr.sqrt())],
            boost: scaled(momentum, rate),
            ahead: 1.0,
        }
    }

    /// Adds dr/dt = v at radius r, cos θ = u, where the backward ray has d(1/r)/dτ = `radial`: N loses g_rr v², and
    /// p_r = r² `radial`/Δ.
    fn fall(&mut self, radial: f64, v: f64, hole: &Kerr, u: f64, r: f64) {
        let delta = hole.delta(r);
        self.still -= hole.sigma(r, u) / delta * v * v;
        self.ahead -= radial * r * r / delta * v;
    }

    /// g and dg/dξ, unless faster than light.
    fn shift(&self, axis: [f64; 3]) -> Option<(f64, [f64; 3])> {
        let dot = |v: [f64; 3]| axis[0] * v[0] + axis[1] * v[1] + axis[2] * v[2];
        let [round, polar] = self.speeds.map(dot);
        let square = self.still + dot(self.drag) - round * round - polar * polar;
        let boost = self.ahead - dot(self.boost);
        // Negated, so that what is no number is dark, too.
        if !(square > 0.0 && boost > 0.0) {
            return None;
        }
        let (clock, [of_round, of_polar]) = (square.sqrt(), self.speeds);
        // d(√N/b) = dN/(2 √N b) + √N Ω L·dξ/b², with b = `ahead` − Ω L·ξ.
        let slope = |c: usize| {
            let of_square = self.drag[c] - 2.0 * (round * of_round[c] + polar * of_polar[c]);
            of_square / (2.0 * clock * boost) + clock * self.boost[c] / (boost * boost)
        };
        Some((clock / boost, core::array::from_fn(slope)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Extremes at a = 0, r = 6: √2/3 and √2.
    #[test]
    fn exact_redshift_extremes_of_an_orbit_seen_edge_on() {
        let velocity = AngularVelocity::Keplerian { drag: 0.0 };
        // Photons that leave along ±φ have k_φ = ±r/√(1 − 2/r).
        let momentum = 6.0 / (1.0f64 - 2.0 / 6.0).sqrt();
        for (sign, expected) in [(1.0, 2f64.sqrt()), (-1.0, 0.471404520791)] {
            let node = Node::new([6.0, 0.0, 0.0], [0.0, 0.0, sign * momentum], 0.0, &velocity);
            let (g, _) = node.shift([0.0, 0.0, 1.0]).unwrap();
            assert!((g - expected).abs() < 1e-12, "{g}");
        }
    }

    #[test]
    fn exact_gradient_of_the_axis() {
        let velocity = AngularVelocity::Keplerian { drag: 0.3 };
        let node = Node::new([2.0, -3.5, 1.7], [1.0, 2.5, -3.0], 0.8, &velocity);
        let axis = [0.5, 0.3, 0.81];
        let (_, slope) = node.shift(axis).unwrap();
        for c in 0..3 {
            let moved = |h: f64| {
                let mut moved = axis;
                moved[c] += h;
                node.shift(moved).unwrap().0
            };
            let difference = (moved(1e-6) - moved(-1e-6)) / 2e-6;
            assert!((difference - slope[c]).abs() < 1e-9, "{difference} {}", slope[c]);
        }
    }

    /// Circular geodesics in the equatorial plane end at the circular photon orbit, 2 (1 + cos(2/3 arccos(−a))) (Bardeen, Press &
    /// Teukolsky 1972, eq. 2.18); far from the hole nothing is dark.
    #[test]
    fn exact_circles_are_dark_within_the_photon_orbit() {
        for spin in [-0.9, -0.74, 0.0, 0.6] {
            let velocity = AngularVelocity::Keplerian { drag: spin };
            let circles = Circles { spin, velocity };
            let photon_orbit = 2.0 * (1.0 + (2.0 / 3.0 * f64::acos(-spin)).cos());
            let axis = Axis::new([0.0, 0.0, 1.0]).expect("an axis");
            let is_dark = |r: f64| circles.is_dark(axis, [0.6 * r, 0.8 * r, 0.0]);
            assert!(is_dark(photon_orbit - 0.01) && !is_dark(photon_orbit + 0.01), "{spin}");
            assert!(!is_dark(8.0));
            let resting = AngularVelocity::PowerLaw { radius: 8.0, rate: 0.0, exponent: 0.0 };
            let resting = Circles { spin, velocity: resting };
            assert!(!resting.is_dark(axis, [3.0, 0.0, 0.0]), "matter that rests");
        }
    }
}
