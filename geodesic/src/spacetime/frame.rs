//! The frame of zero angular momentum at a point, and the Walker–Penrose constant of what is
//! known there.

use crate::spacetime::kerr::Kerr;
use crate::spacetime::point::PathPoint;

/// The orthonormal tetrad of the observer of zero angular momentum at a point outside the
/// horizon: e_t, e_r, e_θ, e_φ along the Boyer–Lindquist coordinates (Bardeen, Press &
/// Teukolsky 1972, eq. 3.2). Components are contravariant, in the order (t, r, θ, φ).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ZamoFrame {
    radius: f64,
    sin: f64,
    cos: f64,
    /// Its lapse, angular velocity ω, and √(A/Σ).
    pub(crate) lapse: f64,
    pub(crate) drag: f64,
    pub(crate) girth: f64,
    /// √Σ and √(Δ/Σ).
    length: f64,
    radial: f64,
    /// a cos θ.
    polar: f64,
    /// Γ and Γv, along e_φ, of the observer of Carter's tetrad.
    carter: [f64; 2],
}

impl ZamoFrame {
    /// The frame at radius `r` (in M) and the polar angle with this sine and cosine; `None`
    /// where r is not finite or not outside the horizon.
    #[inline]
    pub fn at(hole: &Kerr, r: f64, sin: f64, cos: f64) -> Option<Self> {
        let (a, delta, sigma) = (hole.spin(), hole.delta(r), hole.sigma(r, cos));
        if !(r.is_finite() && r > hole.horizon() && delta > 0.0) {
            return None;
        }
        let sum = r * r + a * a;
        let area = sum.powi(2) - a * a * delta * sin * sin;
        let (lapse, girth) = ((delta * sigma / area).sqrt(), (area / sigma).sqrt());
        let length = sigma.sqrt();
        let root = 1.0 / (girth * length);
        let gap = delta.sqrt();
        Some(ZamoFrame {
            radius: r,
            sin,
            cos,
            lapse,
            drag: 2.0 * a * r / area,
            girth,
            length,
            radial: gap / length,
            polar: a * cos,
            carter: [sum * root, a * sin * gap * root],
        })
    }

    /// The frame at a point of a ray; `None` at the horizon.
    #[inline]
    pub fn of(hole: &Kerr, point: &PathPoint) -> Option<Self> {
        Self::at(hole, point.radius(), point.sin_theta(), point.cos_theta())
    }

    /// Boyer–Lindquist radius, in M.
    pub fn radius(&self) -> f64 {
        self.radius
    }

    /// Sine and cosine of the polar angle.
    #[inline]
    pub fn polar_angle(&self) -> [f64; 2] {
        [self.sin, self.cos]
    }

    /// A covariant Boyer–Lindquist vector (p_t, p_r, p_θ, p_φ), the angular ones in M, in this frame. On the axis
    /// p_φ must be 0.
    #[inline]
    pub fn covariant(&self, p: [f64; 4]) -> [f64; 4] {
        let around = if p[3] == 0.0 { 0.0 } else { p[3] / (self.girth * self.sin) };
        let energy = -(p[0] + self.drag * p[3]) / self.lapse;
        [energy, p[1] * self.radial, p[2] / self.length, around]
    }

    /// A contravariant Boyer–Lindquist vector (uᵗ, uʳ, u^θ, u^φ), the angular ones in M⁻¹, in this frame.
    #[inline]
    pub fn contravariant(&self, u: [f64; 4]) -> [f64; 4] {
        let around = self.girth * self.sin * (u[3] - self.drag * u[0]);
        [self.lapse * u[0], u[1] / self.radial, self.length * u[2], around]
    }

    /// The contravariant Boyer–Lindquist components, the angular ones in M⁻¹, of a vector of this frame; u^φ diverges on
    /// the axis.
    pub fn to_coordinates(&self, v: [f64; 4]) -> [f64; 4] {
        let time = v[0] / self.lapse;
        let around = self.drag * time + v[3] / (self.girth * self.sin);
        [time, v[1] * self.radial, v[2] / self.length, around]
    }

    /// The covariant Boyer–Lindquist components, the angular ones in M, of a vector of this frame.
    pub fn to_covariant(&self, v: [f64; 4]) -> [f64; 4] {
        let around = v[3] * self.girth * self.sin;
        let time = -self.lapse * v[0] - self.drag * around;
        [time, v[1] / self.radial, v[2] * self.length, around]
    }

    /// The velocity in this frame, along e_φ, of matter that circles the axis with dφ/dt =
    /// `rate`, in radians per M. That at rest with respect to infinity, of rate 0, is not below 1 in magnitude in the
    /// ergosphere, where there is no rest.
    pub fn orbital_velocity(&self, rate: f64) -> f64 {
        self.girth * self.sin * (rate - self.drag) / self.lapse
    }

    /// The velocity in this frame, along e_r, e_θ, e_φ, of matter that moves at constant r with
    /// the components `polar` and `around` of dn/dt (per M of coordinate time) along e_θ and
    /// e_φ, n = (sin θ cos φ, sin θ sin φ, cos θ).
    pub fn sphere_velocity(&self, polar: f64, around: f64) -> [f64; 3] {
        let across = self.girth * (around - self.sin * self.drag);
        [0.0, self.length * polar / self.lapse, across / self.lapse]
    }

    /// Returns (E_r, H_r) and (E_θ, E_φ) of the bivector k∧f in Carter's tetrad, and kᵗ.
    #[inline]
    fn carter_bivector(&self, k: [f64; 4], f: [f64; 4]) -> ([f64; 2], [f64; 2], f64) {
        let [boost, swift] = self.carter;
        let electric = |i: usize| k[0] * f[i] - k[i] * f[0];
        let magnetic = |i: usize, j: usize| k[i] * f[j] - k[j] * f[i];
        let radial = [
            boost * electric(1) - swift * magnetic(3, 1),
            boost * magnetic(2, 3) + swift * electric(2),
        ];
        let across = [boost * electric(2) + swift * magnetic(2, 3), electric(3)];
        (radial, across, boost * k[0] - swift * k[3])
    }

    /// The Walker–Penrose constant κ₁ + iκ₂ = (A − iB)(r − ia cos θ) of a photon `k` with a
    /// vector `f` normal to it, both in this frame: the same at every point of the ray along
    /// which f is parallel-transported (Walker & Penrose 1970; Himwich et al. 2020,
    /// arXiv:2001.08750, eqs. 6–8). Multiples of k that are added to f do not change it.
    ///
    /// A and −B are the radial components of the electric and magnetic parts of the bivector
    /// k∧f in Carter's tetrad, the one in which both principal null directions are radial.
    #[inline]
    pub fn walker_penrose(&self, k: [f64; 4], f: [f64; 4]) -> [f64; 2] {
        let ([e, h], _, _) = self.carter_bivector(k, f);
        [e * self.radius + h * self.polar, h * self.radius - e * self.polar]
    }

    /// (north, east) of f on the screen, for a photon on a principal null ray.
    fn principal_transport(&self, k: [f64; 4], f: [f64; 4]) -> [f64; 2] {
        let (_, [e_theta, e_phi], energy) = self.carter_bivector(k, f);
        let [cos, sin] = if self.sin == 0.0 {
            [1.0, 0.0]
        } else {
            [self.radius, self.polar].map(|x| x / self.length)
        };
        let (re, im) = (-e_theta / energy, e_phi / energy);
        [re * cos - im * sin, -(im * cos + re * sin)]
    }
}

/// A point (α, β) of the screen of an observer at infinity, for the polarisation that arrives
/// there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScreenPoint {
    beta: f64,
    /// ν = −(α + a sin i).
    nu: f64,
    /// β² + ν²: Carter's constant 𝒦 = Q + (L − aE)² over E².
    carter: f64,
    /// True if the ray is a principal null one, on which κ vanishes.
    principal: bool,
}

/// Largest 𝒦/sin²i (in M²) of a ray that is taken to be a principal null one: the limit is right to √𝒦/sin i, the
/// general formula to the momentum's rounding over √𝒦.
const PRINCIPAL: f64 = 1e-14;

impl ScreenPoint {
    /// The point (α, β), in M, of a screen at `inclination` (`sin_inclination` = sin i).
    #[inline]
    pub fn new(hole: &Kerr, sin_inclination: f64, alpha: f64, beta: f64) -> Self {
        let nu = -(alpha + hole.spin() * sin_inclination);
        let carter = beta * beta + nu * nu;
        let principal = carter <= PRINCIPAL * sin_inclination * sin_inclination;
        ScreenPoint { beta, nu, carter, principal }
    }

    /// Parallel transport to the screen: what the vector `f`, normal to the photon `k` (both in
    /// `frame`, k for unit energy at infinity), has become there, as its components (north,
    /// east) along +β and −α. Its length is that of f but for multiples of k.
    ///
    /// Transports polarisation to the screen. With κ the Walker–Penrose constant, f_β + i f_α = κ/(β + iν), ν = −(α + a
    /// sin i) (Himwich et al. 2020, eq. 27; Gelles et al. 2021, arXiv:2105.09440, eq. 31). Where β = ν = 0 the ray is a
    /// principal null one, κ vanishes, and the limit is −(f_θ − i f_φ)(r + ia cos θ)/√Σ in Carter's tetrad, without the
    /// last factor (a turn of the meridian) on the axis itself.
    #[inline]
    pub fn transport(&self, frame: &ZamoFrame, k: [f64; 4], f: [f64; 4]) -> [f64; 2] {
        if self.principal {
            return frame.principal_transport(k, f);
        }
        let [re, im] = frame.walker_penrose(k, f);
        let scale = 1.0 / self.carter;
        let north = (re * self.beta + im * self.nu) * scale;
        [north, (re * self.nu - im * self.beta) * scale]
    }
}
