//! A ray's radius and its equatorial crossings as functions of Mino time, in closed form.
//!
//! Gralla & Lupsasca (2020a, arXiv:1910.12881) write r(τ) by Jacobi functions of the radial
//! roots, in four cases. Weierstrass's function needs none: for a quartic
//! W(w) = 1 + A w² + B w³ + C w⁴ and w(0) = 0 (Whittaker & Watson, § 20.6)
//!
//! w = (B/4 − ℘')/\[2(s² − C/4)\] = −(4s + A)/\[2(℘' + B/4)\],  s = ℘(τ) − A/12,
//!
//! with g₂ = A²/12 + C and g₃ = AC/6 − A³/216 − B²/16. With B ≥ 0 the first form has no
//! cancellation while ℘' < 0, the second afterwards. Next to the critical curve two roots of
//! 4e³ = g₂e + g₃ nearly coincide; their difference comes from the height of W at its minimum,
//! which [`RadialPotential`](crate::RadialPotential) has with twice the working precision.

use super::elliptic::{agm, rf, rf_pair, sn_cs};
use crate::screen::observer::Ray;
use crate::spacetime::kerr::Kerr;
use crate::spacetime::radial::{Barrier, RadialPotential};
use core::f64::consts::{FRAC_PI_2, PI};

/// A ray's radial motion and its equatorial crossings in closed form.
#[derive(Debug, Clone, Copy)]
pub struct ClosedForm {
    radial: Radial,
    polar: Polar,
    /// Mino time from infinity to the observer.
    start: f64,
    total: f64,
}

/// A crossing of the equatorial plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Crossing {
    /// Mino time since the observer, in 1/M.
    pub mino_time: f64,
    /// Boyer–Lindquist radius, in M.
    pub radius: f64,
}

impl ClosedForm {
    /// Prepares the motion of a ray that starts inwards, from outside of all turning points: one that a camera sees outwards, or
    /// within the barrier of its potential, moves otherwise. All that follows is NaN, and there is no crossing, if `ray` was made
    /// for another hole.
    ///
    /// # Examples
    /// ```
    /// use kerrlight_geodesic::{Inclination, Kerr, Observer, analytic::ClosedForm};
    /// let hole = Kerr::new(0.94)?;
    /// let observer = Observer::at_infinity(Inclination::from_degrees(17.0)?);
    /// let ray = ClosedForm::new(&hole, &observer.ray(&hole, 4.0, -3.5)?);
    /// let radii: Vec<f64> = ray.crossings().map(|crossing| crossing.radius).collect();
    /// assert!(!radii.is_empty());
    /// # Ok::<(), kerrlight_geodesic::Error>(())
    /// ```
    pub fn new(hole: &Kerr, ray: &Ray) -> Self {
        let radial = Radial::new(&ray.potential);
        let start = if ray.inverse_radius > 0.0 {
            let rate = ray.potential.value(ray.inverse_radius).max(0.0).sqrt();
            radial.time_inwards(ray.inverse_radius, rate)
        } else {
            0.0
        };
        let end = if ray.is_from_horizon {
            start
        } else if ray.potential.captures() {
            // At the horizon √W = |r₊² + a² − aλ|/r₊².
            let (w, a) = (ray.potential.horizon, hole.spin());
            radial.time_inwards(w, (2.0 / w - a * ray.lambda).abs() * w * w)
        } else {
            radial.time_to_return()
        };
        // The tip of an extremal hole's critical curve has coinciding infinities.
        let total = if end.is_nan() { f64::INFINITY } else { end - start };
        let total = if ray.check_hole(hole).is_ok() { total } else { f64::NAN };
        ClosedForm { radial, polar: Polar::new(hole, ray), start, total }
    }

    /// Mino time in M⁻¹ from the observer to the end of the ray: the horizon, or infinity, as
    /// [`Path::mino_total`](crate::Path::mino_total). Infinite on the critical curve.
    pub fn mino_total(&self) -> f64 {
        self.total
    }

    /// Mino time from the observer back to its radius, for a ray that turns.
    pub(crate) fn time_back(&self) -> f64 {
        self.total - self.start
    }

    /// w = 1/r at a Mino time in \[0, [`mino_total`](Self::mino_total)\] since the observer.
    pub fn inverse_radius(&self, mino_time: f64) -> f64 {
        self.radial.inverse_radius(self.start + mino_time)
    }

    /// Mino time at which the ray would cross the equatorial plane for the k-th time (k from
    /// 1), before or behind the ray's end. Infinite for rays that never do.
    pub fn crossing_time(&self, k: u32) -> f64 {
        if k == 0 {
            return f64::NEG_INFINITY;
        }
        if self.polar.first.is_infinite() {
            return f64::INFINITY;
        }
        self.polar.first + f64::from(k - 1) * self.polar.half_period
    }

    /// The k-th crossing of the equatorial plane (k from 1) outside the horizon, if there is
    /// one. The observer's own position is none.
    pub fn crossing(&self, k: u32) -> Option<Crossing> {
        let mino_time = self.crossing_time(k);
        let outside = (0.0..self.total).contains(&mino_time) && mino_time.is_finite();
        let at = |mino_time| Crossing { mino_time, radius: 1.0 / self.inverse_radius(mino_time) };
        outside.then(|| at(mino_time))
    }

    /// All crossings, in the order of the backward ray; without end on the critical curve.
    pub fn crossings(&self) -> impl Iterator<Item = Crossing> + use<> {
        let ray = *self;
        (1..).map_while(move |k| ray.crossing(k))
    }
}

/// The polar motion: a crossing at `first`, and one every half period from there.
#[derive(Debug, Clone, Copy)]
struct Polar {
    first: f64,
    half_period: f64,
}

impl Polar {
    /// u'² = (u₊ − u²)(Z₊ + a²u²) for u = cos θ (see
    /// [`half_orbit`](super::CriticalPoint::half_orbit)).
    fn new(hole: &Kerr, ray: &Ray) -> Self {
        let a2 = hole.spin() * hole.spin();
        let [quadratic, _, quartic] = ray.potential.coefficients;
        // C = −a²η has been rounded from twice the working precision.
        let eta = if a2 > 1e-200 { -quartic / a2 } else { ray.eta };
        let never = Polar { first: f64::INFINITY, half_period: f64::INFINITY };
        if eta < 0.0 {
            return never;
        }
        let fast2 = quadratic.hypot(2.0 * (-quartic).max(0.0).sqrt());
        let slow2 = if quadratic <= 0.0 {
            0.5 * (fast2 - quadratic)
        } else {
            -2.0 * quartic / (fast2 + quadratic)
        };
        if slow2 <= 0.0 {
            return never;
        }
        let half_period = PI / agm(slow2.sqrt(), fast2.sqrt());
        let (u, rate) = (ray.position[2], ray.velocity[2]);
        if u == 0.0 {
            return Polar { first: half_period, half_period };
        }
        if eta == 0.0 {
            return never;
        }
        let here = slow2 + a2 * u * u;
        let away = u.abs() * rf(eta, slow2 * rate * rate / here, eta / slow2 * here);
        Polar { first: if u * rate < 0.0 { away } else { half_period - away }, half_period }
    }
}

/// w(τ) and its inverse, in units in which the coefficients of W are of order 1.
#[derive(Debug, Clone, Copy)]
struct Radial {
    scale: f64,
    coefficients: [f64; 3],
    roots: Roots,
}

/// The roots of 4e³ = g₂e + g₃.
#[derive(Debug, Clone, Copy)]
enum Roots {
    /// e₁ ≥ e₂ ≥ e₃: e₁, e₁ − e₃, and m₁ = (e₁ − e₂)/(e₁ − e₃).
    Real { largest: f64, span: f64, m1: f64 },
    /// e and −e/2 ± iv: e, v, H = √(9e²/4 + v²), and m₁ = ½ + 3e/(4H).
    Pair { real: f64, imaginary: f64, h: f64, m1: f64 },
}

impl Radial {
    fn new(potential: &RadialPotential) -> Self {
        let [a, b, c] = potential.coefficients;
        let scale = a.abs().sqrt().max(b.cbrt()).max(1.0);
        let coefficients = [a / scale / scale, b / scale / scale / scale, c / scale.powi(4)];
        let roots = Roots::new(coefficients, potential.barrier.as_ref(), scale);
        Radial { scale, coefficients, roots }
    }

    fn inverse_radius(&self, mino_time: f64) -> f64 {
        let tau = mino_time * self.scale;
        if tau <= 0.0 {
            return 0.0;
        }
        let [a, b, c] = self.coefficients;
        let (s, slope) = self.roots.weierstrass(tau, a);
        let w = if slope <= 0.0 {
            (0.25 * b - slope) / (2.0 * (s * s - 0.25 * c))
        } else {
            -(4.0 * s + a) / (2.0 * (slope + 0.25 * b))
        };
        w / self.scale
    }

    /// Mino time from infinity to w on the way in, where dw/dτ = `rate`.
    fn time_inwards(&self, w: f64, rate: f64) -> f64 {
        let w = w * self.scale;
        let [a, b, _] = self.coefficients;
        let s = (1.0 + rate) / (2.0 * w * w);
        let late = 0.25 * b + (4.0 * s + a) / (2.0 * w) < 0.0;
        let p = s + a / 12.0;
        let tau = self.roots.inverse(p, p - self.roots.least());
        (if late { 2.0 * self.roots.half_period() - tau } else { tau }) / self.scale
    }

    /// Mino time from infinity to infinity of a ray that turns: there ℘ = −A/6, ℘' = B/4.
    fn time_to_return(&self) -> f64 {
        let [a, b, _] = self.coefficients;
        let p = -a / 6.0;
        // (p − e₁)(p − e₂)(p − e₃) = ℘'²/4: the smallest factor comes from the others.
        let product = b * b / 64.0;
        let others = match self.roots {
            Roots::Real { largest, span, m1 } => (p - largest + m1 * span) * (p - largest + span),
            Roots::Pair { real, imaginary, .. } => (p + 0.5 * real).powi(2) + imaginary * imaginary,
        };
        let tau = self.roots.inverse(p, product / others);
        (2.0 * self.roots.half_period() - tau) / self.scale
    }
}

impl Roots {
    fn new([a, b, c]: [f64; 3], barrier: Option<&Barrier>, scale: f64) -> Self {
        let g2 = a * a / 12.0 + c;
        let g3 = a * c / 6.0 - a * a * a / 216.0 - b * b / 16.0;
        let isolated = isolated_root(g2, g3);
        match barrier {
            Some(barrier) if g3 < 0.0 => {
                let (isolated, split) = split_about_the_barrier(barrier, scale, isolated);
                Roots::from_isolated(isolated, split)
            }
            _ => Roots::from_isolated(isolated, 0.25 * (g2 - 3.0 * isolated * isolated)),
        }
    }

    /// Starts from the root e that is not one of the close pair −e/2 ± √split.
    fn from_isolated(e: f64, split: f64) -> Self {
        if split < 0.0 {
            let h = (2.25 * e * e - split).sqrt();
            let m1 = if e < 0.0 { -split / (h * (2.0 * h - 3.0 * e)) } else { 0.5 + 0.75 * e / h };
            return Roots::Pair { real: e, imaginary: (-split).sqrt(), h, m1 };
        }
        let d = split.sqrt();
        let span = 1.5 * e.abs() + d;
        if span == 0.0 {
            return Roots::Real { largest: 0.0, span, m1: 1.0 };
        }
        if e < 0.0 {
            Roots::Real { largest: -0.5 * e + d, span, m1: 2.0 * d / span }
        } else {
            Roots::Real { largest: e, span, m1: ((1.5 * e - d) / span).max(0.0) }
        }
    }

    /// ℘ − A/12 and ℘'.
    fn weierstrass(&self, tau: f64, a: f64) -> (f64, f64) {
        match *self {
            // W = 1: a ray straight into a hole without spin.
            Roots::Real { span: 0.0, .. } => {
                ((tau * tau).recip() - a / 12.0, -2.0 / (tau * tau * tau))
            }
            Roots::Real { largest, span, m1 } => {
                let (sn, cs) = sn_cs(span.sqrt() * tau, m1);
                let cn2 = (cs * sn).powi(2);
                let dn = (m1 + (1.0 - m1) * cn2).sqrt();
                let slope = -2.0 * span * span.sqrt() * cs * dn / (sn * sn);
                (largest - a / 12.0 + span * cs * cs, slope)
            }
            Roots::Pair { real, h, m1, .. } => {
                let (sn, cs) = sn_cs(h.sqrt() * tau, m1);
                let cn2 = (cs * sn).powi(2);
                let dn2 = m1 + (1.0 - m1) * cn2;
                let q2 = cs * cs / dn2;
                let fall = ((1.0 - m1) * cn2 * cn2 + m1) / (sn * sn * dn2);
                let slope = -2.0 * h * h.sqrt() * cs / dn2.sqrt() * fall;
                (real - a / 12.0 + h * q2, slope)
            }
        }
    }

    /// The largest real root: ℘ at the half period.
    fn least(&self) -> f64 {
        match *self {
            Roots::Real { largest, .. } => largest,
            Roots::Pair { real, .. } => real,
        }
    }

    /// The τ in the first half period at which ℘ = p, given p less the largest real root too.
    fn inverse(&self, p: f64, above: f64) -> f64 {
        let above = above.max(0.0);
        match *self {
            Roots::Real { span, m1, .. } => rf(above, above + m1 * span, above + span),
            Roots::Pair { real, imaginary, .. } => rf_pair(above, p + 0.5 * real, imaginary),
        }
    }

    fn half_period(&self) -> f64 {
        match *self {
            Roots::Real { span, m1, .. } => FRAC_PI_2 / agm(1.0, m1.sqrt()) / span.sqrt(),
            Roots::Pair { h, m1, .. } => FRAC_PI_2 / agm(1.0, m1.sqrt()) / h.sqrt(),
        }
    }
}

/// The root of 4e³ = g₂e + g₃ that has the sign of g₃, by Newton's method from outside of all
/// roots, where it converges from one side. The two others may coincide, this one stands apart.
fn isolated_root(g2: f64, g3: f64) -> f64 {
    let mut e = 2.0 * (0.25 * g2.abs()).sqrt().max((0.25 * g3.abs()).cbrt());
    if e == 0.0 {
        return 0.0;
    }
    for _ in 0..100 {
        let step = ((4.0 * e * e - g2) * e - g3.abs()) / (12.0 * e * e - g2);
        e -= step;
        if step <= f64::EPSILON * e {
            break;
        }
    }
    e.copysign(g3)
}

/// The isolated root e and the square of half the difference of the two others, from W's
/// expansion h + kx + c₂x² + c₃x³ + c₄x⁴ about its minimum. With c = c₂/12 the roots are c, c and
/// −2c for h = k = 0; what h and k move is computed without cancellation.
fn split_about_the_barrier(barrier: &Barrier, scale: f64, e: f64) -> (f64, f64) {
    let (h, k) = (barrier.height, barrier.slope / scale);
    let [c2, c3, c4] = barrier.expansion;
    let (c, c3, c4) = (c2 / scale.powi(2) / 12.0, c3 / scale.powi(3), c4 / scale.powi(4));
    let g2_change = c4 * h - 0.25 * c3 * k;
    let constant = c3 * c3 * h / 16.0 - 0.75 * c * c3 * k + c4 * k * k / 16.0;
    // e = −2c + σ.
    let mut sigma = e + 2.0 * c;
    for _ in 0..6 {
        let value =
            ((4.0 * sigma - 24.0 * c) * sigma + 36.0 * c * c - g2_change) * sigma + constant;
        let slope = (12.0 * sigma - 48.0 * c) * sigma + 36.0 * c * c - g2_change;
        if slope == 0.0 {
            break;
        }
        sigma -= value / slope;
    }
    (sigma - 2.0 * c, 0.25 * (g2_change + (12.0 * c - 3.0 * sigma) * sigma))
}
