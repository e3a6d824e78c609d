//! The redshift of gas on spheres, or falling, for numbers that carry derivatives.

use kerrlight_geodesic::Elementary;

/// What g of gas that turns about an axis depends on.
pub(super) struct Gas<T> {
    /// The point r n, M.
    pub position: [T; 3],
    /// Angular momentum of the arriving photon per energy, M.
    pub momentum: [T; 3],
    /// a, M.
    pub spin: T,
    /// Angular velocity, radians per M.
    pub velocity: T,
    /// dr/dt, and d(1/r)/dτ of the backward ray; none of gas on spheres.
    pub fall: Option<[T; 2]>,
}

impl<T: Elementary> Gas<T> {
    /// g = √N/(1 − Ω ξ·L), N = −u·u of the gas per (dt)², with dφ/dt = −Ω ξ·θ̂/sin θ and dθ/dt = Ω ξ·φ̂, less
    /// g_rr (dr/dt)² and p_r dr/dt of gas that falls; none where
    /// it would be faster than light.
    pub fn redshift(&self, axis: [f64; 3]) -> Option<T> {
        let s = T::constant;
        let axis = axis.map(s);
        let dot = |a: [T; 3], b: [T; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let ([x, y, z], a, rate) = (self.position, self.spin, self.velocity);
        let square = x * x + y * y;
        let r2 = square + z * z;
        let r = r2.sqrt();
        let (u, s2) = (z / r, square / r2);
        let (cos, sin, sin_theta) = if square.value() > 0.0 {
            let flat = square.sqrt();
            (x / flat, y / flat, flat / r)
        } else {
            (s(1.0), s(0.0), s(0.0))
        };
        let along_theta = dot([u * cos, u * sin, -sin_theta], axis);
        let along_phi = dot([-sin, cos, s(0.0)], axis);
        let sigma = r2 + a * a * u * u;
        let round = r2 + a * a + s(2.0) * a * a * r * s2 / sigma;
        let drag = s(4.0) * a * r * sin_theta * rate * along_theta / sigma;
        let speeds =
            rate * rate * (round * along_theta * along_theta + sigma * along_phi * along_phi);
        let mut square = s(1.0) - s(2.0) * r / sigma - drag - speeds;
        let mut boost = s(1.0) - rate * dot(self.momentum, axis);
        if let Some([fall, radial]) = self.fall {
            let delta = r2 - s(2.0) * r + a * a;
            square = square - sigma / delta * fall * fall;
            boost = boost - radial * fall * r2 / delta;
        }
        (square.value() > 0.0 && boost.value() > 0.0).then(|| square.sqrt() / boost)
    }
}
