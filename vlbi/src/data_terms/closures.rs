//! Closure phases and log closure amplitudes, with the covariance of those that share baselines.

use super::{ClosureScan, Comparison, DARK, DataTerm, DataTermError, Residual, faintest, wrapped};
use crate::Error;
use crate::observation::Observation;
use crate::operator::Float;
use crate::products::{ClosureKind, ClosureSet};
use core::f64::consts::PI;
use nalgebra::DMatrix;
use num_complex::Complex;

/// χ² = Σ over scans of rᵀ C⁻¹ r, with residuals r of closure quantities (phases in (−π, π]) and
/// their covariance C.
#[derive(Debug, Clone)]
pub struct ClosureTerm<T> {
    kind: ClosureKind,
    visibilities: usize,
    scans: Vec<Scan<T>>,
}

#[derive(Debug, Clone)]
struct Scan<T> {
    /// Visibilities and signs of each quantity.
    legs: Vec<Vec<(usize, T)>>,
    data: Vec<T>,
    /// C⁻¹, row after row.
    precision: Vec<T>,
    /// Lower triangle F of C⁻¹ = F Fᵀ, column after column: Fᵀ r are independent.
    factor: Vec<f64>,
    stations: Vec<Vec<u16>>,
}

impl<T: Float> ClosureTerm<T> {
    /// Takes an observation's Stokes I: in every scan a largest set of independent quantities, from baselines stronger
    /// than `least_snr` times their noise.
    ///
    /// # Errors
    /// If there are none.
    pub fn new(
        observation: &Observation,
        kind: ClosureKind,
        least_snr: f64,
    ) -> Result<Self, Error> {
        let bad = observation.stokes_i().position(|(_, i)| !i.visibility.is_finite());
        if let Some(index) = bad {
            return Err(DataTermError::NotFinite(index).into());
        }
        let sets = ClosureSet::of(observation, kind, least_snr);
        if sets.is_empty() {
            return Err(DataTermError::Empty.into());
        }
        let scans = sets.iter().map(Scan::new).collect::<Result<_, _>>()?;
        Ok(ClosureTerm { kind, visibilities: observation.stokes_i().count(), scans })
    }
}

impl<T: Float> Scan<T> {
    fn new(set: &ClosureSet) -> Result<Self, DataTermError> {
        let n = set.closures.len();
        let covariance = DMatrix::from_row_slice(n, n, &set.covariance);
        let singular = || DataTermError::Singular(set.time_h);
        let inverse = covariance.cholesky().ok_or_else(singular)?.inverse();
        let factor = inverse.clone().cholesky().ok_or_else(singular)?.unpack();
        let legs = |c: &crate::products::Closure| {
            c.legs.iter().map(|leg| (leg.visibility, T::of(leg.sign.into()))).collect()
        };
        let precision: Vec<T> = inverse.iter().map(|x| T::of(*x)).collect();
        // The inverse of tiny variances may overflow single precision.
        if precision.iter().any(|x| !x.is_finite()) {
            return Err(DataTermError::Singular(set.time_h));
        }
        Ok(Scan {
            legs: set.closures.iter().map(legs).collect(),
            data: set.closures.iter().map(|c| T::of(c.value)).collect(),
            // Symmetric: columns are rows.
            precision,
            factor: factor.iter().copied().collect(),
            stations: set.closures.iter().map(|c| c.stations.clone()).collect(),
        })
    }

    fn single(&self) -> ClosureScan {
        let singles = |numbers: &[T]| numbers.iter().map(|x| x.double() as f32).collect();
        let legs = |legs: &Vec<(usize, T)>| {
            legs.iter().map(|(visibility, sign)| (*visibility, sign.double() as f32)).collect()
        };
        ClosureScan {
            legs: self.legs.iter().map(legs).collect(),
            data: singles(&self.data),
            precision: singles(&self.precision),
        }
    }

    /// Residuals of the quantities. Where the model has no visibility, its phase and logarithm are not defined: the
    /// residual is then as large as one can be (phases), or that of an amplitude that is wrong by a factor of e¹⁰⁰.
    fn residuals(&self, kind: ClosureKind, model: &[Complex<T>]) -> Vec<T> {
        let of = |visibility: usize| match kind {
            ClosureKind::Phase => model[visibility].arg(),
            ClosureKind::LogAmplitude => model[visibility].norm().ln(),
        };
        self.legs
            .iter()
            .zip(&self.data)
            .map(|(legs, datum)| {
                if legs.iter().any(|(v, _)| is_dark(model[*v])) {
                    return match kind {
                        ClosureKind::Phase => T::of(PI),
                        ClosureKind::LogAmplitude => T::of(DARK),
                    };
                }
                let sum: T = legs.iter().map(|(v, sign)| *sign * of(*v)).sum();
                match kind {
                    ClosureKind::Phase => wrapped(sum - *datum),
                    ClosureKind::LogAmplitude => sum - *datum,
                }
            })
            .collect()
    }

    /// The same, combined such that their errors are independent and 1.
    fn independent(&self, kind: ClosureKind, model: &[Complex<T>]) -> Vec<Residual> {
        let residuals = self.residuals(kind, model);
        let columns = self.factor.chunks_exact(residuals.len());
        let pull =
            |column: &[f64]| column.iter().zip(&residuals).map(|(f, r)| f * r.double()).sum();
        let of = |(column, stations): (&[f64], &Vec<u16>)| Residual {
            value: pull(column),
            datum: 0.0,
            freedom: 1.0,
            stations: stations.clone(),
        };
        columns.zip(&self.stations).map(of).collect()
    }
}

fn is_dark<T: Float>(visibility: Complex<T>) -> bool {
    visibility.norm() <= faintest()
}

impl<T: Float> DataTerm<T> for ClosureTerm<T> {
    fn visibilities(&self) -> usize {
        self.visibilities
    }

    fn degrees_of_freedom(&self) -> usize {
        self.scans.iter().map(|scan| scan.data.len()).sum()
    }

    fn is_scale_free(&self) -> bool {
        true
    }

    fn comparison(&self) -> Option<Comparison> {
        let (kind, visibilities) = (self.kind, self.visibilities);
        let scans = self.scans.iter().map(Scan::single).collect();
        Some(Comparison::Closures { kind, visibilities, scans })
    }

    /// Returns χ² and its gradient. Where a visibility of the model is 0 its phase and logarithm mean nothing: the
    /// residual is then π, or 100 for a logarithm, so that a dark model is worse than one that shines, and the
    /// gradient leaves that quantity out.
    fn value_and_gradient(
        &self,
        model: &[Complex<T>],
        weight: T,
        gradient: &mut [Complex<T>],
    ) -> f64 {
        assert_eq!((model.len(), gradient.len()), (self.visibilities, self.visibilities));
        let mut total = 0.0;
        for scan in &self.scans {
            let residuals = scan.residuals(self.kind, model);
            let rows = scan.precision.chunks_exact(residuals.len());
            for ((row, residual), legs) in rows.zip(&residuals).zip(&scan.legs) {
                let pull: T = row.iter().zip(&residuals).map(|(p, r)| *p * *r).sum();
                total += residual.double() * pull.double();
                if legs.iter().any(|(v, _)| is_dark(model[*v])) {
                    continue;
                }
                for (v, sign) in legs {
                    // d arg V = Re(conj(iV) dV)/|V|², d ln|V| = Re(conj(V) dV)/|V|².
                    let direction = match self.kind {
                        ClosureKind::Phase => Complex::new(-model[*v].im, model[*v].re),
                        ClosureKind::LogAmplitude => model[*v],
                    };
                    // In two divisions, as the square of a faint visibility would leave single precision.
                    let norm = model[*v].norm();
                    let factor = (weight + weight) * pull * *sign / norm;
                    gradient[*v] += direction.unscale(norm).scale(factor);
                }
            }
        }
        total
    }

    /// Combinations of the quantities of a scan, each under the stations of its least noisy one.
    fn residuals(&self, model: &[Complex<T>]) -> Vec<Residual> {
        self.scans.iter().flat_map(|scan| scan.independent(self.kind, model)).collect()
    }
}
