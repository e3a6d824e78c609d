//! Area of the sky that a bundle of rays covers.

use kerrlight_geodesic::footprint::Sky;
use kerrlight_geodesic::vector::dot;

/// A small elliptical patch of the sky with Gaussian weights: the image on the sky of a Gaussian
/// on the screen, by the differential of the lens map (Heckbert 1989).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Beam {
    direction: [f64; 3],
    /// Unit vectors along its longer and its shorter axis.
    axes: [[f64; 3]; 2],
    /// Standard deviations along them, in radians.
    spread: [f64; 2],
}

/// Standard deviation on the screen over the spacing of rays. Side by side, such Gaussians add up
/// to the same everywhere within 2 exp(−2π² 0.65²) = 5e-4.
const KERNEL: f64 = 0.65;

/// A beam ends at this many standard deviations (e^−9 of its peak).
const REACH: f64 = 4.242_640_687_119_285;

/// Beams are cut off at this standard deviation, in radians: next to the critical curve a pixel
/// covers the sky more than once, and the differential of the map says nothing about it.
const LARGEST: f64 = 0.25;

impl Beam {
    /// The beam of one ray among others that lie `spacing` apart on the screen.
    pub fn new(sky: &Sky, spacing: f64) -> Self {
        let ellipse = sky.ellipse();
        let [right, up] = sky.frame();
        let (sin, cos) = ellipse.orientation.sin_cos();
        let mix = |p: f64, q: f64| core::array::from_fn(|k| p * right[k] + q * up[k]);
        let size = KERNEL * spacing;
        let spread = [ellipse.semi_major, ellipse.semi_minor].map(|s| (size * s).min(LARGEST));
        Beam { direction: sky.direction, axes: [mix(cos, sin), mix(-sin, cos)], spread }
    }

    /// The spacing of rays whose beams have a full width at half maximum on the screen.
    pub fn spacing(fwhm: f64) -> f64 {
        fwhm / (8.0 * core::f64::consts::LN_2).sqrt() / KERNEL
    }

    /// A round beam of standard deviation `spread` (radians) around a unit vector.
    pub fn of_circle(direction: [f64; 3], spread: f64) -> Self {
        let zero = [0.0; 3];
        let sky = Sky { direction, by_first: zero, by_second: zero };
        Beam { direction, axes: sky.frame(), spread: [spread; 2] }
    }

    /// Its middle.
    pub fn direction(&self) -> [f64; 3] {
        self.direction
    }

    /// Standard deviations along its axes in radians, the longer first.
    pub fn spread(&self) -> [f64; 2] {
        self.spread
    }

    /// The same convolved with a round Gaussian.
    pub fn widened(&self, by: f64) -> Self {
        Beam { spread: self.spread.map(|s| s.hypot(by)), ..*self }
    }

    /// The same, at least so wide.
    pub fn at_least(&self, width: f64) -> Self {
        Beam { spread: self.spread.map(|s| s.max(width)), ..*self }
    }

    /// Its weight per steradian in the middle, if all weights add up to 1.
    pub fn peak_density(&self) -> f64 {
        1.0 / (core::f64::consts::TAU * self.spread[0] * self.spread[1])
    }

    /// The weight of a direction over that of the middle; 0 out of reach.
    pub fn weight(&self, direction: [f64; 3]) -> f64 {
        // The tangent plane does not tell the far hemisphere from the near one.
        if dot(direction, self.direction) <= 0.0 {
            return 0.0;
        }
        let along = |k: usize| (dot(direction, self.axes[k]) / self.spread[k]).powi(2);
        let square = along(0) + along(1);
        if square < REACH * REACH { (-0.5 * square).exp() } else { 0.0 }
    }

    /// Returns its extent across and along the meridian, in radians.
    pub fn reach(&self) -> [f64; 2] {
        let [x, y, _] = self.direction;
        let s = x.hypot(y);
        let right = if s > 0.0 { [y / s, -x / s, 0.0] } else { [0.0, -1.0, 0.0] };
        let across: [f64; 2] = core::array::from_fn(|k| dot(self.axes[k], right) * self.spread[k]);
        // Axes are unit vectors tangent to the sky: what is not across is along.
        let along: [f64; 2] = core::array::from_fn(|k| {
            (1.0 - dot(self.axes[k], right).powi(2)).max(0.0).sqrt() * self.spread[k]
        });
        [across, along].map(|[p, q]| REACH * p.hypot(q))
    }

    /// Mean over the beam of what is seen in single directions, on a net of points.
    pub fn mean(&self, color: impl Fn([f64; 3]) -> [f32; 3]) -> [f32; 3] {
        const SIDE: i32 = 7;
        let (mut sum, mut total) = ([0.0; 3], 0.0);
        for (i, j) in (-SIDE..=SIDE).flat_map(|i| (-SIDE..=SIDE).map(move |j| (i, j))) {
            let [p, q] = [i, j].map(|k| 2.8 * f64::from(k) / f64::from(SIDE));
            let weight = (-0.5 * (p * p + q * q)).exp();
            let steps = [p * self.spread[0], q * self.spread[1]];
            let n: [f64; 3] = core::array::from_fn(|k| {
                self.direction[k] + steps[0] * self.axes[0][k] + steps[1] * self.axes[1][k]
            });
            let length = dot(n, n).sqrt();
            total += weight;
            for (sum, c) in sum.iter_mut().zip(color(n.map(|c| c / length))) {
                *sum += weight * f64::from(c);
            }
        }
        sum.map(|c| (c / total) as f32)
    }
}
