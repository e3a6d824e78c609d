//! Optical depth along a ray.

use crate::emission::medium::Emission;
use kerrlight_geodesic::simd::RayNodes;

/// Optical depth along a ray.
#[derive(Debug, Default)]
pub(in crate::transport) struct DepthProfile {
    times: Vec<f64>,
    depths: Vec<f64>,
    rates: Vec<f64>,
    /// Depth of the whole way.
    total: f64,
}

impl DepthProfile {
    /// Forgets its ray: no absorption.
    pub fn clear(&mut self) {
        self.times.clear();
    }

    /// Takes the depths at the nodes of a ray and that of the whole way.
    pub fn set(
        &mut self,
        spin: f64,
        nodes: &RayNodes<'_>,
        emission: &Emission,
        depths: &[f64],
        total: f64,
    ) {
        self.total = total;
        let count = depths.len();
        self.times.clear();
        self.times.extend_from_slice(&nodes.mino_time[..count]);
        self.depths.clear();
        self.depths.extend_from_slice(depths);
        self.rates.clear();
        let places = nodes.radius.iter().zip(nodes.cos_theta).zip(&emission.absorption);
        // dD/dτ = κ Σ.
        let rate = |((r, u), k): ((&f64, &f64), &f64)| k * (r * r + (spin * u).powi(2));
        self.rates.extend(places.take(count).map(rate));
    }

    /// The depth in front of the point at a Mino time: cubic between nodes.
    pub fn at(&self, time: f64) -> f64 {
        let k = self.times.partition_point(|t| *t < time);
        let (Some(last), true) = (self.times.len().checked_sub(1), k > 0) else { return 0.0 };
        if k > last {
            return self.total;
        }
        let h = self.times[k] - self.times[k - 1];
        let s = (time - self.times[k - 1]) / h;
        let (d0, d1) = (self.depths[k - 1], self.depths[k]);
        let (m0, m1) = (self.rates[k - 1] * h, self.rates[k] * h);
        let (t2, t3) = (s * s, s * s * s);
        d0 * (2.0 * t3 - 3.0 * t2 + 1.0)
            + m0 * (t3 - 2.0 * t2 + s)
            + d1 * (3.0 * t2 - 2.0 * t3)
            + m1 * (t3 - t2)
    }
}
