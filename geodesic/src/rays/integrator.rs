//! The ways to trace rays, by name.

use crate::integrate::trace::Method;

/// Method by which rays are traced.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash)]
#[non_exhaustive]
pub enum Integrator {
    /// `rk45-affine`: Runge–Kutta 5(4) in the affine parameter on Kerr–Schild coordinates, an
    /// independent referee. Needs an observer at a finite radius.
    #[cfg(feature = "affine")]
    Rk45Affine,
    /// `rk45-mino`: see [`Method::Rk45`].
    Rk45Mino,
    /// `dop853-mino`: see [`Method::Dop853`].
    Dop853Mino,
    /// `taylor-mino`: see [`Method::Taylor`].
    #[default]
    TaylorMino,
    /// `elliptic`: the closed form in elliptic functions, several rays a SIMD register
    /// ([`simd`](crate::simd)), by far the fastest for samples equidistant in Mino time and for
    /// equatorial crossings. What it does not serve is traced as with `taylor-mino`: rays next to the
    /// critical curve, where it has errors above the tolerance or 1e-11; observers nearer than 5 M;
    /// requests for momenta or for other samples. Rays that reach a finite observer nearly along its
    /// sphere, (dr/dτ)²/r⁴ below 0.01, are refused.
    Elliptic,
}

impl Integrator {
    /// All of them.
    pub const ALL: &'static [Integrator] = &[
        #[cfg(feature = "affine")]
        Integrator::Rk45Affine,
        Integrator::Rk45Mino,
        Integrator::Dop853Mino,
        Integrator::TaylorMino,
        Integrator::Elliptic,
    ];

    /// The name that commands, files and documents use.
    pub fn name(self) -> &'static str {
        match self {
            #[cfg(feature = "affine")]
            Integrator::Rk45Affine => "rk45-affine",
            Integrator::Rk45Mino => "rk45-mino",
            Integrator::Dop853Mino => "dop853-mino",
            Integrator::TaylorMino => "taylor-mino",
            Integrator::Elliptic => "elliptic",
        }
    }

    /// The integrator with that name.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.iter().copied().find(|integrator| integrator.name() == name)
    }

    /// Its stepping method, for those in Mino time; that of the rays that `elliptic` does not serve in
    /// closed form.
    pub fn method(self) -> Option<Method> {
        match self {
            #[cfg(feature = "affine")]
            Integrator::Rk45Affine => None,
            Integrator::Rk45Mino => Some(Method::Rk45),
            Integrator::Dop853Mino => Some(Method::Dop853),
            Integrator::TaylorMino | Integrator::Elliptic => Some(Method::Taylor),
        }
    }
}
